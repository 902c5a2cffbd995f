// A capture set from its folder.
#pragma once

#include "capture/capture.hpp"

#include <cstdint>
#include <functional>
#include <string>

namespace clsp {

// Called after each frame; may throw to stop.
using CaptureProgress = std::function<void(std::uint64_t done, std::uint64_t total)>;

// Reads and validates the set in a folder, or the one that a capture.json describes. Throws kIo for what cannot be read, kInvalidArgument for
// what the description says, kInvalidData for what the arrays hold; each message names the file and the frame or field.
Capture read_capture(const std::string &folder, const CaptureProgress &progress = {});

} // namespace clsp
