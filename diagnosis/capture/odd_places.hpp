// Where pixels of a capture are not like the others, by all of its sequences.
#pragma once

#include "capture/pixel_oddities.hpp"
#include "capture/sequence_scan.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

bool is_odd(const SequenceScan &scan);
// scans: by sequence.
OddPlaces odd_places(const CaptureLayout &layout, const std::vector<SequenceScan> &scans);
// Rows, columns and blocks.
std::vector<PixelBlock> blocks_of(const OddPlaces &places);
// 0 in these and in pixels that jump in one frame, 1 elsewhere; empty: there are none.
std::vector<std::uint8_t> beside_odd_blocks(const CaptureLayout &layout, const std::vector<SequenceScan> &scans);

} // namespace clsp
