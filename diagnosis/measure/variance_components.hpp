// An image's variance, split into that of whole rows, of whole columns and of single pixels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clsp {

struct ImageShape {
    std::size_t width = 0, height = 0;
    std::size_t size() const { return width * height; }
};

// Unbiased estimates, some of which chance makes negative. Mean squares and degrees of freedom tell their errors.
struct VarianceComponents {
    double pixel = 0.0, row = 0.0, column = 0.0;
    double pixel_error = 0.0; // standard error, whatever the distribution of pixels
    double row_square = 0.0, row_degrees = 0.0, column_square = 0.0,
           column_degrees = 0.0;            // of means of rows, of columns
    double per_row = 0.0, per_column = 0.0; // harmonic means of the number of pixels

    double total() const { return pixel + row + column; }
};

// counts: 0 where a pixel is left out. With a smooth trend of degree 2 taken away before: its terms cost degrees.
VarianceComponents variance_components(const ImageShape &shape, const std::vector<double> &image,
                                       const std::vector<std::uint8_t> &counts, bool without_trend = false);

// A polynomial of degree 2: 1, u, v, u^2, u v, v^2, with u and v from -1/2 to 1/2 across the image.
struct SmoothTrend {
    std::array<double, 6> terms{}, errors{}; // least squares; robust to whatever rows, columns and neighbours share
    double at(const ImageShape &shape, std::size_t pixel) const;
};
SmoothTrend fit_trend(const ImageShape &shape, const std::vector<double> &image,
                      const std::vector<std::uint8_t> &counts);

// The image without its smoothed self: box filters of 7 x 7 and 11 x 11, then binomial 3 x 3, mirrored at the borders
// (EMVA 1288, release 4.0, section 8.1).
struct HighPass {
    std::vector<double> image;
    double pixel_gain = 1.0, line_gain = 1.0; // of the variance of independent pixels; of independent rows or columns
};
HighPass high_pass(const ImageShape &shape, const std::vector<double> &image);

} // namespace clsp
