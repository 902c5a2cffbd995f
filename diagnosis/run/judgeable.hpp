// Which sequences of a capture tell something of the camera, for a diagnosis and for a comparison.
#pragma once

#include "capture/capture_check.hpp"

#include <cstddef>
#include <string>

namespace clsp {

// Why a sequence is left out; empty: it is judged.
std::string why_not_judged(const CaptureLayout &layout, const CaptureSummary &summary, std::size_t sequence);

// As notes say it.
std::string left_out_note(const std::string &sequence, const std::string &reason);

} // namespace clsp
