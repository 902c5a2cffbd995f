// Small tiles of a sequence's frames, which tell how its noise is correlated and whether the picture moves.
#pragma once

#include "capture/capture.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clsp {

// How far the picture of a frame lies from where it is in frame 0, in pixels: to the right, down.
struct PictureShift {
    double x = 0.0, y = 0.0;
    // That it is another place, by the tiles' agreement (1e-6 in a sequence), 0.03 pixels away, and that this explains
    // 40 % of what differs.
    bool sure = false;
};

// Of the noise of a pixel and another one, without what all pixels of a row or column share.
struct NoiseCorrelation {
    double value = 0.0;
    bool sure = false; // that it is not zero, by the tiles' agreement (1e-6)
};

struct NoiseCorrelations {
    NoiseCorrelation right, down; // of neighbours
    NoiseCorrelation next;        // of a pixel and itself in the next frame
    NoiseCorrelation rows;        // of the means of neighbouring rows
    double rows_dn = 0.0;         // deviation of the rows' means in time
};

// Of one frame, without what the frame, a row or a column shares: mean squares over the pixels, in DN^2.
struct FrameNoise {
    double square = 0.0; // about the pixels' means over frames
    double step = 0.0;   // of the difference to the frame before; 0 of frame 0
};

struct FrameNoises {
    std::vector<FrameNoise> frames;
    double pixels = 0.0; // that it is a mean of, less those that the rows' and columns' means take
};

// 16 tiles of up to 64 x 64 pixels, fewer of many frames, of the first 1024 frames: 8 MB at most.
class FrameSample {
  public:
    FrameSample(const CaptureLayout &layout, std::uint32_t frames);

    // Rows [first_row, first_row + row_count) of a frame.
    void add(std::uint32_t frame, std::uint32_t first_row, std::uint32_t row_count, const std::uint16_t *rows);

    // mask: empty, or 0 where a pixel of the image does not count. Of each frame; of scenes at rest that have grain or
    // dots. Empty where too little of the sample counts.
    std::vector<PictureShift> shifts(const std::vector<std::uint8_t> &mask) const;
    // Of dark frames and even light. Pixels that have 4 times the usual variance, or that clip, do not count.
    NoiseCorrelations correlations(const std::vector<std::uint8_t> &mask) const;
    // Of scenes at rest, with the same pixels. Empty where too little of the sample counts.
    FrameNoises noise(const std::vector<std::uint8_t> &mask) const;

  private:
    static constexpr std::size_t kTilesAcross = 4, kTiles = kTilesAcross * kTilesAcross;
    struct Corner {
        std::uint32_t x, y;
    };

    std::size_t tile_pixels() const { return std::size_t{tile_width_} * tile_height_; }
    const std::uint16_t *tile(std::uint32_t frame, std::size_t k) const {
        return codes_.data() + (std::size_t{frame} * kTiles + k) * tile_pixels();
    }
    // What a tile's noise is measured about.
    struct NoiseTile {
        std::size_t k = 0;
        std::vector<float> counts, means, away; // by pixel: 1 or 0, the mean over frames, that from the tile's
        double pixels = 0.0, spread = 0.0;      // that count; sum of the squares of away
        std::vector<float> in_row, in_column;   // pixels that count
    };
    // Those that have enough pixels, of the first frames.
    std::vector<NoiseTile> noise_tiles(const std::vector<std::uint8_t> &mask, std::uint32_t frames) const;
    // The noise of a frame by pixel, without what the frame, a row or a column shares; row_means: what was.
    void noise_of(const NoiseTile &of, std::uint32_t frame, std::vector<float> &rest,
                  std::vector<float> &row_means) const;
    // By pixel of a tile.
    std::vector<std::uint8_t> counted(std::size_t k, const std::vector<std::uint8_t> &mask) const;

    std::uint32_t width_, height_, frames_;
    std::uint16_t top_;
    std::uint32_t tile_width_, tile_height_;
    std::array<Corner, kTiles> corners_;
    std::vector<std::uint16_t> codes_;
};

} // namespace clsp
