// Rigid motions as the API takes them: 12 numbers, [R|t], 3 x 4 row-major.
#pragma once

#include "runtime/error.hpp"

#include <cmath>
#include <cstddef>
#include <fmt/core.h>

namespace clsp {

// Throws kInvalidArgument unless all 12 numbers are finite and R is a rotation; single-precision poses are let through.
inline void check_pose(const double *pose, const char *name) {
    for (std::size_t i = 0; i < 12; ++i)
        if (!std::isfinite(pose[i]))
            throw Error(Status::kInvalidArgument, fmt::format("{}[{}] is {}; it must be finite", name, i, pose[i]));
    // R R^T must be the identity and det R = +1.
    constexpr double kTolerance = 1e-4;
    const auto row = [&](int i) { return pose + 4 * i; };
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j) {
            double dot = 0;
            for (int k = 0; k < 3; ++k)
                dot += row(i)[k] * row(j)[k];
            if (std::abs(dot - (i == j ? 1.0 : 0.0)) > kTolerance)
                throw Error(Status::kInvalidArgument,
                            fmt::format("the left 3 x 3 part of {} is not a rotation: its rows must be orthonormal "
                                        "(row-major [R|t], t in metres)",
                                        name));
        }
    const double *a = row(0), *b = row(1), *c = row(2);
    const double determinant =
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    if (determinant < 0)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the left 3 x 3 part of {} is a reflection (determinant -1); flip an axis to get a rotation",
                        name));
}

} // namespace clsp
