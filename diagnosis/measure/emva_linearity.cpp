// What changes with the exposure: the signal of flats, and the dark current.
#include "measure/emva_measurement.hpp"

#include "statistics/distributions.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

constexpr double kLinearFrom = 0.05, kLinearTo = 0.95; // of saturation: the standard's numbers, section 6.7

} // namespace

// Section 6.7: a line through the signals between 5 and 95 % of saturation that weighs relative deviations alike.
void EmvaMeasurement::measure_linearity() {
    const auto set = [&](const std::string &reason) {
        result_.linearity_min = result_.linearity_max = unknown_emva_value(reason);
    };
    std::vector<const EmvaSequence *> used;
    for (const EmvaSequence &flat : flats_)
        if (flat.usable && flat.layout->exposure_ms && dark_of(flat) && flat.stack.counted_pixels > 0.0 &&
            flat.stack.top_share <= kEmvaSaturated) {
            const double signal = this->signal(flat);
            if (signal >= kLinearFrom * saturation_limit_ && signal <= kLinearTo * saturation_limit_)
                used.push_back(&flat);
        }
    std::stable_sort(used.begin(), used.end(), [](const EmvaSequence *a, const EmvaSequence *b) {
        return *a->layout->exposure_ms < *b->layout->exposure_ms;
    });
    if (flats_.empty())
        return set("the capture has no flat frames");
    if (darks_.empty() || !dark_of(flats_.front()))
        return set(reason_without_dark());
    if (!disorder_.empty())
        return set(disorder_);
    std::size_t exposures = used.empty() ? 0 : 1;
    for (std::size_t k = 1; k < used.size(); ++k) {
        const double shorter = *used[k - 1]->layout->exposure_ms, longer = *used[k]->layout->exposure_ms;
        if (longer - shorter > kEmvaSameExposure * longer)
            ++exposures;
        else if (std::abs(signal(*used[k]) - signal(*used[k - 1])) > kEmvaSameLevel * signal(*used[k]))
            return set(fmt::format("{} and {} have one exposure and two levels: the light was varied, and is not known",
                                   used[k - 1]->layout->name, used[k]->layout->name));
    }
    if (exposures < 3)
        return set(
            fmt::format("{} exposure time{} of flats between 5 and 95 % of saturation; three are needed, given as "
                        "exposure_ms",
                        exposures, exposures == 1 ? "" : "s"));
    const auto n = static_cast<Eigen::Index>(used.size());
    Eigen::MatrixXd design = Eigen::MatrixXd::Zero(n, 2);
    Eigen::VectorXd y = Eigen::VectorXd::Zero(n), weights = y, errors = y;
    // The light's fluctuation from frame to frame beyond the noise of pixels, rows and columns: of all pairs, as a
    // sequence of two frames hardly tells its own.
    double flicker = 0.0, pairs = 0.0;
    bool one_dark = true;
    const auto noise_of = [](const FrameStack &stack) {
        const VarianceComponents &parts = stack.successive.components;
        return parts.pixel / stack.counted_pixels + std::max(0.0, parts.row) / (parts.row_degrees + 1.0) +
               std::max(0.0, parts.column) / (parts.column_degrees + 1.0);
    };
    for (Eigen::Index k = 0; k < n; ++k) {
        const EmvaSequence &flat = *used[std::size_t(k)];
        y[k] = signal(flat);
        weights[k] = 1.0 / y[k];
        design.row(k) << *flat.layout->exposure_ms, 1.0;
        one_dark = one_dark && dark_of(flat) == dark_of(*used.front());
        const std::vector<double> &means = flat.stack.frame_means;
        for (std::size_t t = 1; t < means.size(); ++t, pairs += 1.0)
            flicker += (0.5 * std::pow(means[t] - means[t - 1], 2) - noise_of(flat.stack)) / (y[k] * y[k]);
    }
    flicker = std::max(0.0, flicker / std::max(1.0, pairs));
    for (Eigen::Index k = 0; k < n; ++k) {
        const EmvaSequence &flat = *used[std::size_t(k)];
        errors[k] = std::sqrt((noise_of(flat.stack) + flicker * y[k] * y[k]) / double(flat.stack.frames));
        if (!one_dark) // else the line's offset takes it
            errors[k] = std::hypot(errors[k], dark_of(flat)->level_error);
    }
    const Eigen::MatrixXd weighted = weights.asDiagonal() * design;
    const Eigen::MatrixXd inverse = (weighted.transpose() * weighted).inverse();
    const Eigen::Vector2d line = inverse * (weighted.transpose() * weights.cwiseProduct(y));
    const Eigen::VectorXd fitted = design * line;
    const Eigen::VectorXd deviation = 100.0 * (y - fitted).cwiseQuotient(fitted);
    const Eigen::MatrixXd rest =
        Eigen::MatrixXd::Identity(n, n) - design * inverse * weighted.transpose() * weights.asDiagonal();
    // The largest of several: each at the chance of one among them.
    const double quantile = student_two_sided_quantile(0.05 / double(n), std::max(1.0, pairs));
    const auto at = [&](Eigen::Index k) {
        const double error = 100.0 * rest.row(k).cwiseProduct(errors.transpose()).norm() / fitted[k];
        EmvaValue value;
        value.value = deviation[k];
        value.low = deviation[k] - quantile * error;
        value.high = deviation[k] + quantile * error;
        return value;
    };
    Eigen::Index lowest = 0, highest = 0;
    deviation.minCoeff(&lowest);
    deviation.maxCoeff(&highest);
    result_.linearity_min = at(lowest);
    result_.linearity_max = at(highest);
}

void EmvaMeasurement::measure_dark_current() {
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, longest = 0.0, shortest = std::numeric_limits<double>::max();
    for (const EmvaSequence &dark : darks_)
        if (dark.usable && dark.layout->exposure_ms) {
            const double t = *dark.layout->exposure_ms;
            n += 1.0;
            x += t;
            y += dark.level;
            xx += t * t;
            xy += t * dark.level;
            longest = std::max(longest, t);
            shortest = std::min(shortest, t);
        }
    if (n < 2.0 || longest - shortest <= kEmvaSameExposure * longest) {
        result_.dark_current = unknown_emva_value("dark frames of two exposure times are needed, given as exposure_ms");
        return;
    }
    const double spread = xx - x * x / n, slope = (xy - x * y / n) / spread;
    double variance = 0.0, rest = 0.0;
    for (const EmvaSequence &dark : darks_)
        if (dark.usable && dark.layout->exposure_ms) {
            const double t = *dark.layout->exposure_ms - x / n;
            variance += std::pow(t / spread * dark.level_error, 2);
            rest += std::pow(dark.level - y / n - slope * t, 2);
        }
    double error = std::sqrt(variance);
    if (n > 2.0) // levels wander from one sequence to the next, too
        error =
            std::max(error, std::sqrt(rest / (n - 2.0) / spread) * student_two_sided_quantile(0.05, n - 2.0) / kEmva95);
    result_.dark_current = emva_value(slope, error);
}

} // namespace clsp
