// What codes that never occur say: codes that stand in upper bits, that were stretched, brought through a table, or
// that a converter misses.
#pragma once

#include "capture/capture_check.hpp"

#include <vector>

namespace clsp {

// scans, summaries: by sequence.
std::vector<CaptureWarning> code_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                          const std::vector<SequenceSummary> &summaries);

} // namespace clsp
