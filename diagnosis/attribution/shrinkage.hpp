// How far a gap shrinks once effects are in the simulator, on halves of the frames that the fit has not seen.
#pragma once

#include "attribution/search.hpp"

#include <array>
#include <vector>

namespace clsp {

struct Shrinkage {
    double before = 0.0; // distances beyond chance, in the standard deviations of metric_model, root mean square over statistics
    double after = 0.0;
    double fraction = 0.0;
    std::array<double, 2> fraction_95{};
};

// Root of what a mean square has beyond chance.
double beyond_chance(double mean_square, double chance);
// The part of a distance that is gone.
double gone(double before, double after);
// 95 % interval of such a part, from mean squares before and after on replicates.
std::array<double, 2> gone_95(double fraction, const Eigen::VectorXd &before, double chance_before, const Eigen::VectorXd &after,
                              double chance_after);

// Each half is compared with the model fitted to the other half. The interval comes from the model's replicates: new surfaces and new
// noise each, as a bootstrap over independent captures. metric_model: whose covariance measures the distances, the best model: the scatter
// that an effect itself brings (a shaking image, few hot pixels) is no gap.
Shrinkage shrinkage(const Experiment &experiment, const FittedModel &baseline, const FittedModel &model,
                    const FittedModel &metric_model);

} // namespace clsp
