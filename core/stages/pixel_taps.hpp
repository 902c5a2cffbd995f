// Weights that turn samples of a band-limited intensity into its integral over a pixel's light-sensitive area.
#pragma once

#include <cstdint>
#include <vector>

namespace clsp {

// A square of side sqrt(fill_factor) pixels has the transfer function sinc(sqrt(fill_factor) f) along each axis, f in
// cycles per pixel. The symmetric weights whose transfer function is nearest to it, in the mean square over |f| <=
// bandwidth (the intensity's, twice the pupil's radius), and equal at f = 0. Samples lie 1 / oversampling of a pixel
// apart; weights of them, an even number where oversampling is even, are centred on the pixel.
std::vector<double> pixel_taps(double fill_factor, std::uint32_t oversampling, double bandwidth_cycles_per_pixel);

} // namespace clsp
