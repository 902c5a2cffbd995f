// The independent patterns of an exposure, against closed forms of the kernel exp(-L |t - t'|) that they expand.
#include "simulator/exposure_modes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace {

using clsp::ExposureMode;

// int_0^1 int_0^1 exp(-x |t - t'|) dt dt'.
double mean_correlation(double x) {
    return x < 1e-4 ? 1.0 - x / 3.0 : 2.0 * (std::exp(-x) - 1.0 + x) / (x * x);
}

// int int int exp(-L (|s - t| + |t - u| + |u - s|)) = 6 int_0^1 (1 - d) d exp(-2 L d) dd: the three points span 2 d.
double mean_cube(double path) {
    constexpr int kSteps = 20000;
    double sum = 0.0;
    for (int i = 0; i < kSteps; ++i) {
        const double d = (i + 0.5) / kSteps;
        sum += 6.0 * (1.0 - d) * d * std::exp(-2.0 * path * d) / kSteps;
    }
    return sum;
}

class ExposureModes : public testing::TestWithParam<double> {
  protected:
    const std::vector<ExposureMode> modes = clsp::exposure_modes(GetParam());
    static double midpoints() { return 0.5 * (GetParam() / 128.0) * (GetParam() / 128.0); }
    template <typename Term> double sum(Term term) const {
        return std::accumulate(modes.begin(), modes.end(), 0.0,
                               [&](double s, const ExposureMode &m) { return s + term(m); });
    }
};

INSTANTIATE_TEST_SUITE_P(Paths, ExposureModes, testing::Values(0.0, 0.01, 0.1, 0.4, 1.0, 2.5, 6.0, 16.0, 32.0));

TEST_P(ExposureModes, HaveTheLightOfTheExposure) {
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight; }), 1.0, 1e-9);
    // The few patterns have all of the variance of the integral equation on its midpoints, 128 of them, which are off
    // by what a cell varies and by the kink at t = t', 2 L / (3 128^2).
    const double variance = mean_correlation(2.0 * GetParam()), cube = mean_cube(GetParam());
    const double midpoints = this->midpoints();
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.weight; }), variance,
                1e-9 + midpoints * variance + GetParam() / (1.4 * 128.0 * 128.0));
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.weight * m.weight; }), cube,
                (0.011 + 2.0 * midpoints) * cube);
}

TEST_P(ExposureModes, ShareWhatKeepsItsPhase) {
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.coherent_gain * m.coherent_gain; }), 1.0, 1e-9);
    // How steady and changing light beat: sum_k w_k a_k^2 is the mean of the kernel.
    const double beat = mean_correlation(GetParam());
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.weight * m.coherent_gain * m.coherent_gain; }),
                beat, (0.005 + midpoints()) * beat);
}

TEST_P(ExposureModes, AreFew) {
    EXPECT_GE(modes.size(), 1u);
    EXPECT_LE(modes.size(), 64u); // as many as a frame's counter has room for
    if (GetParam() == 0.0) {
        EXPECT_EQ(modes.size(), 1u);
    }
    for (std::size_t i = 1; i < modes.size(); ++i)
        EXPECT_LE(modes[i].weight, modes[i - 1].weight * (1.0 + 1e-9));
}

} // namespace
