#include "stages/exposure_modes.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace clsp {
namespace {

constexpr Eigen::Index kPoints = 128;
constexpr double kCubeError = 0.01;
// What is left of the light's variance by rounding.
constexpr double kLeastRest = 1e-12;

struct Modes {
    Eigen::ArrayXd values, integrals; // of eigenfunctions of norm 1
};

// The integral equation on the midpoints of equal intervals.
Modes solve(double path, ExposureCorrelation correlation) {
    Eigen::MatrixXd kernel(kPoints, kPoints);
    for (Eigen::Index i = 0; i < kPoints; ++i)
        for (Eigen::Index j = 0; j < kPoints; ++j) {
            const double lag = path * std::abs(static_cast<double>(i - j)) / kPoints;
            kernel(i, j) = std::exp(correlation == ExposureCorrelation::kGaussian ? -lag * lag : -lag) / kPoints;
        }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(kernel);
    return {solver.eigenvalues().reverse(),
            solver.eigenvectors().colwise().sum().transpose().reverse().array().abs() / std::sqrt(double(kPoints))};
}

} // namespace

std::vector<ExposureMode> exposure_modes(double path, ExposureCorrelation correlation) {
    const auto [values, integrals] = solve(path, correlation);
    const double cube = values.cube().sum();
    Eigen::Index best_kept = 0, best_equal = kPoints;
    double best_next = 1.0;
    double rest = 1.0, rest_variance = values.square().sum(), rest_cube = cube;
    for (Eigen::Index kept = 0; kept < best_kept + best_equal && rest_variance > 0.0; ++kept) {
        for (Eigen::Index equal = 0; kept + equal < best_kept + best_equal; ++equal) {
            // Weights a and b of the next pattern and the equal ones: a + n b = rest, a^2 + n b^2 = rest_variance.
            const double n = static_cast<double>(equal), root = n * ((n + 1.0) * rest_variance - rest * rest);
            if (root < 0.0 || (equal == 0 && rest * rest - rest_variance > kLeastRest))
                continue;
            const double next = std::min((rest + std::sqrt(root)) / (n + 1.0), rest);
            const double one = equal > 0 ? (rest - next) / n : 0.0;
            if (std::abs(next * next * next + n * one * one * one - rest_cube) > kCubeError * cube)
                continue;
            best_kept = kept;
            best_equal = equal;
            best_next = next;
        }
        rest -= values[kept];
        rest_variance -= values[kept] * values[kept];
        rest_cube -= values[kept] * values[kept] * values[kept];
    }
    std::vector<ExposureMode> modes;
    // What keeps its phase: power, and how it beats with what changes.
    double left = 1.0, steady = integrals.square().sum(), beat = (values * integrals.square()).sum();
    for (Eigen::Index k = 0; k < best_kept; ++k) {
        modes.push_back({values[k], integrals[k] / std::sqrt(values[k])});
        left -= values[k];
        steady -= integrals[k] * integrals[k];
        beat -= values[k] * integrals[k] * integrals[k];
    }
    if (best_equal == 0) {
        modes.push_back({best_next, std::sqrt(steady / best_next)});
        return modes;
    }
    const double one = (left - best_next) / static_cast<double>(best_equal);
    const double steady_next =
        best_next > one ? std::clamp((beat - one * steady) / (best_next - one), 0.0, steady) : 0.0;
    modes.push_back({best_next, std::sqrt(steady_next / best_next)});
    modes.insert(modes.end(), static_cast<std::size_t>(best_equal),
                 {one, std::sqrt((steady - steady_next) / (left - best_next))});
    return modes;
}

} // namespace clsp
