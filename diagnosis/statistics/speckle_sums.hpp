// Sums over images of speckle: the residuals of a moving scene, or the one mean image of a static one.
#pragma once

#include "statistics/geometry.hpp"

#include <array>
#include <vector>

namespace clsp::statistics {

constexpr std::array<Lag, 12> kSpeckleLags{
    {{1, 0}, {2, 0}, {3, 0}, {6, 0}, {0, 1}, {0, 2}, {0, 3}, {0, 6}, {1, 1}, {-1, 1}, {2, 2}, {-2, 2}}};
// Rings of long lags, in bins of 4 x 4 pixels: beyond the first edge, up to the second.
constexpr std::array<std::array<int, 2>, 3> kRings{{{2, 3}, {3, 5}, {5, 8}}};

struct SpeckleSums {
    double variance = 0.0; // DN^2
    std::array<double, kSpeckleLags.size()> correlation{};
    std::array<double, kRings.size()> ring{};  // correlation
    double lopsided_x = 0.0, lopsided_y = 0.0; // <a b (a - b)> of neighbours over sigma^3
    double binned_skewness = 0.0;              // of bins of 4 x 4 pixels
    std::array<double, 9> region_variance{},
        region_neighbour{}; // variance, correlation of neighbours (mean of x and y)
};

// Of one image.
struct SpeckleFrameSums {
    double square = 0.0, lopsided_x = 0.0, lopsided_y = 0.0;
    std::array<double, kSpeckleLags.size()> lag{};
    std::array<double, kRings.size()> ring{};
    Powers bins;
    std::array<double, 9> region_square{}, region_neighbour{};
};
// Lags of each ring in bins, half of the plane: the other half is its mirror image.
const std::array<std::vector<Lag>, kRings.size()> &ring_lags();
// image: of geometry.pixels, zero on average, masked pixels 0.
SpeckleFrameSums sum_speckle_image(const Geometry &geometry, const float *image);
SpeckleSums combine_speckle(const Geometry &geometry, const std::vector<SpeckleFrameSums> &parts);

} // namespace clsp::statistics
