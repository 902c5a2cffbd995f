// How far a gap shrinks once effects are in the simulator, on halves of the frames that the fit has not seen.
#pragma once

#include "inference/model_fit.hpp"

#include <array>
#include <vector>

namespace clsp {

struct Shrinkage {
    // Distances beyond chance, in the standard deviations of metric_model, root mean square over statistics.
    double before = 0.0;
    double after = 0.0;
    double fraction = 0.0;
    std::array<double, 2> fraction_95{};
};

// Root of what a mean square has beyond chance.
double beyond_chance(double mean_square, double chance);
// The part of a distance that is gone.
double gone(double before, double after);
// 95 % interval of such a part, from mean squares before and after on replicates.
std::array<double, 2> gone_95(double fraction, const Eigen::VectorXd &before, double chance_before,
                              const Eigen::VectorXd &after, double chance_after);

// Each half is compared with the model fitted to the other half. The interval comes from the model's replicates: new
// surfaces and new noise each, as a bootstrap over independent captures. metric_model: whose covariance measures the
// distances, the best model: the scatter that an effect itself brings (a shaking image, few hot pixels) is no gap.
Shrinkage shrinkage(const ReplicateRunner &runner, const FittedModel &baseline, const FittedModel &model,
                    const FittedModel &metric_model);

// The same of one statistic: its own differences alone, in standard deviations of halves simulated with the effects.
struct StatisticShrinkage {
    bool held_out = false;      // else nothing of it is known: no frames of its sequence are new to the fit
    bool beyond_chance = false; // the distance before; else there is no part of it to speak of
    double before = 0.0, after = 0.0;
    double fraction = 0.0;
    std::array<double, 2> fraction_95{};
};

// Differences of a capture from the baseline and from the model, of each half that is judged: columns.
struct HeldOutDifferences {
    Eigen::MatrixXd before, after;
};

// By statistic. replicates: of captures of the model itself. least: standard deviations below which none is trusted.
//
// The interval is Fieller's. If `after` is the part r of `before` in the mean, after - r * before is chance alone. So
// r is possible where the mean square of that over the halves is at most what the replicates' own is and the
// errors of their means are, times the square of Student's quantile. Halves that scatter alike give 95 % then,
// independent ones 98 %. All that it takes of the replicates is three second moments: it does not ask for more of them
// than there are, as quantiles of a part would.
std::vector<StatisticShrinkage> statistic_shrinkages(const HeldOutDifferences &capture,
                                                     const std::vector<HeldOutDifferences> &replicates,
                                                     const Eigen::VectorXd &deviation, const Eigen::VectorXd &least);
// Of the model, which is the metric's, too; not held out where a sequence is not parted.
std::vector<StatisticShrinkage> statistic_shrinkages(const ReplicateRunner &runner, const FittedModel &baseline,
                                                     const FittedModel &model);

} // namespace clsp
