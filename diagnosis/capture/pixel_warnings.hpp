// Rows, blocks and single pixels that are not like the others, and colour mosaics.
#pragma once

#include "capture/capture_check.hpp"

#include <vector>

namespace clsp {

// scans: by sequence.
std::vector<CaptureWarning> pixel_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                           const DarkLevel &dark);

} // namespace clsp
