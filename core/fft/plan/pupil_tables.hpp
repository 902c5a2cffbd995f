// What the engines for CPUs and GPUs tell their kernels about a pupil.
#pragma once

#include "runtime/device_buffer.hpp"
#include "stages/field_grid.hpp"
#include "stages/pupil.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

// Of index `index` of a transform, in cycles per sample.
inline float signed_frequency(std::uint32_t index, std::uint32_t length) {
    return static_cast<float>((double(index) - (2 * index < length ? 0.0 : double(length))) / double(length));
}

template <typename T> DeviceBuffer device_table(const std::shared_ptr<Context> &context, const std::vector<T> &values) {
    const T none{};
    return values.empty() ? DeviceBuffer(context, sizeof(T), &none)
                          : DeviceBuffer(context, values.size() * sizeof(T), values.data());
}

// True if something of the frequencies `row` along the columns passes.
inline bool row_passes(const Pupil &pupil, const FieldGrid &grid, std::uint32_t row) {
    const auto first = pupil.transmission.begin() + std::ptrdiff_t(row) * grid.grid_width;
    return std::any_of(first, first + grid.grid_width, [](float t) { return t > 0.0f; });
}

// The same of the frequencies `column` along the rows.
inline bool column_passes(const Pupil &pupil, const FieldGrid &grid, std::uint32_t column) {
    for (std::uint32_t row = 0; row < grid.grid_height; ++row)
        if (pupil.transmission[std::size_t{row} * grid.grid_width + column] > 0.0f)
            return true;
    return false;
}

// The pupil's amplitude with the inverse transforms' 1 / samples.
inline std::complex<float> scaled_amplitude(const Pupil &pupil, const FieldGrid &grid, std::uint32_t row,
                                            std::uint32_t column) {
    constexpr double kTurn = 2.0 * 3.14159265358979323846;
    const std::size_t at = std::size_t{row} * grid.grid_width + column;
    const double t = 1.0 / double(grid.samples()) * pupil.transmission[at];
    if (pupil.phase_turns.empty())
        return {static_cast<float>(t), 0.0f};
    const double angle = kTurn * pupil.phase_turns[at];
    return {static_cast<float>(t * std::cos(angle)), static_cast<float>(t * std::sin(angle))};
}

} // namespace clsp
