// Whether whole fields go through the fused engine's lanes, and what lanes are.
#pragma once

#include "runtime/context.hpp"

#include <cstdint>
#include <string>

namespace clsp {

// Of line transforms and refreshes; an aperture's engine is its own matter (Context::engine_choices()).
inline bool works_in_lanes(const Context &context) {
    switch (context.fft_choice()) {
    case FftChoice::kFusedLanes:
        return true;
    case FftChoice::kFused:
    case FftChoice::kAuto:
        return fused_engine_for(context) == Engine::kFusedLanes;
    case FftChoice::kClfft:
    case FftChoice::kFusedGroups:
        break;
    }
    return false;
}

// Vectors as long as the device's own, and at least 4 floats: shorter ones would only make the code scalar.
inline std::uint32_t fused_lanes(const Context &context) {
    const cl_uint native = context.device().getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>();
    return native >= 16 ? 16 : native >= 8 ? 8 : 4;
}

// Local memory of a tile: one line in each lane, and a point behind them that stands for lines that are not there.
inline std::uint64_t fused_tile_bytes(std::uint32_t length, std::uint32_t lanes) {
    return (std::uint64_t{length} + 1) * 2 * lanes * sizeof(float);
}

} // namespace clsp
