// What a gap means for a depth camera: errors of the dots' centres, and of the depth that follows from them.
#pragma once

#include "measure/diagnosis_result.hpp"

#include <cstdint>
#include <functional>
#include <vector>

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

// Frames of one version (0: the camera's) of a sequence.
using VersionFrames =
    std::function<std::vector<std::uint16_t>(std::size_t version, std::size_t sequence, std::uint32_t frame_count)>;

// Of two or three versions: the camera's, the simulator's, and with effects. simulated_dots: where the dots of all but
// the camera's are meant to be; nullptr: where the layout says. Otherwise as below.
Downstream measure_downstream(const CaptureLayout &layout, const CaptureDots *simulated_dots, std::size_t versions,
                              const VersionFrames &frames, const std::function<void()> &checkpoint);

// Not valid without a sequence of dots. Moving sequences if there are any: their frames have independent speckle.
// final: nullptr if no effect was found; `after` is then `before`.
Downstream measure_downstream(ReplicateRunner &runner, const Capture &real, const FittedModel &baseline,
                              const FittedModel *final, std::uint64_t seed = 0);

} // namespace clsp
