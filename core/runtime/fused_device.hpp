// Where the fused engine and its explicit vectors belong.
#pragma once

#include "runtime/context.hpp"

#include <cstdint>
#include <string>

namespace clsp {

// Vectors as long as the device's own, and at least 4 floats: shorter ones would only make the code scalar.
inline std::uint32_t fused_lanes(const Context &context) {
    const cl_uint native = context.device().getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>();
    return native >= 16 ? 16 : native >= 8 ? 8 : 4;
}

// Local memory of a tile: one line in each lane, and a point behind them that stands for lines that are not there.
inline std::uint64_t fused_tile_bytes(std::uint32_t length, std::uint32_t lanes) {
    return (std::uint64_t{length} + 1) * 2 * lanes * sizeof(float);
}

// Why kernels with explicit vectors are not to be used on this device; "" if they are.
inline std::string fused_engine_refusal(const Context &context) {
    if (context.fft_choice() == FftChoice::kClfft)
        return "CLSPECKLE_FFT is clfft";
    // Its work-groups are single work-items, which leave most of a GPU idle.
    if (context.fft_choice() == FftChoice::kAuto && !(context.device().getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU))
        return "the fused engine is made for CPUs, and the device is none; CLSPECKLE_FFT=fused takes it nevertheless";
    return {};
}

} // namespace clsp
