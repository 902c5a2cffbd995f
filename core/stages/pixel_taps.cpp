#include "stages/pixel_taps.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace clsp {
std::vector<double> pixel_taps(double fill_factor, std::uint32_t oversampling, double bandwidth) {
    const std::uint32_t count = oversampling + (oversampling < 4 ? 6 : 4);
    const std::uint32_t pairs = count / 2; // and a middle one where count is odd
    const bool middle = count % 2 != 0;
    const std::uint32_t unknowns = pairs + (middle ? 1 : 0);
    const double side = std::sqrt(fill_factor);
    const double band = std::min(bandwidth, 0.5 * oversampling);
    // Transfer function of unknown j at frequency f: cos(2 pi f t_j), t_j its distance from the centre.
    const auto basis = [&](std::uint32_t j, double f) {
        const double t = middle ? double(j) / oversampling : (j + 0.5) / oversampling;
        return (middle && j == 0 ? 1.0 : 2.0) * std::cos(2.0 * M_PI * f * t);
    };
    // Normal equations on a fine grid of frequencies, a little damping where the band leaves weights undetermined, and
    // a Lagrange multiplier for the exact sum.
    constexpr int kFrequencies = 256;
    Eigen::MatrixXd transfer(kFrequencies, unknowns);
    Eigen::VectorXd wanted(kFrequencies);
    for (int k = 0; k < kFrequencies; ++k) {
        const double f = band * (k + 0.5) / kFrequencies;
        const double x = M_PI * side * f;
        wanted[k] = x == 0.0 ? 1.0 : std::sin(x) / x;
        for (std::uint32_t j = 0; j < unknowns; ++j)
            transfer(k, j) = basis(j, f);
    }
    Eigen::MatrixXd system = Eigen::MatrixXd::Zero(unknowns + 1, unknowns + 1);
    system.topLeftCorner(unknowns, unknowns) =
        transfer.transpose() * transfer / kFrequencies + 1e-9 * Eigen::MatrixXd::Identity(unknowns, unknowns);
    Eigen::VectorXd right(unknowns + 1);
    right.head(unknowns) = transfer.transpose() * wanted / kFrequencies;
    right[unknowns] = 1.0;
    for (std::uint32_t j = 0; j < unknowns; ++j)
        system(unknowns, j) = system(j, unknowns) = basis(j, 0.0);
    const Eigen::VectorXd half = system.fullPivLu().solve(right);
    std::vector<double> taps(count);
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t distance =
            middle ? (i < pairs ? pairs - i : i - pairs) : (i < pairs ? pairs - 1 - i : i - pairs);
        taps[i] = half[distance];
    }
    return taps;
}

} // namespace clsp
