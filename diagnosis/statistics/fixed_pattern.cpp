// What stays from frame to frame in the dark and under even light, once the smooth field is out.
#include "statistics/spectrum_sums.hpp"
#include "statistics/statistic_groups.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace clsp::statistics {

namespace {

// Black levels of a camera wander that far from sequence to sequence, in read noise.
constexpr double kLeastLevelDeviation = 0.01;

using Values = Eigen::ArrayXf;

Values used_values(const Geometry &geometry, const std::vector<float> &image) {
    Values values(static_cast<Eigen::Index>(geometry.pixels));
    Eigen::Index count = 0;
    for (std::size_t i = 0; i < geometry.pixels; ++i)
        if (geometry.is_used(i))
            values[count++] = image[i];
    values.conservativeResize(count);
    return values;
}

// Standard deviation of the bulk: the fixed point of a variance under the weight exp(-u^2 / 18), u in standard
// deviations, which for a normal law is 9/10 of the variance. Pixels beyond some five deviations have no say.
double bulk_deviation(const Values &values) {
    Values magnitudes = values.abs();
    float *const ranked = magnitudes.data() + magnitudes.size() * 68 / 100;
    std::nth_element(magnitudes.data(), ranked, magnitudes.data() + magnitudes.size());
    double deviation = std::max(double(*ranked), 1e-4);
    const Values squared = values.square();
    for (int step = 0; step < 5; ++step) {
        const Values weights = (float(-1.0 / (18.0 * deviation * deviation)) * squared).exp();
        const double squares = (weights * squared).cast<double>().sum();
        deviation = std::max(std::sqrt(ratio(squares, weights.cast<double>().sum()) / 0.9), 1e-4);
    }
    return deviation;
}

// Few pixels far out would hide what all others do: they are counted beside.
constexpr double kFarOut = 6.0; // deviations of the bulk
std::vector<float> without_far_out(const std::vector<float> &image, double deviation) {
    std::vector<float> result(image);
    for (float &value : result)
        if (std::abs(double(value)) > kFarOut * deviation)
            value = 0.0f;
    return result;
}

// How many pixels are beyond 6, 12 and 48 deviations, and beyond 6 below. Each count begins softly, as
// 1 / (1 + exp(12 - 12 u / limit)) at u deviations, so that it is never exactly nothing.
struct FarOut {
    double above_6, above_12, above_48, below_6;
};

FarOut count_far_out(const Values &values, double deviation) {
    // One exponential for all of them. What is farther out than this is so for all limits.
    constexpr double kMost = 80.0;
    const double far = std::exp(12.0);
    const Eigen::ArrayXd quarter = (values.cast<double>() / (4.0 * deviation)).max(-kMost).min(kMost).exp();
    const Eigen::ArrayXd whole = quarter.square().square(), twice = whole.square();
    return {(twice / (twice + far)).sum(), (whole / (whole + far)).sum(), (quarter / (quarter + far)).sum(),
            (1.0 + far * twice).inverse().sum()};
}

// Variance of the means of the rows (columns) times their pixels: that of a pixel, if pixels are independent.
double line_variance(const Geometry &geometry, const std::vector<float> &image, bool rows) {
    const std::vector<double> &used = rows ? geometry.row_used : geometry.column_used;
    std::vector<double> totals(used.size());
    for (std::size_t y = 0; y < geometry.height; ++y)
        for (std::size_t x = 0; x < geometry.width; ++x)
            totals[rows ? y : x] += double(image[y * geometry.width + x]);
    double variance = 0.0;
    for (std::size_t i = 0; i < totals.size(); ++i)
        variance += ratio(totals[i] * totals[i], used[i]) / double(totals.size());
    return variance;
}

// Variance over time of a pixel without what rows and columns have in common: their excess over independent pixels.
double independent_variance(const StatisticInput &in) {
    const Geometry &geometry = in.geometry;
    const double samples = double(geometry.frames) * double(geometry.used), all = in.residual.powers.square / samples;
    double rows = 0.0;
    for (std::size_t t = 0; t < geometry.frames; ++t)
        for (std::size_t y = 0; y < geometry.height; ++y) {
            const double mean = in.frames.row_mean[t * geometry.height + y];
            rows += geometry.row_used[y] * mean * mean;
        }
    const double row_share = (rows - all * double(geometry.frames * geometry.height)) / samples;
    const double column_share = (in.residual.column_variance - all) * double(geometry.width) / double(geometry.used);
    return in.frames.pixel_variance * std::max(1.0 - ratio(row_share + column_share, all), 0.0);
}

} // namespace

void measure_fixed_pattern(const StatisticInput &in, Sink &sink) {
    const Geometry &geometry = in.geometry;
    const bool is_flat = geometry.scene == CaptureScene::kFlat;
    std::vector<float> mean = in.frames.mean;
    for (std::size_t i = 0; is_flat && in.dark_frame && i < geometry.pixels; ++i)
        mean[i] -= geometry.is_used(i) ? (*in.dark_frame)[i] : 0.0f;
    const FieldCoefficients field = fit_field(geometry, mean, kFieldTerms);
    const std::vector<float> pattern = without_field(geometry, mean, field);
    const Values values = used_values(geometry, pattern);
    const double deviation = bulk_deviation(values);
    std::vector<float> bulk = without_far_out(pattern, deviation);
    bulk = without_field(geometry, bulk, fit_field(geometry, bulk, kFieldTerms)); // they bent the field
    Powers powers;
    for (std::size_t y = 0; y < geometry.height; ++y)
        powers.add(bulk.data() + y * geometry.width, geometry.width);
    const double used = double(geometry.used), variance = powers.square / used;
    // Of one frame pattern and noise are one, whose amount is no gap: photon noise would pass for a pattern.
    const bool told = geometry.frames > 1;
    const double temporal = told ? in.frames.pixel_variance / double(geometry.frames) : variance;

    if (told && is_flat)
        sink.put("sensor", "temporal_variance", "log", log_ratio(independent_variance(in), in.frames.read_variance));
    if (told)
        sink.put("sensor", "fixed_pattern", "log", log_ratio(variance, temporal));
    sink.put("sensor", "fixed_pattern_columns", "log", log_ratio(line_variance(geometry, bulk, false), variance));
    sink.put("sensor", "fixed_pattern_rows", "log", log_ratio(line_variance(geometry, bulk, true), variance));
    sink.put("sensor", "fixed_pattern_skewness", "asinh",
             std::asinh(powers.cube / used / std::pow(variance + 1e-6, 1.5)));
    sink.put("sensor", "fixed_pattern_kurtosis", "log",
             std::log((powers.fourth / used + 1e-6) / (variance * variance + 1e-6)));
    const FarOut far_out = count_far_out(values, deviation);
    sink.put_count("sensor", "hot_pixels_6_sigma", far_out.above_6);
    sink.put_count("sensor", "hot_pixels_12_sigma", far_out.above_12);
    sink.put_count("sensor", "hot_pixels_48_sigma", far_out.above_48);
    if (is_flat)
        sink.put_count("sensor", "cold_pixels_6_sigma", far_out.below_6);

    const char *names[] = {"fixed_pattern_correlation_x1", "fixed_pattern_correlation_y1"};
    const Lag lags[] = {{1, 0}, {0, 1}};
    for (std::size_t k = 0; k < 2; ++k) {
        const double covariance = ratio(
            lag_sum(bulk.data(), bulk.data(), geometry.width, geometry.height, lags[k]), geometry.pairs(lags[k]));
        sink.put("sensor", names[k], "1", ratio(covariance, variance));
    }
    SpectralLine line;
    const SpectrumSums spectrum = sum_spectrum(geometry, 0.7072, {bulk.data()}, 1, &line);
    sink.put("sensor", "fixed_pattern_lines", "log", std::log(spectrum.peaks));
    sink.put("sensor", "fixed_pattern_wave", "1", line.prominence);
    if (geometry.light_error > 0.0)
        sink.put("sensor", "signal_by_exposure", "log", std::log(in.frames.light), geometry.light_error);
    // Of several dark sequences after different exposures: what the black level that they share leaves.
    if (geometry.exposures_differ)
        sink.put("sensor", "dark_level", "1", in.frames.mean_signal / in.frames.light, kLeastLevelDeviation);
}

} // namespace clsp::statistics
