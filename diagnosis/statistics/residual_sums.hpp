// Sums over the residuals: moments, correlations between pixels and between frames, motion of the image.
#pragma once

#include "statistics/frame_sums.hpp"

#include <array>
#include <cstddef>
#include <vector>

namespace clsp::statistics {

// Frames apart, below frame_count: 1, 2, (4, 8 of a static laser scene,) frame_count / 2.
std::vector<std::size_t> temporal_lags(const Geometry &geometry);

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
