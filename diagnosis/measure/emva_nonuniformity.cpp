// What differs across the image: fixed patterns of dark and flat frames, and the illumination.
#include "measure/emva_measurement.hpp"

#include "statistics/distributions.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

// Of chi squared.
double chi_square_quantile(double upper, double degrees) {
    double low = 0.0, high = degrees + 20.0 * std::sqrt(2.0 * degrees) + 20.0;
    for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (gamma_upper(middle, degrees, 2.0 * degrees) > upper ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

struct Spread {
    double variance = 0.0, low = 0.0, high = 0.0; // 95 %
};

// Of a mean square of that many degrees of freedom less what else is in it, whose standard error is known.
Spread spread_of(double variance, double square, double degrees, double other_error) {
    Spread result{variance, variance, variance};
    if (degrees < 1.0)
        return result;
    const double low = square * degrees / chi_square_quantile(0.025, degrees);
    const double high = square * degrees / chi_square_quantile(0.975, degrees);
    result.low -= std::hypot(square - low, kEmva95 * other_error);
    result.high += std::hypot(high - square, kEmva95 * other_error);
    return result;
}

EmvaValue deviation_of(const Spread &spread, double scale) {
    if (!(spread.high > 0.0))
        return unknown_emva_value(spread.high < 0.0
                                      ? "the temporal noise explains more than all of it"
                                      : "no pixel differs from a smooth field: no camera records without noise");
    EmvaValue result;
    result.value = scale * std::sqrt(std::max(0.0, spread.variance));
    result.low = scale * std::sqrt(std::max(0.0, spread.low));
    result.high = scale * std::sqrt(spread.high);
    return result;
}

// The variance of a mean frame less that of the temporal noise that is left in it, each for pixels, rows and columns.
EmvaNonuniformity pattern_of(const VarianceComponents &image, const VarianceComponents &noise, double noise_error,
                             double scale) {
    const Spread pixel{image.pixel - noise.pixel,
                       image.pixel - noise.pixel - kEmva95 * std::hypot(image.pixel_error, noise_error),
                       image.pixel - noise.pixel + kEmva95 * std::hypot(image.pixel_error, noise_error)};
    const Spread row = spread_of(image.row - noise.row, image.row_square, image.row_degrees,
                                 image.pixel_error / std::max(1.0, image.per_row));
    const Spread column = spread_of(image.column - noise.column, image.column_square, image.column_degrees,
                                    image.pixel_error / std::max(1.0, image.per_column));
    Spread total{pixel.variance + row.variance + column.variance, 0.0, 0.0};
    const auto reach = [&](auto side) {
        return std::sqrt(std::pow(side(pixel), 2) + std::pow(side(row), 2) + std::pow(side(column), 2));
    };
    total.low = total.variance - reach([](const Spread &s) { return s.variance - s.low; });
    total.high = total.variance + reach([](const Spread &s) { return s.high - s.variance; });
    return {deviation_of(total, scale), deviation_of(pixel, scale), deviation_of(row, scale),
            deviation_of(column, scale)};
}

EmvaNonuniformity unknown_pattern(const std::string &reason) {
    return {unknown_emva_value(reason), unknown_emva_value(reason), unknown_emva_value(reason),
            unknown_emva_value(reason)};
}

VarianceComponents part_of(const VarianceComponents &components, double part) {
    VarianceComponents result = components;
    result.pixel *= part;
    result.row *= part;
    result.column *= part;
    return result;
}

EmvaSpatial spatial_of(const std::string &name, const FrameStack &stack, const HighPass &filtered) {
    EmvaSpatial result;
    result.sequence = name;
    result.frames = double(stack.frames);
    const std::size_t width = stack.shape.width, height = stack.shape.height;
    std::vector<double> rows(height), columns(width), row_counts(height), column_counts(width);
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < stack.shape.size(); ++i)
        sum += stack.unmasked[i] ? filtered.image[i] : 0.0;
    const double mean = sum / std::max(1.0, stack.unmasked_pixels);
    for (std::size_t i = 0; i < stack.shape.size(); ++i) {
        if (!stack.unmasked[i])
            continue;
        rows[i / width] += filtered.image[i] - mean;
        row_counts[i / width] += 1.0;
        columns[i % width] += filtered.image[i] - mean;
        column_counts[i % width] += 1.0;
        squares += std::pow(filtered.image[i] - mean, 2);
    }
    const auto scatter = [&](const std::vector<double> &sums, const std::vector<double> &counts, double &lines) {
        double total = 0.0;
        for (std::size_t i = 0; i < sums.size(); ++i)
            if (counts[i] > 0.0) {
                total += std::pow(sums[i] / counts[i], 2);
                lines += 1.0;
            }
        return lines > 0.0 ? total / lines : 0.0;
    };
    result.mean = stack.unmasked_level;
    result.stack_variance = stack.stack_variance;
    result.measured_variance = squares / std::max(1.0, stack.unmasked_pixels - 1.0);
    result.row_average_variance = scatter(rows, row_counts, result.rows);
    result.column_average_variance = scatter(columns, column_counts, result.columns);
    const double m = std::max(1.0, result.rows), n = std::max(1.0, result.columns),
                 noise = stack.stack_variance / result.frames;
    result.variance = result.measured_variance - filtered.pixel_gain * noise;
    result.row_average_variance -= filtered.line_gain * noise / n;
    result.column_average_variance -= filtered.line_gain * noise / m;
    // Section 8.2: column + pixel / m, row + pixel / n, and column + row + pixel are these three.
    result.pixel_variance = (result.variance - result.row_average_variance - result.column_average_variance) /
                            std::max(1e-9, 1.0 - 1.0 / m - 1.0 / n);
    result.row_variance = result.row_average_variance - result.pixel_variance / n;
    result.column_variance = result.column_average_variance - result.pixel_variance / m;
    return result;
}

} // namespace

void EmvaMeasurement::measure_nonuniformity() {
    // The dark with the most frames, the flat whose mean frame has the least noise for its signal.
    const EmvaSequence *dark = nullptr, *flat = nullptr;
    for (const EmvaSequence &candidate : darks_)
        if (candidate.usable && (!dark || candidate.stack.frames > dark->stack.frames))
            dark = &candidate;
    const auto noise_of = [&](const EmvaSequence &of) {
        return std::sqrt(of.variance / double(of.stack.frames)) / (dark ? of.level - dark->level : of.level);
    };
    for (std::size_t k = 0; k < flats_.size(); ++k) {
        const EmvaPoint &point = result_.points[darks_.size() + k];
        if (point.used && (!flat || noise_of(flats_[k]) < noise_of(*flat)))
            flat = &flats_[k];
    }
    const std::string without_dark = dark ? "" : reason_without_dark();
    FrameStack dark_stack;
    if (!dark) {
        result_.dsnu = result_.dsnu_e = unknown_pattern(without_dark);
    } else {
        const FrameStack &stack = dark_stack = stack_frames(capture_, dark->stack.sequence);
        result_.spatial_dark = spatial_of(dark->layout->name, stack, {stack.mean, 1.0, 1.0});
        result_.filtered_dark = spatial_of(dark->layout->name, stack, high_pass(stack.shape, stack.mean));
        if (dark->clipped) {
            const std::string reason = "the dark frames clip at 0; the total is that behind the clipping";
            result_.dsnu = unknown_pattern(reason);
            const double variance = dark->clipped->fixed_variance,
                         error = kEmva95 * dark->clipped->fixed_variance_error;
            result_.dsnu.total = deviation_of({variance, variance - error, variance + error}, 1.0);
        } else {
            std::vector<std::uint8_t> counts = stack.counts;
            result_.defect_share_dark =
                leave_out_defects(stack.shape, without_trend(stack.shape, stack.mean, counts), counts);
            // No lamp is in it: what is smooth is the sensor's.
            result_.dsnu = pattern_of(variance_components(stack.shape, stack.mean, counts),
                                      part_of(stack.successive.components, 1.0 / double(stack.frames)),
                                      stack.successive.error / double(stack.frames), 1.0);
        }
        for (const auto member : {&EmvaNonuniformity::total, &EmvaNonuniformity::pixel, &EmvaNonuniformity::row,
                                  &EmvaNonuniformity::column})
            result_.dsnu_e.*member = emva_quotient(result_.dsnu.*member, result_.gain);
    }
    if (!flat || !dark) {
        std::string why = without_dark;
        if (dark && flats_.empty())
            why = "the capture has no flat frames";
        for (std::size_t k = 0; dark && k < flats_.size(); ++k) {
            const EmvaPoint &point = result_.points[darks_.size() + k];
            why += fmt::format("{}{}: {}", why.empty() ? "" : "; ", point.sequence, point.unused);
        }
        result_.prnu = unknown_pattern(why);
        return;
    }
    const FrameStack stack = stack_frames(capture_, flat->stack.sequence);
    result_.spatial_flat = spatial_of(flat->layout->name, stack, {stack.mean, 1.0, 1.0});
    result_.filtered_flat = spatial_of(flat->layout->name, stack, high_pass(stack.shape, stack.mean));
    std::vector<double> image = stack.mean;
    std::vector<std::uint8_t> counts = stack.counts;
    VarianceComponents noise = part_of(stack.successive.components, 1.0 / double(stack.frames));
    double noise_error = stack.successive.error / double(stack.frames);
    if (dark->clipped) {
        noise.pixel += dark->clipped->fixed_variance;
        noise_error = std::hypot(noise_error, dark->clipped->fixed_variance_error);
    } else {
        const VarianceComponents &own = dark_stack.successive.components;
        const auto frames = double(dark->stack.frames);
        for (std::size_t i = 0; i < image.size(); ++i) {
            image[i] -= dark_stack.mean[i];
            counts[i] = counts[i] && dark_stack.counts[i];
        }
        noise.pixel += own.pixel / frames;
        noise.row += own.row / frames;
        noise.column += own.column / frames;
        noise_error = std::hypot(noise_error, dark->stack.successive.error / frames);
    }
    // A few strong pixels must not bend the trend: it is fitted twice.
    result_.defect_share_flat = leave_out_defects(stack.shape, without_trend(stack.shape, image, counts), counts);
    image = without_trend(stack.shape, std::move(image), counts);
    result_.prnu = pattern_of(variance_components(stack.shape, image, counts, kPatternTrend), noise, noise_error,
                              100.0 / (flat->level - dark->level));
}

void EmvaMeasurement::measure_illumination() {
    for (const std::vector<EmvaSequence> *group : {&flats_, &others_})
        for (const EmvaSequence &lit : *group) {
            const EmvaSequence *dark = dark_of(lit);
            const double offset = dark ? dark->level : capture_.layout.black_level_dn;
            const FrameStack &stack = lit.stack;
            const double light = stack.level - offset;
            if (stack.counted_pixels < 64.0 || !(light > 1.0))
                continue;
            EmvaIllumination one;
            one.sequence = lit.layout->name;
            for (std::size_t k = 0; k < one.percent.size(); ++k) {
                one.percent[k] = 100.0 * lit.trend.terms[k + 1] / light;
                one.error_percent[k] = 100.0 * lit.trend.errors[k + 1] / light;
            }
            result_.illumination.push_back(std::move(one));
        }
}

} // namespace clsp
