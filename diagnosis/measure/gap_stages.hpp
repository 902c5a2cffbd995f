// In which stage an unexplained gap lies, by the scenes that show it.
#pragma once

#include "measure/diagnosis_result.hpp"

#include <string>
#include <vector>

namespace clsp {

// The standard deviation that a place's z counts in; 0 where nothing tells it.
double deviation_of(const GapPlace &place);

// A statistic's own stage is that of the effects that it shows first; what causes a gap is unknown, and may be of
// another stage. Some stages are ruled out by the sequences that differ:
// - No light reaches the dark, so the sensor alone shows there.
// - A flat has no speckle and no dots, so laser, pattern, surface and motion leave it alone.
// - Where boards of the same surface and speckle agree, dots differ by their pattern or by the lens. Where boards
//   differ, no pattern did it.
// - What only static or only moving sequences show is motion, if the others would have shown it.
// - Resting laser light that changes as a whole, or row by row behind a rolling shutter, where the flat's does not, is
//   the laser's.
// Where the sequences rule nothing out, a cause that a known effect imitates lies where that effect does. alike: that
// effect's stage; empty: there is none. Changes the stages of the places accordingly.
void place_stages(const CaptureLayout &layout, std::vector<GapPlace> &places, const std::string &alike);

} // namespace clsp
