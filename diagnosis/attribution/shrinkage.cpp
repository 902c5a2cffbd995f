#include "attribution/shrinkage.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

double mean_square(const Covariance &covariance, const Eigen::VectorXd &first, const Eigen::VectorXd &second) {
    return 0.5 * (covariance.whiten(first).squaredNorm() + covariance.whiten(second).squaredNorm()) /
           static_cast<double>(first.size());
}

// Of a capture from the baseline.
double before_square(const Covariance &metric, const FittedModel &baseline, const FoldStatistics &s) {
    const GapModel &model = baseline.model;
    return mean_square(metric, s.first - model.first_mean(), s.second - model.second_mean());
}

// Of a capture from a model, each half after the fit to the other one.
double after_square(const Covariance &metric, const FittedModel &fitted, const FoldStatistics &s) {
    const GapModel &model = fitted.model;
    const Eigen::VectorXd first = s.first - model.first_mean(), second = s.second - model.second_mean();
    const Eigen::VectorXd of_first = model.coefficients(model.fold(), first), of_second = model.coefficients(model.fold(), second);
    return mean_square(metric, first - fitted.jacobian * of_second, second - fitted.jacobian * of_first);
}

} // namespace

double beyond_chance(double mean_square, double chance) { return std::sqrt(std::max(0.0, mean_square - chance)); }

double gone(double before, double after) { return before > 0.0 ? 1.0 - after / before : 0.0; }

std::array<double, 2> gone_95(double fraction, const Eigen::VectorXd &before, double chance_before, const Eigen::VectorXd &after,
                              double chance_after) {
    Eigen::VectorXd fractions(before.size());
    for (Eigen::Index r = 0; r < before.size(); ++r)
        fractions[r] = gone(beyond_chance(before[r], chance_before), beyond_chance(after[r], chance_after));
    const double n = static_cast<double>(fractions.size());
    const double deviation = std::sqrt((fractions.array() - fractions.mean()).square().sum() / (n - 1.0));
    const double reach = 2.0 * deviation * std::sqrt(1.0 + 1.0 / n);
    return {fraction - reach, std::min(1.0, fraction + reach)};
}

Shrinkage shrinkage(const Experiment &experiment, const FittedModel &baseline, const FittedModel &fitted,
                    const FittedModel &metric_model) {
    const Covariance &metric = metric_model.model.fold();
    double chance_before = 0.0, chance_after = 0.0;
    const auto &baseline_draws = baseline.model.replicates().draws;
    const auto &draws = fitted.model.replicates().draws;
    for (const FoldStatistics &draw : baseline_draws)
        chance_before += before_square(metric, baseline, draw) / static_cast<double>(baseline_draws.size());
    Eigen::VectorXd before(static_cast<Eigen::Index>(draws.size())), after(before.size());
    for (Eigen::Index r = 0; r < before.size(); ++r) {
        before[r] = before_square(metric, baseline, draws[r]);
        after[r] = after_square(metric, fitted, draws[r]);
    }
    chance_after = after.mean();
    Shrinkage result;
    result.before = beyond_chance(before_square(metric, baseline, experiment.real()), chance_before);
    result.after = beyond_chance(after_square(metric, fitted, experiment.real()), chance_after);
    result.fraction = gone(result.before, result.after);
    result.fraction_95 = gone_95(result.fraction, before, chance_before, after, chance_after);
    return result;
}

} // namespace clsp
