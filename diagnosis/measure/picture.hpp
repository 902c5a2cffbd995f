// Images of a report.
#pragma once

#include <cstdint>
#include <vector>

namespace clsp {

// An image for eyes: 8 bits, row by row, gray (1 channel) or red, green, blue (3 channels).
struct Picture {
    std::uint32_t width = 0, height = 0, channels = 1;
    double low_dn = 0.0, high_dn = 0.0; // shown as the darkest and the brightest (gray), as blue and red (colour)
    std::vector<std::uint8_t> pixels;

    bool empty() const { return pixels.empty(); }
};

namespace evidence {

Picture gray_picture(const std::vector<float> &plane, std::uint32_t width, std::uint32_t height, double low,
                     double high);
// Blue for -reach, white for 0, red for reach.
Picture diverging_picture(const std::vector<float> &plane, std::uint32_t width, std::uint32_t height, double reach);

} // namespace evidence
} // namespace clsp
