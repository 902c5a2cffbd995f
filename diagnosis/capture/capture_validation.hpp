// Whether a capture can be used at all.
#pragma once

#include "capture/capture.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace clsp {

// Limits of the format. They keep a damaged description from taking the memory of the machine.
inline constexpr std::uint32_t kMinCaptureSide = 8; // below, no field regions and no speckle correlation
inline constexpr std::uint32_t kMaxCaptureSide = 16384;
inline constexpr std::uint32_t kMinCaptureBits = 8, kMaxCaptureBits = 16; // as the simulator's sensor
inline constexpr std::uint32_t kMaxCaptureFrames = 65535;
inline constexpr std::size_t kMaxCaptureSequences = 1000;
inline constexpr std::size_t kMaxCaptureDots = 1000000;
inline constexpr std::uint64_t kMaxCaptureBytes = std::uint64_t{4} << 30; // of codes, all sequences together
inline constexpr std::size_t kMaxSequenceName = 63;

// Where the parts of a capture came from, for messages. In memory: "capture", and the sequences have no files.
struct CaptureOrigin {
    std::string description = "capture"; // the path of capture.json
    std::vector<std::string> files;      // by sequence; may be empty
};

// All throw clsp::Error: kInvalidArgument for what is said about the capture, kInvalidData for its codes. Fields are
// named by their JSON pointer in capture.json, also where there is no file.

// The camera, laser and dots; whether the sequences' names, layouts and total size are in order. Takes no codes.
void validate_layout(const CaptureLayout &layout, const CaptureOrigin &origin = {});
void validate_camera(const CaptureLayout &layout, const CaptureOrigin &origin = {});
void validate_dots(const CaptureLayout &layout, const CaptureDots &dots, const CaptureOrigin &origin = {});
// One sequence as the next one of a layout.
void validate_sequence(const CaptureLayout &layout, std::size_t sequence, const CaptureOrigin &origin = {});
// The codes of one sequence: their number and range.
void validate_codes(const CaptureLayout &layout, std::size_t sequence, const std::vector<std::uint16_t> &codes,
                    const CaptureOrigin &origin = {});
// Everything.
void validate_capture(const Capture &capture, const CaptureOrigin &origin = {});

} // namespace clsp
