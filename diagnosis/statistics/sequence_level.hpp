// What the nuisances are calibrated on: the mean of a sequence and the noise of its pixels.
#pragma once

#include "capture/capture.hpp"

#include <cstddef>
#include <cstdint>

namespace clsp {

struct SequenceLevel {
    double mean_dn = 0.0; // of all unmasked pixels and frames
    // Of pixels: rows, columns and whole frames taken out, robust against hot pixels; 0 of a single frame.
    double temporal_noise_dn = 0.0;
};
SequenceLevel sequence_level(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                             std::uint32_t frame_count);
// Its mean alone.
double sequence_mean_dn(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                        std::uint32_t frame_count);

} // namespace clsp
