// A capture set from its folder.
#pragma once

#include "capture/capture.hpp"

#include <cstdint>
#include <functional>
#include <string>

namespace clsp {

// Called with the part of all codes that has been read; may throw to stop.
using CaptureProgress = std::function<void(double part)>;

// A capture of more codes than that stays in its files; what it takes for it is memory of a few frames.
constexpr std::uint64_t kMostBytesInMemory = std::uint64_t{256} << 20;

// Reads and validates the set in a folder, or the one that a capture.json describes. Throws kIo for what cannot be
// read, kInvalidArgument for what the description says, kInvalidData for what the arrays hold; each message names the
// file and the frame or field. All codes are read once and checked, also those that stay in files.
Capture read_capture(const std::string &folder, const CaptureProgress &progress = {},
                     std::uint64_t most_bytes_in_memory = kMostBytesInMemory);

} // namespace clsp
