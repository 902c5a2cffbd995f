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

// counts: 0 where a pixel is left out. trend_degree: of what was taken away before; its terms cost degrees of freedom.
VarianceComponents variance_components(const ImageShape &shape, const std::vector<double> &image,
                                       const std::vector<std::uint8_t> &counts, std::size_t trend_degree = 0);

// The image without a polynomial of degree 4: the lamp's shape times the lens's fall-off, of degree 2 each.
constexpr std::size_t kPatternTrend = 4;
std::vector<double> without_trend(const ImageShape &shape, std::vector<double> image,
                                  const std::vector<std::uint8_t> &counts);

// Pixels that stand out of the image without its trend are defects, not the sensor's fixed pattern: takes them out of
// `counts`. The part of the counted pixels that they were.
double leave_out_defects(const ImageShape &shape, const std::vector<double> &image, std::vector<std::uint8_t> &counts);

// A polynomial of degree 2: 1, u, v, u^2, u v, v^2, with u and v from -1/2 to 1/2 across the image.
struct SmoothTrend {
    std::array<double, 6> terms{}, errors{}; // least squares; robust to whatever rows, columns and neighbors share
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
