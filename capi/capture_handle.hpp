// The handle of a capture; object(capture) is the engine's Capture.
#pragma once

#include "capture/capture.hpp"
#include "handles.hpp"

namespace clsp::capi {

template <> struct HandleTraits<ClspCapture> {
    using Object = Capture;
    static constexpr const char *kName = "capture";
};

} // namespace clsp::capi
