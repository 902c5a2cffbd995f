#include "inference/covariance.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace clsp {

Covariance::Covariance(const Eigen::MatrixXd &replicates, const std::vector<std::size_t> &blocks,
                       const Eigen::VectorXd &least_deviation, const Eigen::VectorXd &tolerance)
    : tolerance_(tolerance), blocks_(blocks) {
    const double n = static_cast<double>(replicates.rows());
    mean_ = replicates.colwise().mean();
    const Eigen::MatrixXd centered = replicates.rowwise() - mean_.transpose();
    deviation_ = (centered.colwise().squaredNorm() / (n - 1.0)).cwiseSqrt().cwiseMax(least_deviation.transpose());
    // Few replicates miss the tails of what is not Gaussian: a largest deviate beyond what n Gaussian ones show widens
    // the scale.
    const double expected = std::sqrt(2.0 * std::log(n)) + 0.8;
    for (Eigen::Index k = 0; k < deviation_.size(); ++k) {
        const double largest = centered.col(k).cwiseAbs().maxCoeff() / deviation_[k];
        deviation_[k] *= std::max(1.0, largest / expected);
    }
    const Eigen::VectorXd spread = deviation_; // of the replicates
    deviation_ = (spread.cwiseAbs2() + tolerance.cwiseAbs2()).cwiseSqrt();
    for (std::size_t b = 0; b + 1 < blocks.size(); ++b) {
        const Eigen::Index begin = static_cast<Eigen::Index>(blocks[b]);
        const Eigen::Index size = static_cast<Eigen::Index>(blocks[b + 1] - blocks[b]);
        Eigen::MatrixXd x = centered.middleCols(begin, size);
        for (Eigen::Index k = 0; k < size; ++k)
            x.col(k) /= spread[begin + k];
        const Eigen::MatrixXd correlation = x.transpose() * x / (n - 1.0);
        // Variance of each correlation, from the products of the replicates.
        double variances = 0.0, squares = 0.0;
        for (Eigen::Index i = 0; i < size; ++i)
            for (Eigen::Index j = i + 1; j < size; ++j) {
                const Eigen::ArrayXd products = x.col(i).array() * x.col(j).array();
                variances += (products - products.mean()).square().sum() * n / ((n - 1.0) * (n - 1.0) * (n - 1.0));
                squares += correlation(i, j) * correlation(i, j);
            }
        const double weight = squares > 0.0 ? std::clamp(variances / squares, 0.05, 1.0) : 1.0;
        Eigen::MatrixXd shrunk = (1.0 - weight) * correlation;
        shrunk.diagonal().setOnes();
        // The model's error is no part of the correlation.
        const Eigen::VectorXd part = (spread.cwiseQuotient(deviation_)).segment(begin, size);
        shrunk = part.asDiagonal() * shrunk * part.asDiagonal();
        shrunk.diagonal().setOnes();
        const Eigen::LLT<Eigen::MatrixXd> cholesky(shrunk);
        factors_.push_back(cholesky.matrixL().solve(Eigen::MatrixXd::Identity(size, size)));
        const Eigen::VectorXd error = tolerance.cwiseQuotient(deviation_).segment(begin, size);
        tolerance_square_.push_back((factors_.back() * error.asDiagonal()).squaredNorm());
    }
}

Eigen::VectorXd certain_skewness(const Eigen::MatrixXd &replicates) {
    const Eigen::Index n = replicates.rows();
    const double error_square = 6.0 / static_cast<double>(n); // of Gaussian replicates
    const Eigen::MatrixXd centered = replicates.rowwise() - replicates.colwise().mean();
    Eigen::VectorXd result = Eigen::VectorXd::Zero(replicates.cols());
    for (Eigen::Index k = 0; k < result.size(); ++k) {
        const double deviation = std::sqrt(centered.col(k).squaredNorm() / static_cast<double>(n - 1));
        if (!(deviation > 0.0))
            continue;
        const double skewness = (centered.col(k).array() / deviation).cube().mean();
        result[k] = skewness * std::max(0.0, 1.0 - error_square / std::max(skewness * skewness, error_square));
    }
    return result;
}

Eigen::VectorXd Covariance::whiten(const Eigen::VectorXd &vector) const {
    Eigen::VectorXd result = vector.cwiseQuotient(deviation_);
    for (std::size_t b = 0; b < factors_.size(); ++b) {
        const Eigen::Index begin = static_cast<Eigen::Index>(blocks_[b]);
        const Eigen::Index size = static_cast<Eigen::Index>(blocks_[b + 1] - blocks_[b]);
        result.segment(begin, size) = (factors_[b] * result.segment(begin, size)).eval();
    }
    return result;
}

} // namespace clsp
