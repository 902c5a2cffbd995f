// What lanes are, and what goes in them besides an aperture's transforms.
#pragma once

#include "fft/engine_choices.hpp"
#include "runtime/context.hpp"

#include <cstdint>
#include <string>

namespace clsp {

// Whether random numbers may be drawn in lanes: on CPUs with vectors, and on other CPUs where the engine is forced. On
// a GPU never: NVIDIA's compiler (580.159) gets some of what is made of products of 64 bits in vectors wrong.
inline bool draws_in_lanes(const Context &context) {
    const cl_device_type type = context.device().getInfo<CL_DEVICE_TYPE>();
    return own_engine(context.device()) == EngineKind::kCpu ||
           ((type & CL_DEVICE_TYPE_CPU) != 0 && forced_engine(context) == EngineKind::kCpu);
}

// Of line transforms and refreshes; an aperture's engine is its own matter (engine_choices()).
inline bool works_in_lanes(const Context &context) {
    return draws_in_lanes(context) && forced_engine(context).value_or(EngineKind::kCpu) == EngineKind::kCpu;
}

// Vectors as long as the device's own, and at least 4 floats: shorter ones would only make the code scalar.
inline std::uint32_t simd_lanes(const Context &context) {
    const cl_uint native = context.device().getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>();
    return native >= 16 ? 16 : native >= 8 ? 8 : 4;
}

// Local memory of a tile: one line in each lane, and a point behind them that stands for lines that are not there.
inline std::uint64_t cpu_tile_bytes(std::uint32_t length, std::uint32_t lanes) {
    return (std::uint64_t{length} + 1) * 2 * lanes * sizeof(float);
}

} // namespace clsp
