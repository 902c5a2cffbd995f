// Which effects on the simulated frames close the difference between two captures: fitted on the first half of the
// frames, judged on the second.
#pragma once

#include "inference/candidate.hpp"
#include "inference/gap_test.hpp"
#include "inference/model_fit.hpp"
#include "inference/replicate_runner.hpp"
#include "simulator/finished_frames.hpp"

#include <Eigen/Core>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

// An effect of which the simulated frames seem to have more than the camera's: what is there cannot be taken out of
// finished frames.
struct SurplusEffect {
    std::string effect;
    double gain =
        0.0; // by which its removal would lower the squared distance, by a straight line through its own answer
};

// A camera that both sets are of: its effects and its light make them scatter.
struct KnownCamera {
    EffectSettings effects;
    std::vector<double> gain_dn; // by sequence; empty: not known
};

// Differences of two independent draws of our simulator with these effects: what real and simulated frames of one
// camera differ by. gain_dn: as KnownCamera.
Replicates draw_differences(ReplicateRunner &runner, const EffectSettings &effects, const std::vector<double> &gain_dn,
                            std::uint32_t count, std::uint64_t seed,
                            const std::function<void(double fraction)> &progress);

// Effects on the simulated frames, fitted and tested.
struct ClosedGap {
    EffectSettings effects;
    std::vector<FittedParameter> parameters;
    FoldStatistics change;                 // of the simulated frames' statistics
    Eigen::MatrixXd jacobian;              // of the change, per unit of strength of each parameter
    std::shared_ptr<const GapModel> model; // of the differences that the effects leave, about the change
    GapTest residual;
};

struct ClosingResult {
    std::vector<SearchStep> steps;
    std::vector<ClosedGap> models; // after each step
    std::vector<SurplusEffect> surplus;
};

struct ClosingOptions {
    std::uint64_t seed = 0;
    std::uint32_t max_effects = 16;
    std::uint32_t model_replicates = 24; // differences
    std::uint32_t refined = 7;           // effects whose strength is fitted in each step
    double residual_level = 0.005;
    KnownCamera camera;
};

// difference: real less simulated statistics. null: of differences without effects.
ClosingResult close_gap(ReplicateRunner &runner, FinishedFrames &finished, const std::vector<Candidate> &candidates,
                        const FoldStatistics &difference, const GapModel &null, const ClosingOptions &options,
                        const Progress &progress);

} // namespace clsp
