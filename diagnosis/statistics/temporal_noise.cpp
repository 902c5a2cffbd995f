#include "statistics/statistic_groups.hpp"

#include <algorithm>
#include <cmath>

namespace clsp::statistics {

namespace {

// Variance of row means over what independent pixels would give.
double row_excess(const StatisticInput &in, double pixel_variance) {
    double total = 0.0;
    for (std::size_t t = 0; t < in.geometry.frames; ++t)
        for (std::size_t y = 0; y < in.geometry.height; ++y) {
            const double mean = in.frames.row_mean[t * in.geometry.height + y];
            total += in.geometry.row_used[y] * mean * mean;
        }
    return log_ratio(total / double(in.geometry.frames * in.geometry.height), pixel_variance);
}

double frame_deviation(const Frames &frames) {
    double total = 0.0;
    for (const double mean : frames.frame_mean)
        total += (mean - frames.mean_signal) * (mean - frames.mean_signal);
    return std::sqrt(total / double(frames.frame_mean.size() - 1));
}

// Differences of frame means are measured by the fluctuation of the others (Student's t): a laser that flickers has a
// first frame and a slope of any size and sign, which say nothing beyond frame_mean_fluctuation.
constexpr double kLeastFluctuation = 1e-4; // DN

// Slope of the frame mean over the sequence, by least squares.
double drift_t(const Frames &frames) {
    const double count = double(frames.frame_mean.size()), middle = 0.5 * (count - 1.0);
    double product = 0.0, square = 0.0, total = 0.0;
    for (std::size_t t = 0; t < frames.frame_mean.size(); ++t) {
        const double deviation = frames.frame_mean[t] - frames.mean_signal;
        product += (double(t) - middle) * deviation;
        square += (double(t) - middle) * (double(t) - middle);
        total += deviation * deviation;
    }
    const double residual = std::max(0.0, total - product * product / square) / (count - 2.0);
    return product / std::sqrt(square) / (std::sqrt(residual) + kLeastFluctuation);
}

// The first frame against all others.
double first_frame_t(const Frames &frames) {
    const double others = double(frames.frame_mean.size() - 1);
    double mean = 0.0, variance = 0.0;
    for (std::size_t t = 1; t < frames.frame_mean.size(); ++t)
        mean += frames.frame_mean[t] / others;
    for (std::size_t t = 1; t < frames.frame_mean.size(); ++t)
        variance += (frames.frame_mean[t] - mean) * (frames.frame_mean[t] - mean) / (others - 1.0);
    return (frames.frame_mean[0] - mean) / ((std::sqrt(variance) + kLeastFluctuation) * std::sqrt(1.0 + 1.0 / others));
}

constexpr double kLeastDifference = 1e-3; // of frames, over their mean

} // namespace

void measure_temporal_noise(const StatisticInput &in, Sink &sink) {
    const Geometry &geometry = in.geometry;
    if (geometry.frames < 2)
        return;
    const char *source = geometry.is_laser() ? "laser" : "sensor";
    const double samples = double(geometry.frames) * double(geometry.used);
    const Powers &powers = in.residual.powers;
    const double variance = powers.square / samples;
    sink.put("sensor", "row_noise", "log", row_excess(in, variance));
    sink.put("sensor", "column_noise", "log", log_ratio(in.residual.column_variance, variance));
    const double fluctuation = (frame_deviation(in.frames) + 1e-4) / in.frames.light;
    sink.put_square(source, "frame_mean_fluctuation", geometry.frames, fluctuation * fluctuation,
                    std::log(fluctuation));
    // Of three frames the fluctuation of the others is a single difference, and may be as small as it likes: Student's
    // t of one degree of freedom is beyond 600 once in a thousand times.
    if (geometry.frames > 3) {
        sink.put("sensor", "first_frame", "asinh", std::asinh(first_frame_t(in.frames)));
        sink.put(source, "frame_mean_drift", "asinh", std::asinh(drift_t(in.frames)));
    }

    const char *change = geometry.is_laser() ? "motion" : "sensor";
    const std::vector<std::size_t> lags = temporal_lags(geometry);
    for (std::size_t k = 0; k < lags.size(); ++k)
        sink.put(change, "temporal_correlation_" + std::to_string(lags[k]), "1", in.residual.temporal[k]);
    if (geometry.moving)
        return;
    const double cube = powers.cube / samples, fourth = powers.fourth / samples;
    if (geometry.frames > 2) // of two frames the residuals are each other's negative
        sink.put("sensor", "noise_skewness", "1", cube / std::pow(variance + 1e-6, 1.5));
    sink.put("sensor", "noise_kurtosis", "log", std::log((fourth + 1e-6) / (variance * variance + 1e-6)));
    const auto &noise = in.residual.noise;
    sink.put(change, "noise_correlation_x1", "1", noise[0]);
    sink.put(change, "noise_correlation_y1", "1", noise[1]);
    sink.put(change, "noise_correlation_diagonal", "1", 0.5 * (noise[2] + noise[3]));
    sink.put(change, "noise_correlation_2", "1", 0.5 * (noise[4] + noise[5]));
}

void measure_repetition(const StatisticInput &in, Sink &sink) {
    const Geometry &geometry = in.geometry;
    if (geometry.frames < 3)
        return;
    // The harmonic mean of the squared differences falls far below their mean as soon as one of them nearly vanishes,
    // and unlike the smallest it has a narrow law otherwise.
    const std::vector<std::vector<double>> parts = in.sums.frame_differences(geometry, in.frames);
    double mean = 0.0, inverse = 0.0, pairs = 0.0;
    for (const auto &part : parts)
        for (const double difference : part) {
            mean += difference;
            pairs += 1.0;
        }
    mean /= pairs;
    for (const auto &part : parts)
        for (const double difference : part)
            inverse += (mean + 1e-9) / (difference + kLeastDifference * mean + 1e-9) / pairs;
    // Without the floor under the differences it is 0 at least, and about half the relative variance of the
    // differences.
    sink.put_square("sensor", "repeated_frames", geometry.frames,
                    std::max(std::log(inverse * (1.0 + kLeastDifference)), 0.0), std::log(inverse));
}

} // namespace clsp::statistics
