// What a gap means for a depth camera: errors of the dots' centres, and of the depth that follows from them.
#pragma once

#include "attribution/diagnosis.hpp"

#include <cstdint>

namespace clsp {

// Depth camera for which depth errors are stated; the focal length in pixels is the image's width, a field of view of
// 53 degrees.
constexpr double kDepthDistance = 1.0;  // m
constexpr double kDepthBaseline = 0.05; // m

// Errors of dots' centres in single frames of one sequence.
struct CentreErrors {
    double square_sum = 0.0;                // px^2, of dx^2 + dy^2
    double square_sum_x = 0.0, count = 0.0; // along the rows; dots that were found

    double rms() const;
    double rms_x() const;
};

// Centroid of the light above the surroundings within two standard deviations of each dot, about its nominal place and
// then once more about itself. Dots without light above their surroundings, masked ones and those at the edge are left
// out.
CentreErrors centre_errors(const CaptureLayout &layout, const SequenceLayout &sequence, const std::uint16_t *codes,
                           std::uint32_t frame_count);

// Not valid without a sequence of dots. Moving sequences if there are any: their frames have independent speckle.
// final: nullptr if no effect was found; `after` is then `before`.
Downstream measure_downstream(Experiment &experiment, const Capture &real, const FittedModel &baseline,
                              const FittedModel *final, std::uint64_t seed = 0);

} // namespace clsp
