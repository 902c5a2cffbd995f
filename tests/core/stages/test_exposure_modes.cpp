// The independent patterns of an exposure, against integrals of the kernels exp(-L |t - t'|) and exp(-L^2 (t - t')^2)
// that they expand.
#include "stages/exposure_modes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace {

using clsp::ExposureCorrelation;
using clsp::ExposureMode;

// int_0^1 int_0^1 exp(-x |t - t'|) dt dt', or of exp(-x^2 (t - t')^2).
double mean_correlation(double x, ExposureCorrelation law) {
    if (law == ExposureCorrelation::kGaussian)
        return x < 1e-3 ? 1.0 - x * x / 6.0
                        : std::sqrt(std::acos(-1.0)) * std::erf(x) / x + std::expm1(-x * x) / (x * x);
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

// The same of exp(-L^2 ((s - t)^2 + (t - u)^2 + (u - s)^2)), by the differences a = t - s and b = u - s: 2 L^2 (a^2 - a
// b + b^2), and three points that span d lie in [0, 1] with the measure 1 - d.
double mean_gaussian_cube(double path) {
    constexpr int kSteps = 400;
    double sum = 0.0;
    for (int i = 0; i < 2 * kSteps; ++i)
        for (int j = 0; j < 2 * kSteps; ++j) {
            const double a = (i + 0.5) / kSteps - 1.0, b = (j + 0.5) / kSteps - 1.0;
            const double span = std::max({0.0, a, b}) - std::min({0.0, a, b});
            sum += std::max(0.0, 1.0 - span) * std::exp(-2.0 * path * path * (a * a - a * b + b * b));
        }
    return sum / (double(kSteps) * kSteps);
}

class ExposureModes : public testing::TestWithParam<std::tuple<double, ExposureCorrelation>> {
  protected:
    const double path = std::get<0>(GetParam());
    const ExposureCorrelation law = std::get<1>(GetParam());
    const std::vector<ExposureMode> modes = clsp::exposure_modes(path, law);
    double midpoints() const { return 0.5 * (path / 128.0) * (path / 128.0); }
    template <typename Term> double sum(Term term) const {
        return std::accumulate(modes.begin(), modes.end(), 0.0,
                               [&](double s, const ExposureMode &m) { return s + term(m); });
    }
};

INSTANTIATE_TEST_SUITE_P(Paths, ExposureModes,
                         testing::Combine(testing::Values(0.0, 0.01, 0.1, 0.4, 1.0, 2.5, 6.0, 16.0, 32.0),
                                          testing::Values(ExposureCorrelation::kField,
                                                          ExposureCorrelation::kGaussian)));

TEST_P(ExposureModes, HaveTheLightOfTheExposure) {
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight; }), 1.0, 1e-9);
    // The few patterns have all of the variance of the integral equation on its midpoints, 128 of them, which are off
    // by what a cell varies and by the kink at t = t', 2 L / (3 128^2).
    const bool gaussian = law == ExposureCorrelation::kGaussian;
    const double variance = mean_correlation((gaussian ? std::sqrt(2.0) : 2.0) * path, law);
    const double cube = gaussian ? mean_gaussian_cube(path) : mean_cube(path);
    const double midpoints = this->midpoints();
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.weight; }), variance,
                1e-9 + midpoints * variance + (gaussian ? 0.0 : path / (1.4 * 128.0 * 128.0)));
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.weight * m.weight; }), cube,
                (0.011 + 2.0 * midpoints) * cube);
}

TEST_P(ExposureModes, ShareWhatKeepsItsPhase) {
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.coherent_gain * m.coherent_gain; }), 1.0, 1e-9);
    // How steady and changing light beat: sum_k w_k a_k^2 is the mean of the kernel.
    const double beat = mean_correlation(path, law);
    EXPECT_NEAR(sum([](const ExposureMode &m) { return m.weight * m.weight * m.coherent_gain * m.coherent_gain; }),
                beat, (0.005 + midpoints()) * beat);
}

TEST_P(ExposureModes, AreFew) {
    EXPECT_GE(modes.size(), 1u);
    EXPECT_LE(modes.size(), 64u); // as many as a frame's counter has room for
    if (path == 0.0) {
        EXPECT_EQ(modes.size(), 1u);
    }
    for (std::size_t i = 1; i < modes.size(); ++i)
        // Those of a Gaussian correlation are nearly equal up to where they end: the one after the kept ones stands for
        // several.
        EXPECT_LE(modes[i].weight, modes[i - 1].weight * (law == ExposureCorrelation::kGaussian ? 1.3 : 1.0 + 1e-9));
}

} // namespace
