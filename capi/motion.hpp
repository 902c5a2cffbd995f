// From the C struct to the engine's, for the pipeline too.
#pragma once

#include "clspeckle/motion.h"
#include "stages/motion.hpp"

namespace clsp::capi {

MotionInput motion_input(const ClspMotionInput *user);

} // namespace clsp::capi
