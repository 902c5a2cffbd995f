// Which effects explain a capture: forward selection with parameters fitted on common random numbers, judged on the
// other half of the frames.
#pragma once

#include "inference/candidate.hpp"
#include "inference/effect_model.hpp"
#include "inference/gap_test.hpp"
#include "inference/replicate_runner.hpp"
#include "inference/response.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace clsp {

struct SearchOptions {
    std::uint64_t seed = 0;
    std::uint32_t null_replicates = 48;  // of the baseline
    std::uint32_t model_replicates = 24; // of each model that is compared in the end
    std::uint32_t pool_seeds = 2;        // common random numbers
    std::uint32_t refined = 7;           // effects whose strength is fitted in each step
    std::uint32_t finalists = 3;
    std::uint32_t max_effects = 6;
    double most_work =
        900.0; // beside the baseline's, what is asked for before the last step begins (ReplicateRunner::work)
    double level = 0.02;           // of a false alarm
    double residual_level = 0.005; // of calling a right model wrong: there are several models to a capture
};

// The baseline with effects, simulated at its fitted parameters and tested.
struct FittedModel {
    EffectSettings effects;
    std::vector<FittedParameter> parameters;
    GapModel model;
    GapTest residual;           // with the fitted parameters' directions taken out
    Eigen::MatrixXd jacobian;   // change of the statistics per unit of each strength
    std::vector<Strength> columns; // these strengths
    double part = 1.0;          // of the usual finite differences: the Jacobian's
    Eigen::VectorXd change;     // of the mean statistics by the effects, without the correction
    Eigen::VectorXd step;       // of each strength: the last, linear one of the fit
    Eigen::VectorXd correction; // of the mean, by that step
    double score = 0.0;         // held-out squared distance plus log determinant; smaller is better
};

// What an effect promises at the first look at the baseline's gap.
struct FirstLook {
    std::string effect;
    double share = 0.0;  // of the squared distance, that as much of its change as fits best takes away; or that a
                         // change along a line to the strong end does, held out (Search::look_again)
    bool fitted = false; // whether its parameters were fitted then; what a look promises little of is put aside
};

struct SearchResult {
    FittedModel baseline;
    std::vector<FirstLook> looks; // at all candidates that can show; the most promising first; none without a gap
    std::vector<SearchStep> steps;
    std::vector<FittedModel> models; // after each step
    double work = 0.0;               // what was asked for beside the baseline's (ReplicateRunner::work)
    bool ended_early = false;        // at the most work, with more to try
};

using Progress = std::function<void(const std::string &what, double fraction)>;

SearchResult search(ReplicateRunner &runner, const std::vector<Candidate> &candidates, const SearchOptions &options,
                    const Progress &progress);

} // namespace clsp
