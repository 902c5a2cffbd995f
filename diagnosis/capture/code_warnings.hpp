// What codes that never occur say: codes that stand in upper bits, that were stretched, brought through a table, or
// that a converter misses.
#pragma once

#include "capture/capture_check.hpp"

#include <vector>

namespace clsp {

// scans, summaries: by sequence. dark, noise_dn: as the codes tell them, where they do (0: no noise was measured).
std::vector<CaptureWarning> code_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                          const std::vector<SequenceSummary> &summaries, const DarkLevel &dark,
                                          double noise_dn);

} // namespace clsp
