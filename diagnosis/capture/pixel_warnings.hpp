// Rows, blocks and single pixels that are not like the others, and colour mosaics.
#pragma once

#include "capture/capture_check.hpp"

#include <vector>

namespace clsp {

// scans: by sequence.
std::vector<CaptureWarning> pixel_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                           const DarkLevel &dark);
// 0 in rows, columns and blocks that are not like the others, 1 elsewhere; empty: there are none.
std::vector<std::uint8_t> beside_odd_blocks(const CaptureLayout &layout, const std::vector<SequenceScan> &scans);

} // namespace clsp
