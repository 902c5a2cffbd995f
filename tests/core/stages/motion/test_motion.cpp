// Motion and materials through the C interface: defaults, the three ways to say how points moved, and what bad
// arguments get.
#include "stage_support.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

namespace {

constexpr float nan_value = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();

TEST(Material, InitFunctionWritesDefaults) {
    test::check_init<ClspMaterial>("clspMaterialInit", clspMaterialInit);
    const auto material = clspeckle::make<ClspMaterial>();
    EXPECT_TRUE(std::isinf(material.roughness_rms_m));
    EXPECT_LT(material.degree_of_polarization, 0.0);
    EXPECT_TRUE(std::isinf(material.correlation_time_s));
    EXPECT_DOUBLE_EQ(0.5e-3, material.lateral_correlation_length_m);
    EXPECT_DOUBLE_EQ(3e-3, material.axial_correlation_length_m);
    EXPECT_NEAR(4.36332e-3, material.rotation_correlation_angle_rad, 1e-8);
    EXPECT_EQ(0.0, material.subsurface_fraction);
}

class Motion : public test::StageTest<ClspMotion> {
  protected:
    static constexpr std::uint32_t width = 6, height = 5, pixels = width * height;
    static constexpr double focal_length = 100.0, lateral = 0.5e-3, axial = 3e-3;

    ClspMotionDesc valid() const override {
        auto desc = clspeckle::make<ClspMotionDesc>();
        desc.width = width;
        desc.height = height;
        desc.fx_px = desc.fy_px = focal_length;
        desc.cx_px = 2.5;
        desc.cy_px = 2.0;
        return desc;
    }
    // What a run gives: images of this size, filled by `input`.
    struct Outputs {
        std::vector<float> path, correlation, shift, displacement;
        std::vector<std::uint8_t> mask;
    };
    Outputs run(const clspeckle::Motion &motion, const ClspMotionInput &input) {
        auto path = make_image(width, height, CLSP_FORMAT_FLOAT32, 64, 12);
        auto correlation = make_image(width, height, CLSP_FORMAT_FLOAT32);
        auto shift = make_image(width, height, CLSP_FORMAT_FLOAT32X2);
        auto displacement = make_image(width, height, CLSP_FORMAT_FLOAT32X3);
        auto mask = make_image(width, height, CLSP_FORMAT_UINT8, 16, 3);
        auto output = clspeckle::make<ClspMotionOutput>();
        output.path = path.view;
        output.correlation = correlation.view;
        output.shift = shift.view;
        output.displacement = displacement.view;
        output.mask = mask.view;
        motion.enqueue_compute(queue, input, output);
        queue.finish();
        EXPECT_TRUE(margins_untouched(path));
        EXPECT_TRUE(margins_untouched(mask));
        return {download<float>(path), download<float>(correlation), download<float>(shift),
                download<float>(displacement), download<std::uint8_t>(mask)};
    }
    static constexpr double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};
constexpr double Motion::identity[12];

TEST_F(Motion, InitFunctionsWriteDefaults) {
    const ClspMotionDesc desc = checked_defaults();
    test::check_init<ClspMotionInput>("clspMotionInputInit", clspMotionInputInit);
    test::check_init<ClspMotionOutput>("clspMotionOutputInit", clspMotionOutputInit);
    EXPECT_EQ(CLSP_MOTION_CORRELATE, desc.rule);
    EXPECT_EQ(0u, desc.translate);
    EXPECT_EQ(CLSP_DEPTH_ALONG_AXIS, desc.depth_kind);
    EXPECT_EQ(nullptr, desc.materials);
    EXPECT_EQ(0.0, desc.fx_px);
    EXPECT_DOUBLE_EQ(0.01, desc.replace_threshold);
    EXPECT_DOUBLE_EQ(0.02, desc.occlusion_tolerance);
}

TEST_F(Motion, RigidTransformMovesPointsByHand) {
    const clspeckle::Motion motion(context, valid());
    const auto depth = floats(std::vector<float>(pixels, 1.0f), width, height);
    double pose[12];
    std::copy(identity, identity + 12, pose);
    pose[3] = -7e-6; // the point was 7 um to the left
    auto input = clspeckle::make<ClspMotionInput>();
    input.depth = depth.view;
    input.previous_from_current = pose;
    input.transform_count = 1;
    const auto out = run(motion, input);
    for (std::uint32_t i = 0; i < pixels; ++i) {
        const double x = (i % width - 2.5) / focal_length, y = (i / width - 2.0) / focal_length;
        const double length = std::sqrt(x * x + y * y + 1.0), along = 7e-6 * x / length;
        const double across = std::sqrt(7e-6 * 7e-6 - along * along);
        EXPECT_NEAR(across, out.displacement[3 * i], 1e-12);
        EXPECT_NEAR(along, out.displacement[3 * i + 1], 1e-12);
        EXPECT_EQ(0.0f, out.displacement[3 * i + 2]);
        EXPECT_NEAR(std::hypot(across / lateral, along / axial), out.path[i], 1e-7);
        EXPECT_NEAR(-7e-6 * focal_length, out.shift[2 * i], 1e-9);
        EXPECT_EQ(0.0f, out.shift[2 * i + 1]);
        EXPECT_EQ(1.0f, out.correlation[i]);
        EXPECT_EQ(1u, out.mask[i]) << "a path of 0.014 is above the threshold of 0.01";
    }
    pose[3] = -4e-6;
    for (std::uint8_t moved : run(motion, input).mask)
        EXPECT_EQ(0u, moved) << "a path of 0.008 is below it";

    // Spin about the viewing axis at the principal point: no displacement there, but a rotation.
    const double a = 1e-3;
    const double spin[12] = {std::cos(a), -std::sin(a), 0, 0, std::sin(a), std::cos(a), 0, 0, 0, 0, 1, 0};
    input.previous_from_current = spin;
    const auto spun = run(motion, input);
    for (std::uint32_t i = 0; i < pixels; ++i)
        EXPECT_NEAR(a, spun.displacement[3 * i + 2], 1e-9);
    input.previous_from_current = identity;
    const auto still = run(motion, input);
    for (std::uint32_t i = 0; i < pixels; ++i) {
        EXPECT_EQ(0.0f, still.path[i]);
        EXPECT_EQ(0u, still.mask[i]);
    }
    EXPECT_CLSP_OK(clspMotionCheck(motion, queue));
}

TEST_F(Motion, BadPixelsAreMovedAndReported) {
    auto skin = clspeckle::make<ClspMaterial>();
    skin.correlation_time_s = 0.0;
    const clspeckle::MaterialTable table(context, {clspeckle::make<ClspMaterial>(), skin});
    auto desc = valid();
    desc.materials = table;
    const clspeckle::Motion motion(context, desc);
    std::vector<float> now(3 * pixels, 1.0f), before(now);
    now[3 * 4] = nan_value;        // no surface
    before[3 * 9 + 1] = nan_value; // (3, 1)
    before[3 * 20 + 2] = infinity;
    std::vector<std::uint8_t> ids(pixels, 0);
    ids[13] = 1;
    ids[14] = 2; // (2, 2), outside of the table
    ids[4] = 77; // no surface: does not count
    const auto position = upload(now, width, height, CLSP_FORMAT_FLOAT32X3);
    const auto previous = upload(before, width, height, CLSP_FORMAT_FLOAT32X3);
    const auto material = upload(ids, width, height, CLSP_FORMAT_UINT8);
    auto input = clspeckle::make<ClspMotionInput>();
    input.position = position.view;
    input.previous_position = previous.view;
    input.material = material.view;
    const auto out = run(motion, input);
    for (std::uint32_t i = 0; i < pixels; ++i) {
        const bool moved = i == 9 || i == 20;
        EXPECT_EQ(moved ? infinity : 0.0f, out.path[i]) << i;
        EXPECT_EQ(moved || i == 13 ? 1u : 0u, out.mask[i]) << i;
        EXPECT_EQ(i == 13 ? 0.0f : 1.0f, out.correlation[i]) << i;
        EXPECT_EQ(0.0f, out.shift[2 * i]) << i;
    }
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "2 surface pixels", clspMotionCheck(motion, queue));
    EXPECT_CLSP_OK(clspMotionCheck(motion, queue));
    run(motion, input);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "x = 3, y = 1", clspMotionCheck(motion, queue));
    run(motion, input);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "1 pixels with a material id outside of the table (it has 2)",
                      clspMotionCheck(motion, queue));
}

TEST_F(Motion, TransformsOfMaterialsAreCopiedDuringTheCall) {
    const clspeckle::MaterialTable table(context, std::vector<ClspMaterial>(3, clspeckle::make<ClspMaterial>()));
    auto desc = valid();
    desc.materials = table;
    const clspeckle::Motion motion(context, desc);
    const auto depth = floats(std::vector<float>(pixels, 1.0f), width, height);
    std::vector<std::uint8_t> ids(pixels);
    for (std::uint32_t i = 0; i < pixels; ++i)
        ids[i] = static_cast<std::uint8_t>(i % 3);
    const auto material = upload(ids, width, height, CLSP_FORMAT_UINT8);
    auto path = make_image(width, height, CLSP_FORMAT_FLOAT32);
    auto output = clspeckle::make<ClspMotionOutput>();
    output.path = path.view;
    for (const std::uint32_t flags : {0u, test::out_of_order(context), CLSP_QUEUE_PROFILING}) {
        const clspeckle::Queue working(context, flags);
        auto poses = std::make_unique<std::vector<double>>();
        for (double z : {0.0, 3e-3, 6e-3}) {
            poses->insert(poses->end(), identity, identity + 12);
            poses->back() = z;
        }
        auto input = clspeckle::make<ClspMotionInput>();
        input.depth = depth.view;
        input.material = material.view;
        input.previous_from_current = poses->data();
        input.transform_count = 3;
        motion.enqueue_compute(working, input, output);
        std::fill(poses->begin(), poses->end(), 1e9);
        poses.reset();
        working.finish();
        const auto found = download<float>(path);
        for (std::uint32_t i = 0; i < pixels; ++i)
            EXPECT_NEAR(i % 3, found[i], 0.05 * (i % 3)) << i; // nearly axial at the centre
    }
}

TEST_F(Motion, CreateRefusesBadArguments) {
    using D = ClspMotionDesc;
    const auto refuses = check_create(valid());
    refuses("width", &D::width, test::bad_sides);
    refuses("height", &D::height, test::bad_sides);
    refuses("rule is 2, expected CLSP_MOTION_CORRELATE (0) or CLSP_MOTION_REPLACE (1)", &D::rule, {2});
    refuses("translate", &D::translate, {2});
    refuses("depth_kind is 2, expected CLSP_DEPTH_ALONG_AXIS (0) or CLSP_DEPTH_ALONG_RAY (1)", &D::depth_kind, {2});
    refuses("fx_px", &D::fx_px, test::bad({-1.0}));
    refuses("fy_px", &D::fy_px, test::bad({-1.0, 0.0}));
    refuses("replace_threshold", &D::replace_threshold, test::bad({-1.0}));
    refuses("occlusion_tolerance", &D::occlusion_tolerance, test::bad({-1.0}));
    refuses("cx_px", &D::cx_px, test::bad());
    refuses("cy_px", &D::cy_px, test::bad());
    refuses("table", &D::materials, {reinterpret_cast<ClspMaterialTable>(context.get())}, CLSP_ERROR_INVALID_HANDLE);
    const test::HostContext host;
    const auto other = clspeckle::Context::from_host(host.context, host.device);
    const clspeckle::MaterialTable foreign(other, {clspeckle::make<ClspMaterial>()});
    refuses("materials", &D::materials, {foreign.get()}, CLSP_ERROR_WRONG_CONTEXT);
}

TEST_F(Motion, ComputeRefusesBadArguments) {
    const clspeckle::MaterialTable table(context, std::vector<ClspMaterial>(2, clspeckle::make<ClspMaterial>()));
    auto desc = valid();
    desc.materials = table;
    const clspeckle::Motion motion(context, desc);
    const auto depth = floats(std::vector<float>(pixels, 1.0f), width, height);
    const auto position = upload(std::vector<float>(3 * pixels, 1.0f), width, height, CLSP_FORMAT_FLOAT32X3);
    const auto vectors = upload(std::vector<float>(2 * pixels, 0.0f), width, height, CLSP_FORMAT_FLOAT32X2);
    const auto ids = upload(std::vector<std::uint8_t>(pixels, 0), width, height, CLSP_FORMAT_UINT8);
    auto path = make_image(width, height, CLSP_FORMAT_FLOAT32);
    auto shift = make_image(width, height, CLSP_FORMAT_FLOAT32X2);
    using I = ClspMotionInput;
    using O = ClspMotionOutput;
    auto input = clspeckle::make<I>();
    input.depth = depth.view;
    input.motion = vectors.view;
    input.previous_depth = depth.view;
    auto output = clspeckle::make<O>();
    output.path = path.view;
    const auto call = [&](ClspMotion m, const I *i, const O *o) { return enqueue(clspMotionEnqueueCompute, m, i, o); };
    const test::Failures fails("clspMotionEnqueueCompute");
    fails(CLSP_ERROR_INVALID_HANDLE, "motion", call(nullptr, &input, &output));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "input", call(motion, nullptr, &output));
    fails(CLSP_ERROR_INVALID_ARGUMENT, "output", call(motion, &input, nullptr));
    check_enqueue(CLSP_NAMED(clspMotionEnqueueCompute), motion, &input, &output);
    const auto with = [&](const I &base) {
        return test::Refusals<I>("clspMotionEnqueueCompute", base, [&](I *i) { return call(motion, i, &output); });
    };
    const auto refuses = with(input);
    refuses.check_struct_size();
    // Each image, alone wrong.
    I full = input;
    full.normal = full.previous_normal = position.view;
    full.material = full.previous_material = ids.view;
    const auto of_full = with(full);
    of_full.check_image(context, "depth", &I::depth, CLSP_FORMAT_FLOAT32X3);
    of_full.check_image(context, "motion", &I::motion, CLSP_FORMAT_FLOAT32);
    of_full.check_image(context, "previous_depth", &I::previous_depth, CLSP_FORMAT_UINT16);
    of_full.check_image(context, "normal", &I::normal, CLSP_FORMAT_FLOAT32X2);
    of_full.check_image(context, "previous_normal", &I::previous_normal, CLSP_FORMAT_FLOAT32X2);
    of_full.check_image(context, "material", &I::material, CLSP_FORMAT_FLOAT32);
    of_full.check_image(context, "previous_material", &I::previous_material, CLSP_FORMAT_UINT16);
    I positions = clspeckle::make<I>();
    positions.position = positions.previous_position = position.view;
    with(positions).check_image(context, "position", &I::position, CLSP_FORMAT_FLOAT32X2);
    with(positions).check_image(context, "previous_position", &I::previous_position, CLSP_FORMAT_FLOAT32);

    refuses("reserved", &I::reserved, {1});
    refuses("roll_from_motion", &I::roll_from_motion, {2});
    refuses("frame_time_s", &I::frame_time_s, test::bad({-1.0}));
    refuses("both position and depth", &I::position, {position.view});
    refuses("neither position nor depth", &I::depth, {{}});
    refuses("previous_depth", &I::previous_position, {position.view});
    refuses("previous_depth", &I::previous_depth, {{}});
    refuses("how surfaces moved", [](I &i) { i.motion = i.previous_depth = {}; });
    refuses("previous_from_current is NULL", &I::transform_count, {1});
    refuses("transform_count is 0", &I::previous_from_current, {identity});
    refuses("both previous_from_current", [](I &i) { i.previous_from_current = identity, i.transform_count = 1; });
    refuses("previous_normal needs normal", &I::previous_normal, {position.view});
    refuses("previous_material needs material", &I::previous_material, {ids.view});
    double pose[24];
    std::copy(identity, identity + 12, pose);
    std::copy(identity, identity + 12, pose + 12);
    I moved = input;
    moved.motion = moved.previous_depth = {};
    moved.previous_from_current = pose;
    moved.transform_count = 1;
    const auto refuses_transforms = with(moved);
    refuses_transforms("transform_count is 3", &I::transform_count, {3});
    refuses_transforms("material", &I::transform_count, {2});
    refuses_transforms("roll_from_motion needs motion", &I::roll_from_motion, {1});
    pose[7] = test::nan_value;
    refuses_transforms("finite", &I::transform_count, {1});
    pose[7] = 0.0;
    pose[0] = 1.1;
    refuses_transforms("rotation", &I::transform_count, {1});
    pose[0] = -1.0;
    refuses_transforms("reflection", &I::transform_count, {1});

    const test::Refusals<O> of_output("clspMotionEnqueueCompute", output,
                                      [&](O *o) { return call(motion, &input, o); });
    of_output.check_struct_size();
    of_output("reserved", &O::reserved, {1});
    of_output("no image", &O::path, {{}});
    of_output("mask", &O::mask, {path.view}, CLSP_ERROR_INVALID_FORMAT);
    of_output("correlation", &O::correlation, {path.view}, CLSP_ERROR_OVERLAP);
    of_output("depth", &O::path, {depth.view}, CLSP_ERROR_OVERLAP);
    of_output("motion", &O::shift, {vectors.view}, CLSP_ERROR_OVERLAP);

    // Without the focal length.
    auto blind_desc = valid();
    blind_desc.fx_px = blind_desc.fy_px = 0.0;
    const clspeckle::Motion blind(context, blind_desc);
    fails(CLSP_ERROR_INVALID_ARGUMENT, "fx_px", call(blind, &input, &output));
    EXPECT_CLSP_OK(call(blind, &positions, &output));
    output.shift = shift.view;
    fails(CLSP_ERROR_INVALID_ARGUMENT, "fx_px", call(blind, &positions, &output));
    queue.finish();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "motion", clspMotionCheck(nullptr, queue));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspMotionCheck(motion, nullptr));
}

TEST_F(Motion, TableRefusesBadMaterials) {
    ClspMaterialTable table = nullptr;
    const auto good = clspeckle::make<ClspMaterial>();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspMaterialTableCreate(nullptr, &good, 1, &table));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "materials", clspMaterialTableCreate(context, nullptr, 1, &table));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "table", clspMaterialTableCreate(context, &good, 1, nullptr));
    for (const std::uint32_t count : {0u, 257u, 0xffffffffu})
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspMaterialTableCreate(context, &good, count, &table));
    test::check_struct_size<ClspMaterial>("clspMaterialTableCreate", good, [&](ClspMaterial *m) {
        ClspMaterialTable made = nullptr;
        const ClspStatus status = clspMaterialTableCreate(context, m, 1, &made);
        clspMaterialTableRelease(made);
        return status;
    });
    // The second of two materials is wrong.
    using D = ClspMaterial;
    const test::Refusals<D> refuses("clspMaterialTableCreate", good, [&](D *m) {
        const std::array<D, 2> materials = {good, *m};
        const ClspStatus status = clspMaterialTableCreate(context, materials.data(), 2, &table);
        EXPECT_EQ(nullptr, table);
        EXPECT_TRUE(m->reserved || std::strstr(test::last_error().message, "material 1"));
        return status;
    });
    const double nan = test::nan_value;
    refuses("roughness_rms_m", &D::roughness_rms_m, {-1e-9, nan});
    refuses("degree_of_polarization", &D::degree_of_polarization, {1.001, nan});
    refuses("correlation_time_s", &D::correlation_time_s, {-1.0, nan});
    refuses("lateral_correlation_length_m", &D::lateral_correlation_length_m, {0.0, -1.0, nan});
    refuses("axial_correlation_length_m", &D::axial_correlation_length_m, {0.0, -1.0, nan});
    refuses("rotation_correlation_angle_rad", &D::rotation_correlation_angle_rad, {0.0, -1.0, nan});
    refuses("subsurface_fraction", &D::subsurface_fraction, {-0.1, 1.1, nan});
    refuses("reserved", &D::reserved, {1});
    std::vector<ClspMaterial> uneven(2, good);
    uneven[1].struct_size = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "materials[1]",
                      clspMaterialTableCreate(context, uneven.data(), 2, &table));
}

TEST_F(Motion, RetainAndRelease) {
    check_references("clspMotionCheck", [&](ClspMotion motion) { return clspMotionCheck(motion, queue); });
    ClspMaterialTable table = nullptr;
    const auto material = clspeckle::make<ClspMaterial>();
    ASSERT_CLSP_OK(clspMaterialTableCreate(context, &material, 1, &table));
    auto desc = valid();
    desc.materials = table;
    const clspeckle::Motion motion(context, desc);
    EXPECT_CLSP_OK(clspMaterialTableRetain(table));
    EXPECT_CLSP_OK(clspMaterialTableRelease(table));
    EXPECT_CLSP_OK(clspMaterialTableRelease(table)); // the motion still has it
    EXPECT_CLSP_OK(clspMotionCheck(motion, queue));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "table", clspMaterialTableRelease(table));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "table", clspMaterialTableRetain(nullptr));
    EXPECT_CLSP_OK(clspMaterialTableRelease(nullptr));
}

} // namespace
