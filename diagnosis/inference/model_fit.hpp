// Fitting models of effects to a capture: strengths by common random numbers, judged by replicates of their own. What
// the search and its swaps are made of.
#pragma once

#include "inference/gap_test.hpp"
#include "inference/gauss_newton.hpp"
#include "inference/thresholds.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace clsp {

struct SearchOptions {
    std::uint64_t seed = 0;
    std::uint32_t null_replicates = 48;  // of the baseline
    std::uint32_t model_replicates = 24; // of each model that is compared in the end
    std::uint32_t pool_seeds = 2;        // common random numbers
    std::uint32_t refined = 7;           // effects whose strength is fitted in each step
    std::uint32_t finalists = 3;
    std::uint32_t max_effects = 16;
    double most_work =
        900.0;           // beside the baseline's, what is asked for before the last step begins (ReplicateRunner::work)
    double level = 0.02; // of a false alarm
    double residual_level = 0.005; // of calling a right model wrong: there are several models to a capture
    bool whole = true; // the models of all steps and the intervals of the parameters are wanted, too
};

// The baseline with effects, simulated at its fitted parameters and tested.
struct FittedModel {
    EffectSettings effects;
    std::vector<FittedParameter> parameters;
    GapModel model;
    GapTest residual;              // with the fitted parameters' directions taken out
    Eigen::MatrixXd jacobian;      // change of the statistics per unit of each strength
    std::vector<Strength> columns; // these strengths
    double part = 1.0;             // of the usual finite differences: the Jacobian's
    Eigen::VectorXd change;        // of the mean statistics by the effects, without the correction
    Eigen::VectorXd step;          // of each strength: the last, linear one of the fit
    Eigen::VectorXd correction;    // of the mean, by that step
    double score = 0.0;            // held-out squared distance plus log determinant; smaller is better
};

// Of each strength of `model` that a fitted one has, too, the changes by it. held: only of held ones, which stand
// there.
std::vector<Eigen::VectorXd> known_changes(const FittedModel &fitted, const EffectModel &of_fitted,
                                           const EffectModel &model, bool held = false);

using Progress = std::function<void(const std::string &what, double fraction)>;

// The two halves' differences from a model.
struct Differences {
    Eigen::VectorXd first, second;
    Eigen::VectorXd mean() const { return 0.5 * (first + second); }
};

// What a fit may go by. known: for each strength, how the statistics changed by it when it was last fitted; empty where
// that is not known. The first round goes by it; where a strength is held, all rounds do. replicates: that many judge
// the model, or all that the options of the search say where they leave a doubt.
struct FitOptions {
    std::uint32_t replicates = 0;
    double from = 0.0, to = 0.0; // of the progress
    std::vector<Eigen::VectorXd> known = {};
    bool near = false;    // the strengths are near the right ones: one round with changes of its own does
    double part = 1.0;    // of the usual finite differences
    double worth = 1e300; // a fit that leaves a larger squared distance, by its origin's covariance, is not judged
};

class ModelFit {
  public:
    // unexplained: by statistic, what is known to be no model's to explain, a standard deviation; empty: nothing. Fits
    // are spared it.
    ModelFit(ReplicateRunner &runner, const SearchOptions &options, const Progress &progress,
             Eigen::VectorXd unexplained = {})
        : runner_(runner), options_(options), progress_(progress), unexplained_(std::move(unexplained)) {}

    ReplicateRunner &runner() const { return runner_; }
    const SearchOptions &options() const { return options_; }
    // How far strengths go.
    double strongest() const { return strongest_; }
    void set_strongest(double strongest) { strongest_ = strongest; }
    void report(double fraction, const std::string &what) const {
        if (progress_)
            progress_(what, fraction);
    }

    // The baseline, calibrated and tested; all other fits go from it. To be called first.
    FittedModel fit_baseline(double to);
    // Half captures of the baseline: fit_baseline()'s common random numbers.
    const Pool &baseline_pool() const { return baseline_pool_; }
    // The model's strengths and its pool: by Gauss-Newton rounds, then replicates and a last, linear step. origin: null
    // for the baseline. A fit that is not worth being judged has no effects.
    FittedModel fit(EffectModel &model, Pool &pool, const FitOptions &options, const Origin *origin = nullptr);
    // Takes whole numbers one further where that leaves less: what differs between two of them says little of the next,
    // and a number that was chosen while other effects were missing does not come back by slopes.
    void step_whole_numbers(EffectModel &model, Pool &pool, FittedModel &fitted, double at);
    // Where strengths stand at the search's end, though their parameters' ranges go on and the last step leads there,
    // the fit goes on, up to the ends of these ranges. The better of both stays; false if that is the one before.
    bool go_on(EffectModel &model, Pool &pool, FittedModel &fitted, double at);
    // Fits again from where the last, linear step of a fit led, by small differences: for statistics that bend sharply.
    // The better of both stays.
    void polish(EffectModel &model, Pool &pool, FittedModel &fitted, double at);
    // Twice as many replicates for a fit whose residual is in doubt by those that it has: what is left of a path of
    // light that the model lacks is to be seen, and what few replicates make of chance is not.
    void confirm(FittedModel &fitted, double at);
    // The rest of a fit, by `count` replicates; nothing where it has as many.
    void judge(FittedModel &fitted, Replicates replicates, std::uint32_t count, double from, double to);
    // The first effects of a model, as they are in it, whose pool is `pool`: the whole's replicates, moved by what the
    // other effects change, with common random numbers. To tell what each step takes away.
    FittedModel part_of(const FittedModel &whole, const Pool &pool, const EffectModel &part);
    // By all statistics, also those that fits were spared. The fit stays.
    void judge_by_all(FittedModel &fitted) const;
    // The parameters of a fit and their intervals: by changes from more random numbers than its strengths were fitted
    // with. Where an effect is a few draws itself (power that flickers, air, hot pixels), two captures say of some
    // statistics how they answer to these draws, not to the effect. And where a statistic bends sharply (codes of
    // coarse steps), a slope is that of one side.
    void measure_parameters(FittedModel &fitted, const EffectModel &model, double at);
    // Enough to see that much is missing.
    std::uint32_t few_replicates() const {
        return std::min(options_.model_replicates, std::max(12u, options_.model_replicates / 2));
    }

    // Sequences in which an effect shows.
    std::vector<bool> concerned(const std::string &id) const;
    Differences differences(const FittedModel &fitted) const;
    // Squared distance of each half after the fit to the other half, summed. response: of one effect more, its strength
    // fitted to both.
    double held_out(const FittedModel &fitted, const Response *response = nullptr, double *strength = nullptr) const;
    // The squared distance of the whole capture that a fit leaves, by a covariance that need not be its own: those of
    // two models differ by chance, too.
    double square_by(const Covariance &covariance, const FittedModel &fitted) const;
    // By how much the capture's squared distance is less, by one covariance of both models.
    double gain_by_common(const FittedModel &before, const FittedModel &after) const;
    // The larger of that and of what the scores differ by. By scores each model has a covariance of its own: of large
    // gaps these differ by more than an effect explains.
    double gain_over(const FittedModel &before, const FittedModel &after) const;
    // What was asked for beside the baseline's (ReplicateRunner::work). No search goes on for ever: after so much of it
    // no step begins, and what is not explained by then is unknown.
    double work() const { return runner_.work() - baseline_work_; }
    bool may_go_on() {
        ended_early_ = ended_early_ || work() >= options_.most_work;
        return !ended_early_;
    }
    bool ended_early() const { return ended_early_; }
    // What the squared distance of both halves has beyond chance.
    double excess_square(const FittedModel &fitted) const {
        return held_out(fitted) - 2.0 * static_cast<double>(runner_.count());
    }

  private:
    // A column of the Jacobian, on both sides of a strength and by the replicates' own random numbers: less by what it
    // is uncertain of and by what the sides differ. part: of the usual finite differences.
    Eigen::VectorXd measured_slope(const Replicates &replicates, const EffectModel &model, Eigen::Index strength,
                                   double part) const;
    // The squared distance that another fit may leave at the most to take this one's place.
    double worth_replacing(const FittedModel &fitted) const;
    // A fit that starts from another's pool takes its place, with model and pool, if it is better.
    bool replace(EffectModel &model, Pool &pool, FittedModel &fitted, EffectModel start, FitOptions options);
    // The rest of a fit, by replicates that are there.
    void judge_by(FittedModel &fitted, Replicates replicates) const;
    // Draws replicates until there are `count`.
    void replicate(Replicates &replicates, std::uint32_t count, double from, double to) const;

    ReplicateRunner &runner_;
    SearchOptions options_;
    Progress progress_;
    double strongest_ = kStrengths.strongest;
    Eigen::VectorXd border_error(const Replicates &replicates, double from, double to) const;
    // Standard deviation of the model's own error in each statistic.
    Eigen::VectorXd model_error(const FittedModel &fitted) const;
    Eigen::VectorXd with_unexplained(const Eigen::VectorXd &error) const;

    GapModel baseline_; // from which fits go: with the errors of every model
    Eigen::VectorXd unexplained_, border_error_; // of every model
    Pool baseline_pool_;
    double baseline_work_ = 0.0;
    bool ended_early_ = false;
};

} // namespace clsp
