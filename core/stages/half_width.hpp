// Transforms of real images by complex ones of half the width: neighbours along a row are the two parts of one number.
// kernels/stages/filter.cl has the equations.
#pragma once

#include "runtime/device_buffer.hpp"

#include <cstdint>
#include <memory>

namespace clsp {

// Whether such a width has a half that the transforms take.
inline bool can_be_halved(std::uint32_t width) {
    return width % 2 == 0 && width >= 4;
}

// exp(-2 pi i k / width) for k below half of the width: complex numbers of two floats.
DeviceBuffer half_roots(const std::shared_ptr<Context> &context, std::uint32_t width);

} // namespace clsp
