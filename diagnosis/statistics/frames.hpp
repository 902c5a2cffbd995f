// The frames of a sequence as signals, and sums over each of them.
#pragma once

#include "statistics/geometry.hpp"
#include "statistics/sequence_statistics.hpp"
#include "statistics/spare_buffers.hpp"

#include <cstdint>
#include <vector>

namespace clsp::statistics {

// Lags of pixel pairs in the noise: right, down, both diagonals, two right, two down.
constexpr std::array<Lag, 6> kNoiseLags{{{1, 0}, {0, 1}, {1, 1}, {-1, 1}, {2, 0}, {0, 2}}};
// Frames apart, below frame_count: 1, 2, (4, 8 of a static laser scene,) frame_count / 2.
std::vector<std::size_t> temporal_lags(const Geometry &geometry);

struct Frames {
    std::vector<double> frame_mean; // DN above the black level, by frame
    double mean_signal = 0.0;       // their mean
    double light = 1.0;         // what relative statistics divide by: the mean signal, or the read noise in the dark
    double read_variance = 1.0; // calibrated, at least that of rounding
    std::vector<float> mean;    // image, DN above the black level; masked pixels 0
    // Frame minus mean image, zero on average over the frame; the mean of each frame of a static laser scene is first
    // scaled to that of all, so that flicker of the laser is out. There a code that clips has no residual, and the mean
    // image goes without it if it can. Masked pixels 0. Empty for a single frame, and where the device has it.
    SpareBuffers<float>::Buffer residual;
    std::vector<double> row_mean;         // of the residual: frames x height
    std::vector<float> variance;          // of each pixel over time, unbiased; masked pixels 0
    double pixel_variance = 0.0;          // its mean; the read variance of a single frame
    std::vector<std::uint64_t> histogram; // codes 0 ... maximum

    const float *residual_of(const Geometry &geometry, std::size_t frame) const {
        return residual.data() + frame * geometry.pixels;
    }
};

class FrameSums;
// sums: takes the sums over pixels, here and from here on.
Frames make_frames(const Geometry &geometry, const std::uint16_t *codes, const Calibration &calibration,
                   FrameSums &sums);

// Sums over the residuals of all frames, in the order of the frames.
struct ResidualSums {
    Powers powers;
    double column_variance = 0.0;                  // of column means times their pixels, mean over columns and frames
    std::array<double, kNoiseLags.size()> noise{}; // correlation at kNoiseLags
    std::vector<double> temporal;                  // correlation at temporal_lags()
    // Motions of the image of a static laser scene, by frame, in px (turn and breathing: px at the corner): the
    // residual regressed on the derivative of the mean image with respect to the motion. information: sum of squares of
    // that derivative.
    struct Motion {
        double information = 0.0;
        std::vector<double> amount;
    };
    std::array<Motion, 4> motions; // right, down, turn, breathing
};

ResidualSums sum_residuals(const Geometry &geometry, const Frames &frames, FrameSums &sums);

} // namespace clsp::statistics
