// Flats of one lamp at several exposure times: their light goes as the time, so that their means show how the camera
// responds to it (linearity of EMVA 1288).
#pragma once

#include "capture/capture.hpp"

#include <vector>

namespace clsp {

struct ExposureSeries {
    std::vector<std::size_t> flats; // sequences; empty: there is no series, each sequence's light is its own
    double light_error = 0.0;       // of the lamp's light from one exposure to the next, relative
};

// Flats are a series that are of one f-number and six exposure times or more, not saturated, with levels that go as the
// times do, but for what a response may bend. A response bends smoothly: what levels scatter about a smooth curve is
// the lamp's. light_dn: mean codes above the dark ones, by sequence.
ExposureSeries exposure_series(const CaptureLayout &layout, const std::vector<double> &light_dn);

// Gives the flats of a series (SequenceLayout::light_error) the light that one lamp would have given them: a line over
// the exposure time, whose offset is the shutter's. light: by sequence, in any unit.
void tie_light_to_exposures(const CaptureLayout &layout, std::vector<double> &light);

} // namespace clsp
