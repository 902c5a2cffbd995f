#include "pipeline/exposure_steps.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

constexpr std::uint32_t kLeastSteps = 4;
constexpr double kLongestPath = 32.0; // of exposure_modes()
// By fewer lines of the laser: of the squared contrast of the whole exposure, to which a weak pattern adds little.
constexpr double kLineError = 1e-3;

// Correlation of the intensity over a path.
double intensity_correlation(double path, Dynamics dynamics) {
    if (dynamics != Dynamics::kContinuous)
        return std::exp(-2.0 * path);
    const double d = kKnotsPerPath * path;
    if (d >= 2.0)
        return 0.0;
    const double rho = (1.0 - 0.5 * d) * std::cos(0.5 * M_PI * d) + std::sin(0.5 * M_PI * d) / M_PI;
    return rho * rho;
}

// C^2 of the continuous exposure, by Simpson's rule.
double squared_contrast(double length, Dynamics dynamics) {
    constexpr int kIntervals = 2048;
    double sum = 0.0;
    for (int i = 0; i <= kIntervals; ++i) {
        const double l = length * i / kIntervals;
        const double weight = i == 0 || i == kIntervals ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
        sum += weight * (length - l) * intensity_correlation(l, dynamics);
    }
    return 2.0 / (length * length) * sum * (length / kIntervals / 3.0);
}

double squared_contrast_of_steps(std::uint32_t count, double step, Dynamics dynamics) {
    double sum = count;
    for (std::uint32_t k = 1; k < count; ++k)
        sum += 2.0 * (count - k) * intensity_correlation(k * step, dynamics);
    return sum / (double(count) * count);
}

} // namespace

ExposureSteps exposure_steps(const ExposureParameters &p) {
    const double exposure_path = p.path;
    const std::uint32_t sub_exposures = p.sub_exposures;
    const Dynamics dynamics = p.dynamics;
    ExposureSteps steps;
    if (exposure_path == 0.0) {
        steps.count = std::max(1u, sub_exposures);
        return steps;
    }
    if (p.correlation == ExposureCorrelation::kGaussian) {
        if (sub_exposures != 0)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("sub_exposures is {}, but a Gaussian exposure_correlation says itself how many there are; "
                            "leave it 0",
                            sub_exposures));
        if (exposure_path > kLongestPath)
            throw Error(Status::kInvalidArgument,
                        fmt::format("exposure_path is {}, with a Gaussian exposure_correlation it must be 0 to {}",
                                    exposure_path, kLongestPath));
        steps.modes = exposure_modes(exposure_path, p.correlation);
        steps.count = static_cast<std::uint32_t>(steps.modes.size());
        // So far that nothing is left of the field.
        if (dynamics == Dynamics::kContinuous)
            steps.path = 2.0 / kKnotsPerPath;
        else
            steps.correlation = 0.0;
        return steps;
    }
    const double wanted = squared_contrast(exposure_path, dynamics);
    const double enough = std::max(double(kLeastSteps), std::ceil(2.0 / wanted));
    const double count = sub_exposures == 0 ? enough : double(sub_exposures);
    if (count > kMaxSubstep || count * wanted <= 1.0)
        throw Error(Status::kInvalidArgument,
                    fmt::format("exposure_path is {}, which averages over {:.3g} independent patterns; it takes more "
                                "sub-exposures than that ({} would do), and there may be at most {}",
                                exposure_path, 1.0 / wanted, enough, kMaxSubstep));
    steps.count = static_cast<std::uint32_t>(count);
    // C_n^2 falls from 1 to 1/n as the step grows.
    double low = 0.0, high = exposure_path;
    while (squared_contrast_of_steps(steps.count, high, dynamics) > wanted)
        high *= 2.0;
    for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (squared_contrast_of_steps(steps.count, middle, dynamics) > wanted ? low : high) = middle;
    }
    const double step = 0.5 * (low + high);
    if (dynamics == Dynamics::kContinuous)
        steps.path = step;
    else
        steps.correlation = std::exp(-step);
    return steps;
}

ExposureSteps independent_exposures(const ExposureParameters &p) {
    ExposureSteps steps;
    steps.independent = true;
    steps.modes = p.path == 0.0 ? std::vector<ExposureMode>{{1.0, 1.0}} : exposure_modes(p.path, p.correlation);
    steps.count = static_cast<std::uint32_t>(steps.modes.size());
    double variance = 0.0;
    for (const ExposureMode &mode : steps.modes)
        variance += mode.weight * mode.weight;
    const std::vector<LaserLine> lines = equal_lines(p.line_count);
    for (const ExposureMode &mode : steps.modes) {
        const double share = mode.weight * mode.weight / variance;
        steps.lines.push_back(fewest_lines(lines, p.dephasing_rad, kLineError / (steps.count * share)));
    }
    return steps;
}

} // namespace clsp
