#include "simulator/exposure_modes.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <cstddef>

namespace clsp {
namespace {

constexpr Eigen::Index kPoints = 128;
constexpr double kVarianceError = 0.003, kCubeError = 0.01;

// The eigenvalues, by the integral equation on the midpoints of equal intervals.
Eigen::ArrayXd eigenvalues(double path) {
    Eigen::MatrixXd kernel(kPoints, kPoints);
    for (Eigen::Index i = 0; i < kPoints; ++i)
        for (Eigen::Index j = 0; j < kPoints; ++j)
            kernel(i, j) = std::exp(-path * std::abs(static_cast<double>(i - j)) / kPoints) / kPoints;
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(kernel, Eigen::EigenvaluesOnly).eigenvalues().reverse();
}

} // namespace

std::vector<double> exposure_modes(double path) {
    const Eigen::ArrayXd values = eigenvalues(path);
    const double variance = values.square().sum(), cube = values.cube().sum();
    Eigen::Index best_kept = kPoints;
    double best_rest = 0.0, best_equal = 0.0;
    double rest = 1.0, rest_variance = variance, rest_cube = cube;
    for (Eigen::Index kept = 0; kept < kPoints && rest_variance > 0.0; ++kept) {
        for (const double equal : {std::floor(rest * rest / rest_variance), std::ceil(rest * rest / rest_variance)}) {
            const bool close = equal >= 1.0 && std::abs(rest * rest / equal - rest_variance) < kVarianceError * variance &&
                               std::abs(rest * rest * rest / (equal * equal) - rest_cube) < kCubeError * cube;
            if (close && static_cast<double>(kept) + equal < static_cast<double>(best_kept) + best_equal) {
                best_kept = kept;
                best_rest = rest;
                best_equal = equal;
            }
        }
        rest -= values[kept];
        rest_variance -= values[kept] * values[kept];
        rest_cube -= values[kept] * values[kept] * values[kept];
    }
    std::vector<double> modes(values.data(), values.data() + best_kept);
    modes.insert(modes.end(), static_cast<std::size_t>(best_equal), best_rest / best_equal);
    return modes;
}

} // namespace clsp
