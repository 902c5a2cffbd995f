// Which flats show the camera's response by their exposure times, and what light one lamp gave them.
#include "capture/exposure_series.hpp"
#include "capture_support.hpp"

#include <gtest/gtest.h>
#include <string>
#include <vector>

namespace {

using namespace clsp;

// Dark frames, then flats of these exposure times.
CaptureLayout layout_of(const std::vector<double> &times_ms) {
    CaptureLayout layout = camera_layout(16, 16);
    add_sequence(layout, "dark", CaptureScene::kDark, false, 2);
    for (std::size_t k = 0; k < times_ms.size(); ++k) {
        add_sequence(layout, "flat_" + std::to_string(k), CaptureScene::kFlat, false, 2);
        layout.sequences.back().exposure_ms = times_ms[k];
    }
    return layout;
}

std::vector<double> light_of(const std::vector<double> &times_ms, double dn_per_ms) {
    std::vector<double> light = {0.0};
    for (const double time : times_ms)
        light.push_back(dn_per_ms * time);
    return light;
}

TEST(ExposureSeries, TakesThreeTimes) {
    const auto count = [](const std::vector<double> &times) {
        return exposure_series(layout_of(times), light_of(times, 10.0)).size();
    };
    EXPECT_EQ(count({}), 0u);
    EXPECT_EQ(count({1.0, 2.0}), 0u);
    EXPECT_EQ(count({1.0, 2.0, 2.0}), 0u);
    EXPECT_EQ(count({1.0, 2.0, 3.0}), 3u);
    EXPECT_EQ(count({3.0, 1.0, 2.0, 2.0}), 4u);
}

TEST(ExposureSeries, ALampThatIsSetAnewIsNoSeries) {
    const std::vector<double> times = {1.0, 2.0, 4.0, 8.0};
    const CaptureLayout layout = layout_of(times);
    const auto is_series = [&](const std::vector<double> &light) { return !exposure_series(layout, light).empty(); };
    EXPECT_TRUE(is_series(light_of(times, 100.0)));
    EXPECT_TRUE(is_series({0.0, 100.0, 196.0, 380.0, 720.0})) << "a bent response";
    EXPECT_TRUE(is_series({0.0, 130.0, 230.0, 430.0, 830.0})) << "a shutter that opens longer";
    EXPECT_FALSE(is_series({0.0, 100.0, 200.0, 400.0, 400.0})) << "half the light";
    EXPECT_FALSE(is_series({0.0, 200.0, 200.0, 200.0, 200.0})) << "brought to one level";
    EXPECT_FALSE(is_series({0.0, 800.0, 400.0, 200.0, 100.0})) << "the other way round";
    EXPECT_FALSE(is_series({0.0, 100.0, 200.0, 400.0, -1.0}));
}

TEST(ExposureSeries, LeavesOutWhatIsSaturated) {
    const std::vector<double> times = {1.0, 2.0, 4.0, 8.0};
    const CaptureLayout layout = layout_of(times);
    const double full = layout.maximum_code() - layout.black_level_dn;
    EXPECT_EQ(exposure_series(layout, {0.0, 0.2 * full, 0.4 * full, 0.8 * full, full}),
              (std::vector<std::size_t>{1, 2, 3}));
    EXPECT_TRUE(exposure_series(layout, {0.0, 0.3 * full, 0.6 * full, full, full}).empty()) << "two are left";
}

TEST(ExposureSeries, IsOfOneFNumber) {
    const std::vector<double> times = {1.0, 2.0, 4.0, 8.0};
    CaptureLayout layout = layout_of(times);
    layout.sequences[2].f_number = 4.0;
    EXPECT_TRUE(exposure_series(layout, light_of(times, 100.0)).empty());
}

// The line that is nearest, relatively: of three points its equations are solved by hand.
TEST(ExposureSeries, OneLampGivesALine) {
    CaptureLayout layout = layout_of({1.0, 2.0, 4.0});
    for (std::size_t k = 1; k < 4; ++k)
        layout.sequences[k].in_exposure_series = true;
    std::vector<double> line = {7.0, 103.0, 203.0, 403.0};
    tie_light_to_exposures(layout, line);
    EXPECT_EQ(line[0], 7.0) << "in no series";
    EXPECT_NEAR(line[1], 103.0, 1e-9);
    EXPECT_NEAR(line[3], 403.0, 1e-9);
    std::vector<double> bent = {7.0, 100.0, 202.0, 400.0};
    tie_light_to_exposures(layout, bent);
    // The residuals of a line through three points are as L_k (c_k / |c L|^2) (c L), c = (2, -3, 1) for times 1, 2, 4.
    const double c[] = {2.0, -3.0, 1.0}, given[] = {100.0, 202.0, 400.0};
    double misfit = 0.0, square = 0.0;
    for (int k = 0; k < 3; ++k) {
        misfit += c[k] * given[k];
        square += c[k] * c[k] * given[k] * given[k];
    }
    for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(bent[k + 1], given[k] - misfit * c[k] * given[k] * given[k] / square, 1e-9) << k;
    std::vector<double> all_own = {7.0, 100.0, 202.0, -1.0};
    tie_light_to_exposures(layout, all_own);
    EXPECT_EQ(all_own, (std::vector<double>{7.0, 100.0, 202.0, -1.0})) << "two are on every line";
}

} // namespace
