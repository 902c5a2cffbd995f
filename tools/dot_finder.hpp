/**
 * @file dot_finder.hpp
 * @brief Where the dots of a projected pattern are in an image.
 */
#ifndef CLSPECKLE_TOOLS_DOT_FINDER_HPP
#define CLSPECKLE_TOOLS_DOT_FINDER_HPP

#include <array>
#include <cstdint>
#include <vector>

namespace tools {

struct FoundDots {
    double sigma_px = 0.0;                           ///< Of the Gaussian dots, as imaged: the median.
    std::vector<std::array<double, 2>> positions_px; ///< x, y; row by row.
};

/**
 * Local maxima above the noise, each fitted by a Gaussian on the pixels that the image has, so that dots which the
 * border cuts are in their places, too.
 *
 * @param image height x width: the mean of frames; with independent speckle in each its grain averages out.
 * @param noise_dn standard deviation of a pixel of it.
 */
FoundDots find_dots(const std::vector<float> &image, std::uint32_t width, std::uint32_t height, double noise_dn);

/**
 * The width of ideal dots that a lens without aberrations images so wide.
 *
 * @param pupil_diameter cycles per pixel: pixel pitch over wavelength times f-number.
 */
double sigma_before_lens(double imaged_px, double pupil_diameter);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DOT_FINDER_HPP
