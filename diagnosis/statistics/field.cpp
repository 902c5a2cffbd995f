// The mean image over the field: fall-off, gradient, regions; and between the four sites of a 2 x 2 mosaic.
#include "statistics/measures.hpp"

#include <array>
#include <cmath>
#include <vector>

namespace clsp::statistics {

namespace {

// Row, column and checker contrast of the sites' means.
std::array<double, 3> mosaic_contrasts(const Geometry &geometry, const std::vector<float> &mean) {
    std::array<double, 4> total{}, used{};
    for (std::size_t y = 0; y < geometry.height; ++y)
        for (std::size_t x = 0; x < geometry.width; ++x) {
            const std::size_t site = 2 * (y % 2) + x % 2;
            total[site] += double(mean[y * geometry.width + x]);
            used[site] += geometry.is_used(y * geometry.width + x);
        }
    std::array<double, 4> site{};
    for (std::size_t k = 0; k < 4; ++k) {
        if (used[k] == 0.0)
            return {};
        site[k] = total[k] / used[k];
    }
    return {0.5 * (site[0] + site[1] - site[2] - site[3]), 0.5 * (site[0] - site[1] + site[2] - site[3]),
            0.5 * (site[0] - site[1] - site[2] + site[3])};
}

constexpr double kPi = 3.14159265358979323846;
// Of the windows of a pattern, and from one to the next: squared cosines, which add up to 1.
constexpr std::size_t kWindow = 16, kHop = kWindow / 2;

// The same of one pattern of speckle, whose few brightest grains, above all where they clip, make most of it: the sum of
// the contrasts within windows over the root of their squares' sum, which no grain makes large. Smooth windows let no
// grain that the lens resolves (below 3/8 cycles per pixel) pass for a mosaic.
std::array<double, 3> windowed_mosaic_contrasts(const Geometry &geometry, const std::vector<float> &mean) {
    std::array<double, kWindow> window;
    for (std::size_t i = 0; i < kWindow; ++i)
        window[i] = std::pow(std::sin(kPi * (double(i) + 0.5) / kWindow), 2);
    const std::size_t columns = geometry.width / kHop + 2, rows = geometry.height / kHop + 2;
    // Sums of even and of odd pixels of each window's rows, then of the windows.
    std::vector<std::array<double, 2>> of_row(columns);
    std::vector<std::array<double, 4>> sites(columns * rows);
    for (std::size_t y = 0; y < geometry.height; ++y) {
        of_row.assign(columns, {});
        for (std::size_t x = 0; x < geometry.width; ++x) {
            const double value = double(mean[y * geometry.width + x]);
            const std::size_t place = x / kHop, within = x % kHop;
            of_row[place][x % 2] += window[within + kHop] * value;
            of_row[place + 1][x % 2] += window[within] * value;
        }
        for (std::size_t half = 0; half < 2; ++half) {
            const double weight = window[y % kHop + (1 - half) * kHop];
            std::array<double, 4> *const to = sites.data() + (y / kHop + half) * columns;
            for (std::size_t k = 0; k < columns; ++k)
                for (std::size_t odd = 0; odd < 2; ++odd)
                    to[k][2 * (y % 2) + odd] += weight * of_row[k][odd];
        }
    }
    std::array<double, 3> sum{}, square{};
    for (const std::array<double, 4> &site : sites) {
        const std::array<double, 3> contrast = {site[0] + site[1] - site[2] - site[3],
                                                site[0] - site[1] + site[2] - site[3],
                                                site[0] - site[1] - site[2] + site[3]};
        for (std::size_t k = 0; k < 3; ++k) {
            sum[k] += contrast[k];
            square[k] += contrast[k] * contrast[k];
        }
    }
    for (std::size_t k = 0; k < 3; ++k)
        sum[k] = ratio(sum[k], std::sqrt(square[k]));
    return sum;
}

} // namespace

void measure_field(const Measurement &m, Sink &sink) {
    const Geometry &geometry = m.geometry;
    const bool is_lit = geometry.is_lit();
    const double light = is_lit ? m.frames.light : 1.0;
    const char *unit = is_lit ? "1" : "DN";
    const bool is_pattern = geometry.is_static_laser();
    const std::array<double, 3> mosaic = is_pattern ? windowed_mosaic_contrasts(geometry, m.frames.mean)
                                                    : mosaic_contrasts(geometry, m.frames.mean);
    const double whole = is_pattern ? 1.0 : light;
    sink.put("sensor", "mosaic_rows", unit, mosaic[0] / whole);
    sink.put("sensor", "mosaic_columns", unit, mosaic[1] / whole);
    sink.put("sensor", "mosaic_checker", unit, mosaic[2] / whole);
    if (geometry.scene == CaptureScene::kDots)
        return; // their light over the field is that of the dots

    const char *stage = is_lit ? "optics" : "sensor";
    const FieldCoefficients field = fit_field(geometry, m.frames.mean, 4);
    sink.put(stage, "gradient_x", unit, field[1] / light);
    sink.put(stage, "gradient_y", unit, field[2] / light);
    sink.put(stage, "radial_falloff", unit, field[3] / light);
    if (geometry.scene == CaptureScene::kFlat) {
        const FieldCoefficients full = fit_field(geometry, m.frames.mean, kFieldTerms);
        sink.put(stage, "radial_falloff_4", unit, full[4] / light);
    }
    if (!is_lit || geometry.is_static_laser())
        return; // one pattern of speckle is too few for nine regions
    // The mean of the last region follows from the others and the mean of all: the centre is left out.
    std::array<double, 9> total{};
    double sum_all = 0.0;
    for (std::size_t y = 0; y < geometry.height; ++y)
        for (std::size_t x = 0; x < geometry.width; ++x)
            total[geometry.region_of(x, y)] += double(m.frames.mean[y * geometry.width + x]);
    for (const double region : total)
        sum_all += region;
    const double all = sum_all / double(geometry.used);
    for (std::size_t k = 0; k < 9; ++k)
        if (k != 4 && geometry.region_used[k] > 0.0)
            sink.put(stage, "region_mean", "r" + std::to_string(k / 3) + "c" + std::to_string(k % 3), "1",
                     (total[k] / geometry.region_used[k] - all) / light);
}

} // namespace clsp::statistics
