// Whether the frames of a sequence are of one scene. A capture's statistics compare halves and pixels; what changes in
// the middle of a sequence would be in both.
#pragma once

#include "capture/capture.hpp"
#include "capture/sequence_scan.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

// What changes between the frames of a sequence.
struct SequenceChange : CaptureWarning {
    bool level_drifts = false; // little by little, as a lamp does: not from one frame to the next
};

// How to leave frames out of a stack, in NumPy's words: codes[0::2].
std::string without_frames(const std::vector<std::size_t> &odd, std::size_t count);

// The kind of frames without light among others that have some.
constexpr const char *kFramesWithoutLight = "frames_without_light";

// Steps, drifts and odd frames of the level, of the noise, of the contrast, of the correlation of neighbours, and of
// what a resting scene shows, each with numbers of frames (from 0). Of sequences of four frames and more.
// dark_level_dn: without light.
//
// A step counts where its t (Student) is rarer than 1e-6 among all places, a drift where neighbouring frames are as
// rarely so alike, which takes 14 frames. A level that follows a line (of four frames and more), or settles
// exponentially within 1 to 8 frames (of eight and more), counts where frames that know nothing of each other do so in
// 1e-5 of sequences, whatever they flicker by. All count where they are larger than 1 % of the level, 5 % of the
// noise, 2 % of the contrast, 0.02 of the correlation. Resting speckle may boil, so that its frames fluctuate together:
// of such sequences these are not asked, but for steps of the noise. Two groups of levels, and frames that differ from
// the one before by more than the others do, count where the gap is as wide as a t of 1e-6, and 8 times the scatter
// within.
constexpr double kChanceOfFrameChange = 1e-6, kChanceOfFrameCourse = 1e-5;
std::vector<SequenceChange> frame_changes(const CaptureLayout &layout, std::size_t sequence, const SequenceScan &scan,
                                          double dark_level_dn);

// A level that goes up and down, or that of resting speckle drifts, by more than a tenth of the light and than speckle
// does: an effect of the lamp (flicker) may explain it, so it is a warning alone. Of sequences without such a change.
std::optional<CaptureWarning> level_fluctuation(const CaptureLayout &layout, std::size_t sequence,
                                                const SequenceScan &scan, double dark_level_dn);

// Frames of laser light at rest whose picture lies a part of a pixel (0.03 and more) beside that of frame 0. It is a
// warning alone: an effect (vibration) may explain it.
std::optional<CaptureWarning> picture_shift(const CaptureLayout &layout, std::size_t sequence,
                                            const SequenceScan &scan);

} // namespace clsp
