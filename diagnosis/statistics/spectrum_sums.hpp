// The power spectrum of images under a Hann window: a real frame is not periodic, and its edges would leak into all
// frequencies.
#pragma once

#include "statistics/geometry.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace clsp::statistics {

// The largest even size with no prime factor above 5, which a transform takes fast; 1 if there is none. A spectrum is
// that of the middle of an image, so large.
std::size_t transform_size(std::size_t size);
std::vector<float> hann(std::size_t size); // of 1 for sizes of 1 and 2

// Power of the images by spatial frequency. Mean densities over the total power's.
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
    double prominence = 0.0; // how far it stands out: a standard normal number where there is noise alone
};
bool has_outside(const Geometry &geometry);
// line: gets that of the first image, if not nullptr.
SpectrumSums sum_spectrum(const Geometry &geometry, double cutoff, const std::vector<const float *> &images,
                          unsigned threads, SpectralLine *line = nullptr);

} // namespace clsp::statistics
