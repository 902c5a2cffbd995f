// Speckle on a board: the law of its intensity, its correlation and spectrum, its contrast over the field.
#include "statistics/histogram_share.hpp"
#include "statistics/speckle_sums.hpp"
#include "statistics/spectrum_sums.hpp"
#include "statistics/statistic_groups.hpp"

#include <algorithm>
#include <cmath>

namespace clsp::statistics {

void measure_intensity_law(const StatisticInput &in, Sink &sink) {
    const std::vector<std::uint64_t> &histogram = in.frames.histogram;
    const double total = double(in.geometry.frames) * double(in.geometry.used), light = in.frames.light;
    double second = 0.0, third = 0.0, fourth = 0.0;
    for (std::size_t code = 0; code < histogram.size(); ++code) {
        const double deviation = (double(code) - in.black_level_dn - in.frames.mean_signal) / light,
                     squared = deviation * deviation;
        const double share = double(histogram[code]) / total;
        second += share * squared;
        third += share * squared * deviation;
        fourth += share * squared * squared;
    }
    sink.put("surface", "intensity_skewness", "1", third / std::pow(second + 1e-6, 1.5));
    sink.put("surface", "intensity_kurtosis", "log", std::log((fourth + 1e-9) / (second * second + 1e-9)));
    // Distribution function at multiples of the mean.
    for (const int percent : {5, 10, 25, 50, 100, 200, 300, 400}) {
        const double above = share_above(histogram, total, in.black_level_dn, 0.01 * percent * light);
        sink.put("surface", "intensity_below_" + std::to_string(percent) + "_percent", "1", 1.0 - above);
    }
}

namespace {

void put_correlation(const SpeckleSums &sums, bool odd_moments, Sink &sink) {
    for (std::size_t k = 0; k < kSpeckleLags.size(); ++k) {
        const Lag lag = kSpeckleLags[k];
        if (lag.dx < 0)
            continue; // with its mirror image
        if (lag.dx != 0 && lag.dy != 0) {
            sink.put("optics", "speckle_correlation_diagonal" + std::to_string(lag.dx), "1",
                     0.5 * (sums.correlation[k] + sums.correlation[k + 1]));
            continue;
        }
        sink.put("optics",
                 "speckle_correlation_" + (lag.dx != 0 ? "x" + std::to_string(lag.dx) : "y" + std::to_string(lag.dy)),
                 "1", sums.correlation[k]);
    }
    const char *rings[] = {"speckle_correlation_8_to_12", "speckle_correlation_12_to_20",
                           "speckle_correlation_20_to_32"};
    for (std::size_t k = 0; k < kRings.size(); ++k)
        sink.put("optics", rings[k], "1", sums.ring[k]);
    if (!odd_moments)
        return;
    sink.put("sensor", "speckle_lopsided_x", "1", sums.lopsided_x);
    sink.put("sensor", "speckle_lopsided_y", "1", sums.lopsided_y);
    sink.put("surface", "speckle_binned_skewness", "1", sums.binned_skewness);
}

// Contrast of the nine regions over the whole's; correlation of neighbours in the centre, at the edges, in the corners.
void put_regions(const Geometry &geometry, const Frames &frames, const SpeckleSums &sums, Sink &sink) {
    std::array<double, 9> mean{};
    for (std::size_t y = 0; y < geometry.height; ++y)
        for (std::size_t x = 0; x < geometry.width; ++x)
            mean[geometry.region_of(x, y)] += double(frames.mean[y * geometry.width + x]);
    std::array<double, 3> neighbours{}, regions{};
    for (std::size_t k = 0; k < 9; ++k) {
        if (geometry.region_used[k] == 0.0)
            continue;
        const double local = std::max(mean[k] / geometry.region_used[k], 0.1 * frames.light);
        sink.put(
            "surface", "contrast", "r" + std::to_string(k / 3) + "c" + std::to_string(k % 3), "log",
            0.5 * log_ratio(sums.region_variance[k] / (local * local), sums.variance / (frames.light * frames.light)));
        const std::size_t zone = k == 4 ? 0 : k % 2 == 1 ? 1 : 2;
        neighbours[zone] += sums.region_neighbour[k];
        regions[zone] += 1.0;
    }
    const char *zones[] = {"centre", "edges", "corners"};
    for (std::size_t zone = 0; zone < 3; ++zone)
        if (regions[zone] > 0.0)
            sink.put("optics", "speckle_neighbour_correlation", zones[zone], "1", neighbours[zone] / regions[zone]);
}

void put_spectrum(const Geometry &geometry, const SpectrumSums &sums, Sink &sink) {
    for (std::size_t k = 0; k < kBands; ++k)
        if (k != 2) // the shares of all bands add up
            sink.put("optics", "power_band_" + std::to_string(k), "log", std::log(sums.band[k] + 1e-6));
    if (has_outside(geometry))
        sink.put("sensor", "power_beyond_cutoff", "log", std::log(sums.outside + 1e-6));
    sink.put("optics", "power_direction", "log", std::log(sums.direction));
    sink.put("sensor", "power_lines", "log", std::log(sums.peaks));
}

// Means of rows and columns of speckle and of nothing else have a known spread; smear and banding widen it.
void put_lines(const Geometry &geometry, const std::vector<float> &image, double variance, Sink &sink) {
    double rows = 0.0, columns = 0.0;
    std::vector<double> column(geometry.width);
    for (std::size_t y = 0; y < geometry.height; ++y) {
        const float *row = image.data() + y * geometry.width;
        const double total = sum(row, geometry.width);
        rows += ratio(total * total, geometry.row_used[y]) / double(geometry.height);
        for (std::size_t x = 0; x < geometry.width; ++x)
            column[x] += double(row[x]);
    }
    for (std::size_t x = 0; x < geometry.width; ++x)
        columns += ratio(column[x] * column[x], geometry.column_used[x]) / double(geometry.width);
    sink.put("sensor", "row_means", "log", log_ratio(rows, variance));
    sink.put("sensor", "column_means", "log", log_ratio(columns, variance));
}

} // namespace

void measure_speckle(const StatisticInput &in, Sink &sink) {
    const Geometry &geometry = in.geometry;
    // A moving scene shows new speckle in each frame: its residuals from the mean image, which falls off with the
    // light. A static scene shows one, whatever the frames; only the smooth field can be taken out of it.
    std::vector<SpeckleFrameSums> parts;
    std::vector<const float *> spectra;
    std::vector<float> still;
    double gain = 1.0, noise = in.frames.read_variance;
    if (geometry.moving && geometry.frames > 1) {
        parts = in.sums.sum_speckle(geometry, in.frames);
        const std::size_t count = std::min<std::size_t>(geometry.frames, 4);
        std::vector<std::size_t> which;
        for (std::size_t k = 0; k < count; ++k)
            which.push_back(k * geometry.frames / count);
        spectra = in.sums.residual_images(geometry, in.frames, which);
        gain = double(geometry.frames) / double(geometry.frames - 1);
    } else {
        still = without_field(geometry, in.frames.mean, fit_field(geometry, in.frames.mean, 4));
        parts.push_back(sum_speckle_image(geometry, still.data()));
        spectra.push_back(still.data());
        noise /= double(geometry.frames);
    }
    const SpeckleSums sums = combine_speckle(geometry, parts);
    const double light = in.frames.light;
    sink.put("surface", "contrast", "log", 0.5 * log_ratio((gain * sums.variance - noise) / (light * light), 1.0));
    // The residuals of two frames are each other's negative: their odd moments are 0.
    put_correlation(sums, parts.size() != 2, sink);
    if (geometry.moving)
        put_regions(geometry, in.frames, sums, sink); // one pattern is too few for nine regions
    put_spectrum(geometry, sum_spectrum(geometry, std::max(geometry.cutoff, 0.02), spectra, in.threads), sink);

    if (!geometry.moving || geometry.frames < 2) // the others' residuals tell of them as row_noise and column_noise
        put_lines(geometry, still, sums.variance, sink);
}

} // namespace clsp::statistics
