// Which flats show the camera's response by their exposure times, and what light one lamp gave them.
#include "capture/exposure_series.hpp"
#include "capture_support.hpp"
#include "simulator/host_noise.hpp"

#include <cmath>
#include <functional>
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

const std::vector<double> kTimes = {1.0, 2.0, 3.0, 4.0, 6.0, 8.0};

TEST(ExposureSeries, TakesSixTimes) {
    const auto count = [](const std::vector<double> &times) {
        return exposure_series(layout_of(times), light_of(times, 10.0)).flats.size();
    };
    EXPECT_EQ(count({}), 0u);
    EXPECT_EQ(count({1.0, 2.0, 3.0, 4.0, 5.0}), 0u);
    EXPECT_EQ(count({1.0, 2.0, 3.0, 4.0, 5.0, 5.0}), 0u);
    EXPECT_EQ(count(kTimes), 6u);
    EXPECT_EQ(count({8.0, 3.0, 1.0, 2.0, 2.0, 4.0, 6.0}), 7u);
}

TEST(ExposureSeries, ALampThatIsSetAnewIsNoSeries) {
    const CaptureLayout layout = layout_of(kTimes);
    const auto is_series = [&](const std::function<double(double)> &light) {
        std::vector<double> of = {0.0};
        for (const double time : kTimes)
            of.push_back(light(time));
        return !exposure_series(layout, of).flats.empty();
    };
    EXPECT_TRUE(is_series([](double t) { return 100.0 * t; }));
    EXPECT_TRUE(is_series([](double t) { return 100.0 * std::pow(t, 0.9); })) << "a bent response";
    EXPECT_TRUE(is_series([](double t) { return 100.0 * t + 30.0; })) << "a shutter that opens longer";
    EXPECT_FALSE(is_series([](double t) { return t < 7.0 ? 100.0 * t : 400.0; })) << "half the light";
    EXPECT_FALSE(is_series([](double) { return 200.0; })) << "brought to one level";
    EXPECT_FALSE(is_series([](double t) { return 800.0 / t; })) << "the other way round";
    EXPECT_FALSE(is_series([](double t) { return t < 7.0 ? 100.0 * t : -1.0; }));
}

// A response is smooth: gamma of 0.95 leaves 0.6e-3 about a cubic. A lamp is not. Six times leave two degrees
// of freedom, of which Student's quantile is 4.30.
TEST(ExposureSeries, WhatIsNotSmoothIsTheLamps) {
    const CaptureLayout layout = layout_of(kTimes);
    const auto error = [&](double gamma, const std::vector<double> &lamp) {
        std::vector<double> light = {0.0};
        for (std::size_t k = 0; k < kTimes.size(); ++k)
            light.push_back(100.0 * std::pow(kTimes[k], gamma) * (lamp.empty() ? 1.0 : lamp[k]));
        return exposure_series(layout, light).light_error;
    };
    EXPECT_NEAR(error(1.0, {}), 1e-3, 1e-9);
    EXPECT_LT(error(0.95, {}), 2e-3);
    EXPECT_GT(error(1.0, {1.0, 1.01, 0.99, 1.005, 0.995, 1.0}), 5e-3);
    // The mean square over many draws is that of the lamp.
    double square = 0.0;
    constexpr int kDraws = 2000;
    for (int draw = 0; draw < kDraws; ++draw) {
        HostNoise noise(20261130, 0, draw, HostStream::kProbe);
        std::vector<double> lamp;
        for (std::size_t k = 0; k < kTimes.size(); ++k)
            lamp.push_back(1.0 + 0.01 * noise.normal());
        square += std::pow(error(1.0, lamp), 2) / kDraws;
    }
    // Chi-square of 4000 degrees of freedom: 1.1 % of a deviation.
    EXPECT_NEAR(std::sqrt(square), 0.01 * 4.3027 / 1.96, 0.001);
}

TEST(ExposureSeries, LeavesOutWhatIsSaturated) {
    const std::vector<double> times = {1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0};
    const CaptureLayout layout = layout_of(times);
    const double full = layout.maximum_code() - layout.black_level_dn;
    std::vector<double> light = light_of(times, 0.13 * full);
    light.back() = full;
    EXPECT_EQ(exposure_series(layout, light).flats, (std::vector<std::size_t>{1, 2, 3, 4, 5, 6}));
    light[6] = full;
    EXPECT_TRUE(exposure_series(layout, light).flats.empty()) << "five are left";
}

TEST(ExposureSeries, IsOfOneFNumber) {
    CaptureLayout layout = layout_of(kTimes);
    layout.sequences[2].f_number = 4.0;
    EXPECT_TRUE(exposure_series(layout, light_of(kTimes, 100.0)).flats.empty());
}

// The residuals of the nearest line are normal to its offset and to its slope.
TEST(ExposureSeries, OneLampGivesALine) {
    CaptureLayout layout = layout_of(kTimes);
    for (std::size_t k = 1; k <= kTimes.size(); ++k)
        layout.sequences[k].light_error = 1e-3;
    std::vector<double> line = {7.0}, bent = {7.0};
    for (const double time : kTimes) {
        line.push_back(3.0 + 100.0 * time);
        bent.push_back(100.0 * std::pow(time, 0.95));
    }
    const std::vector<double> given = line, curve = bent;
    tie_light_to_exposures(layout, line);
    for (std::size_t k = 0; k < line.size(); ++k)
        EXPECT_NEAR(line[k], given[k], 1e-9) << k;
    tie_light_to_exposures(layout, bent);
    double along_offset = 0.0, along_time = 0.0;
    for (std::size_t k = 1; k < bent.size(); ++k) {
        const double off = bent[k] / curve[k] - 1.0;
        along_offset += off / curve[k];
        along_time += off * kTimes[k - 1] / curve[k];
    }
    EXPECT_NEAR(along_offset, 0.0, 1e-12);
    EXPECT_NEAR(along_time, 0.0, 1e-12);
    EXPECT_NEAR((bent[6] - bent[1]) / (kTimes[5] - kTimes[0]), (bent[3] - bent[2]) / (kTimes[2] - kTimes[1]), 1e-9);
    std::vector<double> five = curve;
    five.back() = -1.0;
    const std::vector<double> before = five;
    tie_light_to_exposures(layout, five);
    EXPECT_EQ(five, before) << "too few";
}

} // namespace
