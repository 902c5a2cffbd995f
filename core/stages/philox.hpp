// Philox4x32-10 on the device. kernels/common/philox.h has the arithmetic, philox.h of the C API the mapping.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/image_view.hpp"

#include <array>
#include <cstdint>
#include <memory>

namespace clsp {

enum class Distribution : std::uint32_t { kBits = 0, kUniform = 1, kNormal = 2 };

struct PhiloxParameters {
    Distribution distribution = Distribution::kUniform;
    std::uint64_t seed = 0;
    std::uint64_t frame_index = 0;
    std::uint32_t stream = 0x8000;
    std::uint32_t local_size = 0;
};

inline cl_uint2 philox_key(std::uint64_t seed) {
    return {{static_cast<cl_uint>(seed & 0xffffffffu), static_cast<cl_uint>(seed >> 32)}};
}

// Frame indices fill 32 bits of one counter word and the upper 16 of another.
constexpr std::uint64_t kMaxFrameIndex = (std::uint64_t{1} << 48) - 1;
void check_frame_index(std::uint64_t frame_index);
inline cl_uint frame_low(std::uint64_t frame_index) {
    return static_cast<cl_uint>(frame_index & 0xffffffffu);
}
inline cl_uint frame_high(std::uint64_t frame_index) {
    return static_cast<cl_uint>(frame_index >> 32);
}

// A block of Philox4x32-10 on the host.
std::array<std::uint32_t, 4> host_block(std::uint64_t seed, std::array<std::uint32_t, 4> counter);

// Numbers for a whole frame are drawn on the host.
constexpr std::uint32_t kStreamFlicker = 0x33, kStreamVibration = 0x34;
// Black level and read noise of a camera that only its data sheet tells of.
constexpr std::uint32_t kStreamCameraLevels = 0x35;
// Of the design of diffractive elements: phases of the orders, places of dots.
constexpr std::uint32_t kStreamDoePhase = 0x51, kStreamDotLayout = 0x52;
// Two standard normal numbers, from words 0 and 1 of the block of counter (0, 0, frame, stream) by Box and Muller.
std::array<double, 2> host_normals(std::uint64_t seed, std::uint64_t frame_index, std::uint32_t stream);

// Rows that share Philox blocks: row y takes word y / quarter of the block of row y mod quarter.
inline std::uint32_t quarter_rows(std::uint32_t height) {
    return (height + 3) / 4;
}

void enqueue_philox_blocks(Context &context, CommandChain &chain, cl_mem counters, std::uint64_t counters_offset_bytes,
                           const std::uint32_t key[2], std::uint64_t count, std::uint64_t local_size, cl_mem blocks,
                           std::uint64_t blocks_offset_bytes);

void enqueue_philox_fill(Context &context, CommandChain &chain, const PhiloxParameters &parameters,
                         const ImageDescription &image);

} // namespace clsp
