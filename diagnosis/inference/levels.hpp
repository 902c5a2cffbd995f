// Two captures brought to the same light and read noise, as far as finished frames allow, before any gap is spoken of.
#pragma once

#include "capture/pairing.hpp"

#include <cstdint>
#include <optional>

namespace clsp {

// What the dark frames of one set say, or its data sheet.
struct CameraLevels {
    double black_level_dn = 0.0, read_noise_dn = 0.0;
    bool noise_measured = false; // else the data sheet's
    double noise_error = 0.0;    // relative standard error of the read noise
};
CameraLevels camera_levels(const Capture &capture);

struct ReadNoiseComparison {
    CameraLevels real, sim;        // as recorded
    double added_dn = 0.0;         // standard deviation of the noise that was added to the simulated frames; 0: none
    bool excess = false;           // the simulated frames have more noise than the camera: that cannot be taken out
    double z = 0.0, p_value = 1.0; // of the difference, where both are measured
};

// Multiplies the light above the black level of the brighter one of each lit pair, and adds what read noise that takes
// away; the other's scale is made to end where the multiplied one's does. Adds read noise to simulated frames that have
// less than the camera's. Levels stay as they are where the read noise is too small to stand in for the codes that a
// multiplication leaves out, and where same_light says that only chance makes them differ; statistics are relative to
// the light all the same. Pairs without light in either set are dropped, with a note. seed: of the noise. Throws
// kInvalidData where nothing is left.
ReadNoiseComparison level_captures(PairedCaptures &captures, const CameraLevels &real, const CameraLevels &sim,
                                   bool same_light, std::uint64_t seed);

} // namespace clsp
