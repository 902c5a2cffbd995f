#include "statistics/speckle_sums.hpp"

#include "statistics/sink.hpp"

#include <cmath>

namespace clsp::statistics {

namespace {

// Lags of a ring, half of the plane: the other half is its mirror image.
std::vector<Lag> lags_of_ring(const std::array<int, 2> &edges) {
    std::vector<Lag> lags;
    for (int dy = 0; dy <= edges[1]; ++dy)
        for (int dx = dy == 0 ? 1 : -edges[1]; dx <= edges[1]; ++dx) {
            const int squared = dx * dx + dy * dy;
            if (squared > edges[0] * edges[0] && squared <= edges[1] * edges[1])
                lags.push_back({dx, dy});
        }
    return lags;
}

std::vector<float> bin_image(const Geometry &geometry, const float *image) {
    const std::size_t bins_x = geometry.width / kBin, bins_y = geometry.height / kBin;
    std::vector<float> bins(bins_x * bins_y), rows(geometry.width);
    for (std::size_t by = 0; by < bins_y; ++by) {
        std::fill(rows.begin(), rows.end(), 0.0f);
        for (std::size_t y = by * kBin; y < (by + 1) * kBin; ++y)
            add(rows.data(), image + y * geometry.width, geometry.width);
        for (std::size_t bx = 0; bx < bins_x; ++bx)
            for (std::size_t k = 0; k < kBin; ++k)
                bins[by * bins_x + bx] += rows[bx * kBin + k];
    }
    return bins;
}

void sum_regions(const Geometry &geometry, const float *image, SpeckleFrameSums &sums) {
    const std::size_t width = geometry.width, height = geometry.height;
    for (std::size_t y = 0; y < height; ++y)
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t left = (c * width + 2) / 3, right = ((c + 1) * width + 2) / 3,
                              region = 3 * (3 * y / height) + c;
            const float *row = image + y * width + left;
            sums.region_square[region] += dot(row, row, right - left);
            sums.region_neighbour[region] += dot(row, row + 1, right - left - 1);
            if (y + 1 < height)
                sums.region_neighbour[region] += dot(row, row + width, right - left);
        }
}

} // namespace

const std::array<std::vector<Lag>, kRings.size()> &ring_lags() {
    static const std::array<std::vector<Lag>, kRings.size()> rings{lags_of_ring(kRings[0]), lags_of_ring(kRings[1]),
                                                                   lags_of_ring(kRings[2])};
    return rings;
}

SpeckleFrameSums sum_speckle_image(const Geometry &geometry, const float *image) {
    const std::size_t width = geometry.width, height = geometry.height;
    const auto &rings = ring_lags();
    SpeckleFrameSums sums;
    for (std::size_t y = 0; y < height; ++y) {
        const float *row = image + y * width;
        sums.square += dot(row, row, width);
        sums.lopsided_x += lopsided(row, row + 1, width - 1);
        if (y + 1 < height)
            sums.lopsided_y += lopsided(row, row + width, width);
    }
    for (std::size_t k = 0; k < kSpeckleLags.size(); ++k)
        sums.lag[k] = lag_sum(image, image, width, height, kSpeckleLags[k]);
    const std::vector<float> bins = bin_image(geometry, image);
    const std::size_t bins_x = width / kBin, bins_y = height / kBin;
    sums.bins.add(bins.data(), bins.size());
    for (std::size_t k = 0; k < rings.size(); ++k)
        for (const Lag &lag : rings[k])
            sums.ring[k] += lag_sum(bins.data(), bins.data(), bins_x, bins_y, lag);
    sum_regions(geometry, image, sums);
    return sums;
}

SpeckleSums combine_speckle(const Geometry &geometry, const std::vector<SpeckleFrameSums> &parts) {
    const auto &rings = ring_lags();
    std::array<double, kRings.size()> ring_pairs{};
    const std::size_t bins_x = geometry.width / kBin, bins_y = geometry.height / kBin;
    for (std::size_t k = 0; k < rings.size(); ++k)
        for (const Lag &lag : rings[k])
            ring_pairs[k] += lag_sum(geometry.bin_used.data(), geometry.bin_used.data(), bins_x, bins_y, lag);
    SpeckleFrameSums total;
    for (const SpeckleFrameSums &part : parts) {
        total.square += part.square;
        total.lopsided_x += part.lopsided_x;
        total.lopsided_y += part.lopsided_y;
        for (std::size_t k = 0; k < total.lag.size(); ++k)
            total.lag[k] += part.lag[k];
        for (std::size_t k = 0; k < total.ring.size(); ++k)
            total.ring[k] += part.ring[k];
        total.bins.add(part.bins);
        for (std::size_t k = 0; k < 9; ++k) {
            total.region_square[k] += part.region_square[k];
            total.region_neighbour[k] += part.region_neighbour[k];
        }
    }

    SpeckleSums sums;
    const double count = double(parts.size());
    sums.variance = ratio(total.square, count * double(geometry.used));
    const double cubed = std::pow(sums.variance, 1.5);
    for (std::size_t k = 0; k < total.lag.size(); ++k)
        sums.correlation[k] = ratio(ratio(total.lag[k], count * geometry.pairs(kSpeckleLags[k])), sums.variance);
    for (std::size_t k = 0; k < total.ring.size(); ++k)
        sums.ring[k] = ratio(ratio(total.ring[k], count * ring_pairs[k]), sums.variance);
    sums.lopsided_x = ratio(ratio(total.lopsided_x, count * geometry.pairs({1, 0})), cubed);
    sums.lopsided_y = ratio(ratio(total.lopsided_y, count * geometry.pairs({0, 1})), cubed);
    const double bin_count = count * double(bins_x * bins_y);
    sums.binned_skewness = ratio(total.bins.cube / bin_count, std::pow(total.bins.square / bin_count, 1.5));
    for (std::size_t k = 0; k < 9; ++k) {
        sums.region_variance[k] = ratio(total.region_square[k], count * geometry.region_used[k]);
        sums.region_neighbour[k] = ratio(0.5 * total.region_neighbour[k], total.region_square[k]);
    }
    return sums;
}

} // namespace clsp::statistics
