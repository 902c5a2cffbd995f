// Dark frames whose lower half the converter cuts off: what lies behind code 0.
#pragma once

#include "capture/capture.hpp"
#include "measure/frame_stack.hpp"

#include <string>

namespace clsp {

constexpr double kMostZeros = 1e-4; // of dark codes: beyond it the cut-off takes 0.2 % of the variance away

struct ClippedDark {
    std::string unknown;                                     // why it cannot be told; empty: it can
    double level = 0.0, level_error = 0.0;                   // DN; standard errors hold the misfit of a Gaussian, too
    double variance = 0.0, variance_error = 0.0;             // over time, without the quantization's
    double fixed_variance = 0.0, fixed_variance_error = 0.0; // of pixels' offsets
};

// A Gaussian in codes of 1 DN, cut off at 0 and at an upper quantile, by maximum likelihood; the part of its variance
// that does not change is what makes cut-off pixels differ as much as these do.
ClippedDark estimate_clipped_dark(const Capture &capture, const FrameStack &stack);

} // namespace clsp
