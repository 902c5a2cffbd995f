// Rows, blocks and single pixels that are not like the others, and colour mosaics.
#pragma once

#include "capture/capture_check.hpp"

#include <vector>

namespace clsp {

// The kind of pixels that are unlike themselves in one frame.
constexpr const char *kTransientPixels = "transient_pixels";

// scans: by sequence.
std::vector<CaptureWarning> pixel_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                           const DarkLevel &dark);

} // namespace clsp
