// The grid that fields live on: oversampled, and padded to a size that the FFT takes.
#pragma once

#include <cstdint>

namespace clsp {

struct FieldGrid {
    std::uint32_t width = 0, height = 0; // the image, in pixels
    std::uint32_t oversampling = 1;      // samples per pixel along each axis
    std::uint32_t guard_px = 0;          // padding at least this wide
    std::uint32_t grid_width = 0, grid_height = 0;

    std::uint64_t samples() const { return std::uint64_t{grid_width} * grid_height; }
    bool same_as(const FieldGrid &other) const {
        return width == other.width && height == other.height && oversampling == other.oversampling &&
               guard_px == other.guard_px;
    }
};

// Checks the first four members and computes the grid's size.
FieldGrid make_field_grid(std::uint32_t width, std::uint32_t height, std::uint32_t oversampling,
                          std::uint32_t guard_px);

// The smallest n >= least that has no prime factor above 13.
std::uint32_t fft_size_at_least(std::uint32_t least);

constexpr std::uint32_t kMaxOversampling = 8;
// 8192 x 8192. clFFT goes astray somewhere above (at 16384 x 16384 it crashes on PoCL).
constexpr std::uint64_t kMaxGridSamples = std::uint64_t{1} << 26;

} // namespace clsp
