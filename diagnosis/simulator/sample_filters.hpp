// Filters of samples whose picture between them is the band-limited one.
#pragma once

#include "stages/filter.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

constexpr std::uint32_t kPixelAreaGuardPx = 16;
// What a pixel of that width (of the pixels' distance) integrates: h(d) = integral of sinc(d - t) over |t| < width / 2,
// the spectrum multiplied by sinc(width f).
PointSpread pixel_area_spread(double fill_factor);

// The image moved by (dx, dy) px, interpolated with Lanczos's window of 4 px; beyond its borders it goes on with its
// edge pixels.
std::vector<float> shifted(const std::vector<float> &image, std::uint32_t width, std::uint32_t height, double dx,
                           double dy);

} // namespace clsp
