// The image that a pattern becomes: W/sr over direction cosines, centred on the axis.
#pragma once

#include <cstdint>

namespace clsp {

struct PatternImage {
    double power_w = 1; // of the beam
    std::uint32_t image_width = 2048, image_height = 2048;
    double half_extent_x = 0, half_extent_y = 0;
};

// zero_extent: a half extent of 0 is allowed and stands for all that a design can reach.
void check_pattern_image(const PatternImage &image, bool zero_extent);

} // namespace clsp
