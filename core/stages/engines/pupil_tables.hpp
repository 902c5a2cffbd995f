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

// Which frequencies along the columns (rows of the grid) and along the rows (its columns) pass something.
struct PassedLines {
    PassedLines(const Pupil &pupil, const FieldGrid &grid) : rows(grid.grid_height), columns(grid.grid_width) {
        std::vector<float> most(grid.grid_width); // of a column
        const float *t = pupil.transmission.data();
        for (std::uint32_t row = 0; row < grid.grid_height; ++row, t += grid.grid_width) {
            rows[row] = std::any_of(t, t + grid.grid_width, [](float passed) { return passed > 0.0f; });
            for (std::uint32_t column = 0; rows[row] && column < grid.grid_width; ++column)
                most[column] = std::max(most[column], t[column]);
        }
        std::transform(most.begin(), most.end(), columns.begin(), [](float passed) { return passed > 0.0f; });
    }

    std::vector<bool> rows, columns;
};

// The pupil's amplitude at a place of its grid; scale: the inverse transforms' 1 / samples.
inline std::complex<float> scaled_amplitude(const Pupil &pupil, std::size_t at, double scale) {
    constexpr double kTurn = 2.0 * M_PI;
    const double t = scale * pupil.transmission[at];
    if (pupil.phase_turns.empty() || t == 0.0)
        return {static_cast<float>(t), 0.0f};
    const double angle = kTurn * pupil.phase_turns[at];
    return {static_cast<float>(t * std::cos(angle)), static_cast<float>(t * std::sin(angle))};
}

} // namespace clsp
