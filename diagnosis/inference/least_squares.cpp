#include "inference/least_squares.hpp"

#include <Eigen/QR>

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

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd &matrix) {
    return matrix.completeOrthogonalDecomposition().pseudoInverse();
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
