// A model of effects with a strength for each parameter, and what every search for one goes by: the diagnosis's on
// simulated captures, the comparison's on finished frames.
#pragma once

#include "inference/candidate.hpp"
#include "inference/gap_test.hpp"
#include "inference/thresholds.hpp"
#include "runtime/error.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <string>
#include <vector>

namespace clsp {

// A parameter of one of the model's effects and its strength.
struct Strength {
    std::size_t effect;    // of the model's effects
    std::size_t parameter; // of the effect
    double strength;
    double reach = kStrengths.weakest; // how far it may go where the search ends before (ModelFit::go_on)
    bool held = false;                 // an explained rung told it: only fine fits move it (ModelFit::polish)
};

struct ModelEffect {
    const Candidate *candidate;
    double sign; // -1: the other direction, where an effect has one
};

struct EffectModel {
    std::vector<ModelEffect> effects;
    std::vector<Strength> strengths;

    EffectSettings settings() const;
    bool has(const Candidate &candidate) const;
    // All of an effect's parameters begin at one strength, but those that the catalogue does not vary at its value.
    void add(const Candidate &candidate, double sign, double strength);
    EffectModel without(std::size_t effect) const;
    // How many are far below the catalogue's weakest, beside others that are not: these are not named. step: of each
    // strength, still to be made; or none.
    std::size_t slight_count(const Eigen::VectorXd &step) const;
    EffectModel first(std::size_t count) const;
    void hold(bool held) {
        for (Strength &s : strengths)
            s.held = held;
    }
    // How unlikely an effect's parameters are beside what the catalogue has: -2 ln of a probability, 0 within its
    // range.
    double unlikelihood(std::size_t effect) const;
    // Of each strength from that of a model of the same effects.
    Eigen::VectorXd distance_from(const EffectModel &other) const;
    // How far to go with a strength for a finite difference. part: of the usual one; below 0: the other way.
    double difference(Eigen::Index strength, double part = 1.0) const;
    const std::string &id_of(Eigen::Index strength) const {
        return effects[strengths[static_cast<std::size_t>(strength)].effect].candidate->id;
    }
};

// Whether a strength stands where a search ends, or within a step of the grid that it begins with.
inline bool is_at(double strength, double end) {
    return strength > end - kStrengths.grid_step;
}

// Moves a strength as far as a finite difference needs, the other way where its range ends; how far that is.
double move_one(EffectModel &model, Eigen::Index strength, double part = 1.0);
// No step leads further down where an effect, below the catalogue's range, shows no more; which ones would have.
// columns: whitened slopes of the strengths.
std::vector<Eigen::Index> stop_where_nothing_shows(const std::vector<Strength> &strengths,
                                                   const Eigen::MatrixXd &columns, Eigen::VectorXd &step);
// A step of strengths, each bounded; the largest one.
double move_strengths(EffectModel &model, const Eigen::VectorXd &step, double strongest = kStrengths.strongest);

// A fitted parameter of a model.
struct FittedParameter {
    std::string effect, name;
    double value = 0.0, low = 0.0, high = 0.0; // 95 % interval
};

// Parameters at strengths, their 95 % intervals from the strengths' standard deviations, which were estimated from so
// many replicates.
std::vector<FittedParameter> fitted_parameters(const EffectModel &model, const Eigen::VectorXd &strengths,
                                               const Eigen::VectorXd &deviations, double replicates);
// Standard deviation of the simulator's error in each statistic: a part of what the effects change. A logarithm that
// grows by c is of a quantity to which 1 - exp(-c) of what it is then was added, and no more than that part of it is in
// doubt. One that falls far counts alike: it comes near the floor that it has, where nothing is left to be wrong about
// (by a part of c, clipped light that no pixel shows any more would be in doubt by a fifth of itself). change: of the
// mean statistics by the effects.
Eigen::VectorXd simulator_error(const std::vector<StatisticInfo> &list, const Eigen::VectorXd &change);
// Standard deviations of fitted strengths: how far the fit strays on replicates (GapModel::strays), and what errors of
// the model do to it: of the size of all changes together, and of each statistic on its own. Of those of which the
// statistics say nothing, so large that any value lies within. error: simulator_error().
Eigen::VectorXd strength_deviations(const GapModel &model, const Eigen::MatrixXd &strays, const Eigen::VectorXd &error);

// By how much statistics may differ between two ways of reading the effects' definitions. A part of the frame before
// remains in a lagging frame: of its light alone, or of what it was read as, with what had remained in it. Neighbouring
// frames are correlated by f (1 - f) / (1 - 2 f + 2 f^2) or by f, which differ by less than f^2, frames two apart not
// at all or by f^2; and the first frame had one before it, which nobody recorded, or none. And distortion may be that
// of the camera's lens, which stretches dots as it moves them, or that of the projector's, which leaves them as they
// are. Photon noise may be Poisson's or Gaussian, whose third moment is 0. change: of the mean statistics by the
// effects; jacobian: by a unit of each of the strengths, `columns`.
Eigen::VectorXd reading_tolerance(const std::vector<StatisticInfo> &list, const CaptureLayout &layout,
                                  const EffectSettings &effects, const std::vector<Strength> &columns,
                                  const Eigen::VectorXd &change, const Eigen::MatrixXd &jacobian);

// An effect that was weighed in a step of a search. Those that screening put aside are not among them.
struct RankedEffect {
    std::string effect;
    std::vector<double> values;
    double gain = 0.0;        // of the held-out squared distance
    double probability = 0.0; // among the effects of this step
    double distance_after = 0.0;
    bool simulated = false; // compared by replicates of its own
};
// Probabilities from the gains, the most probable effect first.
void weigh(std::vector<RankedEffect> &ranking);

struct SearchStep {
    std::string added;
    std::vector<RankedEffect> ranking; // best first
    GapTest residual;                  // after the step
};

// False if the simulator refuses what it was asked for: an effect beyond what a capture's geometry allows is no
// candidate.
template <typename Work> bool possible(const Work &work) {
    try {
        work();
    } catch (const Error &error) {
        if (error.status() != Status::kInvalidArgument)
            throw;
        return false;
    }
    return true;
}

} // namespace clsp
