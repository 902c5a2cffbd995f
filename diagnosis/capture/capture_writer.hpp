// A capture set into a folder.
#pragma once

#include "capture/capture.hpp"

#include <string>

namespace clsp {

// Writes capture.json, an .npy stack for each sequence and a PNG for each mask. The folder appears under its name only
// when it is complete. An existing folder is refused (kInvalidArgument), unless `overwrite` is set and it holds nothing
// but what this function writes (capture.json, key.json, .npy, masks): then it is replaced. Throws kIo if it cannot be
// written; nothing is left behind then.
void write_capture(const Capture &capture, const std::string &folder, bool overwrite = false);

} // namespace clsp
