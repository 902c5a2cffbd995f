// capture.json, the description of a capture set: from the file, and to it.
#pragma once

#include "capture/capture.hpp"
#include "io/raw.hpp"

#include <optional>
#include <string>
#include <vector>

namespace clsp {

// Lengths of sequences and codes are not known yet.
struct CaptureDescription {
    CaptureLayout layout;           // sequences with frame_count 0 and no mask
    std::vector<std::string> files; // by sequence: a path, folder or glob pattern within the folder of the description
    bool msb_aligned = false;       // codes stand in the upper bits of 16-bit words
    std::vector<std::string> masks; // by sequence; empty: none
    std::vector<std::optional<image_io::RawLayout>> raws; // by sequence: of raw frames
    std::vector<CaptureWarning> warnings;
};

// Throws kIo if it cannot be read, kInvalidArgument if it is not what the format says, naming the field.
CaptureDescription read_capture_json(const std::string &path);

// The text of a description; the file of sequence NAME is NAME.npy, its mask NAME_mask.png.
std::string capture_json(const CaptureLayout &layout);

} // namespace clsp
