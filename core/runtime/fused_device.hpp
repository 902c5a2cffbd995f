// Which shape of the fused engine a device gets, and what its lanes are.
#pragma once

#include "runtime/context.hpp"

#include <cstdint>
#include <string>

namespace clsp {

// kLanes: explicit vectors, a work-item for each work-group, for CPUs. kGroups: work-groups that share lines in local
// memory, for GPUs.
enum class FusedShape { kNone, kLanes, kGroups };

inline FusedShape fused_shape(const Context &context) {
    const bool cpu = (context.device().getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU) != 0;
    switch (context.fft_choice()) {
    case FftChoice::kFusedLanes:
        return FusedShape::kLanes;
    case FftChoice::kFusedGroups:
        return FusedShape::kGroups;
    case FftChoice::kFused:
        return cpu ? FusedShape::kLanes : FusedShape::kGroups;
    case FftChoice::kAuto:
        return cpu ? FusedShape::kLanes : FusedShape::kNone;
    case FftChoice::kClfft:
        break;
    }
    return FusedShape::kNone;
}

// Why a context's shape is kNone.
inline std::string fused_shape_refusal(const Context &context) {
    return context.fft_choice() == FftChoice::kClfft ? "CLSPECKLE_FFT is clfft"
                                                     : "the device is no CPU, and others keep clFFT until they are "
                                                       "told; CLSPECKLE_FFT=fused takes the fused engine";
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
