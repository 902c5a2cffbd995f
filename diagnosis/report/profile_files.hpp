// A camera profile with its maps, as files: NAME.json, NAME.dark.npy, NAME.gain.npy (docs/reference/profile.md).
#pragma once

#include "measure/camera_profile.hpp"

#include <memory>
#include <string>
#include <vector>

namespace clsp {

// All files are complete before the first one appears. Throws kIo if one cannot be written, and what map_values() does.
void write_profile(const CameraProfile &profile, const std::string &path);

// A map that the profile has. Throws kIo if its file cannot be read, kInvalidData if it is not the one that was written
// with the profile.
std::shared_ptr<const std::vector<float>> map_values(const CameraProfile &profile, ProfileMapKind kind);
// The path of its file.
std::string map_path(const CameraProfile &profile, ProfileMapKind kind);

} // namespace clsp
