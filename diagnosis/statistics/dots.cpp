#include "statistics/statistic_groups.hpp"

#include "statistics/dot_shape.hpp"
#include "statistics/parallel_for.hpp"

#include <algorithm>
#include <cmath>

namespace clsp::statistics {

namespace {

using Point = std::array<double, 2>;

// Mean over points of light in a spot of a dot's width over its surroundings.
double mean_peak(const Geometry &geometry, const std::vector<float> &image, const std::vector<Point> &points) {
    double total = 0.0;
    for (const Point &point : points)
        total += window_mean(geometry, image, point, 0.7 * geometry.dots.sigma) -
                 window_mean(geometry, image, point, 2.0 * geometry.dots.sigma);
    return total / double(points.size());
}

// visible: 1 where spots are seen, 0 where there is none whose place could be told.
void put_positions(const Geometry &geometry, const DotPositions &positions, double visible, Sink &sink) {
    sink.put("optics", "dot_shift_x", "px", positions.terms[kShiftX]);
    sink.put("optics", "dot_shift_y", "px", positions.terms[kShiftY]);
    if (geometry.dots.positions.size() >= kDotsForField) {
        // The linear and the cubic term are nearly parallel over the field: the one is told as the displacement at 3/4
        // of the corner radius, where most light is, the other as it is.
        constexpr double kRadius = 0.75;
        sink.put("laser", "dot_radial_displacement", "px",
                 kRadius * positions.terms[kRadial] + kRadius * kRadius * kRadius * positions.terms[kCubic]);
        sink.put("optics", "dot_cubic_displacement", "px", positions.terms[kCubic]);
        sink.put("optics", "dot_turn", "px", positions.terms[kTurn]);
        sink.put("optics", "dot_anisotropy", "px", positions.terms[kAnisotropy]);
        sink.put("optics", "dot_shear", "px", positions.terms[kShear]);
    }
    sink.put("optics", "dot_position_scatter", "log", visible * std::log(positions.residual_rms + 1e-3));
}

// Moments of what is no spot tell nothing: it is as wide as the window, and the others are 0.
void put_shape(const Geometry &geometry, const DotShape &shape, double visible, Sink &sink) {
    const double window = kShapeWindow * geometry.dots.sigma;
    const auto seen_width = [&](double width) { return visible * width + (1.0 - visible) * window; };
    sink.put("optics", "dot_width_x", "px", seen_width(shape.width_x));
    sink.put("optics", "dot_width_y", "px", seen_width(shape.width_y));
    sink.put("laser", "dot_covariance_xy", "1", visible * shape.covariance_xy);
    sink.put("laser", "dot_skewness_x", "1", visible * shape.skewness_x);
    sink.put("laser", "dot_skewness_y", "1", visible * shape.skewness_y);
    sink.put("laser", "dot_kurtosis", "1", visible * shape.kurtosis);
    const char *rings[kProfileRings] = {"ring_0.0_to_0.5", "ring_0.5_to_1.0", "ring_1.0_to_1.5", "ring_1.5_to_2.0",
                                        "ring_2.0_to_2.5", "ring_2.5_to_3.0", "ring_3.0_to_4.0", "ring_4.0_to_5.0"};
    for (std::size_t k = 0; k < kProfileRings; ++k)
        if (k != 1) // the core that the rings are divided by holds the first two
            sink.put(k < 5 ? "laser" : "optics", "dot_profile", rings[k], "1", shape.profile[k]);
    const char *zones[] = {"core", "flank", "cell"},
               *terms[] = {"cos1", "sin1", "cos2", "sin2", "cos3", "sin3", "cos4", "sin4"};
    for (std::size_t zone = 0; zone < 3; ++zone)
        for (std::size_t k = 0; k < 8; ++k) {
            const bool is_listed = zone == 0 ? k < 4 : zone == 2 && k >= 2 && k != 4 && k != 5;
            if (is_listed)
                // The cell's is over the core's light, the others' over their zone's own.
                sink.put(zone == 2 ? "doe" : "laser", std::string("dot_angular_") + terms[k], zones[zone], "1",
                         (zone == 2 ? 1.0 : visible) * shape.harmonics[zone][k]);
        }
    if (!geometry.moving)
        return;
    // Width over the field: the dots of three rings of equal width in radius.
    std::array<double, 3> width{}, count{};
    std::array<bool, 3> exists{};
    for (std::size_t i = 0; i < shape.dot_width.size(); ++i) {
        const Point &dot = geometry.dots.positions[i];
        const double radius = std::hypot(dot[0] - geometry.principal_point[0], dot[1] - geometry.principal_point[1]) /
                              geometry.corner_radius;
        const std::size_t ring = std::min<std::size_t>(std::size_t(3.0 * radius), 2);
        exists[ring] = true;
        if (shape.dot_width[i] > 0.0) {
            width[ring] += shape.dot_width[i];
            count[ring] += 1.0;
        }
    }
    for (std::size_t ring = 0; ring < 3; ++ring)
        if (exists[ring])
            sink.put("optics", "dot_width", "ring" + std::to_string(ring), "px",
                     seen_width(ratio(width[ring], count[ring])));
}

// least: that the dots' mean light is taken to be, as that of dots out of focus may be next to nothing.
void put_flux(const Geometry &geometry, const DotPositions &positions, double visible, double least, Sink &sink) {
    const std::size_t count = positions.flux.size();
    double mean = 0.0, spread = 0.0, radial = 0.0, radial_square = 0.0, radial_mean = 0.0;
    std::vector<double> squared(count);
    std::array<double, 9> region{}, region_count{};
    for (std::size_t i = 0; i < count; ++i) {
        const Point &dot = geometry.dots.positions[i];
        const double u = (dot[0] - geometry.principal_point[0]) / geometry.corner_radius;
        const double v = (dot[1] - geometry.principal_point[1]) / geometry.corner_radius;
        squared[i] = u * u + v * v;
        radial_mean += squared[i] / double(count);
        mean += positions.flux[i] / double(count);
        const auto clamp = [](double value, std::size_t size) {
            return std::size_t(std::clamp(value, 0.0, double(size - 1)));
        };
        const std::size_t k = geometry.region_of(clamp(dot[0], geometry.width), clamp(dot[1], geometry.height));
        region[k] += positions.flux[i];
        region_count[k] += 1.0;
    }
    for (std::size_t i = 0; i < count; ++i) {
        const double deviation = positions.flux[i] - mean;
        spread += deviation * deviation / double(count);
        radial += (squared[i] - radial_mean) * deviation;
        radial_square += (squared[i] - radial_mean) * (squared[i] - radial_mean);
    }
    const double scale = std::max({mean, least, 1e-3});
    sink.put("optics", "dot_flux_falloff", "1", ratio(radial, radial_square) / scale);
    sink.put("doe", "dot_flux_spread", "log", visible * std::log(std::sqrt(spread) / scale + 1e-4));
    if (!geometry.moving)
        return; // under one pattern of speckle the flux of a single dot says little
    std::size_t last = 9;
    for (std::size_t k = 0; k < 9; ++k)
        if (region_count[k] > 0.0)
            last = k == 4 ? 4 : last == 4 ? 4 : k;
    for (std::size_t k = 0; k < 9; ++k)
        if (region_count[k] > 0.0 && k != last) // the last follows from the others
            sink.put("optics", "dot_flux", "r" + std::to_string(k / 3) + "c" + std::to_string(k % 3), "1",
                     (region[k] / region_count[k] - mean) / scale);
}

// Light between the dots: scattered, in ghosts, undiffracted.
void put_stray_light(const StatisticInput &in, const DotShape &shape, double background, Sink &sink) {
    const Geometry &geometry = in.geometry;
    const DotGeometry &dots = geometry.dots;
    const std::vector<float> &mean = in.frames.mean;
    const double scale = shape.core;
    if (!dots.between.empty()) {
        double spread = 0.0;
        for (const std::uint32_t pixel : dots.between)
            spread +=
                (double(mean[pixel]) - background) * (double(mean[pixel]) - background) / double(dots.between.size());
        sink.put("doe", "light_between_dots", "1", background / in.frames.light);
        if (geometry.frames > 1) // of one frame the noise is not known
            sink.put("doe", "light_between_dots_spread", "log",
                     log_ratio(spread, in.frames.pixel_variance / double(geometry.frames)));
    }
    const auto put_peak = [&](const char *stage, const char *name, const std::vector<Point> &points) {
        if (points.size() >= 4)
            sink.put(stage, name, "1", mean_peak(geometry, mean, points) / scale);
    };
    put_peak("doe", "peak_at_cell_centres", dots.cell_centres);
    put_peak("doe", "peak_at_half_ways", dots.half_ways);
    put_peak("optics", "peak_at_point_reflections", dots.mirrored_both);
    put_peak("optics", "peak_at_mirror_images_x", dots.mirrored_x);
    put_peak("optics", "peak_at_mirror_images_y", dots.mirrored_y);
    sink.put("doe", "peak_on_axis", "asinh",
             std::asinh((window_mean(geometry, mean, geometry.principal_point, dots.sigma) -
                         window_mean(geometry, mean, geometry.principal_point, 2.5 * dots.sigma)) /
                        scale));
}

// The law of the speckle's intensity in the cores, relative to the dot's own profile; its size in a moving scene.
void put_core_speckle(const StatisticInput &in, const DotShape &shape, const DotPositions &positions, Sink &sink) {
    const Geometry &geometry = in.geometry;
    const double sigma = geometry.dots.sigma, reach = 0.8 * sigma + 0.5;
    std::vector<std::uint32_t> pixels;
    std::vector<float> inverse;
    const double peak = shape.core / kCoreOfPeak;
    for (const Point &dot : positions.modelled)
        for (double y = std::ceil(dot[1] - reach); y <= dot[1] + reach; ++y)
            for (double x = std::ceil(dot[0] - reach); x <= dot[0] + reach; ++x) {
                const double squared = (x - dot[0]) * (x - dot[0]) + (y - dot[1]) * (y - dot[1]);
                if (squared > reach * reach || x < 0.0 || y < 0.0 || x > double(geometry.width - 1) ||
                    y > double(geometry.height - 1))
                    continue;
                const std::size_t pixel = std::size_t(y) * geometry.width + std::size_t(x);
                if (!geometry.is_used(pixel))
                    continue;
                pixels.push_back(std::uint32_t(pixel));
                inverse.push_back(float(std::exp(0.5 * squared / (sigma * sigma)) / peak));
            }
    constexpr std::array<float, 5> kLevels{0.1f, 0.25f, 0.5f, 1.0f, 2.0f};
    const std::size_t frames = geometry.moving ? geometry.frames : 1;
    std::vector<Powers> powers(frames);
    std::vector<std::array<double, kLevels.size()>> below(frames);
    parallel_for(frames, in.threads, [&](std::size_t t) {
        std::vector<float> intensity(pixels.size());
        for (std::size_t i = 0; i < pixels.size(); ++i) {
            const float signal = geometry.moving
                                     ? float(in.codes[t * geometry.pixels + pixels[i]]) - float(in.black_level_dn)
                                     : in.frames.mean[pixels[i]];
            intensity[i] = signal * inverse[i];
            for (std::size_t k = 0; k < kLevels.size(); ++k)
                below[t][k] += intensity[i] < kLevels[k];
        }
        powers[t].add(intensity.data(), intensity.size());
    });
    Powers total;
    std::array<double, kLevels.size()> share{};
    const double count = double(frames) * double(pixels.size());
    for (std::size_t t = 0; t < frames; ++t) {
        total.add(powers[t]);
        for (std::size_t k = 0; k < kLevels.size(); ++k)
            share[k] += ratio(below[t][k], count);
    }
    const double mean = ratio(total.sum, count), square = ratio(total.square, count), cube = ratio(total.cube, count);
    const double variance = std::max(square - mean * mean, 0.0);
    sink.put("surface", "core_contrast", "log", 0.5 * log_ratio(variance, mean * mean));
    sink.put("surface", "core_skewness", "1",
             (cube - 3.0 * mean * square + 2.0 * mean * mean * mean) / std::pow(variance + 1e-6, 1.5));
    const char *names[] = {"core_below_10_percent", "core_below_25_percent", "core_below_50_percent",
                           "core_below_100_percent", "core_below_200_percent"};
    for (std::size_t k = 0; k < kLevels.size(); ++k)
        sink.put("surface", names[k], "1", share[k]);
}

void put_dot_speckle(const StatisticInput &in, Sink &sink) {
    const Geometry &geometry = in.geometry;
    if (!geometry.moving || geometry.frames < 2)
        return;
    DotLagFrameSums total{};
    for (const DotLagFrameSums &part : in.sums.sum_dot_lags(geometry, in.frames))
        for (std::size_t k = 0; k < total.size(); ++k)
            total[k] += part[k];
    const auto correlation = [&](std::size_t k) { return ratio(total[k], total.back()); };
    const char *names[] = {"grain_correlation_x1", "grain_correlation_x2", "grain_correlation_x4",
                           "grain_correlation_y1", "grain_correlation_y2", "grain_correlation_y4"};
    for (std::size_t k = 0; k < 6; ++k)
        sink.put("optics", names[k], "1", correlation(k));
    sink.put("optics", "grain_correlation_diagonal", "1", 0.5 * (correlation(6) + correlation(7)));
}

} // namespace

void measure_dots(const StatisticInput &in, Sink &sink) {
    const Geometry &geometry = in.geometry;
    double background = 0.0;
    for (const std::uint32_t pixel : geometry.dots.between)
        background += double(in.frames.mean[pixel]) / double(geometry.dots.between.size());
    const double least = kLeastCore * expected_core(geometry) * in.frames.light;
    DotPositions positions = locate_dots(geometry, in.frames.mean, background);
    DotShape shape = measure_shape(geometry, in.frames.mean, background, positions, least);
    const double visible = visibility(shape, least);
    if (visible < 1.0) {
        positions = pulled_back(geometry, in.frames.mean, background, std::move(positions), visible);
        shape = measure_shape(geometry, in.frames.mean, background, positions, least);
    }
    sink.put("doe", "dot_peak", "log", std::log(shape.core / in.frames.light));
    put_positions(geometry, positions, visible, sink);
    put_shape(geometry, shape, visible, sink);
    put_flux(geometry, positions, visible, least / kCoreOfPeak * gaussian_flux(geometry), sink);
    put_stray_light(in, shape, background, sink);
    put_core_speckle(in, shape, positions, sink);
    put_dot_speckle(in, sink);
}

} // namespace clsp::statistics
