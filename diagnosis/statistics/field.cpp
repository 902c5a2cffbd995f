// The mean image over the field: fall-off, gradient, regions; and between the four sites of a 2 x 2 mosaic.
#include "statistics/statistic_groups.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace clsp::statistics {

namespace {

// Row, column and checker contrast of the four sites.
std::array<double, 3> contrasts_of(const std::array<double, 4> &site) {
    return {site[0] + site[1] - site[2] - site[3], site[0] - site[1] + site[2] - site[3],
            site[0] - site[1] - site[2] + site[3]};
}

// Of their means.
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
    std::array<double, 3> contrasts = contrasts_of(site);
    for (double &contrast : contrasts)
        contrast *= 0.5;
    return contrasts;
}

// Of the windows of laser light, and from one to the next: squared sines, which add up to 1.
constexpr std::size_t kWindow = 16, kHop = kWindow / 2;

struct WindowedContrasts {
    std::array<double, 3> sum{}, square{}; // of the windows' contrasts
    double weight = 0.0;                   // of the pixels that are used, in all windows
};

// The contrasts of laser light within smooth windows that lie wholly inside: what the lens resolves is no mosaic, and
// where an image ends an alternating sum holds half of a pixel's light. Simulated speckle goes on from one border to
// the other, where that cancels; a camera's ends.
WindowedContrasts windowed_contrasts(const Geometry &geometry, const std::vector<float> &mean) {
    std::array<double, kWindow> window;
    for (std::size_t i = 0; i < kWindow; ++i)
        window[i] = std::pow(std::sin(M_PI * (double(i) + 0.5) / kWindow), 2);
    WindowedContrasts result;
    if (geometry.width < kWindow || geometry.height < kWindow)
        return result;
    const std::size_t columns = (geometry.width - kWindow) / kHop + 1, rows = (geometry.height - kWindow) / kHop + 1;
    struct Site {
        double light = 0.0, weight = 0.0;
    };
    // Sums of even and of odd pixels of each window's rows, then of the windows.
    std::vector<std::array<Site, 2>> of_row(columns);
    std::vector<std::array<Site, 4>> sites(columns * rows);
    for (std::size_t y = 0; y < geometry.height; ++y) {
        for (std::size_t k = 0; k < columns; ++k) {
            of_row[k] = {};
            for (std::size_t i = 0; i < kWindow; ++i) {
                const std::size_t pixel = y * geometry.width + k * kHop + i;
                Site &site = of_row[k][i % 2]; // kHop is even
                site.light += window[i] * double(mean[pixel]);
                site.weight += geometry.is_used(pixel) ? window[i] : 0.0;
            }
        }
        for (std::size_t half = 0; half < 2; ++half) {
            const std::size_t block = y / kHop;
            if (block < half || block - half >= rows)
                continue;
            const double weight = window[y % kHop + half * kHop];
            std::array<Site, 4> *const to = sites.data() + (block - half) * columns;
            for (std::size_t k = 0; k < columns; ++k)
                for (std::size_t odd = 0; odd < 2; ++odd) {
                    to[k][2 * (y % 2) + odd].light += weight * of_row[k][odd].light;
                    to[k][2 * (y % 2) + odd].weight += weight * of_row[k][odd].weight;
                }
        }
    }
    for (const std::array<Site, 4> &site : sites) {
        // Of the means of the sites, as a mask leaves more of some than of others.
        std::array<double, 4> means{};
        double weight = 0.0, least = site[0].weight;
        for (std::size_t k = 0; k < 4; ++k) {
            means[k] = ratio(site[k].light, site[k].weight);
            weight += site[k].weight;
            least = std::min(least, site[k].weight);
        }
        if (!(least > 0.0))
            continue;
        const std::array<double, 3> contrast = contrasts_of(means);
        for (std::size_t k = 0; k < 3; ++k) {
            const double weighted = 0.5 * weight * contrast[k];
            result.sum[k] += weighted;
            result.square[k] += weighted * weighted;
        }
        result.weight += weight;
    }
    return result;
}

// Of one pattern of speckle a few speckles, the brightest and those that clip, make most: the sum over the root of the
// sum of squares is made large by no single one of them. Of many patterns relative to the light.
std::array<double, 3> laser_mosaic_contrasts(const Geometry &geometry, const Frames &frames) {
    const WindowedContrasts found = windowed_contrasts(geometry, frames.mean);
    std::array<double, 3> result{};
    for (std::size_t k = 0; k < 3; ++k)
        result[k] = geometry.moving ? ratio(found.sum[k], found.weight * frames.light)
                                    : ratio(found.sum[k], std::sqrt(found.square[k]));
    return result;
}

} // namespace

void measure_field(const StatisticInput &in, Sink &sink) {
    const Geometry &geometry = in.geometry;
    const bool is_lit = geometry.is_lit();
    const double light = is_lit ? in.frames.light : 1.0;
    const char *unit = is_lit ? "1" : "DN";
    std::array<double, 3> mosaic;
    if (geometry.is_laser()) {
        mosaic = laser_mosaic_contrasts(geometry, in.frames);
    } else {
        mosaic = mosaic_contrasts(geometry, in.frames.mean);
        for (double &contrast : mosaic)
            contrast /= light;
    }
    sink.put("sensor", "mosaic_rows", unit, mosaic[0]);
    sink.put("sensor", "mosaic_columns", unit, mosaic[1]);
    sink.put("sensor", "mosaic_checker", unit, mosaic[2]);
    if (geometry.scene == CaptureScene::kDots)
        return; // their light over the field is that of the dots

    const char *stage = is_lit ? "optics" : "sensor";
    const FieldCoefficients field = fit_field(geometry, in.frames.mean, 4);
    sink.put(stage, "gradient_x", unit, field[1] / light);
    sink.put(stage, "gradient_y", unit, field[2] / light);
    sink.put(stage, "radial_falloff", unit, field[3] / light);
    if (geometry.scene == CaptureScene::kFlat) {
        const FieldCoefficients full = fit_field(geometry, in.frames.mean, kFieldTerms);
        sink.put(stage, "radial_falloff_4", unit, full[4] / light);
    }
    if (!is_lit || geometry.is_static_laser())
        return; // one pattern of speckle is too few for nine regions
    // The mean of the last region follows from the others and the mean of all: the centre is left out.
    std::array<double, 9> total{};
    double sum_all = 0.0;
    for (std::size_t y = 0; y < geometry.height; ++y)
        for (std::size_t x = 0; x < geometry.width; ++x)
            total[geometry.region_of(x, y)] += double(in.frames.mean[y * geometry.width + x]);
    for (const double region : total)
        sum_all += region;
    const double all = sum_all / double(geometry.used);
    for (std::size_t k = 0; k < 9; ++k)
        if (k != 4 && geometry.region_used[k] > 0.0)
            sink.put(stage, "region_mean", "r" + std::to_string(k / 3) + "c" + std::to_string(k % 3), "1",
                     (total[k] / geometry.region_used[k] - all) / light);
}

} // namespace clsp::statistics
