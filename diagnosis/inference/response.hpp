// How the mean statistics answer to one effect's strength, on top of a set of other effects: simulations with common
// random numbers.
#pragma once

#include "inference/candidate.hpp"
#include "inference/replicate_runner.hpp"
#include "inference/thresholds.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace clsp {

// Half captures of one set of effects at the seeds of the pool.
struct Pool {
    EffectSettings effects;
    CalibratedLevels levels;
    std::vector<Eigen::VectorXd> statistics; // by seed

    Eigen::VectorXd mean(std::uint32_t seeds) const; // of the first ones, or of all where there are fewer
};

// Seeds of the pool are apart from those of replicates, which count up from 1.
constexpr std::uint64_t kPoolSeed = std::uint64_t{1} << 40;

Pool simulate_pool(ReplicateRunner &runner, const EffectSettings &effects, std::uint64_t seed, std::uint32_t seed_count,
                   const CalibratedLevels *levels = nullptr);

// Mean change of the statistics from `base` to other effects. concerned: sequences in which they differ.
struct Change {
    Eigen::VectorXd mean;     // of the change
    Eigen::VectorXd variance; // of a single seed's change about the mean; 0 with one seed
    CalibratedLevels levels;
};
Change simulate_change(ReplicateRunner &runner, const Pool &base, const EffectSettings &effects,
                       const std::vector<bool> &concerned, std::uint64_t seed, std::uint32_t seed_count);

// The answer to a strength by interpolation between simulated ones: through the three nearest, a parabola (straight
// lines cost false rejections).
class Response {
  public:
    // weakest: where the strengths begin. Below the catalogue's range each statistic follows the power law of simulated
    // strengths on both sides, or of the weakest.
    explicit Response(double weakest = kStrengths.weakest) : weakest_(weakest) {}
    void add(double strength, Change change);
    bool empty() const { return strengths_.empty(); }
    std::size_t size() const { return strengths_.size(); }
    const std::vector<double> &strengths() const { return strengths_; }
    const Change &nearest(double strength) const;
    double distance(double strength) const; // to the nearest simulated one
    Eigen::VectorXd at(double strength) const;

    double weakest() const { return weakest_; }

  private:
    Eigen::VectorXd faded(double strength) const;

    double weakest_;
    std::vector<double> strengths_; // ascending
    std::vector<Change> changes_;
};

} // namespace clsp
