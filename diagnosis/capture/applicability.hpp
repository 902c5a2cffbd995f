// In which sequences of a capture an effect acts, and in which it can show: what its record says of them.
#pragma once

#include "capture/capture.hpp"
#include "effects/effects.hpp"

namespace clsp {

// False where the effect leaves every code as it is, whatever its parameters and whatever other catalogue effects are
// on. With shaped_light the ideal image is no longer uniform on flat and board (a hypothesis on the irradiance is on).
bool acts_in(const Effect &effect, const SequenceLayout &sequence, FieldKind field, bool shaped_light);
// The same of a field that any effect can work on, and of even light.
bool acts_in(const Effect &effect, const SequenceLayout &sequence);

} // namespace clsp
