// The C++ binding: who owns what, what is thrown, and that each wrapper reaches its C function.
#include "test_support.hpp"

#include <type_traits>

namespace {

using test::DeviceTest;

static_assert(std::is_copy_constructible<clspeckle::Context>::value &&
                  std::is_nothrow_move_constructible<clspeckle::Context>::value,
              "");
static_assert(std::is_copy_assignable<clspeckle::Pipeline>::value &&
                  std::is_nothrow_move_assignable<clspeckle::Pipeline>::value,
              "");
static_assert(!std::is_copy_constructible<clspeckle::Queue>::value &&
                  std::is_nothrow_move_constructible<clspeckle::Queue>::value,
              "");
static_assert(!std::is_copy_assignable<clspeckle::Buffer>::value &&
                  std::is_nothrow_move_assignable<clspeckle::Buffer>::value,
              "");
static_assert(!std::is_copy_constructible<clspeckle::Event>::value, "");
static_assert(clspeckle::pixel_bytes(CLSP_FORMAT_UINT8) == 1 && clspeckle::pixel_bytes(CLSP_FORMAT_UINT16) == 2 &&
                  clspeckle::pixel_bytes(CLSP_FORMAT_UINT32) == 4 && clspeckle::pixel_bytes(CLSP_FORMAT_FLOAT32) == 4 &&
                  clspeckle::pixel_bytes(CLSP_FORMAT_FLOAT32X2) == 8 &&
                  clspeckle::pixel_bytes(CLSP_FORMAT_FLOAT32X3) == 12 &&
                  clspeckle::pixel_bytes(CLSP_FORMAT_FLOAT32X4) == 16 && clspeckle::pixel_bytes(CLSP_FORMAT_NONE) == 0,
              "");

class CppBinding : public DeviceTest {
  protected:
    clspeckle::Sensor make_sensor(std::uint32_t width = 16) {
        auto desc = clspeckle::make<ClspSensorDesc>();
        desc.width = width;
        desc.height = 8;
        return {context, desc};
    }
    static cl_uint references(cl_mem mem) {
        cl_uint count = 0;
        clGetMemObjectInfo(mem, CL_MEM_REFERENCE_COUNT, sizeof(count), &count, nullptr);
        return count;
    }
    static cl_uint references(cl_command_queue queue) {
        cl_uint count = 0;
        clGetCommandQueueInfo(queue, CL_QUEUE_REFERENCE_COUNT, sizeof(count), &count, nullptr);
        return count;
    }
};

TEST_F(CppBinding, ErrorsCarryEverything) {
    try {
        make_sensor(0);
        FAIL() << "no exception";
    } catch (const clspeckle::Error &error) {
        EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, error.status());
        EXPECT_EQ(0, error.opencl_code());
        EXPECT_EQ("clspSensorCreate", error.function());
        EXPECT_NE(std::string::npos, error.message().find("width"));
        EXPECT_EQ("", error.build_log());
        EXPECT_EQ("clspSensorCreate: " + error.message() + " (CLSP_ERROR_INVALID_ARGUMENT)", error.what());
    }
    EXPECT_NO_THROW(clspeckle::check(CLSP_SUCCESS));
    EXPECT_THROW(clspeckle::check(CLSP_ERROR_IO), clspeckle::Error) << "a status that is not the last error's";
}

TEST_F(CppBinding, CopiesShareAndMovesEmpty) {
    clspeckle::Sensor original = make_sensor();
    const ClspSensor handle = original.get();
    {
        clspeckle::Sensor copy = original;
        EXPECT_EQ(handle, copy.get());
        original.reset();
        EXPECT_FALSE(original);
        copy.set_exposure_gain(3); // still alive
        original = copy;
        clspeckle::Sensor &self = copy;
        copy = std::move(self);
        EXPECT_TRUE(copy) << "assigned to itself";
        clspeckle::Sensor &same = original;
        original = same;
        EXPECT_EQ(handle, original.get());
    }
    clspeckle::Sensor moved = std::move(original);
    EXPECT_FALSE(original); // NOLINT: a moved-from handle is empty by contract
    EXPECT_THROW(original.set_exposure_gain(1), clspeckle::Error);
    clspeckle::Sensor adopted = clspeckle::Sensor::adopt(moved.release());
    EXPECT_FALSE(moved);
    adopted.set_exposure_gain(1);
    adopted = make_sensor();
    EXPECT_EQ(CLSP_ERROR_INVALID_HANDLE, clspSensorRetain(handle)) << "a reference was left over";
}

TEST_F(CppBinding, BorrowedObjectsKeepTheirReferences) {
    const test::HostContext host;
    cl_mem mem = host.buffer(256);
    cl_command_queue raw_queue = host.queue();
    {
        auto borrowed = clspeckle::Buffer::borrow(mem, 256);
        EXPECT_FALSE(borrowed.owned());
        const std::vector<int> values = {1, 2, 3, 4};
        cl_uint with_wrapper = 0;
        {
            const auto borrowed_queue = clspeckle::Queue::borrow(raw_queue);
            borrowed.write(borrowed_queue, values);
            EXPECT_EQ(values, borrowed.read<int>(borrowed_queue, 4));
            borrowed_queue.finish();
            with_wrapper = references(raw_queue); // drivers may hold a reference of their own
        }
        EXPECT_EQ(with_wrapper, references(raw_queue));
        const clspeckle::Buffer moved = std::move(borrowed);
        EXPECT_EQ(256u, moved.size_bytes());
        EXPECT_EQ(0u, borrowed.size_bytes()); // NOLINT: a moved-from buffer is empty by contract
    }
    EXPECT_EQ(1u, references(mem));
    {
        ASSERT_EQ(CL_SUCCESS, clRetainMemObject(mem));
        const auto adopted = clspeckle::Buffer::adopt(mem, 256);
        EXPECT_TRUE(adopted.owned());
        EXPECT_EQ(2u, references(mem));
    }
    EXPECT_EQ(1u, references(mem));
    const cl_uint before = references(raw_queue);
    ASSERT_EQ(CL_SUCCESS, clRetainCommandQueue(raw_queue));
    {
        auto adopted_queue = clspeckle::Queue::adopt(raw_queue);
        EXPECT_EQ(raw_queue, adopted_queue.release());
    }
    EXPECT_EQ(before + 1, references(raw_queue)) << "released objects belong to the caller";
    { const auto adopted_queue = clspeckle::Queue::adopt(raw_queue); }
    EXPECT_EQ(before, references(raw_queue));
    clReleaseMemObject(mem);
    clReleaseCommandQueue(raw_queue);
}

TEST_F(CppBinding, BuffersAndEvents) {
    const std::vector<float> values = {1.5f, 2.5f, 3.5f};
    const clspeckle::Buffer buffer(context, queue, values);
    EXPECT_EQ(12u, buffer.size_bytes());
    EXPECT_EQ(values, buffer.read<float>(queue, 3));
    EXPECT_EQ(std::vector<float>{3.5f}, buffer.read<float>(queue, 1, 8));
    buffer.write(queue, std::vector<float>{9.0f}, 4);
    const float patch = 7.0f;
    std::vector<float> result(3);
    clspeckle::Event written, read;
    buffer.enqueue_write(queue, &patch, sizeof(patch), 8, {}, &written);
    buffer.enqueue_read(queue, result.data(), 12, 0, {written}, &read);
    clspeckle::wait({written, read});
    EXPECT_EQ((std::vector<float>{1.5f, 9.0f, 7.0f}), result);
    clspeckle::wait({});
    const auto borrowed = clspeckle::Event::borrow(read);
    borrowed.wait();
    EXPECT_THROW(clspeckle::Event().wait(), clspeckle::Error);
    EXPECT_THROW(clspeckle::Buffer(context, 0), clspeckle::Error);
    clspeckle::Event kept = std::move(read);
    EXPECT_THROW(buffer.enqueue_read(queue, result.data(), 13, 0, {}, &kept), clspeckle::Error);
    EXPECT_TRUE(kept) << "a failed call leaves the caller's event alone";
    const ClspImage view = buffer.image(3, 1, CLSP_FORMAT_FLOAT32, 16, 4);
    EXPECT_EQ(buffer.get(), view.mem);
    EXPECT_EQ(16u, view.pitch_bytes);
    EXPECT_EQ(4u, view.offset_bytes);
    EXPECT_EQ(0u, view.reserved);
}

TEST_F(CppBinding, FreeFunctions) {
    const clspeckle::Version version = clspeckle::version();
    EXPECT_EQ(static_cast<std::uint32_t>(CLSP_VERSION_MINOR), version.minor);
    EXPECT_EQ(sizeof(ClspMoments), clspeckle::make<ClspMoments>().struct_size);
    EXPECT_EQ(sizeof(ClspErrorInfo), clspeckle::make<ClspErrorInfo>().struct_size);
    EXPECT_EQ(sizeof(ClspDeviceInfo), clspeckle::make<ClspDeviceInfo>().struct_size);
    EXPECT_EQ(5.6, clspeckle::make<ClspApertureDesc>().f_number);
    ASSERT_FALSE(clspeckle::devices().empty());
    EXPECT_NE(std::string::npos, clspeckle::explain_devices().find(clspeckle::devices()[0].name));
    EXPECT_EQ(18u, clspeckle::field_grid(17, 3).grid_width);
    const std::vector<std::uint16_t> pixels = {1, 2, 3, 4, 5, 6};
    auto image = upload(pixels, 3, 2, CLSP_FORMAT_UINT16);
    EXPECT_EQ(3.5, clspeckle::statistics::moments(context, queue, image.view).mean);
    EXPECT_EQ((std::vector<std::uint64_t>{1, 2, 2, 1}),
              clspeckle::statistics::histogram(context, queue, image.view, 2, 6, 2));
    EXPECT_EQ(9u, clspeckle::statistics::autocovariance(context, queue, image.view, 1).size());
}

TEST_F(CppBinding, AWholeFrame) {
    constexpr std::uint32_t width = 16, height = 8;
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    phase_desc.width = aperture_desc.width = width;
    phase_desc.height = aperture_desc.height = height;
    aperture_desc.workspace_from_host = 1;
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    const clspeckle::Buffer workspace(context, aperture.info().workspace_bytes);
    aperture.set_workspace(workspace, 0, workspace.size_bytes());
    const clspeckle::Pipeline pipeline(context, phase, aperture, make_sensor());
    const clspeckle::Queue profiling(context, CLSP_QUEUE_PROFILING);
    auto ideal = floats(std::vector<float>(width * height, 1.0f), width, height);
    auto codes = make_image(width, height, CLSP_FORMAT_UINT16);
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = ideal.view;
    frame.output = codes.view;
    pipeline.warm_up(profiling, frame);
    clspeckle::Event done;
    pipeline.enqueue_frame(profiling, frame, {}, &done);
    done.wait();
    pipeline.check(profiling);
    // Every stage but the pattern. The device's own engine makes the field in its forward transform, and the codes in
    // the inverse one.
    const std::string engine = aperture.info().fft_engine;
    EXPECT_EQ(engine == "clfft" ? 7u : 4u, pipeline.timings().size());
    ideal.buffer.write(queue, std::vector<float>{-1.0f});
    pipeline.enqueue_frame(profiling, frame);
    EXPECT_THROW(pipeline.check(profiling), clspeckle::Error);
    const clspeckle::Buffer state(context, phase.state_size());
    phase.enqueue_save(queue, state);
    phase.enqueue_restore(queue, state);
    queue.finish();
    // What was restored is not lost to an effect.
    auto single = phase_desc;
    single.polarization_count = 1;
    const clspeckle::Phase own(context, single);
    const clspeckle::Pipeline camera(context, own, aperture, make_sensor());
    own.enqueue_restore(queue, state);
    EXPECT_THROW(camera.set_effect("depolarization"), clspeckle::Error);
    own.enqueue_refresh(queue, 0);
    camera.set_effect("depolarization");
    EXPECT_EQ(phase.state_size(), own.state_size());
}

TEST_F(CppBinding, OneCallGivesAFrame) {
    const std::vector<float> light(16 * 8, 0.5f);
    auto sensor = clspeckle::make<ClspSensorDesc>();
    sensor.black_level_dn = 100;
    const auto codes = clspeckle::simulate(light, 16, 8, 7, 1, nullptr, &sensor, context);
    ASSERT_EQ(light.size(), codes.size());
    EXPECT_GT(*std::max_element(codes.begin(), codes.end()), 100);
    EXPECT_NE(codes, clspeckle::simulate(light, 16, 8, 7, 2, nullptr, &sensor, context));
    EXPECT_EQ(codes, clspeckle::simulate(light, 16, 8, 7, 1, nullptr, &sensor));
    EXPECT_THROW(clspeckle::simulate(light, 16, 9), std::invalid_argument);
    EXPECT_THROW(clspeckle::simulate({}, 0, 0), clspeckle::Error);
}

TEST(CppBindingDefaults, MakeGivesWhatTheInitFunctionsWrite) {
    ClspMaterial material;
    ASSERT_EQ(CLSP_SUCCESS, clspMaterialInit(&material, sizeof material));
    EXPECT_EQ(material.lateral_correlation_length_m, clspeckle::make<ClspMaterial>().lateral_correlation_length_m);
    ClspMotionDesc motion;
    ASSERT_EQ(CLSP_SUCCESS, clspMotionDescInit(&motion, sizeof motion));
    EXPECT_EQ(motion.replace_threshold, clspeckle::make<ClspMotionDesc>().replace_threshold);
    ClspMotionInput input;
    ASSERT_EQ(CLSP_SUCCESS, clspMotionInputInit(&input, sizeof input));
    EXPECT_EQ(input.struct_size, clspeckle::make<ClspMotionInput>().struct_size);
    ClspMotionOutput output;
    ASSERT_EQ(CLSP_SUCCESS, clspMotionOutputInit(&output, sizeof output));
    EXPECT_EQ(output.struct_size, clspeckle::make<ClspMotionOutput>().struct_size);
    ClspPhaseAdvance advance;
    ASSERT_EQ(CLSP_SUCCESS, clspPhaseAdvanceInit(&advance, sizeof advance));
    EXPECT_EQ(advance.uniform_correlation, clspeckle::make<ClspPhaseAdvance>().uniform_correlation);
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspMaterialInit(nullptr, sizeof material));
    EXPECT_EQ(CLSP_ERROR_INVALID_STRUCT_SIZE, clspMotionInputInit(&input, 3));
}

TEST_F(CppBinding, EffectsAreListedSwitchedAndCleared) {
    const std::vector<ClspEffectInfo> effects = clspeckle::effects();
    ASSERT_GT(effects.size(), 30u);
    for (const ClspEffectInfo &effect : effects) {
        EXPECT_NE('\0', effect.id[0]);
        EXPECT_GE(effect.parameter_count, 1u);
        EXPECT_LE(effect.parameter_count, CLSP_MAX_EFFECT_PARAMETERS);
    }
    constexpr std::uint32_t width = 48, height = 32;
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = width;
    phase_desc.height = height;
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    aperture_desc.width = width;
    aperture_desc.height = height;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase_desc),
                                       clspeckle::Aperture(context, aperture_desc));
    auto ideal = floats(std::vector<float>(width * height, 1.0f), width, height);
    auto light = make_image(width, height, CLSP_FORMAT_FLOAT32);
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = ideal.view;
    frame.output = light.view;
    frame.refresh = CLSP_REFRESH_ALL;
    const auto render = [&] {
        pipeline.enqueue_frame(queue, frame);
        return light.buffer.read<float>(queue, width * height);
    };
    const std::vector<float> plain = render();
    pipeline.set_effect("glare", {0.125}); // the scale takes the middle of 6 and 6
    const std::vector<float> glare = render();
    EXPECT_NE(plain, glare);
    pipeline.set_effect("glare", {0.125, 6.0});
    EXPECT_EQ(glare, render());
    pipeline.set_effect("glare"); // the middle of 0.05 and 0.2
    EXPECT_EQ(glare, render());
    pipeline.set_effect("defocus", {0.5});
    pipeline.clear_effect("glare");
    EXPECT_NE(plain, render());
    pipeline.clear_effects();
    EXPECT_EQ(plain, render());
    EXPECT_THROW(pipeline.set_effect("no_such_effect"), clspeckle::Error);
    EXPECT_THROW(pipeline.set_effect("defocus", {1e9}), clspeckle::Error);
    EXPECT_THROW(pipeline.set_effect("defocus", {0.1, 0.2}), clspeckle::Error) << "it has one parameter";
    EXPECT_THROW(pipeline.set_effect("prnu"), clspeckle::Error) << "there is no sensor";
    EXPECT_THROW(pipeline.clear_effect("no_such_effect"), clspeckle::Error);
    EXPECT_EQ(plain, render());

    // One of the caller's own, after one of the catalogue.
    clspeckle::Hypothesis own;
    own.id = "twice";
    own.stage = "optics";
    own.parameters = {{"by", "1", 0.0, 4.0, 1.0, 3.0}};
    own.opencl_source = "float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {\n"
                        "    return values.by * hypothesis_pixel(frame, x, y);\n}\n";
    const auto times = [](std::vector<float> values, float factor) {
        for (float &value : values)
            value *= factor;
        return values;
    };
    clspeckle::set_effect(pipeline, own); // the middle
    EXPECT_EQ(times(plain, 2.0f), render());
    pipeline.set_effect("glare", {0.125});
    clspeckle::set_effect(pipeline, own, {4.0});
    EXPECT_EQ(times(glare, 4.0f), render());
    pipeline.clear_effect("glare");
    pipeline.clear_effect("twice");
    EXPECT_EQ(plain, render());
    EXPECT_THROW(clspeckle::set_effect(pipeline, own, {5.0}), clspeckle::Error);
    EXPECT_THROW(clspeckle::set_effect(pipeline, own, {1.0, 1.0}), clspeckle::Error) << "it has one parameter";
    own.opencl_source.clear();
    own.apply = [](const ClspHypothesisFrame &) {};
    try {
        clspeckle::set_effect(pipeline, own);
        FAIL() << "frames on the device do not wait for a function";
    } catch (const clspeckle::Error &error) {
        EXPECT_EQ(CLSP_ERROR_UNSUPPORTED, error.status());
        EXPECT_NE(std::string::npos, std::string(error.what()).find("give opencl_source"));
    }
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspPipelineSetHypothesis(pipeline, nullptr, nullptr, 0));
    EXPECT_EQ(CLSP_ERROR_INVALID_HANDLE, clspPipelineSetHypothesis(nullptr, nullptr, nullptr, 0));
    EXPECT_EQ(plain, render());
}

} // namespace
