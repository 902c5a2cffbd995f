/**
 * @file half.hpp
 * @brief Numbers of files as single precision. Half precision (IEEE 754) is exact, and here because the readers must
 *        not depend on OpenEXR's Imath.
 */
#ifndef CLSPECKLE_TOOLS_IMAGE_IO_HALF_HPP
#define CLSPECKLE_TOOLS_IMAGE_IO_HALF_HPP

#include <cstdint>
#include <cstring>

namespace image_io::detail {

/** A number of a file, in host order. */
template <typename T> float to_float(const unsigned char *bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return static_cast<float>(value);
}

/** From two bytes in host order. */
inline float half_to_float(const unsigned char *bytes) {
    std::uint16_t half;
    std::memcpy(&half, bytes, 2);
    const std::uint32_t sign = (half & 0x8000u) << 16;
    const std::uint32_t exponent = half >> 10 & 31u;
    const std::uint32_t fraction = half & 1023u;
    if (exponent == 0) { // zero and subnormal numbers: multiples of 2^-24
        const float magnitude = static_cast<float>(fraction) * 0x1p-24f;
        return sign ? -magnitude : magnitude;
    }
    // Infinity and NaN keep all bits of the exponent; the bias of the others grows from 15 to 127.
    const std::uint32_t bits = sign | (exponent == 31 ? 255u : exponent + 112u) << 23 | fraction << 13;
    float value;
    std::memcpy(&value, &bits, 4);
    return value;
}

} // namespace image_io::detail

#endif // CLSPECKLE_TOOLS_IMAGE_IO_HALF_HPP
