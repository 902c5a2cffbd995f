// Depth from dots through the C interface: what is found and placed, what is said of what is not, and what bad
// arguments get.
#include "stage_support.hpp"

#include <random>

namespace {

// A laser 5 cm to the right of the camera, both looking along z; a wall at 1 m. Dots are placed with no order, so that
// none of their neighbourhoods repeats.
class Depth : public test::StageTest<ClspDepth> {
  protected:
    static constexpr std::uint32_t width = 160, height = 120;
    static constexpr double focal = 150.0, baseline = 0.05, wall = 1.0, sigma = 1.5;

    std::vector<double> directions;

    Depth() {
        std::mt19937 random(5); // the same everywhere, unlike the standard library's distributions
        const auto uniform = [&](double low, double high) {
            return low + (high - low) * double(random()) / 4294967296.0;
        };
        while (directions.size() < 2 * 90) {
            const double u = uniform(-0.5, 0.4), v = uniform(-0.36, 0.36);
            bool apart = true;
            for (std::size_t j = 0; j < directions.size(); j += 2)
                apart = apart && std::hypot(directions[j] - u, directions[j + 1] - v) > 9.0 / focal;
            if (apart)
                directions.insert(directions.end(), {u, v});
        }
    }
    ClspDepthDesc valid() const override {
        auto desc = clspeckle::make<ClspDepthDesc>();
        desc.width = width;
        desc.height = height;
        desc.max_dots = 1000;
        desc.directions = directions.data();
        desc.direction_count = directions.size() / 2;
        desc.laser_from_camera[3] = -baseline;
        desc.fx_px = desc.fy_px = focal;
        desc.cx_px = 79.5;
        desc.cy_px = 59.5;
        desc.near_m = 0.5;
        desc.far_m = 3.0;
        return desc;
    }
    // Where the wall shows a dot.
    std::array<double, 2> centre(std::size_t j, double depth = wall) const {
        return {79.5 + focal * (directions[2 * j] + baseline / depth), 59.5 + focal * directions[2 * j + 1]};
    }
    std::vector<float> frame(double depth = wall, double shift_y = 0.0, double peak = 100.0) const {
        std::vector<float> image(width * height, 20.0f);
        for (std::size_t j = 0; j < directions.size() / 2; ++j)
            for (std::uint32_t y = 0; y < height; ++y)
                for (std::uint32_t x = 0; x < width; ++x) {
                    const double dx = x - centre(j, depth)[0], dy = y - centre(j, depth)[1] - shift_y;
                    if (std::hypot(dx, dy) < 8 * sigma)
                        image[y * width + x] += float(peak * std::exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma)));
                }
        return image;
    }
    bool inside(const std::array<double, 2> &c, double margin) const {
        return c[0] > margin && c[1] > margin && c[0] < width - 1 - margin && c[1] < height - 1 - margin;
    }
    clspeckle::DepthResult measure(const clspeckle::Depth &depth, const std::vector<float> &image) {
        const Image uploaded = floats(image, width, height);
        depth.enqueue_detect(queue, uploaded.view);
        return depth.dots(queue);
    }
};

TEST_F(Depth, InitFunctionWritesDefaults) {
    const ClspDepthDesc desc = checked_defaults();
    EXPECT_EQ(65536u, desc.max_dots);
    EXPECT_EQ(std::uint32_t{CLSP_PROJECTION_TANGENT_PLANE}, desc.projection);
    EXPECT_EQ(0u, desc.direction_count);
    EXPECT_EQ(nullptr, desc.directions);
    EXPECT_EQ(1.0, desc.laser_from_camera[0]);
    EXPECT_EQ(0.2, desc.near_m);
    EXPECT_EQ(10.0, desc.far_m);
    EXPECT_EQ(1.5, desc.dot_sigma_px);
    EXPECT_EQ(5.0, desc.threshold_sigmas);
    EXPECT_EQ(0.6, desc.min_correlation);
    EXPECT_EQ(1.0, desc.epipolar_tolerance_px);
    EXPECT_EQ(0.0, desc.relative_diameter);
    EXPECT_EQ(1.0, desc.speckle_contrast);
    EXPECT_EQ(0.9, desc.min_confidence);
    for (double off :
         {desc.min_amplitude_dn, desc.read_noise_dn, desc.dn_per_electron, desc.black_level_dn, desc.saturation_dn})
        EXPECT_EQ(0.0, off);
}

TEST_F(Depth, WallIsPlaced) {
    const clspeckle::Depth depth(context, valid());
    const auto result = measure(depth, frame());
    std::size_t placed = 0, expected = 0;
    for (std::size_t j = 0; j < directions.size() / 2; ++j)
        expected += inside(centre(j), 5.0);
    ASSERT_GT(expected, 60u);
    for (const ClspDepthDot &dot : result.dots) {
        if (dot.flags & CLSP_DOT_BORDER)
            continue;
        ASSERT_EQ(std::uint32_t{CLSP_DEPTH_REASON_PLACED}, dot.reason) << dot.x_px << ", " << dot.y_px;
        ++placed;
        const auto truth = centre(dot.dot_index);
        EXPECT_NEAR(truth[0], dot.x_px, 1e-3);
        EXPECT_NEAR(truth[1], dot.y_px, 1e-3);
        EXPECT_NEAR(truth[0], dot.centroid_x_px, 5e-3);
        EXPECT_NEAR(wall, dot.depth_m, 1e-3);
        EXPECT_NEAR((truth[0] - 79.5) / focal * wall, dot.position_m[0], 1e-3);
        EXPECT_EQ(dot.depth_m, dot.position_m[2]);
        EXPECT_NEAR(100.0, dot.amplitude_dn, 0.1);
        EXPECT_NEAR(20.0, dot.background_dn, 0.05);
        EXPECT_NEAR(sigma * sigma, dot.shape_px2[0], 5e-3);
        EXPECT_GT(dot.depth_sd_m, 0.0);
        EXPECT_LT(std::abs(dot.epipolar_error_px), 1e-3);
        EXPECT_GE(dot.confidence, 0.9);
    }
    EXPECT_GE(placed, expected);
    EXPECT_EQ(0u, result.summary.warnings);
    EXPECT_EQ(result.dots.size(), result.summary.detected_count);
    EXPECT_NEAR(sigma, result.summary.median_sigma_px, 1e-3);
    const auto pattern = depth.pattern_dots();
    ASSERT_EQ(directions.size() / 2, pattern.size());
    for (std::size_t j = 0; j < pattern.size(); ++j) {
        if (inside(centre(j), 5.0)) {
            ASSERT_EQ(std::uint32_t{CLSP_DEPTH_REASON_PLACED}, pattern[j].reason);
            EXPECT_EQ(j, result.dots.at(pattern[j].detected_index).dot_index);
        } else if (pattern[j].reason != CLSP_DEPTH_REASON_PLACED) {
            EXPECT_EQ(CLSP_NO_DOT, pattern[j].detected_index);
        }
    }
}

// Amplitudes are written in one way only: the same frame gives the same result bit by bit, in any order of the device's
// work.
TEST_F(Depth, RepeatsItself) {
    const clspeckle::Depth depth(context, valid());
    const auto first = measure(depth, frame()), second = measure(depth, frame());
    ASSERT_EQ(first.dots.size(), second.dots.size());
    for (std::size_t i = 0; i < first.dots.size(); ++i)
        EXPECT_EQ(0, std::memcmp(&first.dots[i].x_px, &second.dots[i].x_px, 5 * sizeof(double)));
}

TEST_F(Depth, CodesWithPitchAndOffset) {
    const auto image = frame();
    std::vector<std::uint16_t> codes(image.size());
    for (std::size_t i = 0; i < image.size(); ++i)
        codes[i] = static_cast<std::uint16_t>(std::lround(20.0 * double(image[i])));
    const Image uploaded = upload(codes, width, height, CLSP_FORMAT_UINT16, 2 * width + 6, 10);
    const clspeckle::Depth depth(context, valid());
    depth.enqueue_detect(queue, uploaded.view);
    const auto result = depth.dots(queue);
    EXPECT_TRUE(margins_untouched(uploaded));
    EXPECT_GT(result.summary.placed_count, 60u);
    for (const ClspDepthDot &dot : result.dots)
        if (dot.reason == CLSP_DEPTH_REASON_PLACED && !(dot.flags & CLSP_DOT_BORDER)) {
            EXPECT_NEAR(centre(dot.dot_index)[0], dot.x_px, 5e-3); // rounding to codes
        }
}

TEST_F(Depth, DetectionAlone) {
    auto desc = valid();
    desc.directions = nullptr;
    desc.direction_count = 0;
    desc.fx_px = 0; // no geometry is asked for
    const clspeckle::Depth depth(context, desc);
    const auto result = measure(depth, frame());
    EXPECT_GT(result.dots.size(), 60u);
    EXPECT_EQ(0u, result.summary.placed_count);
    EXPECT_EQ(0u, result.summary.warnings);
    EXPECT_TRUE(depth.pattern_dots().empty());
    EXPECT_EQ(std::uint32_t{CLSP_DEPTH_REASON_NO_CANDIDATE}, result.dots[0].reason);
    EXPECT_EQ(CLSP_NO_DOT, result.dots[0].dot_index);
    EXPECT_TRUE(std::isnan(result.dots[0].depth_m));
}

TEST_F(Depth, FramesWithoutDots) {
    const clspeckle::Depth depth(context, valid());
    for (float level : {0.0f, 1000.0f, -5.0f}) {
        const auto result = measure(depth, std::vector<float>(width * height, level));
        EXPECT_TRUE(result.dots.empty()) << level;
        EXPECT_EQ(std::uint32_t{CLSP_DEPTH_WARNING_NO_DOTS}, result.summary.warnings);
        EXPECT_TRUE(std::isnan(result.summary.median_epipolar_error_px));
        for (const auto &dot : depth.pattern_dots())
            EXPECT_NE(std::uint32_t{CLSP_DEPTH_REASON_PLACED}, dot.reason);
    }
}

TEST_F(Depth, SaturatedDotsKeepTheirCentre) {
    auto image = frame(wall, 0.0, 400.0);
    for (float &value : image)
        value = std::min(value, 255.0f);
    auto desc = valid();
    desc.saturation_dn = 255.0;
    const auto result = measure(clspeckle::Depth(context, desc), image);
    EXPECT_EQ(std::uint32_t{CLSP_DEPTH_WARNING_SATURATED}, result.summary.warnings & CLSP_DEPTH_WARNING_SATURATED);
    std::size_t placed = 0;
    for (const ClspDepthDot &dot : result.dots)
        if (dot.reason == CLSP_DEPTH_REASON_PLACED && !(dot.flags & CLSP_DOT_BORDER)) {
            ++placed;
            EXPECT_TRUE(dot.flags & CLSP_DOT_SATURATED);
            EXPECT_NEAR(centre(dot.dot_index)[0], dot.x_px, 0.01);
        }
    EXPECT_GT(placed, 50u);
}

TEST_F(Depth, WrongGeometryIsNoticed) {
    // 0.8 px beside the lines: within the tolerance, so dots are placed, and the median tells.
    const auto beside = measure(clspeckle::Depth(context, valid()), frame(wall, 0.8));
    EXPECT_TRUE(beside.summary.warnings & CLSP_DEPTH_WARNING_EPIPOLAR);
    EXPECT_NEAR(0.8, beside.summary.median_epipolar_error_px, 0.05);
    // A laser turned by 4 degrees about the camera's axis: lines pass elsewhere.
    auto desc = valid();
    const double angle = 0.07;
    const double turned[12] = {std::cos(angle),
                               -std::sin(angle),
                               0,
                               -baseline * std::cos(angle),
                               std::sin(angle),
                               std::cos(angle),
                               0,
                               -baseline * std::sin(angle),
                               0,
                               0,
                               1,
                               0};
    std::copy(std::begin(turned), std::end(turned), desc.laser_from_camera);
    const auto wrong = measure(clspeckle::Depth(context, desc), frame());
    EXPECT_TRUE(wrong.summary.warnings & CLSP_DEPTH_WARNING_FEW_PLACED);
    std::size_t unplaced = 0;
    for (const ClspDepthDot &dot : wrong.dots)
        if (dot.reason != CLSP_DEPTH_REASON_PLACED) {
            ++unplaced;
            EXPECT_TRUE(std::isnan(dot.depth_m));
        }
    EXPECT_GT(2 * unplaced, wrong.dots.size());
}

TEST_F(Depth, PixelsThatAreNoNumbers) {
    const clspeckle::Depth depth(context, valid());
    for (double bad : {test::nan_value, test::infinity}) {
        auto image = frame();
        image[7 * width + 11] = float(bad);
        image[90 * width + 3] = float(bad);
        const Image uploaded = floats(image, width, height);
        depth.enqueue_detect(queue, uploaded.view);
        std::uint64_t count = 77;
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA,
                          "2 pixels of the frame are NaN or infinite, the first at x = 11, y = 7",
                          clspDepthGetDots(depth, queue, 0, nullptr, &count, nullptr));
        EXPECT_EQ(77u, count);
    }
    EXPECT_GT(measure(depth, frame()).summary.placed_count, 60u) << "the next frame is not touched by it";
}

TEST_F(Depth, TooManyDots) {
    auto desc = valid();
    desc.max_dots = 10;
    const clspeckle::Depth depth(context, desc);
    const Image uploaded = floats(frame(), width, height);
    depth.enqueue_detect(queue, uploaded.view);
    std::uint64_t count = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_UNSUPPORTED, "max_dots", clspDepthGetDots(depth, queue, 0, nullptr, &count, nullptr));
}

TEST_F(Depth, GettingDots) {
    const clspeckle::Depth depth(context, valid());
    std::uint64_t count = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "no frame",
                      clspDepthGetDots(depth, queue, 0, nullptr, &count, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "asked", clspDepthGetPatternDots(depth, 0, nullptr, &count));
    const Image uploaded = floats(frame(), width, height);
    depth.enqueue_detect(queue, uploaded.view);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STATE, "asked", clspDepthGetPatternDots(depth, 0, nullptr, &count));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "dots", clspDepthGetDots(depth, queue, 3, nullptr, &count, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count",
                      clspDepthGetDots(depth, queue, 0, nullptr, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue",
                      clspDepthGetDots(depth, nullptr, 0, nullptr, &count, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "depth",
                      clspDepthGetDots(nullptr, queue, 0, nullptr, &count, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "depth", clspDepthGetPatternDots(nullptr, 0, nullptr, &count));
    ClspDepthSummary summary{};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size",
                      clspDepthGetDots(depth, queue, 0, nullptr, &count, &summary));
    ClspDepthDot two[3] = {};
    two[2].reserved = 99;
    ASSERT_CLSP_OK(clspDepthGetDots(depth, queue, 2, two, &count, nullptr));
    EXPECT_GT(count, 60u);
    EXPECT_LE(two[0].y_px, two[1].y_px + 1.0);
    EXPECT_EQ(99u, two[2].reserved) << "no more than the capacity is written";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "dots", clspDepthGetPatternDots(depth, 3, nullptr, &count));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspDepthGetPatternDots(depth, 0, nullptr, nullptr));
    ClspDepthPatternDot one[2] = {{77, 77}, {77, 77}};
    ASSERT_CLSP_OK(clspDepthGetPatternDots(depth, 1, one, &count));
    EXPECT_EQ(directions.size() / 2, count);
    EXPECT_EQ(77u, one[1].reason);
}

TEST_F(Depth, WordsForEverything) {
    for (std::uint32_t reason = 0; reason <= CLSP_DEPTH_REASON_NOT_SEEN; ++reason)
        EXPECT_NE(std::string("unknown reason"), clspDepthReasonString(reason)) << reason;
    EXPECT_EQ(std::string("unknown reason"), clspDepthReasonString(1000));
    for (std::uint32_t bit = 1; bit <= CLSP_DEPTH_WARNING_MERGED; bit *= 2)
        EXPECT_NE(std::string("unknown warning"), clspDepthWarningString(bit)) << bit;
    EXPECT_EQ(std::string("unknown warning"), clspDepthWarningString(3));
    EXPECT_EQ(clspeckle::Depth::reason(4), clspDepthReasonString(4));
    EXPECT_EQ(clspeckle::Depth::warning(4), clspDepthWarningString(4));
}

TEST_F(Depth, HandlesAndRules) {
    const clspeckle::Depth depth(context, valid());
    const Image image = floats(frame(), width, height);
    check_enqueue(CLSP_NAMED(clspDepthEnqueueDetect), depth, &image.view);
    check_image("clspDepthEnqueueDetect", "image", image.view, CLSP_FORMAT_FLOAT32X2,
                [&](const ClspImage *view) { return enqueue(clspDepthEnqueueDetect, depth, view); });
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "image", enqueue(clspDepthEnqueueDetect, depth, nullptr));
    check_references("clspDepthEnqueueDetect",
                     [&](ClspDepth handle) { return enqueue(clspDepthEnqueueDetect, handle, &image.view); });
}

TEST_F(Depth, BadDescriptions) {
    using D = ClspDepthDesc;
    const auto refuses = check_create(valid());
    refuses("width", &D::width, {0});
    refuses("16384", &D::height, {20000});
    refuses("need at least 11 x 11", &D::width, {10});
    refuses("max_dots", &D::max_dots, {0, 1000001});
    refuses("expected CLSP_PROJECTION_TANGENT_PLANE (0) or CLSP_PROJECTION_DIRECTION_COSINES (1)", &D::projection, {2});
    refuses("reserved", &D::reserved, {1});
    refuses("directions", &D::directions, {nullptr});
    refuses("directions", &D::direction_count, {0});
    refuses("direction_count", &D::direction_count, {CLSP_MAX_DIRECTIONS + 1});
    refuses("rotation", [](D &d) { d.laser_from_camera[0] = 2; });
    refuses("reflection", [](D &d) { d.laser_from_camera[10] = -1; });
    refuses("laser lies 0 m", [](D &d) { d.laser_from_camera[3] = 0; });
    refuses("near_m is 4", &D::near_m, {4});
    for (double value : test::bad())
        refuses("laser_from_camera", [&](D &d) { d.laser_from_camera[7] = value; });
    refuses("fx_px", &D::fx_px, test::bad());
    refuses("fy_px", &D::fy_px, {0});
    refuses("cx_px", &D::cx_px, test::bad());
    refuses("near_m", &D::near_m, test::bad());
    refuses("far_m", &D::far_m, test::bad());
    refuses("dot_sigma_px", &D::dot_sigma_px, test::bad({0.4}));
    refuses("min_amplitude_dn", &D::min_amplitude_dn, test::bad());
    refuses("threshold_sigmas", &D::threshold_sigmas, test::bad());
    refuses("min_correlation", &D::min_correlation, test::bad());
    refuses("read_noise_dn", &D::read_noise_dn, test::bad());
    refuses("dn_per_electron", &D::dn_per_electron, test::bad());
    refuses("black_level_dn", &D::black_level_dn, test::bad());
    refuses("saturation_dn", &D::saturation_dn, test::bad());
    refuses("epipolar_tolerance_px", &D::epipolar_tolerance_px, test::bad({0}));
    refuses("relative_diameter", &D::relative_diameter, test::bad({1e-4, 1.1e3}));
    refuses("speckle_contrast", &D::speckle_contrast, test::bad({1.001}));
    refuses("min_confidence", &D::min_confidence, test::bad({1}));
    std::vector<double> wrong = directions;
    wrong[9] = test::nan_value;
    refuses("dot 4", &D::directions, {wrong.data()}, CLSP_ERROR_INVALID_DATA);
    wrong[9] = 1.0;
    refuses(
        "direction cosines",
        [&](D &d) { d.directions = wrong.data(), d.projection = CLSP_PROJECTION_DIRECTION_COSINES; },
        CLSP_ERROR_INVALID_DATA);
}

} // namespace
