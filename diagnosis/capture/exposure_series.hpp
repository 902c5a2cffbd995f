// Flats of one lamp at several exposure times: their light goes as the time, so that their means show how the camera
// responds to it (linearity of EMVA 1288).
#pragma once

#include "capture/capture.hpp"

#include <vector>

namespace clsp {

// A lamp's light is the same to so much, relative, from one exposure to the next.
constexpr double kLampError = 1e-3;

// The flats that are such a series: of one f-number and three exposure times or more, not saturated, with levels that
// go as the times do, but for what a response may bend. Empty: there is none, so that each sequence's light is its own.
// light_dn: mean codes above the dark ones, by sequence.
std::vector<std::size_t> exposure_series(const CaptureLayout &layout, const std::vector<double> &light_dn);

// Gives the flats of a series (SequenceLayout::in_exposure_series) the light that one lamp would have given them: a
// line over the exposure time, whose offset is the shutter's. light: by sequence, in any unit.
void tie_light_to_exposures(const CaptureLayout &layout, std::vector<double> &light);

} // namespace clsp
