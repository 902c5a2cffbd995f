// What one pass over all codes of a sequence tells: exact sums of whole numbers, from which summaries and warnings
// follow.
#pragma once

#include "capture/capture.hpp"
#include "capture/code_spacing.hpp"
#include "capture/frame_sample.hpp"
#include "runtime/hash.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace clsp {

struct PixelOddities;

// Sums over the unmasked pixels of a frame.
struct FrameScan {
    std::uint64_t sum = 0, square = 0;
    // Of pairs of neighbours in a row: their number, the sums of the left and of the right ones, and of their products.
    std::uint64_t pairs = 0, lefts = 0, rights = 0, products = 0;
    // Of pixels that neither in this frame nor in the one before are at the top code; of static sequences.
    std::uint64_t both = 0, before = 0, before_square = 0, now = 0, now_square = 0, before_times_now = 0;
    std::uint64_t hash = kFnvBasis; // of all its codes
};

// Rows of a frame that are those of the frame before, bit for bit, though its other rows are not.
struct TornRows {
    std::uint32_t frame = 0, first_row = 0, last_row = 0;
};

struct SequenceScan {
    std::vector<FrameScan> frames;
    std::uint64_t pixels = 0; // that are not masked, of one frame
    std::uint64_t saturated = 0, zero = 0;
    std::uint32_t minimum = 65535, maximum = 0;
    double temporal_variance = 0.0;   // mean over pixels of the unbiased variance over frames
    std::uint16_t largest = 0;        // code, of masked pixels, too
    std::vector<std::uint16_t> codes; // that occur, but for the rarest and those that clip (code_spacing.hpp)
    CodeGaps gaps;                    // of scenes at rest
    CodePile pile;                    // at the top code, too
    std::shared_ptr<const PixelOddities> oddities; // pixel_oddities.hpp
    std::vector<PictureShift> shifts;              // by frame, of laser light at rest
    NoiseCorrelations correlations;                // of dark frames and even light
    FrameNoises noise;                             // of scenes at rest
    std::vector<TornRows> torn;                    // the first of them, where rows otherwise differ
    std::vector<std::uint32_t> sums;               // of dots: by pixel, masked or not, over all frames
};

// progress: what part is done. Takes up to 56 bytes for each pixel of a frame, and no more than 1 GB.
SequenceScan scan_sequence(const Capture &capture, std::size_t sequence,
                           const std::function<void(double part)> &progress = {});
// Without the pixels where also is 0.
SequenceScan scan_masked(const Capture &capture, std::size_t sequence, const std::vector<std::uint8_t> &also);
// Of all sequences; those that are stored have theirs.
std::vector<SequenceScan> scan_capture(const Capture &capture);

} // namespace clsp
