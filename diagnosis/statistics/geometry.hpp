// What is known of a sequence before its first frame: the mask, pairs of pixels at a lag, the smooth field, regions,
// dots.
#pragma once

#include "capture/capture.hpp"
#include "statistics/sums.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clsp::statistics {

constexpr int kMaximumLag = 8;
constexpr std::size_t kFieldTerms = 5; // 1, x, y, r^2, r^4
constexpr std::size_t kBin = 4; // pixels along an edge of the bins for long lags

// Lattice of the dots. Lengths in pixels.
struct DotGeometry {
    double sigma = 0.0, spacing = 0.0; // spacing: mean distance to the nearest neighbour
    std::vector<std::array<double, 2>> positions;
    std::vector<double> cell_radius;    // of each dot: half the distance to its nearest neighbour, at most 5 sigma
    std::vector<float> distance;        // of each pixel from the nearest dot, capped
    std::vector<std::uint32_t> between; // pixels far from every dot
    std::vector<std::array<double, 2>> cell_centres, half_ways, mirrored_both, mirrored_x, mirrored_y;
};

struct Geometry {
    // whole: with what levels can do without, that is regions, dots and the sums of the smooth field.
    Geometry(const CaptureLayout &layout, std::size_t sequence, std::uint32_t frame_count, bool whole = true);

    bool is_lit() const { return scene != CaptureScene::kDark; }
    bool is_laser() const { return clsp::is_laser(scene); }
    bool is_static_laser() const { return is_laser() && !moving; }
    bool is_masked() const { return !weight.empty(); }
    bool is_used(std::size_t pixel) const { return weight.empty() || weight[pixel] != 0.0f; }
    double pairs(Lag lag) const; // |dx|, |dy| <= kMaximumLag
    std::size_t region_of(std::size_t x, std::size_t y) const { return 3 * (3 * y / height) + 3 * x / width; }

    CaptureScene scene = CaptureScene::kDark;
    bool moving = false;
    double light_error = 0.0; // of a flat whose light goes as its exposure; 0: of all others
    bool exposures_differ = false; // dark, and not all dark sequences have the same exposure time
    std::size_t width = 0, height = 0, pixels = 0, frames = 0;
    double maximum_code = 0.0, cutoff = 0.0; // cutoff: highest spatial frequency of the intensity, cycles per pixel (D)
    std::array<double, 2> principal_point{};
    double corner_radius = 1.0; // px; r = 1 there
    std::vector<float> weight;  // 0 or 1 by pixel; empty without a mask
    std::size_t used = 0;       // pixels that are not masked
    std::vector<double> row_used, column_used;
    std::vector<double> field_x, field_y; // by column and row, from the principal point, in corner radii
    std::vector<float> bin_used;          // unmasked pixels of each bin
    std::array<double, 9> region_used{};
    // Sums of the products of two terms of the smooth field over the unmasked pixels; the upper half is 0.
    std::array<std::array<double, kFieldTerms>, kFieldTerms> field_gram{};
    DotGeometry dots; // of scene dots

  private:
    void set_mask(const std::vector<std::uint8_t> &mask);
    void sum_field();
    std::vector<double> pairs_; // (2 kMaximumLag + 1) x (kMaximumLag + 1), masked only
};

using FieldCoefficients = std::array<double, kFieldTerms>;

// Least squares of the first `terms` over the unmasked pixels; the others are 0. All 0 if the pixels do not determine
// them.
FieldCoefficients fit_field(const Geometry &geometry, const std::vector<float> &image, std::size_t terms);
// image - field; masked pixels become 0.
std::vector<float> without_field(const Geometry &geometry, const std::vector<float> &image,
                                 const FieldCoefficients &field);

DotGeometry make_dot_geometry(const Geometry &geometry, const CaptureDots &dots);

} // namespace clsp::statistics
