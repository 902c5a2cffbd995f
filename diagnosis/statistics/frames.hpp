// The frames of a sequence as signals.
#pragma once

#include "statistics/geometry.hpp"
#include "statistics/spare_buffers.hpp"

#include <cstdint>
#include <vector>

namespace clsp::statistics {

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

} // namespace clsp::statistics
