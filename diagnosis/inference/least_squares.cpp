#include "inference/least_squares.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <numeric>
#include <vector>

namespace clsp {

Eigen::MatrixXd whiten_columns(const Covariance &covariance, const Eigen::MatrixXd &matrix) {
    Eigen::MatrixXd result(matrix.rows(), matrix.cols());
    for (Eigen::Index c = 0; c < matrix.cols(); ++c)
        result.col(c) = covariance.whiten(matrix.col(c));
    return result;
}

Eigen::VectorXd solve_least_squares(const Eigen::MatrixXd &matrix, const Eigen::VectorXd &target) {
    if (matrix.cols() == 0)
        return Eigen::VectorXd(0);
    return matrix.completeOrthogonalDecomposition().solve(target);
}

Eigen::VectorXd solve_bounded(const Eigen::MatrixXd &matrix, const Eigen::VectorXd &target,
                              const Eigen::VectorXd &lower, const Eigen::VectorXd &upper) {
    Eigen::VectorXd result = Eigen::VectorXd::Zero(matrix.cols());
    std::vector<Eigen::Index> free(static_cast<std::size_t>(matrix.cols()));
    std::iota(free.begin(), free.end(), Eigen::Index{0});
    Eigen::VectorXd rest = target;
    while (!free.empty()) {
        const Eigen::VectorXd of_free = solve_least_squares(matrix(Eigen::all, free), rest);
        std::vector<Eigen::Index> within;
        for (std::size_t i = 0; i < free.size(); ++i) {
            const Eigen::Index p = free[i];
            const double wanted = of_free[static_cast<Eigen::Index>(i)];
            result[p] = std::clamp(wanted, lower[p], upper[p]);
            if (result[p] == wanted)
                within.push_back(p);
            else
                rest -= matrix.col(p) * result[p];
        }
        if (within.size() == free.size())
            break;
        free = std::move(within);
    }
    return result;
}

double residual_square(const Eigen::MatrixXd &matrix, const Eigen::VectorXd &target) {
    if (matrix.cols() == 0)
        return target.squaredNorm();
    return (target - matrix * solve_least_squares(matrix, target)).squaredNorm();
}

Promise promise_of(const Eigen::VectorXd &column, const Eigen::MatrixXd &matrix, const Eigen::VectorXd &target) {
    Eigen::MatrixXd columns(target.size(), matrix.cols() + 1);
    columns << column, matrix;
    const Eigen::VectorXd coefficients = solve_least_squares(columns, target);
    return {residual_square(matrix, target) - (target - columns * coefficients).squaredNorm(), coefficients[0]};
}

} // namespace clsp
