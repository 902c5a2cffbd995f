// What codes that never occur say: codes that stand in upper bits, that were stretched, brought through a table, or
// that a converter misses.
#pragma once

#include "capture/capture_check.hpp"

#include <optional>
#include <vector>

namespace clsp {

// Of codes that lie closer together once their bytes are swapped: all else that they show follows from that.
// scans: by sequence.
std::optional<CaptureWarning> swapped_bytes(const CaptureLayout &layout, const std::vector<SequenceScan> &scans);

// scans, summaries: by sequence. dark, noise_dn: as the codes tell them, where they do (0: no noise was measured).
std::vector<CaptureWarning> code_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                          const std::vector<SequenceSummary> &summaries, const DarkLevel &dark,
                                          double noise_dn);

} // namespace clsp
