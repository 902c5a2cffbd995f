// Weighted linear least squares in whitened statistics.
#pragma once

#include "inference/covariance.hpp"

#include <Eigen/Core>

namespace clsp {

// Whitened columns of a matrix.
Eigen::MatrixXd whiten_columns(const Covariance &covariance, const Eigen::MatrixXd &matrix);

// b that minimizes |target - matrix b|^2, both whitened; empty without columns.
Eigen::VectorXd solve_least_squares(const Eigen::MatrixXd &matrix, const Eigen::VectorXd &target);

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd &matrix); // of Moore and Penrose

// |target - matrix b|^2 at its least.
double residual_square(const Eigen::MatrixXd &matrix, const Eigen::VectorXd &target);

// What one column more, as much of it as fits best, takes off |target - matrix b|^2; all whitened.
struct Promise {
    double gain = 0.0, coefficient = 0.0;
};
Promise promise_of(const Eigen::VectorXd &column, const Eigen::MatrixXd &matrix, const Eigen::VectorXd &target);

} // namespace clsp
