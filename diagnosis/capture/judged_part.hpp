// Which part of a capture is judged: all of a small one; of a large one a window and some frames. The time and the
// memory that a diagnosis takes go with the pixels that it simulates, and a few millions of them tell what there is to
// tell.
#pragma once

#include "capture/capture.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

struct PixelWindow {
    std::uint32_t x = 0, y = 0, width = 0, height = 0;
};

// What the user wants; nothing: what choose_part() finds best.
struct PartChoice {
    bool whole_image = false;
    std::optional<PixelWindow> window;   // not with whole_image
    std::optional<std::uint32_t> frames; // of each sequence at most; 0: all
};

// Consecutive frames.
struct FrameRun {
    std::uint32_t first = 0, count = 0;
};

struct JudgedPart {
    struct Sequence {
        std::string name;
        std::uint32_t frame_count = 0; // that there are
        std::vector<FrameRun> runs;    // of as many frames one, else one in each half

        std::uint32_t frames() const;
    };
    std::uint32_t image_width = 0, image_height = 0;
    PixelWindow window;
    std::vector<Sequence> sequences;

    bool has_whole_image() const { return window.width == image_width && window.height == image_height; }
    bool is_whole() const;
};

// Frames times pixels of all sequences that are judged, as long as nothing else is asked for.
constexpr std::uint64_t kMostJudgedPixels = 9'000'000;
// As many frames have the power of the check (docs/results/gap-check.md); further pixels go into the window.
constexpr std::uint32_t kEnoughFrames = 24;

// A large image is judged in a strip along its longer side, through the optical axis: it reaches nearly as far from the
// axis as the image does, so that fall-off and distortion stay visible, and crosses all columns. Where masks cover it,
// it moves to where there is more to see. Frames come from the middle of each half of a sequence, so that neighbours in
// time stay neighbours and halves halves.
//
// Throws kInvalidArgument for a window that does not fit, kInvalidData where masks leave too little of it.
JudgedPart choose_part(const CaptureLayout &layout, const PartChoice &choice,
                       std::uint64_t most_pixels = kMostJudgedPixels);

// The part in memory. By sequence of the part: its number in the capture, and its layout with a mask of the whole
// image. Masks, optical axis and dots become those of the window.
Capture take_part(const Capture &capture, const std::vector<std::size_t> &numbers,
                  const std::vector<SequenceLayout> &sequences, const JudgedPart &part);

// What it is, where it is not the whole capture: "columns 0 to 1279 and rows ... and 24 of 300 frames of dark".
std::string part_text(const JudgedPart &part);

} // namespace clsp
