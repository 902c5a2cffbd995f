// Fitting models of effects to a capture: strengths by common random numbers, judged by replicates of their own. What
// the search and its exchanges are made of.
#pragma once

#include "attribution/gauss_newton.hpp"
#include "attribution/search.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace clsp {

// Of the pool's seeds, for the search; fits use all.
constexpr std::uint32_t kSearchSeeds = 1;

// A residual that is seldom by chance, though not too large, comes of an effect that resembles the true one as often as
// of chance.
constexpr double kSeldom = 0.05;

// Effects in the order in which they were found.
struct Path {
    EffectModel model;
    Pool pool; // of the whole model
    std::map<const Candidate *, Eigen::VectorXd>
        looks; // each other effect's change of the statistics when it was last looked at
    std::vector<SearchStep> steps;
    std::vector<FittedModel> models; // after each step
    double progress = 0.0;
};

// The two halves' differences from a model.
struct Differences {
    Eigen::VectorXd first, second;
    Eigen::VectorXd mean() const { return 0.5 * (first + second); }
};

class ModelFit {
  public:
    ModelFit(Experiment &experiment, const SearchOptions &options, const Progress &progress)
        : experiment_(experiment), options_(options), progress_(progress) {}

    Experiment &experiment() const { return experiment_; }
    const SearchOptions &options() const { return options_; }
    // How far strengths go.
    double strongest() const { return strongest_; }
    void set_strongest(double strongest) { strongest_ = strongest; }
    void report(double fraction, const std::string &what) const {
        if (progress_ && experiment_.on_callers_thread())
            progress_(what, fraction);
    }

    // The baseline, calibrated and tested; all other fits go from it. To be called first.
    FittedModel fit_baseline(double to);
    // Half captures of the baseline: fit_baseline()'s common random numbers.
    const Pool &baseline_pool() const { return baseline_pool_; }
    // The model's strengths and its pool. known: the changes by the model's first parameters when they were last
    // fitted, for the first round; may have no columns. replicates: that many judge the model, or all that the options
    // say where they leave a doubt. origin: null for the baseline.
    FittedModel fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, std::uint32_t replicates, double from,
                    double to, const Origin *origin = nullptr);
    FittedModel fit(EffectModel &model, Pool &pool, std::uint32_t replicates, double at,
                    const Origin *origin = nullptr);
    // Fits again from where the last, linear step of a fit led, by small differences: for statistics that bend sharply.
    // The better of both stays.
    void polish(EffectModel &model, Pool &pool, FittedModel &fitted, double at);
    // The rest of a fit, by `count` replicates; nothing where it has as many.
    void judge(FittedModel &fitted, const EffectModel &model, Replicates replicates, std::uint32_t count, double from,
               double to);
    // Enough to see that much is missing.
    std::uint32_t few_replicates() const {
        return std::min(options_.model_replicates, std::max(12u, options_.model_replicates / 2));
    }
    // The models after each of the model's effects from `begin` on, but the last, which is `last`. False if one cannot
    // be simulated.
    bool fit_prefixes(const EffectModel &model, std::size_t begin, std::vector<FittedModel> &models, FittedModel last,
                      double at);

    // Sequences in which an effect shows.
    std::vector<bool> concerned(const std::string &id) const;
    Differences differences(const FittedModel &fitted) const;
    // Squared distance of each half after the fit to the other half, summed. response: of one effect more, its strength
    // fitted, too.
    double held_out(const FittedModel &fitted, const Response *response = nullptr, double *strength = nullptr) const;
    // What the squared distance of both halves has beyond chance.
    double excess_square(const FittedModel &fitted) const {
        return held_out(fitted) - 2.0 * static_cast<double>(experiment_.count());
    }

  private:
    FittedModel fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, int rounds, double part,
                    std::uint32_t replicates, double from, double to, const Origin *origin);
    // Draws replicates until there are `count`.
    void replicate(Replicates &replicates, std::uint32_t count, double from, double to) const;

    Experiment &experiment_;
    SearchOptions options_;
    Progress progress_;
    double strongest_ = kStrongest;
    GapModel baseline_;
    Pool baseline_pool_;
};

} // namespace clsp
