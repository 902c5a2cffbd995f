// Noise that a raw frame does not have: of cameras that denoise, sharpen, interpolate or average.
#pragma once

#include "capture/capture.hpp"
#include "capture/capture_check.hpp"
#include "capture/sequence_scan.hpp"

#include <vector>

namespace clsp {

// Of dark frames and even light: noise that neighbours share by 0.1 and more, without what a row or column shares, or a
// pixel and its next frame by 0.25 and more (a sensor's lag leaves less). Of light at rest: 0.6 of the dark frames'
// noise and less.
std::vector<CaptureWarning> noise_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                           const std::vector<SequenceSummary> &summaries, double dark_noise_dn);

} // namespace clsp
