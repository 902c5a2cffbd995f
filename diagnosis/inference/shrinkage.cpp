#include "inference/shrinkage.hpp"

#include "statistics/distributions.hpp"

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

// Of a capture from a model, each half after the fit to the other one, in the metric of another model or its own.
FoldStatistics after_fit(const FittedModel &fitted, const FittedModel &metric, const FoldStatistics &s) {
    const GapModel &model = fitted.model;
    const Covariance &fold = metric.model.fit_fold();
    const Eigen::VectorXd first = s.first - model.first_mean(), second = s.second - model.second_mean();
    const Eigen::VectorXd of_first = model.coefficients(fold, first), of_second = model.coefficients(fold, second);
    return {first - fitted.jacobian * of_second, second - fitted.jacobian * of_first};
}

double after_square(const FittedModel &metric, const FittedModel &fitted, const FoldStatistics &s) {
    const FoldStatistics after = after_fit(fitted, metric, s);
    return mean_square(metric.model.fold(), after.first, after.second);
}

HeldOutDifferences differences_of(const FittedModel &baseline, const FittedModel &fitted, const FoldStatistics &s) {
    const FoldStatistics after = after_fit(fitted, fitted, s);
    HeldOutDifferences result{Eigen::MatrixXd(s.first.size(), 2), Eigen::MatrixXd(s.first.size(), 2)};
    result.before << s.first - baseline.model.first_mean(), s.second - baseline.model.second_mean();
    result.after << after.first, after.second;
    return result;
}

} // namespace

double beyond_chance(double mean_square, double chance) {
    return std::sqrt(std::max(0.0, mean_square - chance));
}

double gone(double before, double after) {
    return before > 0.0 ? 1.0 - after / before : 0.0;
}

std::array<double, 2> gone_95(double fraction, const Eigen::VectorXd &before, double chance_before,
                              const Eigen::VectorXd &after, double chance_after) {
    Eigen::VectorXd fractions(before.size());
    for (Eigen::Index r = 0; r < before.size(); ++r)
        fractions[r] = gone(beyond_chance(before[r], chance_before), beyond_chance(after[r], chance_after));
    const double n = static_cast<double>(fractions.size());
    const double deviation = std::sqrt((fractions.array() - fractions.mean()).square().sum() / (n - 1.0));
    const double reach = 2.0 * deviation * std::sqrt(1.0 + 1.0 / n);
    return {fraction - reach, std::min(1.0, fraction + reach)};
}

Shrinkage shrinkage(const ReplicateRunner &runner, const FittedModel &baseline, const FittedModel &fitted,
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
        after[r] = after_square(metric_model, fitted, draws[r]);
    }
    chance_after = after.mean();
    Shrinkage result;
    result.before = beyond_chance(before_square(metric, baseline, runner.real()), chance_before);
    result.after = beyond_chance(after_square(metric_model, fitted, runner.real()), chance_after);
    result.fraction = gone(result.before, result.after);
    result.fraction_95 = gone_95(result.fraction, before, chance_before, after, chance_after);
    return result;
}

std::vector<StatisticShrinkage> statistic_shrinkages(const HeldOutDifferences &capture,
                                                     const std::vector<HeldOutDifferences> &replicates,
                                                     const Eigen::VectorXd &deviation, const Eigen::VectorXd &least) {
    const Eigen::Index count = capture.before.rows();
    const double n = static_cast<double>(replicates.size());
    HeldOutDifferences mean{Eigen::MatrixXd::Zero(count, capture.before.cols()),
                            Eigen::MatrixXd::Zero(count, capture.before.cols())};
    for (const HeldOutDifferences &replicate : replicates) {
        mean.before += replicate.before / n;
        mean.after += replicate.after / n;
    }
    // Mean over the halves of the products of two differences.
    const auto products = [](const Eigen::MatrixXd &a, const Eigen::MatrixXd &b) -> Eigen::ArrayXd {
        return (a.array() * b.array()).rowwise().mean();
    };
    Eigen::ArrayXd chance_before = Eigen::ArrayXd::Zero(count), chance_after = chance_before,
                   chance_both = chance_before;
    for (const HeldOutDifferences &replicate : replicates) {
        const Eigen::MatrixXd before = replicate.before - mean.before, after = replicate.after - mean.after;
        chance_before += products(before, before) / (n - 1.0);
        chance_after += products(after, after) / (n - 1.0);
        chance_both += products(before, after) / (n - 1.0);
    }
    chance_before = chance_before.max(least.array().square());
    chance_after = chance_after.max(least.array().square());
    const Eigen::ArrayXd squares_before = products(capture.before, capture.before);
    const Eigen::ArrayXd squares_after = products(capture.after, capture.after);
    const Eigen::ArrayXd both = products(capture.before, capture.after);
    // Both models' means are those of so many replicates, too, each of its own: what the capture's own scatter has in
    // common before and after cancels where little of a distance is gone, and their errors stay.
    const double quantile = student_two_sided_quantile(0.05, n - 1.0), reach = quantile * quantile,
                 with_means = reach * (1.0 + 1.0 / n);
    std::vector<StatisticShrinkage> result(static_cast<std::size_t>(count));
    for (Eigen::Index k = 0; k < count; ++k) {
        StatisticShrinkage &s = result[static_cast<std::size_t>(k)];
        s.held_out = true;
        s.before = beyond_chance(squares_before[k], chance_before[k]) / deviation[k];
        s.after = beyond_chance(squares_after[k], chance_after[k]) / deviation[k];
        // The parts r that a r^2 - 2 b r + c <= 0 holds for.
        const double a = squares_before[k] - with_means * chance_before[k], b = both[k] - reach * chance_both[k],
                     c = squares_after[k] - with_means * chance_after[k];
        s.beyond_chance = a > 0.0;
        if (!s.beyond_chance)
            continue;
        const double width = std::sqrt(std::max(0.0, b * b - a * c)), low = (b - width) / a, high = (b + width) / a;
        const double least_left = low * high < 0.0 ? 0.0 : std::min(std::abs(low), std::abs(high));
        const double most_left = std::max(std::abs(low), std::abs(high));
        s.fraction = gone(s.before, s.after);
        s.fraction_95 = {std::min(s.fraction, 1.0 - most_left), std::max(s.fraction, 1.0 - least_left)};
    }
    return result;
}

std::vector<StatisticShrinkage> statistic_shrinkages(const ReplicateRunner &runner, const FittedModel &baseline,
                                                     const FittedModel &fitted) {
    const auto &draws = fitted.model.replicates().draws;
    std::vector<HeldOutDifferences> replicates;
    for (const FoldStatistics &draw : draws)
        replicates.push_back(differences_of(baseline, fitted, draw));
    std::vector<StatisticShrinkage> result =
        statistic_shrinkages(differences_of(baseline, fitted, runner.real()), replicates,
                             fitted.model.fold().deviation(), least_deviations(runner.list(), draws));
    for (std::size_t s = 0; s < runner.layout().sequences.size(); ++s)
        for (std::size_t k = runner.begin(s); !runner.parted(s) && k < runner.end(s); ++k)
            result[k] = {};
    return result;
}

} // namespace clsp
