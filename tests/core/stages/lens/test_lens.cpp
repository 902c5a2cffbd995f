// The lens through the C API: defaults, bad arguments, memory layouts, configuration. What it computes is compared in
// test_lens_reference.py.
#include "stage_support.hpp"

namespace {

class Lens : public test::StageTest<ClspLens> {
  protected:
    static constexpr std::uint32_t width = 26, height = 18;

    ClspLensDesc valid() const override {
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
        return written(ideal.view.width, ideal.view.height, CLSP_FORMAT_FLOAT32,
                       [&](const ClspImage &image) { lens.enqueue_distort(queue, interpolation, ideal.view, image); });
    }
    std::vector<float> finished(const clspeckle::Lens &lens, const Image &light, bool is_dark = false) {
        return written(light.view.width, light.view.height, CLSP_FORMAT_FLOAT32,
                       [&](const ClspImage &image) { lens.enqueue_finish(queue, light.view, is_dark, image); });
    }
};

TEST_F(Lens, DescInit) {
    const ClspLensDesc desc = checked_defaults();
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
    using D = ClspLensDesc;
    D desc = valid();
    desc.glare_fraction = 0; // no transform to prepare
    desc.principal_point_given = 1;
    const auto refuses = check_create(desc);
    refuses("width|image", &D::width, test::bad_sides);
    refuses("height|image", &D::height, test::bad_sides);
    refuses("radius_unit is 2, expected CLSP_LENS_RADIUS_CORNER (0) or CLSP_LENS_RADIUS_FOCAL_LENGTH (1)",
            &D::radius_unit, {2});
    refuses("focal_length_x_px", &D::radius_unit, {CLSP_LENS_RADIUS_FOCAL_LENGTH});
    refuses("focal_length_y_px", [](D &d) { d.cos4_falloff = 1, d.focal_length_x_px = 100; });
    refuses("cos4_falloff", &D::cos4_falloff, {2});
    refuses("principal_point_given", &D::principal_point_given, {2});
    refuses("principal_point_given", [](D &d) { d.principal_point_given = 0, d.principal_point_y_px = 3; });
    refuses("principal_point_x_px", &D::principal_point_x_px, test::bad({1e300}));
    refuses("principal_point_y_px", &D::principal_point_y_px, test::bad({1e300}));
    refuses("focal_length_x_px", &D::focal_length_x_px, test::bad({-1, 1e300}));
    refuses("focal_length_y_px", &D::focal_length_y_px, test::bad({-1, 1e300}));
    refuses("k1", &D::k1, test::bad({1e300}));
    refuses("k2", &D::k2, test::bad({1e300}));
    refuses("k3", &D::k3, test::bad({1e300}));
    refuses("p1", &D::p1, test::bad({1e300}));
    refuses("p2", &D::p2, test::bad({1e300}));
    refuses("vignetting_corner_loss", &D::vignetting_corner_loss, test::bad({-0.01, 1.01, 1e300}));
    refuses("glare_fraction", &D::glare_fraction, test::bad({-0.01, 1.01, 1e300}));
    refuses("glare_scale_px", &D::glare_scale_px, test::bad({-1, 0, 16385, 1e300}));
    refuses("ambient", &D::ambient, test::bad({-0.01, 1e300}));
    refuses("folds over", &D::k1, {-0.4, -1e6});
    refuses("folds over", &D::k3, {-1.0});
    refuses("folds over", &D::p2, {1.0});
}

TEST_F(Lens, ReferencesAreCounted) {
    const double point[2] = {1, 2};
    double moved[2];
    check_references("clspLensDistortPoints",
                     [&](ClspLens lens) { return clspLensDistortPoints(lens, point, 1, moved); });
}

TEST_F(Lens, DistortRefusesBadImages) {
    const clspeckle::Lens lens(context, valid());
    const auto ideal = floats(scene(), width, height);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto run = [&](ClspLens l, const ClspImage *from, const ClspImage *to,
                         std::uint32_t how = CLSP_INTERPOLATION_LINEAR) {
        return enqueue(clspLensEnqueueDistort, l, how, from, to);
    };
    check_enqueue(CLSP_NAMED(clspLensEnqueueDistort), lens, CLSP_INTERPOLATION_CUBIC, &ideal.view, &out.view);
    test::check_image_rules("clspLensEnqueueDistort", context, ideal.view, "ideal", 99u,
                            [&](const ClspImage *image) { return run(lens, image, &out.view); });
    test::check_image_rules("clspLensEnqueueDistort", context, out.view, "distorted", CLSP_FORMAT_UINT8,
                            [&](const ClspImage *image) { return run(lens, &ideal.view, image); });
    const test::Failures fails("clspLensEnqueueDistort");
    fails(CLSP_ERROR_INVALID_HANDLE, "lens", run(nullptr, &ideal.view, &out.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT,
          "CLSP_INTERPOLATION_NEAREST (0), CLSP_INTERPOLATION_LINEAR (1) or CLSP_INTERPOLATION_CUBIC (2)",
          run(lens, &ideal.view, &out.view, 3));
    fails(CLSP_ERROR_OVERLAP, "ideal", run(lens, &ideal.view, &ideal.view));
    const auto bytes = make_image(width, height, CLSP_FORMAT_UINT8),
               bytes_out = make_image(width, height, CLSP_FORMAT_UINT8);
    for (const std::uint32_t how : {CLSP_INTERPOLATION_LINEAR, CLSP_INTERPOLATION_CUBIC})
        fails(CLSP_ERROR_INVALID_ARGUMENT, "nearest", run(lens, &bytes.view, &bytes_out.view, how));
    EXPECT_CLSP_OK(run(lens, &bytes.view, &bytes_out.view, CLSP_INTERPOLATION_NEAREST));
    cl_int code = CL_SUCCESS;
    const cl_mem constant =
        clCreateBuffer(context.info().cl_context_handle, CL_MEM_READ_ONLY, 4u * width * height, nullptr, &code);
    ASSERT_EQ(CL_SUCCESS, code);
    const ClspImage read_only = clspeckle::image(constant, width, height, CLSP_FORMAT_FLOAT32);
    fails(CLSP_ERROR_INVALID_ARGUMENT, "CL_MEM_READ_ONLY", run(lens, &ideal.view, &read_only));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CL_MEM_READ_ONLY",
                      enqueue(clspLensEnqueueFinish, lens, &ideal.view, 0, &read_only));
    clReleaseMemObject(constant);
}

TEST_F(Lens, FinishRefusesBadImages) {
    const clspeckle::Lens lens(context, valid());
    const auto light = floats(scene(), width, height);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    const auto run = [&](const ClspImage *from, const ClspImage *to) {
        return enqueue(clspLensEnqueueFinish, lens, from, 0, to);
    };
    check_enqueue(CLSP_NAMED(clspLensEnqueueFinish), lens, &light.view, 0, &out.view);
    check_image("clspLensEnqueueFinish", "light", light.view, CLSP_FORMAT_UINT16,
                [&](const ClspImage *image) { return run(image, &out.view); });
    check_image("clspLensEnqueueFinish", "output", out.view, CLSP_FORMAT_UINT16,
                [&](const ClspImage *image) { return run(&light.view, image); });
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "lens",
                      enqueue(clspLensEnqueueFinish, nullptr, &light.view, 0, &out.view));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "is_dark",
                      enqueue(clspLensEnqueueFinish, lens, &light.view, 2, &out.view));
    // Half a row further on: neither the same pixels nor apart.
    const auto large = make_image(width, height + 1, CLSP_FORMAT_FLOAT32);
    const ClspImage first = large.buffer.image(width, height, CLSP_FORMAT_FLOAT32),
                    second = large.buffer.image(width, height, CLSP_FORMAT_FLOAT32, 0, 2 * width);
    EXPECT_CLSP_FAILS(CLSP_ERROR_OVERLAP, "light", enqueue(clspLensEnqueueFinish, lens, &first, 0, &second));
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
                      enqueue(clspLensEnqueueFinish, lens, &image.view, 0, &image.view));
}

TEST_F(Lens, FramesAllocateNothing) {
    const clspeckle::Lens lens(context, valid());
    const auto image = floats(scene(), width, height);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    check_allocates_nothing([&] {
        lens.enqueue_distort(queue, CLSP_INTERPOLATION_CUBIC, image.view, out.view);
        lens.enqueue_finish(queue, out.view, false, out.view);
        queue.finish();
    });
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
