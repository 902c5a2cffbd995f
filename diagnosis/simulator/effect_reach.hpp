// In which sequences an effect of the catalogue can show at all (the capture-set format's sections 1 and 3).
#pragma once

#include "capture/capture.hpp"

#include <string>

namespace clsp {

// On which part of a sequence's simulation an effect works.
enum class EffectPart : std::uint32_t {
    kOptics, // up to the intensity behind the lens's diffraction, distortion and glare
    kLight,  // factors and offsets of the whole intensity image: laser power, fall-off, ambient light
    kSensor  // from the intensity to codes
};

EffectPart effect_part(const std::string &id);

// False where the effect leaves every code as it is, whatever its parameters and whatever other catalogue effects are
// on. With shaped_light the ideal image is no longer uniform on flat and board (a hypothesis on the irradiance is on).
bool effect_reaches(const std::string &id, const SequenceLayout &sequence, FieldKind field, bool shaped_light);

} // namespace clsp
