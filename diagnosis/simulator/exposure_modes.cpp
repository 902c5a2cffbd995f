#include "simulator/exposure_modes.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace clsp {
namespace {

constexpr Eigen::Index kPoints = 128;
constexpr double kVarianceError = 0.003, kCubeError = 0.01;

struct Modes {
    Eigen::ArrayXd values, integrals; // of eigenfunctions of norm 1
};

// The integral equation on the midpoints of equal intervals.
Modes solve(double path) {
    Eigen::MatrixXd kernel(kPoints, kPoints);
    for (Eigen::Index i = 0; i < kPoints; ++i)
        for (Eigen::Index j = 0; j < kPoints; ++j)
            kernel(i, j) = std::exp(-path * std::abs(static_cast<double>(i - j)) / kPoints) / kPoints;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(kernel);
    return {solver.eigenvalues().reverse(), solver.eigenvectors().colwise().sum().transpose().reverse().array().abs() / std::sqrt(double(kPoints))};
}

} // namespace

std::vector<ExposureMode> exposure_modes(double path) {
    const auto [values, integrals] = solve(path);
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
    std::vector<ExposureMode> modes;
    double coherent_rest = 1.0;
    for (Eigen::Index k = 0; k < best_kept; ++k) {
        modes.push_back({values[k], integrals[k] / std::sqrt(values[k])});
        coherent_rest -= integrals[k] * integrals[k];
    }
    modes.insert(modes.end(), static_cast<std::size_t>(best_equal),
                 {best_rest / best_equal, std::sqrt(std::max(0.0, coherent_rest) / best_rest)});
    return modes;
}

} // namespace clsp
