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

// Power of the images by spatial frequency, under a Hann window. Mean densities over the total power's.
constexpr std::size_t kBands = 6; // of |f| up to the optical cutoff
struct SpectrumSums {
    std::array<double, kBands> band{};
    double outside = 0.0;   // |f| beyond the cutoff; 0 if there are too few such frequencies
    double direction = 1.0; // power with |fx| > |fy| over power with |fx| < |fy|
    double peaks = 1.0;     // mean of (P / mean P of the ring)^2 / 2: 1 for noise, more with lines
};
// The wave that stands out most from its surroundings in a spectrum; frequency_x is 0 at least but for the error where
// it is 0.
struct SpectralLine {
    double amplitude = 0.0, frequency_x = 0.0, frequency_y = 0.0; // cycles per pixel
    bool stands_out = false; // beyond what chance makes of noise
};
bool has_outside(const Geometry &geometry);
// line: gets that of the first image, if not nullptr.
SpectrumSums sum_spectrum(const Geometry &geometry, double cutoff, const std::vector<const float *> &images,
                          unsigned threads, SpectralLine *line = nullptr);

} // namespace clsp::statistics
