// Where what capture.json says of a camera and its sequences contradicts their codes.
#pragma once

#include "capture/capture_check.hpp"

#include <vector>

namespace clsp {

// How far a dot's light reaches, in its sigma.
constexpr double kDotReach = 4.0;

// Of a valid capture, the scans and the summaries of its sequences, and what changes between their frames. Nothing here
// stops a diagnosis.
std::vector<CaptureWarning> metadata_warnings(const Capture &capture, const std::vector<SequenceScan> &scans,
                                              const std::vector<SequenceSummary> &summaries, const DarkLevel &dark,
                                              const std::vector<SequenceChange> &frame_changes);

// Read noise that dark frames show, in DN; 0 without two of them, or where their codes never change.
double measured_noise(const std::vector<SequenceSummary> &summaries);

// How much of a sequence's spatial variance is new in the next frame, sensor noise taken out of both: near 1 where a
// board's speckle is new in each frame, near 0 where it stays.
struct FrameChange {
    bool measured = false;   // enough light over the noise, and two frames
    double successive = 0.0; // from one frame to the next
    double distant = 0.0; // between frames half a sequence apart; that of successive ones if there are fewer than four
};
FrameChange frame_change(const Capture &capture, std::size_t sequence, double level_above_dark_dn, double noise_dn);

} // namespace clsp
