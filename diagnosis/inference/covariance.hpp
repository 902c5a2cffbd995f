// Mean and covariance of a statistics vector from few replicates.
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace clsp {

// Statistics of different sequences are independent given the calibration, so the covariance is one block a sequence.
// Each block's correlation matrix is shrunk towards the unit matrix by the weight that minimizes the expected squared
// error (Schaefer and Strimmer 2005), since there are about as many statistics as replicates.
class Covariance {
  public:
    Covariance() = default;
    // rows: replicates; blocks: begins of the blocks and the count of statistics. least_deviation: floor of each
    // standard deviation. tolerance: standard deviation of the model's own error in each statistic, independent of each
    // other, added to what replicates show.
    Covariance(const Eigen::MatrixXd &replicates, const std::vector<std::size_t> &blocks,
               const Eigen::VectorXd &least_deviation, const Eigen::VectorXd &tolerance);

    const Eigen::VectorXd &mean() const { return mean_; }
    const Eigen::VectorXd &deviation() const { return deviation_; }
    // C^(-1/2) v, such that |whiten(v)|^2 = v' C^-1 v.
    Eigen::VectorXd whiten(const Eigen::VectorXd &vector) const;
    // Mean of |whiten(e)|^2 over errors e of the model, the part of a block.
    double tolerance_square(std::size_t block) const { return tolerance_square_[block]; }
    const Eigen::VectorXd &tolerance() const { return tolerance_; }

  private:
    Eigen::VectorXd mean_, deviation_, tolerance_;
    std::vector<std::size_t> blocks_;
    std::vector<Eigen::MatrixXd> factors_; // inverse Cholesky factors of the correlation
    std::vector<double> tolerance_square_;
};

// Of each statistic over the replicates, less its own sampling error (James and Stein's estimate): 0 for most Gaussian
// ones.
Eigen::VectorXd certain_skewness(const Eigen::MatrixXd &replicates);

} // namespace clsp
