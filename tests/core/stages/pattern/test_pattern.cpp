// The pattern lookup: geometry of a plane before the laser, poses, masks, and what bad arguments get.
#include "stage_support.hpp"

namespace {

class Pattern : public test::StageTest<ClspPattern> {
  protected:
    static constexpr std::uint32_t width = 16, height = 12;

    const std::vector<float> flat = std::vector<float>(4 * 4, 2.0f);

    ClspPatternDesc valid() const override {
        auto desc = clspeckle::make<ClspPatternDesc>();
        desc.width = 4;
        desc.height = 4;
        desc.texels = flat.data();
        desc.half_extent_x = desc.half_extent_y = 10; // everything before the laser
        return desc;
    }
    std::vector<float> lookup(const clspeckle::Pattern &pattern, const ClspGeometry &geometry, std::uint32_t w = width,
                              std::uint32_t h = height) {
        return written(w, h, CLSP_FORMAT_FLOAT32,
                       [&](const ClspImage &image) { pattern.enqueue_lookup(queue, geometry, image); });
    }
    static constexpr double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

    static ClspGeometry camera() {
        auto geometry = clspeckle::make<ClspGeometry>();
        geometry.fx_px = 20;
        geometry.fy_px = 25;
        geometry.cx_px = 7.5;
        geometry.cy_px = 5;
        return geometry;
    }
};

TEST_F(Pattern, InitFunctionsWriteDefaults) {
    const ClspPatternDesc desc = checked_defaults();
    test::check_init<ClspGeometry>("clspGeometryInit", clspGeometryInit);
    EXPECT_EQ(CLSP_PROJECTION_TANGENT_PLANE, desc.projection);
    EXPECT_EQ(CLSP_QUANTITY_RADIANT_INTENSITY, desc.quantity);
    EXPECT_EQ(0.5, desc.half_extent_x);
    EXPECT_EQ(0.5, desc.half_extent_y);
    EXPECT_EQ(1.0, desc.power_scale);
    EXPECT_EQ(0u, desc.texels_pitch_bytes);
    for (int i = 0; i < 12; ++i)
        EXPECT_EQ(i == 0 || i == 5 || i == 10 ? 1.0 : 0.0, desc.laser_from_geometry[i]) << i;
    ClspGeometry geometry;
    ASSERT_CLSP_OK(clspGeometryInit(&geometry, sizeof(geometry)));
    EXPECT_EQ(CLSP_DEPTH_ALONG_AXIS, geometry.depth_kind);
    EXPECT_EQ(nullptr, geometry.position.mem);
    EXPECT_EQ(nullptr, geometry.depth.mem);
}

TEST_F(Pattern, InverseSquareCosineAndAlbedo) {
    // A wall at z = 2 seen with intrinsics; the laser 0.3 m to the right and 0.1 m back.
    auto desc = valid();
    desc.power_scale = 3;
    desc.laser_from_geometry[3] = -0.3;
    desc.laser_from_geometry[11] = 0.1;
    std::vector<float> depth(width * height, 2.0f), normals, albedo, visibility(width * height, 1.0f);
    std::vector<std::uint8_t> visible(width * height, 255);
    for (std::size_t i = 0; i < depth.size(); ++i) {
        normals.insert(normals.end(), {0.0f, 0.0f, -1.0f});
        albedo.push_back(static_cast<float>(i % 5) * 0.25f);
    }
    visibility[30] = 0.5f;
    visible[30] = 51; // one fifth
    auto depth_image = floats(depth, width, height);
    auto normal_image = upload(normals, width, height, CLSP_FORMAT_FLOAT32X3, 256, 16);
    auto albedo_image = floats(albedo, width, height);
    auto visibility_image = floats(visibility, width, height);
    auto visible_image = upload(visible, width, height, CLSP_FORMAT_UINT8);
    ClspGeometry geometry = camera();
    geometry.depth = depth_image.view;
    geometry.normal = normal_image.view;
    geometry.albedo = albedo_image.view;
    geometry.visibility = visibility_image.view;
    const clspeckle::Pattern pattern(context, desc);
    const auto got = lookup(pattern, geometry);
    const auto expected = [&](std::uint32_t x, std::uint32_t y) {
        const double px = (x - 7.5) / 20 * 2 - 0.3, py = (y - 5.0) / 25 * 2, pz = 2 + 0.1;
        const double d2 = px * px + py * py + pz * pz;
        return 3 * 2.0 * (pz / std::sqrt(d2)) / d2 * albedo[y * width + x] / M_PI;
    };
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            EXPECT_NEAR(expected(x, y) * visibility[y * width + x], got[y * width + x], 2e-6) << x << ", " << y;
    geometry.visibility = visible_image.view;
    EXPECT_NEAR(expected(30 % width, 30 / width) * 0.2, lookup(pattern, geometry)[30], 2e-6);
}

TEST_F(Pattern, DepthAlongRayAndPositionsAgreeWithDepthAlongAxis) {
    std::vector<float> along_axis, along_ray, positions3, positions4;
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const double z = 1.5 + 0.01 * x, dx = (x - 7.5) / 20, dy = (y - 5.0) / 25;
            along_axis.push_back(static_cast<float>(z));
            along_ray.push_back(static_cast<float>(z * std::sqrt(1 + dx * dx + dy * dy)));
            for (double value : {dx * z, dy * z, z}) {
                positions3.push_back(static_cast<float>(value));
                positions4.push_back(static_cast<float>(value));
            }
            positions4.push_back(std::numeric_limits<float>::quiet_NaN()); // ignored
        }
    }
    // A pattern with structure, so that a wrong position shows.
    std::vector<float> texels(64 * 64);
    for (std::size_t i = 0; i < texels.size(); ++i)
        texels[i] = static_cast<float>(i % 64) + static_cast<float>(i / 64);
    auto desc = valid();
    desc.width = desc.height = 64;
    desc.texels = texels.data();
    desc.half_extent_x = desc.half_extent_y = 1;
    const clspeckle::Pattern pattern(context, desc);
    auto axis_image = floats(along_axis, width, height), ray_image = floats(along_ray, width, height);
    auto image3 = upload(positions3, width, height, CLSP_FORMAT_FLOAT32X3);
    auto image4 = upload(positions4, width, height, CLSP_FORMAT_FLOAT32X4, 512, 64);
    ClspGeometry geometry = camera();
    geometry.depth = axis_image.view;
    const auto expected = lookup(pattern, geometry);
    geometry.depth = ray_image.view;
    geometry.depth_kind = CLSP_DEPTH_ALONG_RAY;
    const auto ray = lookup(pattern, geometry);
    geometry = clspeckle::make<ClspGeometry>();
    geometry.position = image3.view;
    const auto three = lookup(pattern, geometry);
    geometry.position = image4.view;
    const auto four = lookup(pattern, geometry);
    EXPECT_EQ(three, four);
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_GT(expected[i], 0.0f);
        EXPECT_NEAR(expected[i], ray[i], 2e-5 * expected[i]) << i;
        EXPECT_NEAR(expected[i], three[i], 2e-5 * expected[i]) << i;
    }
}

TEST_F(Pattern, BilinearInsideZeroOutside) {
    // A wall at z = 1 under a pattern of 2 x 2 texels: pattern coordinates are the positions themselves.
    const std::vector<float> texels = {0.0f, 1.0f, 2.0f, 3.0f};
    auto desc = valid();
    desc.width = desc.height = 2;
    desc.texels = texels.data();
    desc.half_extent_x = 0.4;
    desc.half_extent_y = 0.2;
    desc.quantity = CLSP_QUANTITY_PLANE_IRRADIANCE;
    const std::vector<std::array<double, 3>> points = {
        // x, y, texel value there
        {-0.2, -0.1, 0.0}, {0.2, -0.1, 1.0},  {-0.2, 0.1, 2.0}, {0.2, 0.1, 3.0},  {0.0, 0.0, 1.5},  {0.1, 0.05, 2.25},
        {0.39, 0.1, 3.0},  {-0.39, 0.1, 2.0}, {0.41, 0.1, 0.0}, {0.1, 0.21, 0.0}, {0.1, -0.21, 0.0}};
    std::vector<float> positions;
    for (const auto &p : points)
        positions.insert(positions.end(), {static_cast<float>(p[0]), static_cast<float>(p[1]), 1.0f});
    const auto count = static_cast<std::uint32_t>(points.size());
    auto image = upload(positions, count, 1, CLSP_FORMAT_FLOAT32X3);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.position = image.view;
    const auto got = lookup(clspeckle::Pattern(context, desc), geometry, count, 1);
    for (std::size_t i = 0; i < points.size(); ++i) {
        // Plane irradiance v at unit distance is the intensity v / cos^3, and without normals the surface faces the
        // laser.
        const double d2 = points[i][0] * points[i][0] + points[i][1] * points[i][1] + 1.0;
        EXPECT_NEAR(points[i][2] * std::pow(d2, 1.5) / d2 / M_PI, got[i], 3e-6) << i;
    }
}

TEST_F(Pattern, DirectionCosinesAndNothingBehindTheLaser) {
    auto desc = valid();
    desc.half_extent_x = desc.half_extent_y = 1;
    std::vector<float> texels(16, 1.0f);
    desc.texels = texels.data();
    const float bad = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    const std::vector<float> positions = {0.0f, 0.0f, 2.0f, 5.0f, 0.0f, 1.0f, 0.0f, 0.0f, -1.0f, 0.0f, 0.0f,
                                          0.0f, bad,  0.0f, 1.0f, 0.0f, inf,  1.0f, 0.0f, 0.0f,  bad};
    auto image = upload(positions, 7, 1, CLSP_FORMAT_FLOAT32X3);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.position = image.view;
    const auto tangent = lookup(clspeckle::Pattern(context, desc), geometry, 7, 1);
    desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
    const auto cosines = lookup(clspeckle::Pattern(context, desc), geometry, 7, 1);
    EXPECT_NEAR(1 / (4 * M_PI), tangent[0], 1e-6);
    EXPECT_EQ(0.0f, tangent[1]) << "x/z = 5 lies outside";
    EXPECT_NEAR(1 / (4 * M_PI), cosines[0], 1e-6);
    EXPECT_NEAR(1 / (26 * M_PI), cosines[1], 1e-6) << "x/d = 0.98 lies inside";
    for (std::size_t i = 2; i < 7; ++i) {
        EXPECT_EQ(0.0f, tangent[i]) << i;
        EXPECT_EQ(0.0f, cosines[i]) << i;
    }
}

TEST_F(Pattern, PoseCanChange) {
    const clspeckle::Pattern pattern(context, valid());
    auto depth = floats(std::vector<float>(width * height, 1.0f), width, height);
    ClspGeometry geometry = camera();
    geometry.depth = depth.view;
    const auto before = lookup(pattern, geometry);
    // Half a turn around y: the laser looks away.
    const double away[12] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0};
    pattern.set_pose(away);
    for (float value : lookup(pattern, geometry))
        EXPECT_EQ(0.0f, value);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pattern", clspPatternSetPose(nullptr, identity));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "laser_from_geometry", clspPatternSetPose(pattern, nullptr));
    const double scaled[12] = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "laser_from_geometry", clspPatternSetPose(pattern, scaled));
    const double mirrored[12] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "laser_from_geometry", clspPatternSetPose(pattern, mirrored));
    for (int i = 0; i < 12; ++i) {
        for (double bad : {test::nan_value, test::infinity}) {
            double pose[12];
            std::copy(std::begin(identity), std::end(identity), pose);
            pose[i] = bad;
            EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "laser_from_geometry", clspPatternSetPose(pattern, pose));
        }
    }
    pattern.set_pose(identity);
    EXPECT_EQ(before, lookup(pattern, geometry));
}

TEST_F(Pattern, OffsetAndPitchGiveTheSameBytes) {
    std::vector<float> depth;
    for (std::uint32_t i = 0; i < width * height; ++i)
        depth.push_back(1.0f + static_cast<float>(i) * 0.003f);
    auto packed = floats(depth, width, height);
    auto strided = upload(depth, width, height, CLSP_FORMAT_FLOAT32, 100, 44);
    const clspeckle::Pattern pattern(context, valid());
    ClspGeometry geometry = camera();
    geometry.depth = packed.view;
    const auto expected = lookup(pattern, geometry);
    geometry.depth = strided.view;
    auto out = make_image(width, height, CLSP_FORMAT_FLOAT32, 68, 1000);
    pattern.enqueue_lookup(queue, geometry, out.view);
    EXPECT_EQ(expected, download<float>(out));
    EXPECT_TRUE(margins_untouched(out));
}

TEST_F(Pattern, TexelPitch) {
    const std::vector<float> padded = {1.0f, 2.0f, -9.0f, 3.0f, 4.0f, -9.0f}, packed = {1.0f, 2.0f, 3.0f, 4.0f};
    auto desc = valid();
    desc.width = desc.height = 2;
    desc.half_extent_x = desc.half_extent_y = 1;
    auto depth = floats(std::vector<float>(width * height, 1.0f), width, height);
    ClspGeometry geometry = camera();
    geometry.depth = depth.view;
    desc.texels = packed.data();
    const auto expected = lookup(clspeckle::Pattern(context, desc), geometry);
    desc.texels = padded.data();
    desc.texels_pitch_bytes = 3 * sizeof(float);
    EXPECT_EQ(expected, lookup(clspeckle::Pattern(context, desc), geometry));
}

TEST_F(Pattern, CreateRefusesBadArguments) {
    using D = ClspPatternDesc;
    const auto refuses = check_create(valid());
    refuses("expected CLSP_PROJECTION_TANGENT_PLANE (0) or CLSP_PROJECTION_DIRECTION_COSINES (1)", &D::projection, {2});
    refuses("expected CLSP_QUANTITY_RADIANT_INTENSITY (0) or CLSP_QUANTITY_PLANE_IRRADIANCE (1)", &D::quantity, {2});
    refuses("filter is 2, expected CLSP_FILTER_BILINEAR (0) or CLSP_FILTER_AREA (1)", &D::filter, {2});
    refuses("reserved", &D::reserved, {1});
    refuses("width", &D::width, {0u, 1u, 16385u, 0xffffffffu});
    refuses("height", &D::height, {0u, 1u, 16385u, 0xffffffffu});
    refuses("texels", &D::texels, {nullptr});
    refuses("texels_pitch_bytes", &D::texels_pitch_bytes,
            {12, 17, std::uint64_t{1} << 40, std::uint64_t{1} << 63, ~std::uint64_t{3}});
    refuses("half_extent_x", &D::half_extent_x, test::bad({0.0, -1.0}));
    refuses("half_extent_y", &D::half_extent_y, test::bad({0.0, -1.0}));
    refuses("power_scale", &D::power_scale, test::bad({-1.0}));
    refuses("laser_from_geometry", [](D &d) { d.laser_from_geometry[0] = 0.5; });
    refuses("laser_from_geometry", [](D &d) { d.laser_from_geometry[3] = test::nan_value; });
    for (double bad : test::bad({-1.0})) {
        std::vector<float> texels(16, 1.0f);
        texels[9] = static_cast<float>(bad);
        refuses("texels", &D::texels, {texels.data()}, CLSP_ERROR_INVALID_DATA);
    }
}

TEST_F(Pattern, LookupRefusesBadArguments) {
    const clspeckle::Pattern pattern(context, valid());
    const auto depth = floats(std::vector<float>(width * height, 1.0f), width, height);
    const auto position = make_image(width, height, CLSP_FORMAT_FLOAT32X3);
    const auto normal = make_image(width, height, CLSP_FORMAT_FLOAT32X4);
    const auto bytes = make_image(width, height, CLSP_FORMAT_UINT8);
    const auto out = make_image(width, height, CLSP_FORMAT_FLOAT32);
    using G = ClspGeometry;
    G geometry = camera();
    geometry.depth = geometry.albedo = depth.view;
    geometry.normal = normal.view;
    geometry.visibility = bytes.view;
    const auto run = [&](ClspPattern p, const G *g, const ClspImage *to) {
        return enqueue(clspPatternEnqueueLookup, p, g, to);
    };
    const test::Failures fails("clspPatternEnqueueLookup");
    fails(CLSP_ERROR_INVALID_HANDLE, "pattern", run(nullptr, &geometry, &out.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "geometry", run(pattern, nullptr, &out.view));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "irradiance", run(pattern, &geometry, nullptr));
    fails(CLSP_ERROR_OVERLAP, "irradiance", run(pattern, &geometry, &depth.view));
    const auto with = [&](const G &base) {
        return test::Refusals<G>("clspPatternEnqueueLookup", base, [&](G *g) { return run(pattern, g, &out.view); });
    };
    const auto refuses = with(geometry);
    refuses.check_struct_size();
    refuses("position", [](G &g) { g.depth.mem = nullptr; }); // neither
    refuses("position", &G::position, {position.view});       // both
    refuses("depth_kind is 2, expected CLSP_DEPTH_ALONG_AXIS (0) or CLSP_DEPTH_ALONG_RAY (1)", &G::depth_kind, {2});
    refuses("fx_px", &G::fx_px, test::bad({0.0, -1.0}));
    refuses("fy_px", &G::fy_px, test::bad({0.0, -1.0}));
    refuses("cx_px", &G::cx_px, test::bad());
    refuses("cy_px", &G::cy_px, test::bad());
    refuses.check_image(context, "depth", &G::depth, CLSP_FORMAT_UINT16);
    refuses.check_image(context, "normal", &G::normal, CLSP_FORMAT_FLOAT32X2);
    refuses.check_image(context, "albedo", &G::albedo, CLSP_FORMAT_UINT8);
    refuses.check_image(context, "visibility", &G::visibility, CLSP_FORMAT_UINT16);
    auto positions = clspeckle::make<G>();
    positions.position = position.view;
    with(positions).check_image(context, "position", &G::position, CLSP_FORMAT_FLOAT32);
    test::check_image_rules("clspPatternEnqueueLookup", context, out.view, "irradiance", CLSP_FORMAT_UINT8,
                            [&](const ClspImage *image) { return run(pattern, &geometry, image); });
    check_enqueue(CLSP_NAMED(clspPatternEnqueueLookup), pattern, &geometry, &out.view);
}

TEST_F(Pattern, RetainAndRelease) {
    check_references("clspPatternSetPose", [&](ClspPattern pattern) { return clspPatternSetPose(pattern, identity); });
}

} // namespace
