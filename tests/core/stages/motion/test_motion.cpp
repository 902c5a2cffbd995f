// Motion and materials through the C interface: defaults, the three ways to say how points moved, and what bad
// arguments get.
#include "test_support.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

namespace {

using test::DeviceTest;

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

class Motion : public DeviceTest {
  protected:
    static constexpr std::uint32_t width = 6, height = 5, pixels = width * height;
    static constexpr double focal_length = 100.0, lateral = 0.5e-3, axial = 3e-3;

    static ClspMotionDesc valid() {
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
    test::check_init<ClspMotionDesc>("clspMotionDescInit", clspMotionDescInit);
    test::check_init<ClspMotionInput>("clspMotionInputInit", clspMotionInputInit);
    test::check_init<ClspMotionOutput>("clspMotionOutputInit", clspMotionOutputInit);
    const auto desc = clspeckle::make<ClspMotionDesc>();
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
    for (const std::uint32_t flags : {0u, CLSP_QUEUE_OUT_OF_ORDER, CLSP_QUEUE_PROFILING}) {
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
    ClspMotion motion = nullptr;
    const ClspMotionDesc desc = valid();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspMotionCreate(nullptr, &desc, &motion));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspMotionCreate(context, nullptr, &motion));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "motion", clspMotionCreate(context, &desc, nullptr));
    test::check_struct_size<ClspMotionDesc>("clspMotionCreate", desc, [&](ClspMotionDesc *d) {
        ClspMotion made = nullptr;
        const ClspStatus status = clspMotionCreate(context, d, &made);
        EXPECT_EQ(status == CLSP_SUCCESS, made != nullptr);
        clspMotionRelease(made);
        return status;
    });
    const auto fails = [&](const char *word, const std::function<void(ClspMotionDesc &)> &change) {
        ClspMotionDesc changed = desc;
        change(changed);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, word, clspMotionCreate(context, &changed, &motion));
        EXPECT_EQ(nullptr, motion);
    };
    for (const std::uint32_t side : {0u, 16385u, 0xffffffffu}) {
        fails("width", [&](ClspMotionDesc &d) { d.width = side; });
        fails("height", [&](ClspMotionDesc &d) { d.height = side; });
    }
    fails("rule is 2, expected CLSP_MOTION_CORRELATE (0) or CLSP_MOTION_REPLACE (1)",
          [](ClspMotionDesc &d) { d.rule = 2; });
    fails("translate", [](ClspMotionDesc &d) { d.translate = 2; });
    fails("depth_kind is 2, expected CLSP_DEPTH_ALONG_AXIS (0) or CLSP_DEPTH_ALONG_RAY (1)",
          [](ClspMotionDesc &d) { d.depth_kind = 2; });
    for (const double wrong : {-1.0, std::nan(""), HUGE_VAL}) {
        fails("fx_px", [&](ClspMotionDesc &d) { d.fx_px = wrong; });
        fails("fy_px", [&](ClspMotionDesc &d) { d.fy_px = wrong; });
        fails("replace_threshold", [&](ClspMotionDesc &d) { d.replace_threshold = wrong; });
        fails("occlusion_tolerance", [&](ClspMotionDesc &d) { d.occlusion_tolerance = wrong; });
    }
    fails("fy_px", [](ClspMotionDesc &d) { d.fy_px = 0.0; });
    fails("cx_px", [](ClspMotionDesc &d) { d.cx_px = std::nan(""); });
    fails("cy_px", [](ClspMotionDesc &d) { d.cy_px = HUGE_VAL; });
    ClspMotionDesc wrong = desc;
    wrong.materials = reinterpret_cast<ClspMaterialTable>(context.get());
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "table", clspMotionCreate(context, &wrong, &motion));
    const test::HostContext host;
    const auto other = clspeckle::Context::from_host(host.context, host.device);
    const clspeckle::MaterialTable foreign(other, {clspeckle::make<ClspMaterial>()});
    wrong.materials = foreign;
    EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "materials", clspMotionCreate(context, &wrong, &motion));
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
    auto input = clspeckle::make<ClspMotionInput>();
    input.depth = depth.view;
    input.motion = vectors.view;
    input.previous_depth = depth.view;
    auto output = clspeckle::make<ClspMotionOutput>();
    output.path = path.view;
    const auto call = [&](const ClspMotionInput &i, const ClspMotionOutput &o) {
        return clspMotionEnqueueCompute(motion, queue, &i, &o, 0, nullptr, nullptr);
    };
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "motion",
                      clspMotionEnqueueCompute(nullptr, queue, &input, &output, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "input",
                      clspMotionEnqueueCompute(motion, queue, nullptr, &output, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "output",
                      clspMotionEnqueueCompute(motion, queue, &input, nullptr, 0, nullptr, nullptr));
    test::check_struct_size<ClspMotionInput>("clspMotionEnqueueCompute", input, [&](ClspMotionInput *i) {
        return clspMotionEnqueueCompute(motion, queue, i, &output, 0, nullptr, nullptr);
    });
    test::check_struct_size<ClspMotionOutput>("clspMotionEnqueueCompute", output, [&](ClspMotionOutput *o) {
        return clspMotionEnqueueCompute(motion, queue, &input, o, 0, nullptr, nullptr);
    });
    test::check_enqueue_rules("clspMotionEnqueueCompute", context,
                              [&](cl_command_queue q, cl_uint count, const cl_event *events, cl_event *event) {
                                  return clspMotionEnqueueCompute(motion, q, &input, &output, count, events, event);
                              });
    // Each image, alone wrong.
    using Member = ClspImage ClspMotionInput::*;
    const auto image_rules = [&](const ClspMotionInput &base, Member member, const char *name, std::uint32_t format) {
        const auto changed = [&](const ClspImage *image) {
            ClspMotionInput i = base;
            i.*member = *image;
            return call(i, output);
        };
        test::check_image_rules("clspMotionEnqueueCompute", context, base.*member, name, format, changed, true);
        test::check_image_size_must_match("clspMotionEnqueueCompute", context, base.*member, name, changed);
    };
    ClspMotionInput full = input;
    full.normal = full.previous_normal = position.view;
    full.material = full.previous_material = ids.view;
    image_rules(full, &ClspMotionInput::depth, "depth", CLSP_FORMAT_FLOAT32X3);
    image_rules(full, &ClspMotionInput::motion, "motion", CLSP_FORMAT_FLOAT32);
    image_rules(full, &ClspMotionInput::previous_depth, "previous_depth", CLSP_FORMAT_UINT16);
    image_rules(full, &ClspMotionInput::normal, "normal", CLSP_FORMAT_FLOAT32X2);
    image_rules(full, &ClspMotionInput::previous_normal, "previous_normal", CLSP_FORMAT_FLOAT32X2);
    image_rules(full, &ClspMotionInput::material, "material", CLSP_FORMAT_FLOAT32);
    image_rules(full, &ClspMotionInput::previous_material, "previous_material", CLSP_FORMAT_UINT16);
    ClspMotionInput positions = clspeckle::make<ClspMotionInput>();
    positions.position = positions.previous_position = position.view;
    image_rules(positions, &ClspMotionInput::position, "position", CLSP_FORMAT_FLOAT32X2);
    image_rules(positions, &ClspMotionInput::previous_position, "previous_position", CLSP_FORMAT_FLOAT32);

    const auto fails = [&](const char *word, const std::function<void(ClspMotionInput &)> &change) {
        ClspMotionInput changed = input;
        change(changed);
        test::poison_last_error("clspMotionEnqueueCompute");
        EXPECT_TRUE(
            test::failed_as("clspMotionEnqueueCompute", call(changed, output), CLSP_ERROR_INVALID_ARGUMENT, word))
            << word;
    };
    fails("reserved", [](ClspMotionInput &i) { i.reserved = 1; });
    fails("roll_from_motion", [](ClspMotionInput &i) { i.roll_from_motion = 2; });
    for (const double wrong : {-1.0, std::nan(""), HUGE_VAL})
        fails("frame_time_s", [&](ClspMotionInput &i) { i.frame_time_s = wrong; });
    fails("both position and depth", [&](ClspMotionInput &i) { i.position = position.view; });
    fails("neither position nor depth", [&](ClspMotionInput &i) { i.depth = {}; });
    fails("previous_depth", [&](ClspMotionInput &i) { i.previous_position = position.view; });
    fails("previous_depth", [&](ClspMotionInput &i) { i.previous_depth = {}; });
    fails("how surfaces moved", [&](ClspMotionInput &i) { i.motion = i.previous_depth = {}; });
    fails("previous_from_current is NULL", [&](ClspMotionInput &i) { i.transform_count = 1; });
    fails("transform_count is 0", [&](ClspMotionInput &i) { i.previous_from_current = identity; });
    fails("both previous_from_current", [&](ClspMotionInput &i) {
        i.previous_from_current = identity;
        i.transform_count = 1;
    });
    fails("previous_normal needs normal", [&](ClspMotionInput &i) { i.previous_normal = position.view; });
    fails("previous_material needs material", [&](ClspMotionInput &i) { i.previous_material = ids.view; });
    double pose[24];
    std::copy(identity, identity + 12, pose);
    std::copy(identity, identity + 12, pose + 12);
    const auto transforms_fail = [&](const char *word, std::uint32_t count,
                                     const std::function<void(ClspMotionInput &)> &change) {
        fails(word, [&](ClspMotionInput &i) {
            i.motion = i.previous_depth = {};
            i.previous_from_current = pose;
            i.transform_count = count;
            change(i);
        });
    };
    const auto nothing = [](ClspMotionInput &) {};
    transforms_fail("transform_count is 3", 3, nothing);
    transforms_fail("material", 2, nothing);
    transforms_fail("roll_from_motion needs motion", 1, [](ClspMotionInput &i) { i.roll_from_motion = 1; });
    pose[7] = std::nan("");
    transforms_fail("finite", 1, nothing);
    pose[7] = 0.0;
    pose[0] = 1.1;
    transforms_fail("rotation", 1, nothing);
    pose[0] = -1.0;
    transforms_fail("reflection", 1, nothing);

    // Outputs.
    const auto output_fails = [&](ClspStatus status, const char *word,
                                  const std::function<void(ClspMotionOutput &)> &change) {
        ClspMotionOutput changed = output;
        change(changed);
        test::poison_last_error("clspMotionEnqueueCompute");
        EXPECT_TRUE(test::failed_as("clspMotionEnqueueCompute", call(input, changed), status, word)) << word;
    };
    output_fails(CLSP_ERROR_INVALID_ARGUMENT, "reserved", [](ClspMotionOutput &o) { o.reserved = 1; });
    output_fails(CLSP_ERROR_INVALID_ARGUMENT, "no image", [](ClspMotionOutput &o) { o.path = {}; });
    output_fails(CLSP_ERROR_INVALID_FORMAT, "mask", [&](ClspMotionOutput &o) { o.mask = path.view; });
    output_fails(CLSP_ERROR_OVERLAP, "correlation", [&](ClspMotionOutput &o) { o.correlation = path.view; });
    output_fails(CLSP_ERROR_OVERLAP, "depth", [&](ClspMotionOutput &o) { o.path = depth.view; });
    output_fails(CLSP_ERROR_OVERLAP, "motion", [&](ClspMotionOutput &o) { o.shift = vectors.view; });

    // Without the focal length.
    auto blind_desc = valid();
    blind_desc.fx_px = blind_desc.fy_px = 0.0;
    const clspeckle::Motion blind(context, blind_desc);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "fx_px",
                      clspMotionEnqueueCompute(blind, queue, &input, &output, 0, nullptr, nullptr));
    EXPECT_CLSP_OK(clspMotionEnqueueCompute(blind, queue, &positions, &output, 0, nullptr, nullptr));
    output.shift = shift.view;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "fx_px",
                      clspMotionEnqueueCompute(blind, queue, &positions, &output, 0, nullptr, nullptr));
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
    const auto fails = [&](double ClspMaterial::*member, const char *name, const std::vector<double> &values) {
        for (const double value : values) {
            std::vector<ClspMaterial> materials(2, good);
            materials[1].*member = value;
            EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, name,
                              clspMaterialTableCreate(context, materials.data(), 2, &table));
            EXPECT_TRUE(test::last_error().message && std::strstr(test::last_error().message, "material 1")) << name;
            EXPECT_EQ(nullptr, table);
        }
    };
    const double nan = std::nan("");
    fails(&ClspMaterial::roughness_rms_m, "roughness_rms_m", {-1e-9, nan});
    fails(&ClspMaterial::degree_of_polarization, "degree_of_polarization", {1.001, nan});
    fails(&ClspMaterial::correlation_time_s, "correlation_time_s", {-1.0, nan});
    for (const double wrong : {0.0, -1.0, nan}) {
        fails(&ClspMaterial::lateral_correlation_length_m, "lateral_correlation_length_m", {wrong});
        fails(&ClspMaterial::axial_correlation_length_m, "axial_correlation_length_m", {wrong});
        fails(&ClspMaterial::rotation_correlation_angle_rad, "rotation_correlation_angle_rad", {wrong});
    }
    fails(&ClspMaterial::subsurface_fraction, "subsurface_fraction", {-0.1, 1.1, nan});
    auto reserved = good;
    reserved.reserved = 1;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "reserved", clspMaterialTableCreate(context, &reserved, 1, &table));
    std::vector<ClspMaterial> uneven(2, good);
    uneven[1].struct_size = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "materials[1]",
                      clspMaterialTableCreate(context, uneven.data(), 2, &table));
}

TEST_F(Motion, RetainAndRelease) {
    ClspMaterialTable table = nullptr;
    const auto material = clspeckle::make<ClspMaterial>();
    ASSERT_CLSP_OK(clspMaterialTableCreate(context, &material, 1, &table));
    ClspMotion motion = nullptr;
    auto desc = valid();
    desc.materials = table;
    ASSERT_CLSP_OK(clspMotionCreate(context, &desc, &motion));
    EXPECT_CLSP_OK(clspMaterialTableRetain(table));
    EXPECT_CLSP_OK(clspMaterialTableRelease(table));
    EXPECT_CLSP_OK(clspMaterialTableRelease(table)); // the motion still has it
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "table", clspMaterialTableRelease(table));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "table", clspMaterialTableRetain(nullptr));
    EXPECT_CLSP_OK(clspMaterialTableRelease(nullptr));
    EXPECT_CLSP_OK(clspMotionRetain(motion));
    EXPECT_CLSP_OK(clspMotionRelease(motion));
    EXPECT_CLSP_OK(clspMotionCheck(motion, queue));
    EXPECT_CLSP_OK(clspMotionRelease(motion));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "motion", clspMotionRelease(motion));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "motion", clspMotionRetain(nullptr));
    EXPECT_CLSP_OK(clspMotionRelease(nullptr));
}

} // namespace
