// Patterns of diffractive elements: every call of doe.h, its defaults, its budget, and what bad arguments get.
#include "test_support.hpp"

#include <numeric>

namespace {

using test::DeviceTest;

class Doe : public DeviceTest {
  protected:
    static constexpr std::uint32_t side = 16;
    // A binary grating of one period along x.
    std::vector<float> phase = [] {
        std::vector<float> values(side * side);
        for (std::size_t i = 0; i < values.size(); ++i)
            values[i] = i % side < side / 2 ? 0.0f : static_cast<float>(M_PI);
        return values;
    }();
    const std::vector<std::int32_t> orders = {1, 0, -1, 0};

    ClspDoePatternDesc valid() const {
        auto desc = clspeckle::make<ClspDoePatternDesc>();
        desc.width = desc.height = side;
        desc.phase = phase.data();
        desc.pixel_pitch_m = 2e-6;
        desc.dot_count = 2;
        desc.dot_orders = orders.data();
        desc.image_width = 64;
        desc.image_height = 48;
        return desc;
    }
    void refused(ClspStatus status, const char *words, const ClspDoePatternDesc &desc) {
        ClspDoePattern pattern = nullptr;
        EXPECT_CLSP_FAILS(status, words, clspDoePatternCreate(context.get(), &desc, &pattern));
        EXPECT_EQ(nullptr, pattern);
    }
};

TEST_F(Doe, InitFunctionsWriteDefaults) {
    test::check_init<ClspBeamProfile>("clspBeamProfileInit", clspBeamProfileInit);
    test::check_init<ClspDoeDefects>("clspDoeDefectsInit", clspDoeDefectsInit);
    test::check_init<ClspDoePatternDesc>("clspDoePatternDescInit", clspDoePatternDescInit);
    test::check_init<ClspSpotPatternDesc>("clspSpotPatternDescInit", clspSpotPatternDescInit);
    ClspBeamProfile beam;
    ASSERT_CLSP_OK(clspBeamProfileInit(&beam, sizeof beam));
    EXPECT_EQ(CLSP_BEAM_GAUSSIAN, beam.kind);
    EXPECT_EQ(0.25e-3 * 0.25e-3, beam.covariance_xx_m2);
    EXPECT_EQ(1.0, beam.m_squared);
    ClspDoeDefects defects;
    ASSERT_CLSP_OK(clspDoeDefectsInit(&defects, sizeof defects));
    EXPECT_EQ(0u, defects.levels);
    EXPECT_EQ(0.0, defects.etch_noise_rms_m);
    EXPECT_EQ(4u, defects.feature_samples);
    ClspDoePatternDesc desc;
    ASSERT_CLSP_OK(clspDoePatternDescInit(&desc, sizeof desc));
    EXPECT_EQ(1u, desc.periodic);
    EXPECT_EQ(940e-9, desc.wavelength_m);
    EXPECT_EQ(2048u, desc.image_width);
    EXPECT_EQ(CLSP_DOE_EVALUATION_AUTO, desc.evaluation);
    ClspSpotPatternDesc spots;
    ASSERT_CLSP_OK(clspSpotPatternDescInit(&spots, sizeof spots));
    EXPECT_EQ(0.5, spots.half_extent_x);
}

TEST_F(Doe, BooksOfABinaryGrating) {
    const clspeckle::DoePattern pattern(context, valid());
    const ClspDoePatternInfo info = pattern.info();
    EXPECT_EQ(64u, info.image_width);
    EXPECT_EQ(48u, info.image_height);
    EXPECT_NEAR(940e-9 / 4e-6, info.half_extent_x, 1e-12);
    EXPECT_NEAR(940e-9 / 32e-6, info.order_spacing_x, 1e-12);
    // 16 samples of a period: the first order of the sampled grating under the pixel's envelope.
    const double expected = std::pow(2 / M_PI, 2);
    EXPECT_NEAR(2 * expected, info.dots, 0.01);
    EXPECT_NEAR(0, info.zero_order, 1e-6);
    EXPECT_NEAR(1, info.dots + info.zero_order + info.ghosts + info.scatter, 1e-6);
    EXPECT_NEAR(0, info.uniformity_rms, 1e-5);
    EXPECT_GT(info.device_memory_bytes, 0u);
    const std::vector<double> shares = pattern.dot_shares();
    ASSERT_EQ(2u, shares.size());
    EXPECT_NEAR(expected, shares[0], 0.005);
    // Back from radiant intensity to power.
    const std::vector<float> texels = pattern.texels();
    double power = 0;
    for (std::uint32_t y = 0; y < 48; ++y)
        for (std::uint32_t x = 0; x < 64; ++x) {
            const double u = ((x + 0.5) / 32 - 1) * info.half_extent_x, v = ((y + 0.5) / 24 - 1) * info.half_extent_y;
            power += texels[y * 64 + x] / std::sqrt(1 - u * u - v * v);
        }
    power *= 4 * info.half_extent_x * info.half_extent_y / (64 * 48);
    EXPECT_NEAR(info.inside_image, power, 1e-6);
}

TEST_F(Doe, TheSameAgainComesFromMemory) {
    auto desc = valid();
    desc.power_w = 1.25; // not asked for before
    const clspeckle::DoePattern first(context, desc), second(context, desc);
    EXPECT_EQ(CLSP_DOE_SOURCE_COMPUTED, first.info().source);
    EXPECT_EQ(CLSP_DOE_SOURCE_MEMORY, second.info().source);
    EXPECT_EQ(first.texels(), second.texels());
    phase[5] += 0.1f;
    EXPECT_EQ(CLSP_DOE_SOURCE_COMPUTED, clspeckle::DoePattern(context, desc).info().source);
}

TEST_F(Doe, ProgressIsToldAndCancels) {
    auto desc = valid();
    const double wavelengths[] = {930e-9, 950e-9};
    desc.line_count = 2;
    desc.line_wavelengths_m = wavelengths;
    for (const std::uint32_t evaluation : {CLSP_DOE_EVALUATION_ORDERS, CLSP_DOE_EVALUATION_APERTURE}) {
        desc.evaluation = evaluation;
        desc.power_w = 3.5; // not asked for before
        const std::uint64_t before = context.info().allocated_bytes;
        ClspDoePattern pattern = nullptr;
        desc.progress = [](void *, const char *what, double fraction) -> std::int32_t {
            EXPECT_NE(nullptr, std::strstr(what, "laser line"));
            return fraction < 0.5;
        };
        EXPECT_CLSP_FAILS(CLSP_ERROR_CANCELLED, "stop", clspDoePatternCreate(context, &desc, &pattern));
        EXPECT_EQ(nullptr, pattern);
        EXPECT_EQ(before, context.info().allocated_bytes);
        desc.progress = nullptr;
        std::vector<double> calls;
        const clspeckle::DoePattern told(context, desc, [&](const std::string &, double fraction) {
            if (!calls.empty()) {
                EXPECT_GE(fraction, calls.back());
            }
            calls.push_back(fraction);
            return true;
        });
        EXPECT_EQ(evaluation == CLSP_DOE_EVALUATION_ORDERS ? 10u : 8u, calls.size());
        EXPECT_EQ(CLSP_DOE_SOURCE_COMPUTED, told.info().source); // what was cancelled is not remembered
    }
}

TEST_F(Doe, NoDeviceMemoryStays) {
    const ClspContextInfo before = context.info();
    auto desc = valid();
    desc.power_w = 2.5;
    desc.evaluation = CLSP_DOE_EVALUATION_APERTURE;
    auto beam = clspeckle::make<ClspBeamProfile>();
    beam.covariance_xx_m2 = beam.covariance_yy_m2 = 2.5e-9;
    desc.beam = &beam;
    const clspeckle::DoePattern pattern(context, desc);
    EXPECT_NEAR(1, pattern.info().dots + pattern.info().zero_order + pattern.info().ghosts + pattern.info().scatter,
                1e-6);
    EXPECT_EQ(before.allocated_bytes, context.info().allocated_bytes);
}

TEST_F(Doe, IdealDotsAndLookup) {
    auto desc = clspeckle::make<ClspSpotPatternDesc>();
    const std::vector<double> directions = {0.1, 0.0, -0.1, 0.05};
    desc.count = 2;
    desc.directions = directions.data();
    desc.image_width = desc.image_height = 128;
    desc.half_extent_x = desc.half_extent_y = 0.2;
    const clspeckle::DoePattern dots(context, desc);
    EXPECT_NEAR(1, dots.info().inside_image, 1e-6);
    EXPECT_EQ(2u, dots.info().dot_count);
    const std::vector<float> texels = dots.texels();
    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    pattern_desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
    pattern_desc.width = pattern_desc.height = 128;
    pattern_desc.texels = texels.data();
    pattern_desc.half_extent_x = pattern_desc.half_extent_y = 0.2;
    pattern_desc.filter = CLSP_FILTER_AREA;
    const clspeckle::Pattern pattern(context, pattern_desc);
    // One pixel at each dot, one between; no neighbour shows a surface beyond the image's edge.
    const double z = std::sqrt(1 - 0.01), z2 = std::sqrt(1 - 0.01 - 0.0025);
    const std::vector<float> positions = {0.1f,  0.0f,  static_cast<float>(z), 0.0f, 0.0f, 1.0f,
                                          -0.1f, 0.05f, static_cast<float>(z2)};
    auto image = upload(positions, 3, 1, CLSP_FORMAT_FLOAT32X3);
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.position = image.view;
    auto out = make_image(3, 1, CLSP_FORMAT_FLOAT32);
    pattern.enqueue_lookup(queue, geometry, out.view);
    const auto got = download<float>(out);
    EXPECT_GT(got[0], 0.0f);
    EXPECT_GT(got[2], 0.0f);
    EXPECT_NEAR(0, got[1], 1e-3 * got[0]) << "the footprint ends before the dots";
}

TEST_F(Doe, HandlesAndLengths) {
    const clspeckle::DoePattern pattern(context, valid());
    EXPECT_CLSP_OK(clspDoePatternRetain(pattern.get()));
    EXPECT_CLSP_OK(clspDoePatternRelease(pattern.get()));
    EXPECT_CLSP_OK(clspDoePatternRelease(nullptr));
    std::vector<float> texels(64 * 48);
    std::vector<double> shares(2);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "3072", clspDoePatternGetTexels(pattern.get(), 10, texels.data()));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDoePatternGetTexels(pattern.get(), 64 * 48, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "2 wanted",
                      clspDoePatternGetDotShares(pattern.get(), 3, shares.data()));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "info is NULL", clspDoePatternGetInfo(pattern.get(), nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "pattern", clspDoePatternRetain(nullptr));
    const auto desc = valid();
    ClspDoePattern made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspDoePatternCreate(nullptr, &desc, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "pattern is NULL",
                      clspDoePatternCreate(context.get(), &desc, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc is NULL", clspDoePatternCreate(context.get(), nullptr, &made));
    const auto spots = clspeckle::make<ClspSpotPatternDesc>();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count is 0", clspSpotPatternCreate(context.get(), &spots, &made));
    EXPECT_EQ(nullptr, made);
}

TEST_F(Doe, ContradictionsAreRefused) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    auto desc = valid();
    desc.phase = nullptr;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "phase is NULL", desc);
    desc = valid();
    desc.width = 0;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "0 x 16", desc);
    desc = valid();
    desc.width = CLSP_MAX_DOE_SAMPLES + 1;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "8192", desc);
    desc = valid();
    desc.pixel_pitch_m = 0;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "pixel_pitch_m", desc);
    desc.pixel_pitch_m = nan;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "pixel_pitch_m", desc);
    desc = valid();
    desc.design_levels = 3;
    refused(CLSP_ERROR_INVALID_DATA, "3 levels", desc);
    desc = valid();
    desc.doe_width_m = 1e-5;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "smaller than its own cell", desc);
    desc.doe_width_m = 5e-4;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "larger than the DOE", desc);
    desc = valid();
    desc.periodic = 0;
    desc.evaluation = CLSP_DOE_EVALUATION_ORDERS;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "does not repeat", desc);
    desc = valid();
    desc.dot_count = 2;
    desc.dot_orders = nullptr;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "dot_orders", desc);
    desc = valid();
    const std::vector<std::int32_t> beyond = {40, 0, 1, 0};
    desc.dot_orders = beyond.data();
    refused(CLSP_ERROR_INVALID_ARGUMENT, "beyond 90 degrees", desc);
    desc = valid();
    desc.line_count = 1;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "line_wavelengths_m is NULL", desc);
    desc.line_count = CLSP_MAX_DOE_LINES + 1;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "at most 16", desc);
    desc = valid();
    desc.max_memory_bytes = 1000;
    desc.power_w = 9; // in no cache: what is known needs no device memory
    refused(CLSP_ERROR_OUT_OF_MEMORY, "max_memory_bytes", desc);
    desc = valid();
    desc.power_w = -1;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "power_w", desc);
    desc = valid();
    desc.half_extent_x = 1.1;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "half_extent_x", desc);
    desc = valid();
    desc.reserved = 1;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "reserved", desc);
    desc = valid();
    desc.evaluation = 3;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "CLSP_DOE_EVALUATION_ORDERS (1) or CLSP_DOE_EVALUATION_APERTURE (2)", desc);
    auto beam = clspeckle::make<ClspBeamProfile>();
    desc = valid();
    desc.beam = &beam;
    beam.kind = 9;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "beam->kind is 9, expected CLSP_BEAM_GAUSSIAN (0), ", desc);
    beam = clspeckle::make<ClspBeamProfile>();
    beam.covariance_xy_m2 = 1;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "positive definite", desc);
    beam = clspeckle::make<ClspBeamProfile>();
    beam.kind = CLSP_BEAM_IMAGE;
    beam.image_width = beam.image_height = 4;
    refused(CLSP_ERROR_INVALID_ARGUMENT, "beam->image is NULL", desc);
    const std::vector<float> image(16, static_cast<float>(nan));
    beam.image = image.data();
    refused(CLSP_ERROR_INVALID_DATA, "finite", desc);
    phase[17] = static_cast<float>(nan);
    refused(CLSP_ERROR_INVALID_DATA, "phase[1][1]", valid());
}

} // namespace
