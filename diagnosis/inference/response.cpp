#include "inference/response.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace clsp {
namespace {

std::vector<std::uint64_t> pool_seeds(std::uint64_t seed, std::uint32_t count) {
    std::vector<std::uint64_t> result(count);
    std::iota(result.begin(), result.end(), seed + kPoolSeed);
    return result;
}

} // namespace

Eigen::VectorXd Pool::mean(std::uint32_t seeds) const {
    const std::size_t count = std::min<std::size_t>(seeds, statistics.size());
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(statistics.front().size());
    for (std::size_t i = 0; i < count; ++i)
        sum += statistics[i];
    return sum / static_cast<double>(count);
}

Pool simulate_pool(ReplicateRunner &runner, const EffectSettings &effects, std::uint64_t seed, std::uint32_t seed_count,
                   const CalibratedLevels *levels) {
    const std::vector<bool> all(runner.layout().sequences.size(), true);
    Pool pool{effects, levels ? *levels : runner.calibrate(effects, all, nullptr), {}};
    pool.statistics = runner.halves(effects, pool.levels, pool_seeds(seed, seed_count), all, {});
    return pool;
}

Change simulate_change(ReplicateRunner &runner, const Pool &base, const EffectSettings &effects,
                       const std::vector<bool> &concerned, std::uint64_t seed, std::uint32_t seed_count) {
    Change change;
    change.levels = runner.calibrate(effects, concerned, &base.levels);
    std::vector<Eigen::VectorXd> differences =
        runner.halves(effects, change.levels, pool_seeds(seed, seed_count), concerned, base.statistics);
    for (std::uint32_t i = 0; i < seed_count; ++i)
        differences[i] -= base.statistics[i];
    change.mean = Eigen::VectorXd::Zero(differences.front().size());
    for (const Eigen::VectorXd &difference : differences)
        change.mean += difference / seed_count;
    change.variance = Eigen::VectorXd::Zero(change.mean.size());
    if (seed_count > 1)
        for (const Eigen::VectorXd &difference : differences)
            change.variance += (difference - change.mean).cwiseAbs2() / (seed_count - 1);
    return change;
}

void Response::add(double strength, Change change) {
    const auto place = std::lower_bound(strengths_.begin(), strengths_.end(), strength);
    changes_.insert(changes_.begin() + (place - strengths_.begin()), std::move(change));
    strengths_.insert(place, strength);
}

double Response::distance(double strength) const {
    double least = 1e30;
    for (const double known : strengths_)
        least = std::min(least, std::abs(known - strength));
    return least;
}

const Change &Response::nearest(double strength) const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < strengths_.size(); ++i)
        if (std::abs(strengths_[i] - strength) < std::abs(strengths_[best] - strength))
            best = i;
    return changes_[best];
}

Eigen::VectorXd Response::faded(double strength) const {
    const auto above = std::upper_bound(strengths_.begin() + 1, strengths_.end() - 1, strength) - strengths_.begin();
    const std::size_t low = static_cast<std::size_t>(above) - 1;
    std::size_t high = low + 1;
    // Beyond the weakest: two that are near to each other tell no law.
    while (strength < strengths_[low] && high + 1 < strengths_.size() &&
           strengths_[high] - strengths_[low] < kStrengths.least_reach)
        ++high;
    const Eigen::ArrayXd weak = changes_[low].mean, strong = changes_[high].mean;
    const double steps = (strengths_[low] - strength) / (strengths_[high] - strengths_[low]);
    // What does not grow with the strength, or turns, is chance, or no law of it: between two it goes straight.
    const Eigen::ArrayXd ratio = (weak.abs() / strong.abs().max(1e-300)).min(1.0);
    const Eigen::ArrayXd straight = steps > 0.0 ? weak : Eigen::ArrayXd(weak - steps * (strong - weak));
    return (weak * strong > 0.0 && weak.abs() <= strong.abs()).select(weak * ratio.pow(steps), straight);
}

Eigen::VectorXd Response::at(double strength) const {
    const std::size_t n = strengths_.size();
    if (n == 1)
        return changes_.front().mean;
    if (weakest_ < kStrengths.weakest && strength < std::max(0.0, strengths_.front()))
        return faded(strength);
    // The window of three (or two) knots nearest to the strength.
    const std::size_t width = std::min<std::size_t>(3, n);
    std::size_t begin = 0;
    double best = 1e30;
    for (std::size_t i = 0; i + width <= n; ++i) {
        const double reach =
            std::max(std::abs(strengths_[i] - strength), std::abs(strengths_[i + width - 1] - strength));
        if (reach < best) {
            best = reach;
            begin = i;
        }
    }
    Eigen::VectorXd result = Eigen::VectorXd::Zero(changes_.front().mean.size());
    for (std::size_t i = begin; i < begin + width; ++i) {
        double weight = 1.0;
        for (std::size_t j = begin; j < begin + width; ++j)
            if (j != i)
                weight *= (strength - strengths_[j]) / (strengths_[i] - strengths_[j]);
        result += weight * changes_[i].mean;
    }
    return result;
}

} // namespace clsp
