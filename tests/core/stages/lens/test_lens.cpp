// The lens through the C API: defaults, bad arguments, memory layouts, configuration. What it computes is compared in
// test_lens_reference.py.
#include "test_support.hpp"

namespace {

using test::DeviceTest;

class Lens : public DeviceTest {
  protected:
    static constexpr std::uint32_t width = 26, height = 18;

    static ClspLensDesc valid() {
        auto desc = clspeckle::make<ClspLensDesc>();
        desc.width = width;
        desc.height = height;
        desc.k1 = 0.05;
        desc.vignetting_corner_loss = 0.25;
        desc.glare_fraction = 0.1;
        desc.glare_scale_px = 2.0;
        desc.ambient = 0.5;
        return desc;
    }
    static std::vector<float> scene() { return test::dots(width, height); }
    std::vector<float> distorted(const clspeckle::Lens &lens, const Image &ideal,
                                 std::uint32_t interpolation = CLSP_INTERPOLATION_CUBIC) {
        auto image = make_image(ideal.view.width, ideal.view.height, CLSP_FORMAT_FLOAT32);
        lens.enqueue_distort(queue, interpolation, ideal.view, image.view);
        return download<float>(image);
    }
    std::vector<float> finished(const clspeckle::Lens &lens, const Image &light, bool is_dark = false) {
        auto image = make_image(light.view.width, light.view.height, CLSP_FORMAT_FLOAT32);
        lens.enqueue_finish(queue, light.view, is_dark, image.view);
        return download<float>(image);
    }
};

TEST_F(Lens, DescInit) {
    test::check_init<ClspLensDesc>("clspLensDescInit", clspLensDescInit);
    ClspLensDesc desc;
    ASSERT_CLSP_OK(clspLensDescInit(&desc, sizeof(desc)));
    EXPECT_EQ(CLSP_LENS_RADIUS_CORNER, desc.radius_unit);
    EXPECT_EQ(0u, desc.cos4_falloff);
    EXPECT_EQ(0u, desc.principal_point_given);
    EXPECT_EQ(0.0, desc.principal_point_x_px);
    EXPECT_EQ(0.0, desc.principal_point_y_px);
    EXPECT_EQ(0.0, desc.focal_length_x_px);
    EXPECT_EQ(0.0, desc.focal_length_y_px);
    for (const double value :
         {desc.k1, desc.k2, desc.k3, desc.p1, desc.p2, desc.vignetting_corner_loss, desc.glare_fraction, desc.ambient})
        EXPECT_EQ(0.0, value);
    EXPECT_EQ(6.0, desc.glare_scale_px);
}

TEST_F(Lens, DefaultsChangeNothingAndCopy) {
    auto desc = clspeckle::make<ClspLensDesc>();
    desc.width = width;
    desc.height = height;
    const clspeckle::Lens lens(context, desc);
    const auto image = floats(scene(), width, height);
    for (const std::uint32_t how : {CLSP_INTERPOLATION_NEAREST, CLSP_INTERPOLATION_LINEAR, CLSP_INTERPOLATION_CUBIC})
        EXPECT_EQ(scene(), distorted(lens, image, how));
    EXPECT_EQ(scene(), finished(lens, image));
    // In place there is nothing to do; the event is complete all the same.
    cl_event event = nullptr;
    ASSERT_CLSP_OK(clspLensEnqueueFinish(lens, queue, &image.view, 0, &image.view, 0, nullptr, &event));
    ASSERT_NE(nullptr, event);
    EXPECT_CLSP_OK(clspEventWait(1, &event));
    EXPECT_CLSP_OK(clspEventRelease(event));
}

TEST_F(Lens, CreateRefusesBadArguments) {
    ClspLensDesc desc = valid();
    desc.glare_fraction = 0; // no transform to prepare
    ClspLens lens = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspLensCreate(nullptr, &desc, &lens));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspLensCreate(context, nullptr, &lens));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "lens", clspLensCreate(context, &desc, nullptr));
    test::check_struct_size<ClspLensDesc>("clspLensCreate", desc, [&](ClspLensDesc *d) {
        ClspLens made = nullptr;
        const ClspStatus status = clspLensCreate(context, d, &made);
        clspLensRelease(made);
        return status;
    });
    const auto fails = [&](const char *word, const std::function<void(ClspLensDesc &)> &change) {
        ClspLensDesc changed = desc;
        change(changed);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, word, clspLensCreate(context, &changed, &lens));
        EXPECT_EQ(nullptr, lens);
    };
    for (std::uint32_t side : {0u, 16385u, 0xffffffffu}) {
        fails("width|image", [&](ClspLensDesc &d) { d.width = side; });
        fails("height|image", [&](ClspLensDesc &d) { d.height = side; });
    }
    fails("radius_unit is 2, expected CLSP_LENS_RADIUS_CORNER (0) or CLSP_LENS_RADIUS_FOCAL_LENGTH (1)",
          [](ClspLensDesc &d) { d.radius_unit = 2; });
    fails("focal_length_x_px", [](ClspLensDesc &d) { d.radius_unit = CLSP_LENS_RADIUS_FOCAL_LENGTH; });
    fails("focal_length_y_px", [](ClspLensDesc &d) {
        d.cos4_falloff = 1;
        d.focal_length_x_px = 100;
    });
    fails("cos4_falloff", [](ClspLensDesc &d) { d.cos4_falloff = 2; });
    fails("principal_point_given", [](ClspLensDesc &d) { d.principal_point_given = 2; });
    fails("principal_point_given", [](ClspLensDesc &d) { d.principal_point_y_px = 3; });
    struct Member {
        const char *name;
        double ClspLensDesc::*member;
        std::vector<double> bad;
    };
    const std::vector<double> not_numbers = {test::nan_value, test::infinity, -test::infinity, 1e300};
    const std::vector<Member> members = {
        {"principal_point_x_px", &ClspLensDesc::principal_point_x_px, {}},
        {"principal_point_y_px", &ClspLensDesc::principal_point_y_px, {}},
        {"focal_length_x_px", &ClspLensDesc::focal_length_x_px, {-1}},
        {"focal_length_y_px", &ClspLensDesc::focal_length_y_px, {-1}},
        {"k1", &ClspLensDesc::k1, {}},
        {"k2", &ClspLensDesc::k2, {}},
        {"k3", &ClspLensDesc::k3, {}},
        {"p1", &ClspLensDesc::p1, {}},
        {"p2", &ClspLensDesc::p2, {}},
        {"vignetting_corner_loss", &ClspLensDesc::vignetting_corner_loss, {-0.01, 1.01}},
        {"glare_fraction", &ClspLensDesc::glare_fraction, {-0.01, 1.01}},
        {"glare_scale_px", &ClspLensDesc::glare_scale_px, {-1, 0, 16385}},
        {"ambient", &ClspLensDesc::ambient, {-0.01}},
    };
    for (const Member &m : members) {
        std::vector<double> bad = m.bad;
        bad.insert(bad.end(), not_numbers.begin(), not_numbers.end());
        for (const double value : bad)
            fails(m.name, [&](ClspLensDesc &d) {
                d.principal_point_given = 1;
                d.*m.member = value;
            });
    }
    fails("folds over", [](ClspLensDesc &d) { d.k1 = -0.4; });
    fails("folds over", [](ClspLensDesc &d) { d.k3 = -1.0; });
    fails("folds over", [](ClspLensDesc &d) { d.p2 = 1.0; });
    fails("folds over", [](ClspLensDesc &d) { d.k1 = -1e6; });
}

TEST_F(Lens, ReferencesAreCounted) {
    ClspLens lens = nullptr;
    const ClspLensDesc desc = valid();
    ASSERT_CLSP_OK(clspLensCreate(context, &desc, &lens));
    EXPECT_CLSP_OK(clspLensRetain(lens));
    EXPECT_CLSP_OK(clspLensRelease(lens));
    const double point[2] = {1, 2};
    double moved[2];
    EXPECT_CLSP_OK(clspLensDistortPoints(lens, point, 1, moved));
    EXPECT_CLSP_OK(clspLensRelease(lens));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens", clspLensDistortPoints(lens, point, 1, moved));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens", clspLensRelease(lens));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens", clspLensRetain(nullptr));
    EXPECT_CLSP_OK(clspLensRelease(nullptr));
}

TEST_F(Lens, DistortRefusesBadImages) {
    const clspeckle::Lens lens(context, valid());
    const auto ideal = floats(scene(), width, height);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto run = [&](const ClspImage *from, const ClspImage *to, std::uint32_t how = CLSP_INTERPOLATION_LINEAR) {
        return clspLensEnqueueDistort(lens, queue, how, from, to, 0, nullptr, nullptr);
    };
    test::check_enqueue_rules("clspLensEnqueueDistort", context,
                              [&](cl_command_queue q, cl_uint count, const cl_event *events, cl_event *event) {
                                  return clspLensEnqueueDistort(lens, q, CLSP_INTERPOLATION_CUBIC, &ideal.view,
                                                                &out.view, count, events, event);
                              });
    test::check_image_rules("clspLensEnqueueDistort", context, ideal.view, "ideal", 99u,
                            [&](const ClspImage *image) { return run(image, &out.view); });
    test::check_image_rules("clspLensEnqueueDistort", context, out.view, "distorted", CLSP_FORMAT_UINT8,
                            [&](const ClspImage *image) { return run(&ideal.view, image); });
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens",
                      clspLensEnqueueDistort(nullptr, queue, 0, &ideal.view, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT,
                      "CLSP_INTERPOLATION_NEAREST (0), CLSP_INTERPOLATION_LINEAR (1) or CLSP_INTERPOLATION_CUBIC (2)",
                      clspLensEnqueueDistort(lens, queue, 3, &ideal.view, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "ideal",
                      clspLensEnqueueDistort(lens, queue, 0, &ideal.view, &ideal.view, 0, nullptr, nullptr));
    const auto bytes = make_image(width, height, CLSP_FORMAT_UINT8),
               bytes_out = make_image(width, height, CLSP_FORMAT_UINT8);
    for (const std::uint32_t how : {CLSP_INTERPOLATION_LINEAR, CLSP_INTERPOLATION_CUBIC})
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "nearest",
                          clspLensEnqueueDistort(lens, queue, how, &bytes.view, &bytes_out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_OK(run(&bytes.view, &bytes_out.view, CLSP_INTERPOLATION_NEAREST));
    cl_int code = CL_SUCCESS;
    const cl_mem constant =
        clCreateBuffer(context.info().cl_context_handle, CL_MEM_READ_ONLY, 4u * width * height, nullptr, &code);
    ASSERT_EQ(CL_SUCCESS, code);
    const ClspImage read_only = clspeckle::image(constant, width, height, CLSP_FORMAT_FLOAT32);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CL_MEM_READ_ONLY",
                      clspLensEnqueueDistort(lens, queue, 0, &ideal.view, &read_only, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CL_MEM_READ_ONLY",
                      clspLensEnqueueFinish(lens, queue, &ideal.view, 0, &read_only, 0, nullptr, nullptr));
    clReleaseMemObject(constant);
}

TEST_F(Lens, FinishRefusesBadImages) {
    const clspeckle::Lens lens(context, valid());
    const auto light = floats(scene(), width, height);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    test::check_enqueue_rules("clspLensEnqueueFinish", context,
                              [&](cl_command_queue q, cl_uint count, const cl_event *events, cl_event *event) {
                                  return clspLensEnqueueFinish(lens, q, &light.view, 0, &out.view, count, events,
                                                               event);
                              });
    test::check_image_rules("clspLensEnqueueFinish", context, light.view, "light", CLSP_FORMAT_UINT16,
                            [&](const ClspImage *image) {
                                return clspLensEnqueueFinish(lens, queue, image, 0, &out.view, 0, nullptr, nullptr);
                            });
    test::check_image_rules("clspLensEnqueueFinish", context, out.view, "output", CLSP_FORMAT_UINT16,
                            [&](const ClspImage *image) {
                                return clspLensEnqueueFinish(lens, queue, &light.view, 0, image, 0, nullptr, nullptr);
                            });
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens",
                      clspLensEnqueueFinish(nullptr, queue, &light.view, 0, &out.view, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "is_dark",
                      clspLensEnqueueFinish(lens, queue, &light.view, 2, &out.view, 0, nullptr, nullptr));
    // Half a row further on: neither the same pixels nor apart.
    const auto large = make_image(width, height + 1, CLSP_FORMAT_FLOAT32);
    const ClspImage first = large.buffer.image(width, height, CLSP_FORMAT_FLOAT32),
                    second = large.buffer.image(width, height, CLSP_FORMAT_FLOAT32, 0, 2 * width);
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "light",
                      clspLensEnqueueFinish(lens, queue, &first, 0, &second, 0, nullptr, nullptr));
}

TEST_F(Lens, OffsetPitchAndInPlaceGiveTheSameBytes) {
    const clspeckle::Lens lens(context, valid());
    const auto plain = floats(scene(), width, height);
    const auto warped = distorted(lens, plain), light = finished(lens, plain);
    auto in = upload(scene(), width, height, CLSP_FORMAT_FLOAT32, 256, 36);
    auto out = make_image(width, height, CLSP_FORMAT_FLOAT32, 128, 4096);
    lens.enqueue_distort(queue, CLSP_INTERPOLATION_CUBIC, in.view, out.view);
    EXPECT_EQ(warped, download<float>(out));
    EXPECT_TRUE(margins_untouched(out));
    lens.enqueue_finish(queue, in.view, false, out.view);
    EXPECT_EQ(light, download<float>(out));
    EXPECT_TRUE(margins_untouched(out));
    EXPECT_EQ(scene(), download<float>(in)) << "the input was changed";
    lens.enqueue_finish(queue, in.view, false, in.view);
    EXPECT_EQ(light, download<float>(in)) << "in place";
    EXPECT_TRUE(margins_untouched(in));
}

TEST_F(Lens, ConfigureReplacesAllOrNothing) {
    const clspeckle::Lens lens(context, valid());
    const auto image = floats(scene(), width, height);
    const auto warped = distorted(lens, image), light = finished(lens, image);
    auto desc = valid();
    desc.k1 = -0.5;
    desc.ambient = 3;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "folds over", clspLensConfigure(lens, &desc));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspLensConfigure(lens, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens", clspLensConfigure(nullptr, &desc));
    EXPECT_EQ(warped, distorted(lens, image));
    EXPECT_EQ(light, finished(lens, image));
    // From warping to not warping and back: kernels without a map and with one.
    desc = valid();
    desc.k1 = 0;
    lens.configure(desc);
    EXPECT_EQ(scene(), distorted(lens, image));
    lens.configure(valid());
    EXPECT_EQ(warped, distorted(lens, image));
    // Another size.
    desc = valid();
    desc.width = 9;
    lens.configure(desc);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "light is",
                      clspLensEnqueueFinish(lens, queue, &image.view, 0, &image.view, 0, nullptr, nullptr));
}

TEST_F(Lens, FramesAllocateNothing) {
    const clspeckle::Lens lens(context, valid());
    const auto image = floats(scene(), width, height);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto frame = [&] {
        lens.enqueue_distort(queue, CLSP_INTERPOLATION_CUBIC, image.view, out.view);
        lens.enqueue_finish(queue, out.view, false, out.view);
        queue.finish();
    };
    frame();
    const ClspContextInfo before = context.info();
    for (int i = 0; i < 20; ++i)
        frame();
    const ClspContextInfo after = context.info();
    EXPECT_EQ(before.allocation_count, after.allocation_count);
    EXPECT_EQ(before.allocated_bytes, after.allocated_bytes);
    EXPECT_EQ(before.programs_built, after.programs_built);
}

TEST_F(Lens, EffectsThatAreOffTakeNoMemory) {
    auto desc = clspeckle::make<ClspLensDesc>();
    desc.width = width;
    desc.height = height;
    const std::uint64_t before = context.info().allocated_bytes;
    desc.ambient = 1;
    desc.vignetting_corner_loss = 0.2;
    const clspeckle::Lens light_only(context, desc);
    EXPECT_EQ(before, context.info().allocated_bytes);
    desc.k1 = 0.01;
    const clspeckle::Lens distorting(context, desc);
    EXPECT_EQ(before + 8u * width * height, context.info().allocated_bytes);
}

TEST_F(Lens, Points) {
    const clspeckle::Lens lens(context, valid());
    const std::vector<double> points = {0, 0, 12.5, 8.5, 25, 17, -3, 40};
    const auto there = lens.distort_points(points), back = lens.undistort_points(there);
    ASSERT_EQ(points.size(), there.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        EXPECT_NEAR(points[i], back[i], 1e-9);
    // The corner lies at r = 1.
    EXPECT_NEAR(12.5 - 12.5 * 1.05, there[0], 1e-12);
    EXPECT_EQ(12.5, there[2]);
    // In place.
    std::vector<double> same = points;
    ASSERT_CLSP_OK(clspLensDistortPoints(lens, same.data(), 4, same.data()));
    EXPECT_EQ(there, same);
    ASSERT_CLSP_OK(clspLensUndistortPoints(lens, same.data(), 4, same.data()));
    EXPECT_EQ(back, same);
    EXPECT_CLSP_OK(clspLensDistortPoints(lens, nullptr, 0, nullptr));
    EXPECT_CLSP_OK(clspLensUndistortPoints(lens, nullptr, 0, nullptr));
    double out[2] = {7, 7};
    const double bad[4] = {1, 2, test::nan_value, 0};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "point 1", clspLensDistortPoints(lens, bad, 2, out));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "point 1", clspLensUndistortPoints(lens, bad, 2, out));
    EXPECT_EQ(7, out[0]) << "written before the check was over";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "ideal_px", clspLensDistortPoints(lens, nullptr, 1, out));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "distorted_px", clspLensDistortPoints(lens, bad, 1, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "distorted_px", clspLensUndistortPoints(lens, nullptr, 1, out));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "ideal_px", clspLensUndistortPoints(lens, bad, 1, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspLensDistortPoints(lens, bad, ~std::uint64_t{0}, out));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens", clspLensUndistortPoints(nullptr, bad, 1, out));
}

TEST_F(Lens, OnePixelAndThinImages) {
    for (const auto &[w, h] : {std::pair<std::uint32_t, std::uint32_t>{1, 1}, {1, 40}, {40, 1}}) {
        auto desc = valid();
        desc.width = w;
        desc.height = h;
        const clspeckle::Lens lens(context, desc);
        const auto image = floats(std::vector<float>(std::size_t{w} * h, 2.0f), w, h);
        for (const float value : distorted(lens, image))
            EXPECT_NEAR(2.0f, value, 1e-6f);
        const auto light = finished(lens, image);
        EXPECT_NEAR(w * h == 1 ? 2.5f : 2.5f * 0.75f, light.front(), 1e-5f);
    }
}

} // namespace
