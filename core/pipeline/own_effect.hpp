// An effect of the user's own, as a pipeline sees it: a step that makes an image of another one.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/opencl.hpp"

#include <cstdint>
#include <functional>

namespace clsp {

enum class OwnEffectPoint : std::uint32_t {
    kIrradiance = 0, // the ideal image, before the lens distorts it
    kIntensity = 1,  // behind the lens, before the sensor
    kCodes = 2       // the sensor's
};

// What a step may know of its frame.
struct OwnEffectFrame {
    std::uint32_t width, height, bits; // 0 bits: no sensor
    std::uint64_t frame_index, seed;
    bool dark, dots; // dots: a pattern's, or ideal ones
    double f_number, pixel_pitch_m, wavelength_m;
};

// Both buffers hold height x width floats, row by row.
using OwnEffectStep = std::function<void(CommandChain &chain, const cl::Buffer &before, const cl::Buffer &after,
                                         const OwnEffectFrame &frame)>;

} // namespace clsp
