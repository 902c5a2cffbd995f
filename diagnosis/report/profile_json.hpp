// A camera profile as a file (docs/reference/profile.md lists its keys).
#pragma once

#include "measure/camera_profile.hpp"

#include <string>

namespace clsp {

std::string profile_json(const CameraProfile &profile);
// Throws kIo if it cannot be read, kInvalidArgument if it is not what this release writes; messages name file and key.
CameraProfile read_profile(const std::string &path);

} // namespace clsp
