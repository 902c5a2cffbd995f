// The handle of a camera profile; object(profile) is the engine's CameraProfile.
#pragma once

#include "handles.hpp"
#include "measure/camera_profile.hpp"

namespace clsp::capi {

CLSP_HANDLE(ClspProfile, const CameraProfile, "profile", kAnyThread)

} // namespace clsp::capi
