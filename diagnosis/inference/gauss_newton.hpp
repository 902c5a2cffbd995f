// Strengths of a model's effects by Gauss-Newton rounds on common random numbers.
#pragma once

#include "inference/covariance.hpp"
#include "inference/effect_model.hpp"
#include "inference/replicate_runner.hpp"
#include "inference/response.hpp"
#include "inference/thresholds.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <vector>

namespace clsp {

// Where the rounds go from: a model that was simulated already. The mean of its replicates, and what common random
// numbers say that another model changes of it, is the other model's mean; its covariance weighs the statistics. The
// nearer, the better.
struct Origin {
    const Covariance &covariance;
    const Pool &pool;
};

struct GaussNewtonOptions {
    std::uint64_t seed = 0;
    std::uint32_t seeds = 1; // of common random numbers
    int rounds = 1;          // with a Jacobian of their own
    int secant_rounds = 0;   // then, at the cost of one simulation each
    double part = 1.0;       // of the usual finite differences
    double near = 0.06;      // a step that is shorter ends it
    double far = 0.06;       // and one that is shorter ends the secant rounds
    double strongest = kStrengths.strongest;
    double give_up_square = 1e300; // so does that squared distance after a few of them
    double least_gain = 0.0; // and two of them in a row that take away less than that part of it
};

struct GaussNewtonFit {
    EffectModel model;
    Pool pool; // of the model
    Eigen::MatrixXd jacobian;
    double square = 1e300; // whitened, after one linear step more
};

// known: columns of the Jacobian for the first round; those that are empty are simulated. report: called on the
// caller's thread before it simulates a column, with the parameter's index; may be empty.
GaussNewtonFit gauss_newton(ReplicateRunner &runner, EffectModel model, const Origin &origin,
                            const std::vector<Eigen::VectorXd> &known, const GaussNewtonOptions &options,
                            const std::function<void(Eigen::Index)> &report);

// The column of the Jacobian of a strength, by a finite difference from the pool of the model.
Eigen::VectorXd slope(ReplicateRunner &runner, const EffectModel &model, Eigen::Index p, const Pool &pool,
                      const GaussNewtonOptions &options);

// Sequences in which an effect shows.
std::vector<bool> concerned_sequences(ReplicateRunner &runner, const std::string &id);

} // namespace clsp
