#include "stages/laser_lines.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <cstddef>

namespace clsp {
namespace {

// An offset that small is 0: such a line needs no surface.
constexpr double kLeastOffset = 1e-9;

double squared_contrast(const std::vector<LaserLine> &lines, double dephasing_rad) {
    double sum = 0.0;
    for (const LaserLine &a : lines)
        for (const LaserLine &b : lines) {
            const double turn = dephasing_rad * (a.offset - b.offset);
            sum += a.weight * b.weight * std::exp(-turn * turn);
        }
    return sum;
}

// Jacobi's matrix of the orthogonal polynomials of the lines' shares, of which the first n rows make the rule of n
// lines: Lanczos's iteration, with every vector made orthogonal to all before it, as few as there are.
Eigen::MatrixXd jacobi_matrix(const std::vector<LaserLine> &lines) {
    const Eigen::Index count = static_cast<Eigen::Index>(lines.size());
    Eigen::ArrayXd offsets(count);
    Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(count, count), result = basis;
    for (Eigen::Index i = 0; i < count; ++i) {
        offsets[i] = lines[static_cast<std::size_t>(i)].offset;
        basis(i, 0) = std::sqrt(lines[static_cast<std::size_t>(i)].weight);
    }
    for (Eigen::Index n = 0; n < count; ++n) {
        Eigen::VectorXd next = (offsets * basis.col(n).array()).matrix();
        result(n, n) = basis.col(n).dot(next);
        if (n + 1 == count)
            break;
        for (int pass = 0; pass < 2; ++pass)
            next -= basis.leftCols(n + 1) * (basis.leftCols(n + 1).transpose() * next);
        result(n, n + 1) = result(n + 1, n) = next.norm();
        basis.col(n + 1) = next.normalized();
    }
    return result;
}

} // namespace

std::vector<LaserLine> equal_lines(std::uint32_t count) {
    if (count == 1)
        return {{0.0, 1.0}};
    std::vector<LaserLine> lines;
    double sum = 0.0;
    for (std::uint32_t i = 0; i < count; ++i) {
        const double k = -2.0 + 4.0 * i / (count - 1.0);
        lines.push_back({k, std::exp(-0.5 * k * k)});
        sum += lines.back().weight;
    }
    for (LaserLine &line : lines)
        line.weight /= sum;
    return lines;
}

std::vector<LaserLine> fewest_lines(const std::vector<LaserLine> &lines, double dephasing_rad, double error) {
    if (!(error > 0.0) || lines.size() < 2)
        return lines;
    const double wanted = squared_contrast(lines, dephasing_rad);
    const Eigen::MatrixXd matrix = jacobi_matrix(lines);
    for (Eigen::Index n = 1; n < matrix.rows(); ++n) {
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix.topLeftCorner(n, n));
        std::vector<LaserLine> fewer;
        for (Eigen::Index i = 0; i < n; ++i) {
            const double first = solver.eigenvectors()(0, i), offset = solver.eigenvalues()[i];
            fewer.push_back({std::abs(offset) < kLeastOffset ? 0.0 : offset, first * first});
        }
        if (std::abs(squared_contrast(fewer, dephasing_rad) - wanted) <= error * wanted)
            return fewer;
    }
    return lines;
}

} // namespace clsp
