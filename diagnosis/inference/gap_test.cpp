#include "inference/gap_test.hpp"

#include "inference/least_squares.hpp"
#include "inference/thresholds.hpp"
#include "statistics/distributions.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

std::vector<std::size_t> blocks_of(const ReplicateRunner &runner) {
    std::vector<std::size_t> blocks;
    for (std::size_t s = 0; s < runner.layout().sequences.size(); ++s)
        blocks.push_back(runner.begin(s));
    blocks.push_back(runner.count());
    return blocks;
}

double excess_distance(double mean_square, double expected) { return std::sqrt(std::max(0.0, mean_square - expected)); }

} // namespace

Eigen::VectorXd least_deviations(const std::vector<StatisticInfo> &list, const std::vector<FoldStatistics> &draws) {
    // A statistic that is the same in all replicates (a count of what never happens) may take another value by chance
    // about once in as many captures; a quarter of its unit keeps that from being a certainty.
    const Eigen::Index count = draws.front().first.size();
    Eigen::VectorXd result(count);
    for (Eigen::Index k = 0; k < count; ++k) {
        const double value = draws.front().first[k];
        const bool constant = std::all_of(draws.begin(), draws.end(), [&](const FoldStatistics &draw) {
            return std::abs(draw.first[k] - value) <= 1e-9 * (1.0 + std::abs(value)) &&
                   std::abs(draw.second[k] - value) <= 1e-9 * (1.0 + std::abs(value));
        });
        result[k] = std::max(list[static_cast<std::size_t>(k)].least_deviation,
                             constant ? 0.25 : 1e-9 * (1.0 + std::abs(value)));
    }
    return result;
}

GapModel::GapModel(const ReplicateRunner &runner, Replicates replicates, double level, Eigen::MatrixXd directions,
                   const Eigen::VectorXd &tolerance, const Eigen::VectorXd &spared)
    : replicates_(std::move(replicates)), level_(level), directions_(std::move(directions)) {
    const auto &draws = replicates_.draws;
    const Eigen::Index n = static_cast<Eigen::Index>(draws.size()), count = static_cast<Eigen::Index>(runner.count());
    const Eigen::VectorXd least = least_deviations(runner.list(), draws);
    const std::vector<std::size_t> &blocks = blocks_ = blocks_of(runner);
    Eigen::MatrixXd full(n, count), folds(2 * n, count);
    for (Eigen::Index r = 0; r < n; ++r) {
        full.row(r) = draws[r].mean();
        folds.row(r) = draws[r].first;
        folds.row(n + r) = draws[r].second;
    }
    first_mean_ = folds.topRows(n).colwise().mean();
    second_mean_ = folds.bottomRows(n).colwise().mean();
    full_ = Covariance(full, blocks, least, tolerance);
    fold_ = Covariance(folds, blocks, least, tolerance);
    fit_full_ = full_;
    fit_fold_ = fold_;
    if (spared.size()) {
        const Eigen::VectorXd of_fit = (tolerance.cwiseAbs2() + spared.cwiseAbs2()).cwiseSqrt();
        fit_full_ = Covariance(full, blocks, least, of_fit);
        fit_fold_ = Covariance(folds, blocks, least, of_fit);
    }
    skewness_ = Eigen::VectorXd::Zero(count);
    for (std::size_t s = 0; s + 1 < blocks.size(); ++s) {
        const auto begin = static_cast<Eigen::Index>(blocks[s]);
        const auto size = static_cast<Eigen::Index>(blocks[s + 1] - blocks[s]);
        if (runner.has_few_frames(s))
            skewness_.segment(begin, size) = certain_skewness(full.middleCols(begin, size));
    }
    const Eigen::Index half = n / 2;
    const Eigen::VectorXd least_of_part = this->least_of_part(least);
    part_[0] = Covariance(full.topRows(half), blocks, least_of_part, tolerance);
    part_[1] = Covariance(full.bottomRows(n - half), blocks, least_of_part, tolerance);
    reference_.resize(n, static_cast<Eigen::Index>(blocks.size() - 1));
    for (Eigen::Index r = 0; r < n; ++r) {
        const Covariance &other = part_[r < half ? 1 : 0];
        const Eigen::VectorXd difference = projected(full.row(r).transpose() - other.mean());
        // Replicates have none of the model's error, a capture may have all of it.
        reference_.row(r) = block_squares(other.whiten(difference));
        for (Eigen::Index b = 0; b < reference_.cols(); ++b)
            reference_(r, b) += other.tolerance_square(static_cast<std::size_t>(b));
    }
}

Eigen::VectorXd GapModel::least_of_part(const Eigen::VectorXd &least) const {
    const Eigen::VectorXd spread =
        (full_.deviation().cwiseAbs2() - full_.tolerance().cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
    return least.cwiseMax(kModelError.rare * spread);
}

Covariance common_covariance(const ReplicateRunner &runner, const GapModel &first, const GapModel &second) {
    std::vector<FoldStatistics> draws;
    std::vector<Eigen::VectorXd> centered;
    for (const GapModel *const model : {&first, &second})
        for (const FoldStatistics &draw : model->replicates().draws) {
            draws.push_back(draw);
            centered.push_back(draw.mean() - model->full().mean());
        }
    Eigen::MatrixXd rows(static_cast<Eigen::Index>(centered.size()), static_cast<Eigen::Index>(runner.count()));
    for (std::size_t r = 0; r < centered.size(); ++r)
        rows.row(static_cast<Eigen::Index>(r)) = centered[r];
    const Eigen::VectorXd tolerance =
        ((first.full().tolerance().cwiseAbs2() + second.full().tolerance().cwiseAbs2()) / 2.0).cwiseSqrt();
    return {rows, blocks_of(runner), least_deviations(runner.list(), draws), tolerance};
}

Eigen::VectorXd GapModel::coefficients(const Covariance &covariance, const Eigen::VectorXd &difference) const {
    return solve_least_squares(whiten_columns(covariance, directions_), covariance.whiten(difference));
}

Eigen::MatrixXd GapModel::strays(const ReplicateRunner &runner, Fit fit) const {
    const auto &draws = replicates_.draws;
    const Eigen::Index n = static_cast<Eigen::Index>(draws.size());
    const Eigen::VectorXd least = least_of_part(least_deviations(runner.list(), draws));
    Eigen::MatrixXd result(n, directions_.cols());
    for (Eigen::Index k = 0; k < kFit.stray_folds; ++k) {
        const Eigen::Index begin = k * n / kFit.stray_folds, end = (k + 1) * n / kFit.stray_folds;
        Eigen::MatrixXd others(n - (end - begin), full_.mean().size());
        for (Eigen::Index r = 0; r < others.rows(); ++r)
            others.row(r) = draws[static_cast<std::size_t>(r < begin ? r : r + (end - begin))].mean();
        const Covariance covariance(others, blocks_of(runner), least, full_.tolerance());
        for (Eigen::Index r = begin; r < end; ++r) {
            const FoldStatistics &draw = draws[static_cast<std::size_t>(r)];
            result.row(r) =
                coefficients(covariance, fit == Fit::kBoth ? draw.mean() - full_.mean() : draw.first - first_mean_);
        }
    }
    return result;
}

Eigen::VectorXd GapModel::projected(const Eigen::VectorXd &difference) const {
    if (directions_.cols() == 0)
        return difference;
    return difference - directions_ * coefficients(fit_full_, difference);
}

Eigen::RowVectorXd GapModel::block_squares(const Eigen::VectorXd &whitened) const {
    Eigen::RowVectorXd result(static_cast<Eigen::Index>(blocks_.size() - 1));
    for (std::size_t b = 0; b + 1 < blocks_.size(); ++b)
        result[static_cast<Eigen::Index>(b)] =
            whitened
                .segment(static_cast<Eigen::Index>(blocks_[b]), static_cast<Eigen::Index>(blocks_[b + 1] - blocks_[b]))
                .squaredNorm();
    return result;
}

GapTest GapModel::test(const FoldStatistics &statistics, const std::vector<bool> &sequences) const {
    GapTest result;
    const Eigen::VectorXd values = statistics.mean();
    const double n = static_cast<double>(replicates_.draws.size());
    Eigen::VectorXd tested(reference_.cols()); // 1 where a sequence is
    std::vector<Eigen::Index> order;
    for (Eigen::Index b = 0; b < tested.size(); ++b) {
        const auto block = static_cast<std::size_t>(b);
        tested[b] = sequences.empty() || sequences[block] ? 1.0 : 0.0;
        for (std::size_t k = blocks_[block]; tested[b] > 0.0 && k < blocks_[block + 1]; ++k)
            order.push_back(static_cast<Eigen::Index>(k));
    }
    const auto count = static_cast<Eigen::Index>(order.size());
    result.z = projected(values - full_.mean()).cwiseQuotient(full_.deviation()) / std::sqrt(1.0 + 1.0 / n);
    Eigen::VectorXd p(values.size());
    for (const Eigen::Index k : order)
        p[k] = student_two_sided(without_skewness(result.z[k], skewness_[k]), n - 1.0);
    std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return p[a] < p[b]; });
    result.p_adjusted.setOnes(values.size());
    double adjusted = 0.0;
    for (Eigen::Index i = 0; i < count; ++i) {
        const Eigen::Index k = order[static_cast<std::size_t>(i)];
        adjusted = std::max(adjusted, std::min(1.0, p[k] * static_cast<double>(count - i)));
        result.p_adjusted[k] = adjusted;
    }
    double square = 0.0;
    for (const Covariance &part : part_)
        square +=
            0.5 * block_squares(part.whiten(projected(values - part.mean()))).dot(tested) / static_cast<double>(count);
    const Eigen::VectorXd reference = reference_ * tested / static_cast<double>(count);
    const double mean = reference.mean();
    const double variance = (reference.array() - mean).square().sum() / (n - 1.0);
    const double p_distance = gamma_upper(square, mean, variance);
    // Bonferroni over the two ways of looking: one large deviation, or many small ones.
    result.p_value = std::min(1.0, 2.0 * std::min(result.p_adjusted.minCoeff(), p_distance));
    result.detected = result.p_value <= level_;
    result.distance = excess_distance(square, mean);
    std::vector<double> sorted(reference.data(), reference.data() + reference.size());
    std::sort(sorted.begin(), sorted.end());
    result.null_95 = excess_distance(sorted[static_cast<std::size_t>(0.95 * (n - 1.0) + 0.5)], mean);
    return result;
}

Eigen::VectorXd GapModel::birge_ratios(const FoldStatistics &statistics) const {
    const Eigen::Index sequences = reference_.cols();
    Eigen::RowVectorXd square = Eigen::RowVectorXd::Ones(sequences);
    for (Eigen::Index s = 0; s < sequences; ++s) {
        std::vector<bool> alone(static_cast<std::size_t>(sequences));
        alone[static_cast<std::size_t>(s)] = true;
        const GapTest left = test(statistics, alone);
        if (left.p_value * static_cast<double>(sequences) <= level_)
            square[s] += left.distance * left.distance;
    }
    Eigen::VectorXd result = Eigen::VectorXd::Ones(directions_.cols());
    for (Eigen::Index p = 0; p < result.size(); ++p) {
        const Eigen::RowVectorXd told = block_squares(fit_full_.whiten(directions_.col(p)));
        if (told.sum() > 0.0)
            result[p] = std::sqrt(told.dot(square) / told.sum());
    }
    return result;
}

} // namespace clsp
