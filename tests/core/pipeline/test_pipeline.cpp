// Whole frames: what a frame consists of, queues and events, host contexts, lifetimes, timings, and what bad arguments
// get.
#include "stage_support.hpp"

#include <chrono>
#include <thread>

namespace {

constexpr std::uint32_t width = 32, height = 28;

ClspPhaseDesc phase_desc() {
    auto desc = clspeckle::make<ClspPhaseDesc>();
    desc.width = width;
    desc.height = height;
    desc.seed = 11;
    return desc;
}
ClspApertureDesc aperture_desc() {
    auto desc = clspeckle::make<ClspApertureDesc>();
    desc.width = width;
    desc.height = height;
    desc.relative_diameter = 0.5;
    desc.degree_of_polarization = 0.5;
    return desc;
}
ClspSensorDesc sensor_desc() {
    auto desc = clspeckle::make<ClspSensorDesc>();
    desc.width = width;
    desc.height = height;
    desc.seed = 12;
    return desc;
}
clspeckle::Pattern make_pattern(const clspeckle::Context &context) {
    auto desc = clspeckle::make<ClspPatternDesc>();
    const std::vector<float> texels = test::dots(128, 96);
    desc.width = 128;
    desc.height = 96;
    desc.texels = texels.data();
    desc.half_extent_x = 1;
    desc.half_extent_y = 0.75;
    return {context, desc};
}
clspeckle::Pipeline make_pipeline(const clspeckle::Context &context, bool with_sensor = true) {
    return {context, clspeckle::Phase(context, phase_desc()), clspeckle::Aperture(context, aperture_desc()),
            with_sensor ? clspeckle::Sensor(context, sensor_desc()) : clspeckle::Sensor()};
}

class Pipeline : public test::StageTest<ClspPipeline> {
  protected:
    const clspeckle::Phase phase_{context, phase_desc()};
    const clspeckle::Aperture aperture_{context, aperture_desc()};
    const clspeckle::Sensor sensor_{context, sensor_desc()};
    ClspPipelineDesc valid() const override {
        auto desc = clspeckle::make<ClspPipelineDesc>();
        desc.phase = phase_;
        desc.aperture = aperture_;
        desc.sensor = sensor_;
        return desc;
    }

    Image ideal = floats(test::dots(width, height), width, height);
    Image codes = make_image(width, height, CLSP_FORMAT_UINT16);

    ClspFrame frame(std::uint64_t index = 0) const {
        auto result = clspeckle::make<ClspFrame>();
        result.frame_index = index;
        result.irradiance = ideal.view;
        result.output = codes.view;
        return result;
    }
    std::vector<std::uint16_t> render(const clspeckle::Pipeline &pipeline, std::uint64_t index = 0) {
        pipeline.enqueue_frame(queue, frame(index));
        return download<std::uint16_t>(codes);
    }
};

TEST_F(Pipeline, InitFunctionsWriteDefaults) {
    const ClspPipelineDesc desc = checked_defaults();
    test::check_init<ClspFrame>("clspFrameInit", clspFrameInit);
    ClspFrame frame;
    ASSERT_CLSP_OK(clspFrameInit(&frame, sizeof(frame)));
    EXPECT_EQ(nullptr, desc.pattern);
    EXPECT_EQ(nullptr, desc.sensor);
    EXPECT_EQ(CLSP_REFRESH_MASK, frame.refresh);
    EXPECT_EQ(0u, frame.frame_index);
    EXPECT_EQ(nullptr, frame.geometry);
    EXPECT_EQ(nullptr, frame.refresh_mask.mem);
}

// A struct as a caller of the first release has it: shorter, in memory that ends with it (sanitizers see who reads on).
template <typename Struct> std::unique_ptr<unsigned char[]> first_release(const Struct &now, std::uint32_t size) {
    std::unique_ptr<unsigned char[]> bytes(new unsigned char[size]);
    std::memcpy(bytes.get(), &now, size);
    std::memcpy(bytes.get(), &size, sizeof size);
    return bytes;
}
template <typename Struct> const Struct *as(const std::unique_ptr<unsigned char[]> &bytes) {
    return reinterpret_cast<const Struct *>(bytes.get());
}

TEST_F(Pipeline, StructsOfTheFirstReleaseStillWork) {
    const auto phase_bytes = first_release(phase_desc(), 40);
    const auto aperture_bytes = first_release(aperture_desc(), 104);
    const auto sensor_bytes = first_release(sensor_desc(), 112);
    auto desc = clspeckle::make<ClspPipelineDesc>();
    ASSERT_CLSP_OK(clspPhaseCreate(context, as<ClspPhaseDesc>(phase_bytes), &desc.phase));
    ASSERT_CLSP_OK(clspApertureCreate(context, as<ClspApertureDesc>(aperture_bytes), &desc.aperture));
    ASSERT_CLSP_OK(clspSensorCreate(context, as<ClspSensorDesc>(sensor_bytes), &desc.sensor));
    const auto pipeline_bytes = first_release(desc, 40);
    ClspPipeline pipeline = nullptr;
    ASSERT_CLSP_OK(clspPipelineCreate(context, as<ClspPipelineDesc>(pipeline_bytes), &pipeline));
    const auto frame_bytes = first_release(frame(3), 144);
    EXPECT_CLSP_OK(enqueue(clspPipelineEnqueueFrame, pipeline, as<ClspFrame>(frame_bytes)));
    const auto old = download<std::uint16_t>(codes);
    EXPECT_EQ(render(make_pipeline(context), 3), old);
    for (std::uint32_t short_by : {1u, 8u}) {
        const auto too_short = first_release(desc, 40 - short_by);
        ClspPipeline none = nullptr;
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size",
                          clspPipelineCreate(context, as<ClspPipelineDesc>(too_short), &none));
    }
    clspPipelineRelease(pipeline);
    clspPhaseRelease(desc.phase);
    clspApertureRelease(desc.aperture);
    clspSensorRelease(desc.sensor);
}

TEST_F(Pipeline, SeveralFramesInOneCallAreTheirFramesOneByOne) {
    auto mask = make_image(width, height, CLSP_FORMAT_UINT8);
    mask.buffer.write(queue, std::vector<std::uint8_t>(width * height, 1));
    constexpr std::uint32_t kCount = 5;
    const auto numbered = [&](std::uint32_t i) {
        auto f = frame(7 + i);
        if (i == 2)
            f.refresh = CLSP_REFRESH_ALL;
        if (i == 3)
            f.refresh_mask = mask.view;
        if (i == 4)
            f.illumination = CLSP_ILLUMINATION_DARK;
        return f;
    };
    const auto one_by_one = make_pipeline(context);
    std::vector<std::vector<std::uint16_t>> expected;
    for (std::uint32_t i = 0; i < kCount; ++i) {
        one_by_one.enqueue_frame(queue, numbered(i));
        expected.push_back(download<std::uint16_t>(codes));
    }
    for (std::uint32_t flags : {0u, test::out_of_order(context), CLSP_QUEUE_PROFILING | test::out_of_order(context)}) {
        const clspeckle::Queue own(context, flags);
        const auto pipeline = make_pipeline(context);
        std::vector<Image> outputs;
        std::vector<ClspFrame> frames;
        for (std::uint32_t i = 0; i < kCount; ++i) {
            outputs.push_back(make_image(width, height, CLSP_FORMAT_UINT16));
            frames.push_back(numbered(i));
            frames.back().output = outputs.back().view;
        }
        clspeckle::Event done;
        pipeline.enqueue_frames(own, frames, {}, &done);
        done.wait();
        for (std::uint32_t i = 0; i < kCount; ++i)
            EXPECT_EQ(expected[i], download<std::uint16_t>(outputs[i])) << "frame " << i << ", flags " << flags;
        if (flags & CLSP_QUEUE_PROFILING) {
            const auto timings = pipeline.timings();
            ASSERT_EQ(2u, timings.size()) << "of the last frame alone, a dark one";
            EXPECT_STREQ("sensor", timings[1].stage);
        }
    }
}

TEST_F(Pipeline, OfFramesThatAreRefusedNoneIsEnqueued) {
    const auto pipeline = make_pipeline(context);
    const auto expected = render(make_pipeline(context), 9);
    codes.buffer.write(queue, std::vector<std::uint16_t>(width * height, 12345));
    std::vector<ClspFrame> frames(4, frame(9));
    const auto fails = [&](ClspStatus status, const std::string &words, const std::vector<ClspFrame> &given) {
        EXPECT_CLSP_FAILS(status, words,
                          clspPipelineEnqueueFrames(pipeline, queue, static_cast<std::uint32_t>(given.size()),
                                                    given.data(), 0, nullptr, nullptr));
    };
    frames[2].refresh = 7;
    fails(CLSP_ERROR_INVALID_ARGUMENT, "frames[2].refresh is 7", frames);
    frames[2] = frame(9);
    frames[3].output.mem = nullptr;
    fails(CLSP_ERROR_INVALID_ARGUMENT, "frames[3]: output", frames);
    frames[3] = frame(9);
    frames[1].struct_size -= 8;
    fails(CLSP_ERROR_INVALID_STRUCT_SIZE, "frames[1].struct_size", frames);
    frames[1] = frame(9);
    frames[1].reserved = 1;
    fails(CLSP_ERROR_INVALID_ARGUMENT, "frames[1].reserved is 1", frames);
    frames[1] = frame(9);
    frames[0].struct_size -= 1;
    fails(CLSP_ERROR_INVALID_STRUCT_SIZE, "it must be a multiple of 8", frames);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count is 0",
                      clspPipelineEnqueueFrames(pipeline, queue, 0, frames.data(), 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "frames is NULL",
                      clspPipelineEnqueueFrames(pipeline, queue, 1, nullptr, 0, nullptr, nullptr));
    EXPECT_EQ(std::vector<std::uint16_t>(width * height, 12345), download<std::uint16_t>(codes));
    EXPECT_EQ(expected, render(pipeline, 9)) << "the state is as it was";
}

// Elements of an array lie as far apart as the caller's struct is long.
TEST_F(Pipeline, SeveralFramesOfTheFirstRelease) {
    constexpr std::uint32_t kFirst = 144, kCount = 3;
    std::unique_ptr<unsigned char[]> bytes(new unsigned char[kCount * kFirst]);
    std::vector<Image> outputs;
    for (std::uint32_t i = 0; i < kCount; ++i) {
        outputs.push_back(make_image(width, height, CLSP_FORMAT_UINT16));
        auto f = frame(i);
        f.output = outputs.back().view;
        std::memcpy(bytes.get() + i * kFirst, first_release(f, kFirst).get(), kFirst);
    }
    const auto pipeline = make_pipeline(context), other = make_pipeline(context);
    ASSERT_CLSP_OK(clspPipelineEnqueueFrames(pipeline, queue, kCount, as<ClspFrame>(bytes), 0, nullptr, nullptr));
    for (std::uint32_t i = 0; i < kCount; ++i)
        EXPECT_EQ(render(other, i), download<std::uint16_t>(outputs[i]));
}

TEST_F(Pipeline, AFrameIsItsStagesOneAfterTheOther) {
    const clspeckle::Phase phase(context, phase_desc());
    const clspeckle::Aperture aperture(context, aperture_desc());
    const clspeckle::Sensor sensor(context, sensor_desc());
    auto intensity = make_image(width, height, CLSP_FORMAT_FLOAT32);
    phase.enqueue_refresh(queue, 4);
    aperture.enqueue_intensity(queue, phase, ideal.view, intensity.view);
    sensor.enqueue_expose(queue, intensity.view, 4, codes.view);
    const auto expected = download<std::uint16_t>(codes);
    const auto expected_intensity = download<float>(intensity);

    EXPECT_EQ(expected, render(make_pipeline(context), 4));
    auto f = frame(4);
    f.output = intensity.view;
    make_pipeline(context, false).enqueue_frame(queue, f);
    EXPECT_EQ(expected_intensity, download<float>(intensity)) << "without a sensor the output is the intensity";

    // The same with a pattern.
    const auto pattern = make_pattern(context);
    auto depth = floats(std::vector<float>(width * height, 1.2f), width, height);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.view;
    geometry.fx_px = geometry.fy_px = 25;
    geometry.cx_px = 15;
    geometry.cy_px = 14;
    auto irradiance = make_image(width, height, CLSP_FORMAT_FLOAT32);
    pattern.enqueue_lookup(queue, geometry, irradiance.view);
    aperture.enqueue_intensity(queue, phase, irradiance.view, intensity.view);
    sensor.enqueue_expose(queue, intensity.view, 4, codes.view);
    const auto expected_scene = download<std::uint16_t>(codes);
    const clspeckle::Pipeline whole(context, pattern, clspeckle::Phase(context, phase_desc()), aperture, sensor);
    f = clspeckle::make<ClspFrame>();
    f.frame_index = 4;
    f.geometry = &geometry;
    f.output = codes.view;
    whole.enqueue_frame(queue, f);
    EXPECT_EQ(expected_scene, download<std::uint16_t>(codes));
    EXPECT_CLSP_OK(clspPipelineCheck(whole, queue));
}

TEST_F(Pipeline, OneCallGivesAPipelinesFirstFrame) {
    const std::vector<float> light = test::dots(width, height);
    ClspApertureDesc aperture = aperture_desc();
    ClspSensorDesc sensor = sensor_desc();
    const auto simulate = [&](ClspContext in, std::uint64_t seed) {
        std::vector<std::uint16_t> result(width * height);
        EXPECT_CLSP_OK(clspSimulate(in, width, height, light.data(), &aperture, &sensor, seed, 5, result.data()));
        return result;
    };
    const auto expected = render(make_pipeline(context), 5);
    EXPECT_EQ(expected, simulate(context, phase_desc().seed));
    EXPECT_EQ(expected, simulate(nullptr, phase_desc().seed));
    aperture.width = aperture.height = sensor.width = sensor.height = 0; // the image's
    EXPECT_EQ(expected, simulate(context, phase_desc().seed));
    EXPECT_NE(expected, simulate(context, phase_desc().seed + 1));
    sensor.seed = 0; // that of the call
    const auto seeded = simulate(context, 12);
    sensor.seed = 12;
    EXPECT_EQ(seeded, simulate(context, 12));
    EXPECT_NE(expected, seeded);

    std::vector<std::uint16_t> plain(width * height), named(width * height);
    auto default_aperture = clspeckle::make<ClspApertureDesc>();
    auto default_sensor = clspeckle::make<ClspSensorDesc>();
    EXPECT_CLSP_OK(clspSimulate(context, width, height, light.data(), nullptr, nullptr, 3, 0, plain.data()));
    EXPECT_CLSP_OK(
        clspSimulate(context, width, height, light.data(), &default_aperture, &default_sensor, 3, 0, named.data()));
    EXPECT_EQ(plain, named);
}

TEST_F(Pipeline, OneCallTakesApertureGridsAndLeavesNothingBehind) {
    const std::vector<float> light = test::dots(width, height);
    std::vector<std::uint16_t> result(width * height);
    ClspApertureDesc aperture = aperture_desc();
    aperture.oversampling = 2;
    aperture.guard_px = 4;
    const auto before = context.info();
    EXPECT_CLSP_OK(clspSimulate(context, width, height, light.data(), &aperture, nullptr, 1, 0, result.data()));
    EXPECT_GT(*std::max_element(result.begin(), result.end()), 64);
    EXPECT_EQ(before.allocation_count, context.info().allocation_count);
}

TEST_F(Pipeline, OneCallRefusesWhatAPipelineWould) {
    std::vector<float> light = test::dots(width, height);
    std::vector<std::uint16_t> result(width * height, 77);
    const auto call = [&](ClspContext in, std::uint32_t w, std::uint32_t h, const float *in_light,
                          const ClspApertureDesc *aperture, const ClspSensorDesc *sensor, std::uint64_t index,
                          std::uint16_t *out) {
        return clspSimulate(in, w, h, in_light, aperture, sensor, 1, index, out);
    };
    const auto refused = [&](ClspStatus expected, const std::string &words, ClspStatus got) {
        EXPECT_TRUE(test::failed_as("clspSimulate", got, expected, words)) << words;
        test::poison_last_error("clspSimulate");
    };
    const ClspStatus argument = CLSP_ERROR_INVALID_ARGUMENT;
    const float *in = light.data();
    std::uint16_t *out = result.data();
    test::poison_last_error("clspSimulate");
    refused(argument, "irradiance is NULL", call(context, width, height, nullptr, nullptr, nullptr, 0, out));
    refused(argument, "codes is NULL", call(context, width, height, in, nullptr, nullptr, 0, nullptr));
    for (const std::uint32_t side : test::bad_sides) {
        refused(argument, "width", call(context, side, height, in, nullptr, nullptr, 0, out));
        refused(argument, "height", call(context, width, side, in, nullptr, nullptr, 0, out));
    }
    refused(argument, "frame_index", call(context, width, height, in, nullptr, nullptr, std::uint64_t{1} << 48, out));
    refused(CLSP_ERROR_INVALID_HANDLE, "context",
            call(reinterpret_cast<ClspContext>(std::uintptr_t{0x123450}), width, height, in, nullptr, nullptr, 0, out));
    const auto of_aperture = [&](const std::string &words, auto change, ClspStatus expected) {
        ClspApertureDesc desc = aperture_desc();
        change(desc);
        refused(expected, words, call(context, width, height, in, &desc, nullptr, 0, out));
    };
    of_aperture(
        "aperture->struct_size", [](auto &d) { d.struct_size = 4; }, CLSP_ERROR_INVALID_STRUCT_SIZE);
    of_aperture(
        "aperture->width is 31, but the image's width is 32", [](auto &d) { d.width = 31; }, argument);
    of_aperture(
        "aperture->height is 1", [](auto &d) { d.height = 1; }, argument);
    of_aperture(
        "workspace_from_host", [](auto &d) { d.workspace_from_host = 1; }, argument);
    of_aperture(
        "aperture->reserved_blades", [](auto &d) { d.reserved_blades = 1; }, argument);
    of_aperture(
        "diameter", [](auto &d) { d.relative_diameter = -1; }, argument);
    const auto of_sensor = [&](const std::string &words, auto change, ClspStatus expected) {
        ClspSensorDesc desc = sensor_desc();
        change(desc);
        refused(expected, words, call(context, width, height, in, nullptr, &desc, 0, out));
    };
    of_sensor(
        "sensor->struct_size", [](auto &d) { d.struct_size = 4; }, CLSP_ERROR_INVALID_STRUCT_SIZE);
    of_sensor(
        "sensor->width is 33", [](auto &d) { d.width = 33; }, argument);
    of_sensor(
        "sensor->height is 27", [](auto &d) { d.height = 27; }, argument);
    of_sensor(
        "bits", [](auto &d) { d.bits = 7; }, argument);
    light[3 * width + 2] = -1;
    refused(CLSP_ERROR_INVALID_DATA, "x = 2, y = 3", call(context, width, height, in, nullptr, nullptr, 0, out));
    EXPECT_EQ(std::vector<std::uint16_t>(width * height, 77), result);
}

TEST_F(Pipeline, StaticSceneKeepsItsSpeckleAndGetsNewNoise) {
    const auto pipeline = make_pipeline(context);
    const auto first = render(pipeline, 0), second = render(pipeline, 1);
    EXPECT_NE(first, second) << "the noise did not change";
    EXPECT_EQ(first, render(pipeline, 0)) << "the speckle changed";

    const auto bare = make_pipeline(context, false);
    auto intensity = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto run = [&](std::uint64_t index, std::uint32_t refresh, const ClspImage *mask) {
        auto f = frame(index);
        f.output = intensity.view;
        f.refresh = refresh;
        if (mask)
            f.refresh_mask = *mask;
        bare.enqueue_frame(queue, f);
        return download<float>(intensity);
    };
    const auto a = run(0, CLSP_REFRESH_MASK, nullptr);
    EXPECT_EQ(a, run(1, CLSP_REFRESH_MASK, nullptr));
    EXPECT_NE(a, run(2, CLSP_REFRESH_ALL, nullptr));
    EXPECT_EQ(a, run(0, CLSP_REFRESH_ALL, nullptr)) << "the same frame index draws the same phases";
    std::vector<std::uint8_t> bits(width * height, 0);
    auto none = upload(bits, width, height, CLSP_FORMAT_UINT8);
    EXPECT_EQ(a, run(3, CLSP_REFRESH_MASK, &none.view));
    bits[5 * width + 9] = 1;
    auto one = upload(bits, width, height, CLSP_FORMAT_UINT8);
    EXPECT_NE(a, run(3, CLSP_REFRESH_MASK, &one.view));
}

TEST_F(Pipeline, HostContextOffsetAndPitchGiveTheSameBytes) {
    const auto expected = render(make_pipeline(context), 7);

    const test::HostContext host;
    const auto host_clsp = clspeckle::Context::from_host(host.context, host.device);
    EXPECT_EQ(host.context, host_clsp.info().cl_context_handle);
    EXPECT_EQ(host.device, host_clsp.info().cl_device);
    const auto pipeline = make_pipeline(host_clsp);
    constexpr std::size_t pitch = 256, offset = 1024, bytes = offset + pitch * height + 64;
    const cl_command_queue_properties out_of_order =
        test::out_of_order(context) ? CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE : 0;
    for (cl_command_queue_properties properties :
         {cl_command_queue_properties{0}, out_of_order, out_of_order | CL_QUEUE_PROFILING_ENABLE}) {
        const auto host_queue = clspeckle::Queue::adopt(host.queue(properties));
        const auto in = clspeckle::Buffer::adopt(host.buffer(bytes), bytes);
        const auto out = clspeckle::Buffer::adopt(host.buffer(bytes), bytes);
        std::vector<unsigned char> memory(bytes, filler);
        out.write(host_queue, memory);
        const auto pixels = test::dots(width, height);
        for (std::uint32_t y = 0; y < height; ++y)
            std::memcpy(&memory[offset + y * pitch], &pixels[y * width], width * sizeof(float));
        in.write(host_queue, memory);
        auto f = clspeckle::make<ClspFrame>();
        f.frame_index = 7;
        f.refresh = CLSP_REFRESH_ALL;
        f.irradiance = in.image(width, height, CLSP_FORMAT_FLOAT32, pitch, offset);
        f.output = out.image(width, height, CLSP_FORMAT_UINT16, pitch, offset);
        clspeckle::Event done;
        pipeline.enqueue_frame(host_queue, f, {}, &done);
        done.wait();
        auto result = out.read<unsigned char>(host_queue, bytes);
        for (std::uint32_t y = 0; y < height; ++y) {
            EXPECT_EQ(0, std::memcmp(&result[offset + y * pitch], &expected[y * width], width * 2)) << "row " << y;
            std::fill_n(&result[offset + y * pitch], width * 2, filler);
        }
        EXPECT_EQ(std::vector<unsigned char>(bytes, filler), result) << "written outside of the picture";
        EXPECT_EQ(memory, in.read<unsigned char>(host_queue, bytes)) << "the input was written";
    }
}

TEST_F(Pipeline, SubBuffersWork) {
    const auto expected = render(make_pipeline(context), 2);
    cl_uint align_bits = 0;
    clGetDeviceInfo(context.info().cl_device, CL_DEVICE_MEM_BASE_ADDR_ALIGN, sizeof(align_bits), &align_bits, nullptr);
    const std::size_t align = align_bits / 8;
    const clspeckle::Buffer parent(context, align * 8 + width * height * 8);
    const std::size_t input_bytes = width * height * sizeof(float);
    const cl_buffer_region in_region{align, input_bytes};
    const cl_buffer_region out_region{align * (2 + input_bytes / align), width * height * 2};
    cl_int code = CL_SUCCESS;
    const auto in = clspeckle::Buffer::adopt(
        clCreateSubBuffer(parent, CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &in_region, &code), input_bytes);
    ASSERT_EQ(CL_SUCCESS, code);
    const auto out = clspeckle::Buffer::adopt(
        clCreateSubBuffer(parent, CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &out_region, &code),
        out_region.size);
    ASSERT_EQ(CL_SUCCESS, code);
    in.write(queue, test::dots(width, height));
    auto f = frame(2);
    f.irradiance = in.image(width, height, CLSP_FORMAT_FLOAT32);
    f.output = out.image(width, height, CLSP_FORMAT_UINT16);
    const auto pipeline = make_pipeline(context);
    pipeline.enqueue_frame(queue, f);
    EXPECT_EQ(expected, out.read<std::uint16_t>(queue, width * height));
    // The same bytes seen through the parent: an overlap.
    f.output = parent.image(width, height, CLSP_FORMAT_UINT16, 0, align + 64);
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "output", enqueue(clspPipelineEnqueueFrame, pipeline, &f));
}

TEST_F(Pipeline, SideBySideInOneAtlas) {
    const auto expected = render(make_pipeline(context), 3);
    constexpr std::uint64_t pitch = 512; // 128 bytes of input, 64 bytes of output, room between them
    const clspeckle::Buffer atlas(context, queue, std::vector<unsigned char>(pitch * height, filler));
    const auto pixels = test::dots(width, height);
    for (std::uint32_t y = 0; y < height; ++y)
        atlas.write(queue, &pixels[y * width], width * sizeof(float), y * pitch + 64);
    const auto pipeline = make_pipeline(context);
    auto f = frame(3);
    f.irradiance = atlas.image(width, height, CLSP_FORMAT_FLOAT32, pitch, 64);
    f.output = atlas.image(width, height, CLSP_FORMAT_UINT16, pitch, 192);
    pipeline.enqueue_frame(queue, f);
    const auto bytes = atlas.read<unsigned char>(queue, pitch * height);
    for (std::uint32_t y = 0; y < height; ++y) {
        EXPECT_EQ(0, std::memcmp(&bytes[y * pitch + 192], &expected[y * width], width * 2)) << "row " << y;
        EXPECT_EQ(0, std::memcmp(&bytes[y * pitch + 64], &pixels[y * width], width * 4)) << "row " << y;
        EXPECT_EQ(filler, bytes[y * pitch + 191 - 128]);
        EXPECT_EQ(filler, bytes[y * pitch + 192 + 64]);
    }
    for (std::uint64_t offset : {std::uint64_t{190}, std::uint64_t{2}}) { // one pixel of the other
        f.output = atlas.image(width, height, CLSP_FORMAT_UINT16, pitch, offset);
        EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "output", enqueue(clspPipelineEnqueueFrame, pipeline, &f));
    }
}

TEST_F(Pipeline, ReadOnlyMemoryIsNotWritten) {
    cl_int code = CL_SUCCESS;
    const auto mem = clspeckle::Buffer::adopt(
        clCreateBuffer(context.info().cl_context_handle, CL_MEM_READ_ONLY, width * height * 4, nullptr, &code),
        width * height * 4);
    ASSERT_EQ(CL_SUCCESS, code);
    mem.write(queue, test::dots(width, height));
    const auto pipeline = make_pipeline(context);
    auto f = frame(3);
    f.output = mem.image(width, height, CLSP_FORMAT_UINT16);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CL_MEM_READ_ONLY", enqueue(clspPipelineEnqueueFrame, pipeline, &f));
    f = frame(3);
    f.irradiance = mem.image(width, height, CLSP_FORMAT_FLOAT32);
    pipeline.enqueue_frame(queue, f);
    EXPECT_EQ(render(make_pipeline(context), 3), (pipeline.enqueue_frame(queue, f), download<std::uint16_t>(codes)));
}

// On an out-of-order queue nothing may run before the wait list is complete, and steps must wait for each other.
TEST_F(Pipeline, NothingRunsBeforeTheUserEvent) {
    const auto expected = render(make_pipeline(context), 1);
    for (std::uint32_t flags : {0u, test::out_of_order(context)}) {
        const auto pipeline = make_pipeline(context);
        const clspeckle::Queue waiting(context, flags);
        codes.buffer.write(queue, std::vector<std::uint16_t>(width * height, 0xDEAD));
        cl_int code = CL_SUCCESS;
        const auto gate = clspeckle::Event::adopt(clCreateUserEvent(context.info().cl_context_handle, &code));
        ASSERT_EQ(CL_SUCCESS, code);
        clspeckle::Event done;
        pipeline.enqueue_frame(waiting, frame(1), {gate}, &done);
        clFlush(waiting);
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        cl_int status = CL_COMPLETE;
        clGetEventInfo(done, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof(status), &status, nullptr);
        EXPECT_GT(status, CL_RUNNING) << "the frame began before its wait list was complete";
        EXPECT_EQ(std::vector<std::uint16_t>(width * height, 0xDEAD), download<std::uint16_t>(codes));
        clSetUserEventStatus(gate, CL_COMPLETE);
        done.wait();
        EXPECT_EQ(expected, download<std::uint16_t>(codes));
    }
}

TEST_F(Pipeline, ManyFramesOnAnOutOfOrderQueue) {
    const clspeckle::Queue chaos(context, test::out_of_order(context));
    const auto in_order = make_pipeline(context), out_of_order = make_pipeline(context);
    std::vector<Image> outputs;
    clspeckle::Event last;
    for (std::uint64_t i = 0; i < 8; ++i) {
        outputs.push_back(make_image(width, height, CLSP_FORMAT_UINT16));
        auto f = frame(i);
        f.refresh = CLSP_REFRESH_ALL;
        f.output = outputs.back().view;
        std::vector<cl_event> wait_list;
        if (last)
            wait_list.push_back(last);
        clspeckle::Event next;
        out_of_order.enqueue_frame(chaos, f, wait_list, &next);
        last = std::move(next);
    }
    last.wait();
    for (std::uint64_t i = 0; i < 8; ++i) {
        auto f = frame(i);
        f.refresh = CLSP_REFRESH_ALL;
        in_order.enqueue_frame(queue, f);
        EXPECT_EQ(download<std::uint16_t>(codes), download<std::uint16_t>(outputs[i])) << "frame " << i;
    }
}

TEST_F(Pipeline, AfterWarmUpFramesAllocateAndBuildNothing) {
    const clspeckle::Context fresh;
    const auto pipeline = make_pipeline(fresh);
    pipeline.warm_up(queue, frame(0));
    const ClspContextInfo before = fresh.info();
    EXPECT_GT(before.allocation_count, 0u);
    const auto first = render(pipeline, 3);
    const ClspContextInfo after = fresh.info();
    EXPECT_EQ(before.programs_built, after.programs_built);
    EXPECT_EQ(before.programs_from_cache, after.programs_from_cache);
    EXPECT_EQ(before.allocation_count, after.allocation_count);
    EXPECT_EQ(before.allocated_bytes, after.allocated_bytes);
    EXPECT_EQ(first, render(make_pipeline(context), 3)) << "the first frame after the warm-up did not draw its phases";
    // A warm-up between frames leaves the phases alone, even one that would draw them anew.
    auto other = frame(9);
    other.refresh = CLSP_REFRESH_ALL;
    pipeline.warm_up(queue, other);
    EXPECT_EQ(first, render(pipeline, 3));
}

TEST_F(Pipeline, TimingsCoverAllStages) {
    const clspeckle::Context own;
    const clspeckle::Queue profiling(own, CLSP_QUEUE_PROFILING);
    const clspeckle::Aperture aperture(own, aperture_desc());
    // The device's own engine makes the field in its forward transform, intensity and codes in the inverse one.
    const std::string engine = aperture.info().fft_engine;
    const std::vector<std::string> expected =
        engine == "clfft" ? std::vector<std::string>{"pattern", "phase",       "field",     "fft",
                                                     "pupil",   "inverse_fft", "intensity", "sensor"}
                          : std::vector<std::string>{"pattern", "phase", "fft", "pupil", "inverse_fft"};
    const clspeckle::Pipeline pipeline(own, make_pattern(own), clspeckle::Phase(own, phase_desc()), aperture,
                                       clspeckle::Sensor(own, sensor_desc()));
    std::uint32_t count = 99;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "no frame", clspPipelineGetTimings(pipeline, 0, nullptr, &count));
    auto depth = floats(std::vector<float>(width * height, 1.0f), width, height);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.view;
    geometry.fx_px = geometry.fy_px = 25;
    auto f = clspeckle::make<ClspFrame>();
    f.geometry = &geometry;
    f.output = codes.view;
    f.refresh = CLSP_REFRESH_ALL;
    pipeline.enqueue_frame(queue, f);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "profiling", clspPipelineGetTimings(pipeline, 0, nullptr, &count));
    for (std::uint32_t flags : {CLSP_QUEUE_PROFILING, CLSP_QUEUE_PROFILING | test::out_of_order(context)}) {
        const clspeckle::Queue timed(own, flags);
        clspeckle::Event done;
        const auto start = std::chrono::steady_clock::now();
        pipeline.enqueue_frame(timed, f, {}, &done);
        done.wait();
        const double wall_ms =
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
        const auto timings = pipeline.timings();
        std::vector<std::string> stages;
        double sum_ms = 0;
        for (const ClspStageTiming &timing : timings) {
            stages.emplace_back(timing.stage);
            EXPECT_GT(timing.milliseconds, 0.0) << timing.stage;
            sum_ms += timing.milliseconds;
        }
        EXPECT_EQ(expected, stages);
        EXPECT_LT(sum_ms, wall_ms * 1.05) << "the stages took longer than the frame";
    }
    ClspStageTiming two[3];
    std::memset(two, 0x77, sizeof(two));
    EXPECT_CLSP_OK(clspPipelineGetTimings(pipeline, 2, two, &count));
    EXPECT_EQ(expected.size(), count);
    EXPECT_STREQ("phase", two[1].stage);
    EXPECT_EQ(0x77, two[2].stage[0]) << "written beyond the capacity";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspPipelineGetTimings(pipeline, 2, two, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "timings", clspPipelineGetTimings(pipeline, 2, nullptr, &count));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pipeline", clspPipelineGetTimings(nullptr, 2, two, &count));
}

TEST_F(Pipeline, CheckReportsBadPixelsWithTheFirstPlace) {
    const auto pipeline = make_pipeline(context);
    EXPECT_CLSP_OK(clspPipelineCheck(pipeline, queue));
    render(pipeline);
    EXPECT_CLSP_OK(clspPipelineCheck(pipeline, queue));
    auto bad = test::dots(width, height);
    bad[9 * width + 5] = std::numeric_limits<float>::quiet_NaN();
    bad[10 * width + 2] = -0.25f;
    bad[11 * width + 1] = std::numeric_limits<float>::infinity();
    auto image = floats(bad, width, height);
    auto f = frame(1);
    f.irradiance = image.view;
    pipeline.enqueue_frame(queue, f);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "x = 5, y = 9", clspPipelineCheck(pipeline, queue));
    const std::string message = test::last_error().message;
    EXPECT_NE(std::string::npos, message.find("irradiance")) << message;
    EXPECT_NE(std::string::npos, message.find("2 NaN or infinite")) << message;
    EXPECT_NE(std::string::npos, message.find("1 negative")) << message;
    EXPECT_CLSP_OK(clspPipelineCheck(pipeline, queue)) << "the same pixels are reported twice";

    // All frames since the last check count, and minus zero is not negative.
    pipeline.enqueue_frame(queue, f);
    pipeline.enqueue_frame(queue, f);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "4 NaN", clspPipelineCheck(pipeline, queue));
    auto zeros = floats(std::vector<float>(width * height, -0.0f), width, height);
    f.irradiance = zeros.view;
    pipeline.enqueue_frame(queue, f);
    EXPECT_CLSP_OK(clspPipelineCheck(pipeline, queue));

    // With a pattern: albedo.
    const clspeckle::Pipeline scene(context, make_pattern(context), clspeckle::Phase(context, phase_desc()),
                                    clspeckle::Aperture(context, aperture_desc()));
    std::vector<float> albedo(width * height, 0.5f);
    albedo[3 * width + 30] = -0.5f;
    auto albedo_image = floats(albedo, width, height);
    auto depth = floats(std::vector<float>(width * height, 1.0f), width, height);
    auto intensity = make_image(width, height, CLSP_FORMAT_FLOAT32);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.view;
    geometry.albedo = albedo_image.view;
    geometry.fx_px = geometry.fy_px = 25;
    f = clspeckle::make<ClspFrame>();
    f.geometry = &geometry;
    f.output = intensity.view;
    scene.enqueue_frame(queue, f);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "x = 30, y = 3", clspPipelineCheck(scene, queue));
    EXPECT_NE(nullptr, std::strstr(test::last_error().message, "albedo"));

    const test::Foreign foreign;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pipeline", clspPipelineCheck(nullptr, queue));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspPipelineCheck(pipeline, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "queue", clspPipelineCheck(pipeline, foreign.queue));
}

TEST_F(Pipeline, ReleaseInAnyOrder) {
    const auto expected = render(make_pipeline(context), 6);
    // 0 context, 1 phase, 2 aperture, 3 sensor, 4 pipeline: all 120 orders; frames run as long as the pipeline lives.
    std::vector<int> order = {0, 1, 2, 3, 4};
    do {
        ClspContext own = nullptr;
        ClspPhase phase = nullptr;
        ClspAperture aperture = nullptr;
        ClspSensor sensor = nullptr;
        ClspPipeline pipeline = nullptr;
        const ClspPhaseDesc p = phase_desc();
        const ClspApertureDesc a = aperture_desc();
        const ClspSensorDesc s = sensor_desc();
        ASSERT_CLSP_OK(clspContextCreate(nullptr, &own));
        ASSERT_CLSP_OK(clspPhaseCreate(own, &p, &phase));
        ASSERT_CLSP_OK(clspApertureCreate(own, &a, &aperture));
        ASSERT_CLSP_OK(clspSensorCreate(own, &s, &sensor));
        auto desc = clspeckle::make<ClspPipelineDesc>();
        desc.phase = phase;
        desc.aperture = aperture;
        desc.sensor = sensor;
        ASSERT_CLSP_OK(clspPipelineCreate(own, &desc, &pipeline));
        const ClspFrame f = frame(6);
        bool alive = true;
        for (int which : order) {
            switch (which) {
            case 0:
                EXPECT_CLSP_OK(clspContextRelease(own));
                break;
            case 1:
                EXPECT_CLSP_OK(clspPhaseRelease(phase));
                break;
            case 2:
                EXPECT_CLSP_OK(clspApertureRelease(aperture));
                break;
            case 3:
                EXPECT_CLSP_OK(clspSensorRelease(sensor));
                break;
            default:
                EXPECT_CLSP_OK(clspPipelineRelease(pipeline));
                alive = false;
            }
            if (alive && which == order[3]) {
                ASSERT_CLSP_OK(enqueue(clspPipelineEnqueueFrame, pipeline, &f));
                EXPECT_EQ(expected, download<std::uint16_t>(codes));
            }
        }
    } while (std::next_permutation(order.begin(), order.end()));
}

TEST_F(Pipeline, ReleasedWhileAFrameIsStillWaiting) {
    const auto expected = render(make_pipeline(context), 6);
    cl_int code = CL_SUCCESS;
    const auto gate = clspeckle::Event::adopt(clCreateUserEvent(context.info().cl_context_handle, &code));
    ASSERT_EQ(CL_SUCCESS, code);
    clspeckle::Event done;
    {
        const clspeckle::Context own;
        make_pipeline(own).enqueue_frame(queue, frame(6), {gate}, &done);
    } // pipeline, stages and context are released before the frame has begun
    clSetUserEventStatus(gate, CL_COMPLETE);
    done.wait();
    EXPECT_EQ(expected, download<std::uint16_t>(codes));
}

TEST_F(Pipeline, RetainAndRelease) {
    const ClspFrame f = frame();
    check_references("clspPipelineEnqueueFrame",
                     [&](ClspPipeline pipeline) { return enqueue(clspPipelineEnqueueFrame, pipeline, &f); });
}

// One live handle of each kind, given to the functions of all other kinds.
TEST_F(Pipeline, HandlesOfAnotherKindAreRefused) {
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    const std::vector<float> texels(4, 1.0f);
    phase_desc.width = phase_desc.height = aperture_desc.width = aperture_desc.height = 8;
    sensor_desc.width = sensor_desc.height = 8;
    pattern_desc.width = pattern_desc.height = 2;
    pattern_desc.texels = texels.data();
    std::vector<clspeckle::Context> own_contexts;
    std::vector<clspeckle::Phase> phases;
    std::vector<clspeckle::Aperture> apertures;
    std::vector<clspeckle::Sensor> sensors;
    std::vector<clspeckle::Pattern> patterns;
    std::vector<clspeckle::Pipeline> pipelines;
    std::vector<std::pair<int, void *>> all; // kind and handle
    for (int i = 0; i < 4; ++i) {
        own_contexts.emplace_back();
        phases.emplace_back(context, phase_desc);
        apertures.emplace_back(context, aperture_desc);
        sensors.emplace_back(context, sensor_desc);
        patterns.emplace_back(context, pattern_desc);
        pipelines.emplace_back(context, phases.back(), apertures.back());
        all.insert(all.end(), {{0, own_contexts.back().get()},
                               {1, phases.back().get()},
                               {2, apertures.back().get()},
                               {3, sensors.back().get()},
                               {4, patterns.back().get()},
                               {5, pipelines.back().get()}});
    }
    for (const auto &[kind, handle] : all) {
        const auto refused = [kind = kind](int other, ClspStatus status) {
            if (other == kind)
                EXPECT_EQ(CLSP_SUCCESS, status) << "kind " << kind;
            else
                EXPECT_EQ(CLSP_ERROR_INVALID_HANDLE, status) << "kind " << kind << " passes as kind " << other;
        };
        auto info = clspeckle::make<ClspContextInfo>();
        auto aperture_info = clspeckle::make<ClspApertureInfo>();
        std::uint64_t size = 0;
        const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
        refused(0, clspContextGetInfo(static_cast<ClspContext>(handle), &info));
        refused(1, clspPhaseGetStateSize(static_cast<ClspPhase>(handle), &size));
        refused(2, clspApertureGetInfo(static_cast<ClspAperture>(handle), &aperture_info));
        refused(3, clspSensorSetExposureGain(static_cast<ClspSensor>(handle), 1.0));
        refused(4, clspPatternSetPose(static_cast<ClspPattern>(handle), identity));
        refused(5, clspPipelineCheck(static_cast<ClspPipeline>(handle), queue));
    }
}

TEST_F(Pipeline, CreateRefusesBadArguments) {
    using D = ClspPipelineDesc;
    const auto refuses = check_create(valid());
    refuses("phase", &D::phase, {nullptr});
    refuses("aperture", &D::aperture, {nullptr});
    refuses("reserved", &D::reserved, {1});
    refuses("reserved_exposure", &D::reserved_exposure, {1});
    refuses("CLSP_EXPOSURE_CORRELATION_FIELD (0) or CLSP_EXPOSURE_CORRELATION_GAUSSIAN (1)", &D::exposure_correlation,
            {2});
    ClspSensor released = clspeckle::Sensor(context, sensor_desc()).get(); // the temporary is gone after this line
    refuses("sensor", &D::sensor, {released}, CLSP_ERROR_INVALID_HANDLE);
    refuses("pattern", &D::pattern, {reinterpret_cast<ClspPattern>(sensor_.get())}, CLSP_ERROR_INVALID_HANDLE);

    auto other_phase = phase_desc();
    other_phase.width += 1;
    const clspeckle::Phase wide(context, other_phase);
    refuses("phase", &D::phase, {wide.get()});
    other_phase = phase_desc();
    other_phase.polarization_count = 1;
    const clspeckle::Phase single(context, other_phase);
    refuses("polarization", &D::phase, {single.get()});
    auto other_sensor = sensor_desc();
    other_sensor.height -= 1;
    const clspeckle::Sensor low(context, other_sensor);
    refuses("sensor", &D::sensor, {low.get()});

    const test::HostContext host;
    const auto foreign = clspeckle::Context::from_host(host.context, host.device);
    const clspeckle::Phase foreign_phase(foreign, phase_desc());
    const clspeckle::Aperture foreign_aperture(foreign, aperture_desc());
    const clspeckle::Sensor foreign_sensor(foreign, sensor_desc());
    const auto foreign_pattern = make_pattern(foreign);
    refuses("phase", &D::phase, {foreign_phase.get()}, CLSP_ERROR_WRONG_CONTEXT);
    refuses("aperture", &D::aperture, {foreign_aperture.get()}, CLSP_ERROR_WRONG_CONTEXT);
    refuses("sensor", &D::sensor, {foreign_sensor.get()}, CLSP_ERROR_WRONG_CONTEXT);
    refuses("pattern", &D::pattern, {foreign_pattern.get()}, CLSP_ERROR_WRONG_CONTEXT);
}

TEST_F(Pipeline, FramesRefuseBadArguments) {
    using F = ClspFrame;
    const auto pipeline = make_pipeline(context);
    const auto bare = make_pipeline(context, false);
    const auto mask = upload(std::vector<std::uint8_t>(width * height, 1), width, height, CLSP_FORMAT_UINT8);
    F valid = frame();
    valid.refresh_mask = mask.view;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pipeline", enqueue(clspPipelineEnqueueFrame, nullptr, &valid));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "frame", enqueue(clspPipelineEnqueueFrame, pipeline, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pipeline", clspPipelineWarmUp(nullptr, queue, &valid));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspPipelineWarmUp(pipeline, nullptr, &valid));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "frame", clspPipelineWarmUp(pipeline, queue, nullptr));
    {
        const test::Foreign foreign;
        EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "queue", clspPipelineWarmUp(pipeline, foreign.queue, &valid));
    }
    const auto enqueues = [&](const clspeckle::Pipeline &which) {
        return test::Refusals<F>("clspPipelineEnqueueFrame", valid,
                                 [&](F *f) { return enqueue(clspPipelineEnqueueFrame, which, f); });
    };
    const auto warms_up = [&](const clspeckle::Pipeline &which) {
        return test::Refusals<F>("clspPipelineWarmUp", valid,
                                 [&](F *f) { return clspPipelineWarmUp(which, queue, f); });
    };
    enqueues(pipeline).check_struct_size();
    warms_up(pipeline).check_struct_size();
    const auto fails = [&](const clspeckle::Pipeline &which, ClspStatus expected, const char *word, auto change) {
        enqueues(which)(word, change, expected);
        warms_up(which)(word, change, expected);
    };
    const auto argument = CLSP_ERROR_INVALID_ARGUMENT;
    fails(pipeline, argument, "refresh is 2, expected CLSP_REFRESH_MASK (0) or CLSP_REFRESH_ALL (1)",
          [](F &f) { f.refresh = 2; });
    fails(pipeline, argument, "CLSP_ILLUMINATION_INCOHERENT (1) or CLSP_ILLUMINATION_DARK (2)",
          [](F &f) { f.illumination = 3; });
    fails(pipeline, argument, "frame_index", [](F &f) { f.frame_index = std::uint64_t{1} << 48; });
    fails(pipeline, CLSP_ERROR_INVALID_FORMAT, "output", [](F &f) { f.output.format = CLSP_FORMAT_UINT8; });
    fails(bare, CLSP_ERROR_INVALID_FORMAT, "output", [](F &) {}); // codes without a sensor
    fails(pipeline, CLSP_ERROR_OVERLAP, "irradiance",
          [&](F &f) { f.output = ideal.view, f.output.format = CLSP_FORMAT_FLOAT32; });
    fails(pipeline, CLSP_ERROR_OVERLAP, "refresh_mask",
          [&](F &f) { f.refresh_mask = codes.view, f.refresh_mask.format = CLSP_FORMAT_UINT8; });
    const auto depth = floats(std::vector<float>(width * height, 1.0f), width, height);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.view;
    geometry.fx_px = geometry.fy_px = 25;
    fails(pipeline, argument, "geometry", [&](F &f) { f.geometry = &geometry; });
    const clspeckle::Pipeline scene(context, make_pattern(context), phase_, aperture_, sensor_);
    fails(scene, argument, "geometry", [](F &f) { f.irradiance = {}; });
    fails(scene, argument, "irradiance", [&](F &f) { f.geometry = &geometry; });
    fails(scene, CLSP_ERROR_OVERLAP, "geometry",
          [&](F &f) { f.irradiance = {}, f.geometry = &geometry, f.output = depth.view; });

    enqueues(pipeline).check_image(context, "refresh_mask", &F::refresh_mask, CLSP_FORMAT_UINT16);
    enqueues(pipeline).check_image(context, "irradiance", &F::irradiance, CLSP_FORMAT_UINT16, false);
    enqueues(pipeline).check_image(context, "output", &F::output, CLSP_FORMAT_UINT32, false);
    check_enqueue(CLSP_NAMED(clspPipelineEnqueueFrame), pipeline, &valid);
}

TEST_F(Pipeline, ARefusedFrameChangesNothing) {
    const auto expected = render(make_pipeline(context), 5);
    // Without its workspace the aperture refuses late, after the phase's turn.
    auto lazy_aperture = aperture_desc();
    lazy_aperture.workspace_from_host = 1;
    const clspeckle::Aperture aperture(context, lazy_aperture);
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase_desc()), aperture,
                                       clspeckle::Sensor(context, sensor_desc()));
    ClspFrame f = frame(1);
    std::uint32_t count = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "workspace", enqueue(clspPipelineEnqueueFrame, pipeline, &f));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "no frame", clspPipelineGetTimings(pipeline, 0, nullptr, &count));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "workspace", clspPipelineWarmUp(pipeline, queue, &f));
    const clspeckle::Buffer workspace(context, aperture.info().workspace_bytes);
    aperture.set_workspace(workspace, 0, workspace.size_bytes());
    EXPECT_EQ(expected, render(pipeline, 5)) << "the refused frame drew the phases";

    // A geometry that only the pattern can refuse.
    const clspeckle::Pipeline scene(context, make_pattern(context), clspeckle::Phase(context, phase_desc()),
                                    clspeckle::Aperture(context, aperture_desc()),
                                    clspeckle::Sensor(context, sensor_desc()));
    auto depth = floats(std::vector<float>(width * height, 1.0f), width, height);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.view; // and no focal length
    f.irradiance = ClspImage{};
    f.geometry = &geometry;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "fx_px", enqueue(clspPipelineEnqueueFrame, scene, &f));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "no frame", clspPipelineGetTimings(scene, 0, nullptr, &count));
}

} // namespace
