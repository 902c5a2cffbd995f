// The handle of a capture; object(capture) is the engine's Capture.
#pragma once

#include "capture/capture.hpp"
#include "handles.hpp"

namespace clsp::capi {

CLSP_HANDLE(ClspCapture, Capture, "capture", kOneWriter)

} // namespace clsp::capi
