// Whether a capture differs from what a model gives, and in which statistics.
#pragma once

#include "inference/covariance.hpp"
#include "inference/replicate_runner.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace clsp {

// Replicates of one model: the baseline, or the baseline with effects.
struct Replicates {
    EffectSettings effects;
    CalibratedLevels levels;
    std::vector<FoldStatistics> draws;
};

struct GapTest {
    bool detected = false;
    double p_value = 1.0;
    // Root of the mean squared whitened difference beyond what chance gives, see excess_distance().
    double distance = 0.0;
    double null_95 = 0.0;  // what chance alone exceeds once in twenty times
    Eigen::VectorXd z;          // of each statistic
    Eigen::VectorXd p_adjusted; // Holm: of each statistic, over all statistics
};

class GapModel {
  public:
    GapModel() = default;
    // At least 8 replicates. directions: changes of the mean statistics per unit of each fitted parameter (no columns:
    // none were); what lies along them is no gap. tolerance: standard deviation of the model's own error in each
    // statistic. spared: of what fits do not go by, and the test does; empty: nothing is.
    GapModel(const ReplicateRunner &runner, Replicates replicates, double level, Eigen::MatrixXd directions,
             const Eigen::VectorXd &tolerance, const Eigen::VectorXd &spared = {});

    const Replicates &replicates() const { return replicates_; }
    const Eigen::MatrixXd &directions() const { return directions_; }
    const Covariance &full() const { return full_; } // of the mean of both halves
    const Covariance &fold() const { return fold_; } // of one half
    const Covariance &fit_full() const { return fit_full_; } // the same, as fits go by it
    const Covariance &fit_fold() const { return fit_fold_; }
    const Eigen::VectorXd &first_mean() const { return first_mean_; } // of the first halves
    const Eigen::VectorXd &second_mean() const { return second_mean_; }
    // The test of the statistics of a whole capture, or of some of its sequences alone (by sequence; empty: of all).
    // z is of all statistics, p_adjusted 1 of those that are not tested.
    GapTest test(const FoldStatistics &statistics, const std::vector<bool> &sequences = {}) const;
    // By how much wider than chance the coefficients of the directions scatter where the model leaves something (Birge
    // 1932): the root of the mean squared whitened rest of the sequences, by how much each tells of a coefficient. Of a
    // sequence of which nothing significant is left it is 1.
    Eigen::VectorXd birge_ratios(const FoldStatistics &statistics) const;
    // The coefficients of the directions that fit a difference from the mean best.
    Eigen::VectorXd coefficients(const Covariance &covariance, const Eigen::VectorXd &difference) const;

    // The coefficients that a fit of both halves of the frames, or of the first, finds in each replicate's difference
    // from the mean, by a covariance of replicates that it is not among: how far a fit strays by chance. One row a
    // replicate.
    enum class Fit { kBoth, kFirst };
    Eigen::MatrixXd strays(const ReplicateRunner &runner, Fit fit) const;

  private:
    // Standard deviations below which those of a part of the replicates are not trusted; least: those of all of them.
    Eigen::VectorXd least_of_part(const Eigen::VectorXd &least) const;
    // Without what lies along the directions.
    Eigen::VectorXd projected(const Eigen::VectorXd &difference) const;
    // Squared norm of each sequence's part.
    Eigen::RowVectorXd block_squares(const Eigen::VectorXd &whitened) const;

    Replicates replicates_;
    double level_ = 0.0;
    Eigen::MatrixXd directions_;
    Covariance full_, fold_, fit_full_, fit_fold_;
    Covariance part_[2];        // of either half of the replicates, which the other half is measured by
    Eigen::VectorXd skewness_;  // of the statistics of few frames, 0 of all others
    std::vector<std::size_t> blocks_; // begins of the sequences' statistics, and their count
    Eigen::MatrixXd reference_; // squared distances of replicates that their covariance has not seen, by sequence
    Eigen::VectorXd first_mean_, second_mean_;
};

// Of the whole capture, by the replicates of two models that differ little but in their means: of many statistics and
// few replicates, what two covariances differ by is chance.
Covariance common_covariance(const ReplicateRunner &runner, const GapModel &first, const GapModel &second);

// Standard deviations below which no statistic is trusted.
Eigen::VectorXd least_deviations(const std::vector<StatisticInfo> &list, const std::vector<FoldStatistics> &draws);

} // namespace clsp
