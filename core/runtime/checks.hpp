// Checks of parameters that several stages make.
#pragma once

#include "runtime/error.hpp"

#include <cmath>
#include <cstdint>
#include <fmt/core.h>
#include <vector>

namespace clsp {

// Kernels compute in single precision; far below its limit nothing can overflow.
constexpr double kLargestNumber = 1e30;

inline double check_positive(double value, const char *name) {
    if (!(value > 0.0 && value <= kLargestNumber))
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} is {}, it must be above 0 and at most {}", name, value, kLargestNumber));
    return value;
}

inline double check_not_negative(double value, const char *name) {
    if (!(value >= 0.0 && value <= kLargestNumber))
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be 0 to {}", name, value, kLargestNumber));
    return value;
}

inline double check_fraction(double value, const char *name) {
    if (!(value >= 0.0 && value <= 1.0))
        throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be 0 to 1", name, value));
    return value;
}

// An image in the host's memory, as a description gives it.
struct HostImage {
    const float *pixels;
    std::uint32_t width, height;
    std::uint64_t pitch_bytes; // 0: tightly packed
    const char *name;          // what messages call the pixels
    const char *pitch_name;    // what messages call the pitch
};

// A tightly packed copy. Throws unless every pixel is `good`; `rule` says what that means.
template <typename Good> std::vector<float> copy_host_image(const HostImage &image, Good good, const char *rule) {
    if (!image.pixels)
        throw Error(Status::kInvalidArgument, fmt::format("{} is NULL; it must point to {} rows of {} floats",
                                                          image.name, image.height, image.width));
    const std::uint64_t row_bytes = std::uint64_t{image.width} * sizeof(float);
    const std::uint64_t pitch = image.pitch_bytes ? image.pitch_bytes : row_bytes;
    constexpr std::uint64_t kLargestPitch = std::uint64_t{1} << 32; // far above any row, far below an overflow
    if (pitch < row_bytes || pitch % sizeof(float) != 0 || pitch > kLargestPitch)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} is {}, it must be a multiple of {}, at least {} (a row) and at most {}",
                                image.pitch_name, pitch, sizeof(float), row_bytes, kLargestPitch));
    std::vector<float> copy;
    copy.reserve(std::size_t{image.width} * image.height);
    for (std::uint32_t y = 0; y < image.height; ++y) {
        const float *row = image.pixels + y * (pitch / sizeof(float));
        for (std::uint32_t x = 0; x < image.width; ++x) {
            if (!good(row[x]))
                throw Error(Status::kInvalidData,
                            fmt::format("{}[{}][{}] (row, column) is {}; {}", image.name, y, x, row[x], rule));
            copy.push_back(row[x]);
        }
    }
    return copy;
}

} // namespace clsp
