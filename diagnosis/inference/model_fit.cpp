#include "inference/model_fit.hpp"

#include "inference/least_squares.hpp"
#include "inference/thresholds.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

namespace clsp {
namespace {

// Of the baseline's progress: its replicates.
constexpr double kOfReplicates = 0.6;

std::string label(const EffectSettings &effects) {
    std::string result;
    for (const EffectSetting &effect : effects)
        result += (result.empty() ? "" : " + ") + effect.id;
    return result;
}

} // namespace

std::vector<Eigen::VectorXd> known_changes(const FittedModel &fitted, const EffectModel &of_fitted,
                                           const EffectModel &model, bool held) {
    std::vector<Eigen::VectorXd> known(model.strengths.size());
    for (std::size_t p = 0; p < model.strengths.size(); ++p)
        for (std::size_t q = 0; q < of_fitted.strengths.size(); ++q)
            if ((!held ||
                 (model.strengths[p].held && model.strengths[p].strength == of_fitted.strengths[q].strength)) &&
                model.strengths[p].parameter == of_fitted.strengths[q].parameter &&
                model.effects[model.strengths[p].effect].candidate ==
                    of_fitted.effects[of_fitted.strengths[q].effect].candidate)
                known[p] = fitted.jacobian.col(static_cast<Eigen::Index>(q));
    return known;
}

void ModelFit::replicate(Replicates &replicates, std::uint32_t count, double from, double to) const {
    const std::string what = "simulating " + (replicates.effects.empty() ? "the baseline" : label(replicates.effects));
    const std::size_t first = replicates.draws.size();
    if (first >= count)
        return;
    std::vector<std::uint64_t> seeds(count - first);
    std::iota(seeds.begin(), seeds.end(), options_.seed + 1 + first);
    std::vector<FoldStatistics> draws =
        runner_.replicates(replicates.effects, replicates.levels, seeds, [&](std::size_t r) {
            report(from + (to - from) * static_cast<double>(first + r) / count, what);
        });
    std::move(draws.begin(), draws.end(), std::back_inserter(replicates.draws));
}

Differences ModelFit::differences(const FittedModel &fitted) const {
    Differences result{runner_.real().first - fitted.model.first_mean(),
                       runner_.real().second - fitted.model.second_mean()};
    if (fitted.correction.size()) {
        result.first -= fitted.correction;
        result.second -= fitted.correction;
    }
    return result;
}

std::vector<bool> ModelFit::concerned(const std::string &id) const {
    return concerned_sequences(runner_, id);
}

double ModelFit::held_out(const FittedModel &fitted, const Response *response, double *strength) const {
    const Covariance &covariance = fitted.model.fold();
    const Eigen::MatrixXd jacobian = whiten_columns(covariance, fitted.jacobian);
    const Differences d = differences(fitted);
    const Eigen::VectorXd halves[2] = {covariance.whiten(d.first), covariance.whiten(d.second)};
    const Eigen::VectorXd both = 0.5 * (halves[0] + halves[1]);
    Eigen::VectorXd change = Eigen::VectorXd::Zero(both.size());
    if (response) {
        // One strength for both halves: they scatter as the effect makes them, of which this covariance, without it,
        // knows nothing, and each for itself would follow that.
        double least = 1e300, best = 0.0;
        for (double u = response->weakest(); u <= strongest_; u += kStrengths.grid_step) {
            const double square = residual_square(jacobian, both - covariance.whiten(response->at(u)));
            if (square < least) {
                least = square;
                best = u;
            }
        }
        if (strength)
            *strength = best;
        change = covariance.whiten(response->at(best));
    }
    double sum = 0.0;
    for (int h = 0; h < 2; ++h)
        sum += (halves[1 - h] - change - jacobian * solve_least_squares(jacobian, halves[h] - change)).squaredNorm();
    return sum;
}

double ModelFit::square_by(const Covariance &covariance, const FittedModel &fitted) const {
    const Eigen::VectorXd difference = runner_.real().mean() - fitted.model.full().mean();
    return residual_square(whiten_columns(covariance, fitted.jacobian), covariance.whiten(difference));
}

double ModelFit::gain_by_common(const FittedModel &before, const FittedModel &after) const {
    const Covariance common = common_covariance(runner_, before.model, after.model);
    return square_by(common, before) - square_by(common, after);
}

double ModelFit::gain_over(const FittedModel &before, const FittedModel &after) const {
    return std::max(before.score - after.score, gain_by_common(before, after));
}

// The baseline's light that leaves at one border comes in at the other, and its pupil is as coarse as the image's sides
// leave it (protocol); cameras' are not. By how much the statistics differ, or scatter more, is the error of every
// model where it is no chance.
Eigen::VectorXd ModelFit::border_error(const Replicates &replicates, double from, double to) const {
    const Eigen::Index count = static_cast<Eigen::Index>(runner_.count());
    Eigen::VectorXd result = Eigen::VectorXd::Zero(count);
    const std::vector<SequenceLayout> &sequences = runner_.layout().sequences;
    if (std::none_of(sequences.begin(), sequences.end(), [](const SequenceLayout &s) { return is_laser(s.scene); }))
        return result;
    std::vector<std::uint64_t> seeds(std::min(kModelError.bordered_captures, replicates.draws.size()));
    std::iota(seeds.begin(), seeds.end(), options_.seed + 1);
    std::vector<FoldStatistics> bordered_draws;
    const auto before_each = [&](std::size_t i) {
        report(from + (to - from) * static_cast<double>(i) / static_cast<double>(seeds.size()),
               "simulating the image's border");
    };
    // An image that is as large as any may be has no room for one.
    if (!possible([&] { bordered_draws = runner_.bordered_replicates(replicates.levels, seeds, before_each); }))
        return result;
    struct Moments {
        Eigen::ArrayXd mean, variance;
        double count;
    };
    const auto moments = [&](const std::vector<FoldStatistics> &of) {
        Eigen::ArrayXXd values(count, static_cast<Eigen::Index>(of.size()));
        for (std::size_t r = 0; r < of.size(); ++r)
            values.col(static_cast<Eigen::Index>(r)) = of[r].mean();
        const double n = static_cast<double>(of.size());
        const Eigen::ArrayXd mean = values.rowwise().mean();
        return Moments{mean, (values.colwise() - mean).square().rowwise().sum() / (n - 1.0), n};
    };
    const Moments baseline = moments(replicates.draws), bordered = moments(bordered_draws);
    for (std::size_t s = 0; s < sequences.size(); ++s) {
        if (!is_laser(sequences[s].scene))
            continue;
        for (auto k = static_cast<Eigen::Index>(runner_.begin(s)); k < static_cast<Eigen::Index>(runner_.end(s)); ++k) {
            const double difference = bordered.mean[k] - baseline.mean[k];
            const double chance = baseline.variance[k] / baseline.count + bordered.variance[k] / bordered.count;
            double square = 0.0;
            if (difference * difference > kModelError.border_mean * kModelError.border_mean * chance)
                square += difference * difference - chance;
            if (bordered.variance[k] > kModelError.border_variance * baseline.variance[k])
                square += bordered.variance[k] - baseline.variance[k];
            result[k] = std::sqrt(square);
        }
    }
    return result;
}

FittedModel ModelFit::fit_baseline(double to) {
    const std::vector<bool> all(runner_.layout().sequences.size(), true);
    const Eigen::Index count = static_cast<Eigen::Index>(runner_.count());
    report(0.0, "calibrating the baseline");
    Replicates replicates{{}, runner_.calibrate({}, all, nullptr), {}};
    const CalibratedLevels levels = replicates.levels;
    replicate(replicates, options_.null_replicates, 0.0, kOfReplicates * to);
    border_error_ = border_error(replicates, kOfReplicates * to, to);
    FittedModel baseline;
    baseline.jacobian.resize(count, 0);
    baseline.model = GapModel(runner_, std::move(replicates), options_.level, baseline.jacobian, border_error_);
    baseline.residual = baseline.model.test(runner_.real());
    baseline.score = held_out(baseline) + 4.0 * baseline.model.fold().deviation().array().log().sum();
    baseline_ = baseline.model;
    if (unexplained_.size())
        baseline_ = GapModel(runner_, baseline.model.replicates(), options_.level, baseline.jacobian,
                             with_unexplained(border_error_));
    if (baseline.residual.detected)
        baseline_pool_ = simulate_pool(runner_, {}, options_.seed, options_.pool_seeds, &levels);
    baseline_work_ = runner_.work();
    return baseline;
}

FittedModel ModelFit::fit(EffectModel &model, Pool &pool, const FitOptions &wanted, const Origin *origin) {
    GaussNewtonOptions options;
    options.seed = options_.seed;
    options.seeds = options_.pool_seeds;
    // What is known is of another strength.
    const bool alone = model.strengths.size() == 1 && (wanted.known.empty() || wanted.known.front().size() == 0);
    options.rounds = wanted.near || alone ? 1 : kFit.rounds;
    options.secant_rounds = kFit.secant_rounds;
    options.part = wanted.part;
    options.near = wanted.part * kStrengths.near;
    options.far = wanted.part * kFit.far;
    options.strongest = strongest_;
    const Origin baseline{baseline_.full(), baseline_pool_};
    GaussNewtonFit reached = gauss_newton(runner_, model, origin ? *origin : baseline, wanted.known, options,
                                          [&](Eigen::Index p) { report(wanted.from, "fitting " + model.id_of(p)); });
    FittedModel fitted;
    if (reached.square > wanted.worth)
        return fitted;
    model = std::move(reached.model);
    pool = std::move(reached.pool);
    fitted.effects = model.settings();
    fitted.jacobian = std::move(reached.jacobian);
    fitted.columns = model.strengths;
    fitted.part = wanted.part;
    fitted.change = pool.mean(options_.pool_seeds) - baseline_pool_.mean(options_.pool_seeds);
    judge(fitted, {fitted.effects, pool.levels, {}}, std::min(wanted.replicates, options_.model_replicates),
          wanted.from, wanted.to);
    if (fitted.residual.p_value > kFit.no_doubt)
        judge(fitted, fitted.model.replicates(), options_.model_replicates, wanted.from, wanted.to);
    return fitted;
}

double ModelFit::worth_replacing(const FittedModel &fitted) const {
    const double now = square_by(fitted.model.full(), fitted);
    return now - kFit.least_polish - kFit.least_polish_part * std::max(0.0, now - static_cast<double>(runner_.count()));
}

bool ModelFit::go_on(EffectModel &model, Pool &pool, FittedModel &fitted, double at) {
    EffectModel onward = model;
    bool goes_on = false;
    for (std::size_t p = 0; p < onward.strengths.size(); ++p) {
        Strength &s = onward.strengths[p];
        const ModelEffect &effect = onward.effects[s.effect];
        if (s.reach > kStrengths.weakest || effect.candidate->parameters[s.parameter].whole ||
            !is_at(s.strength, kStrengths.strongest) || fitted.step[static_cast<Eigen::Index>(p)] < kStrengths.near)
            continue;
        const double end = effect.candidate->snapped(s.parameter, kStrengths.unbounded, effect.sign);
        if (end > s.strength) {
            s.reach = end;
            goes_on = true;
        }
    }
    FitOptions options;
    options.replicates = static_cast<std::uint32_t>(fitted.model.replicates().draws.size());
    options.from = options.to = at;
    options.worth = worth_replacing(fitted);
    return goes_on && replace(model, pool, fitted, std::move(onward), options);
}

void ModelFit::polish(EffectModel &model, Pool &pool, FittedModel &fitted, double at) {
    const std::vector<Strength> before = model.strengths;
    EffectModel moved = model;
    moved.hold(false);
    if (move_strengths(moved, fitted.step, strongest_) < kFit.least_step)
        return;
    FitOptions fine;
    fine.replicates = static_cast<std::uint32_t>(fitted.model.replicates().draws.size());
    fine.from = fine.to = at;
    fine.near = true;
    fine.part = kFit.fine;
    fine.worth = worth_replacing(fitted);
    replace(model, pool, fitted, std::move(moved), fine);
    for (std::size_t p = 0; p < before.size(); ++p)
        model.strengths[p].held = before[p].held;
}

bool ModelFit::replace(EffectModel &model, Pool &pool, FittedModel &fitted, EffectModel start, FitOptions options) {
    options.known = known_changes(fitted, model, start, true);
    Pool own;
    FittedModel again;
    const Origin origin{fitted.model.full(), pool};
    if (!possible([&] { again = fit(start, own, options, &origin); }) || again.effects.empty())
        return false;
    // By as many replicates as the other one: the score depends on how many there are.
    judge(fitted, fitted.model.replicates(), static_cast<std::uint32_t>(again.model.replicates().draws.size()),
          options.from, options.to);
    if (again.score >= fitted.score)
        return false;
    model = std::move(start);
    pool = std::move(own);
    fitted = std::move(again);
    return true;
}

void ModelFit::step_whole_numbers(EffectModel &model, Pool &pool, FittedModel &fitted, double at) {
    for (std::size_t p = 0; p < model.strengths.size(); ++p) {
        const Strength here = model.strengths[p];
        const ModelEffect &effect = model.effects[here.effect];
        const HypothesisParameter &parameter = effect.candidate->parameters[here.parameter];
        if (!parameter.whole)
            continue;
        const Covariance &covariance = fitted.model.full();
        const Eigen::Index column = static_cast<Eigen::Index>(p), columns = fitted.jacobian.cols();
        Eigen::MatrixXd others(fitted.jacobian.rows(), columns - 1);
        others << fitted.jacobian.leftCols(column), fitted.jacobian.rightCols(columns - column - 1);
        const Eigen::VectorXd left = runner_.real().mean() - covariance.mean();
        double least = kFit.whole_step * square_by(covariance, fitted);
        EffectModel best;
        for (const double step : {-1.0, 1.0}) {
            const double value = effect.candidate->value(here.parameter, here.strength, effect.sign) + step;
            if (value < parameter.minimum || value > parameter.maximum)
                continue;
            EffectModel moved = model;
            moved.strengths[p].strength = effect.candidate->strength(here.parameter, value, effect.sign);
            possible([&] {
                const Change change = simulate_change(runner_, pool, moved.settings(), concerned(model.id_of(column)),
                                                      options_.seed, kFit.search_seeds);
                const double square =
                    residual_square(whiten_columns(covariance, others), covariance.whiten(left - change.mean));
                if (square < least) {
                    least = square;
                    best = std::move(moved);
                }
            });
        }
        FitOptions options;
        options.replicates = static_cast<std::uint32_t>(fitted.model.replicates().draws.size());
        options.from = options.to = at;
        if (!best.effects.empty())
            replace(model, pool, fitted, std::move(best), options);
    }
}

void ModelFit::confirm(FittedModel &fitted, double at) {
    const double level = options_.residual_level;
    if (fitted.residual.p_value > std::max(kFit.seldom, level) ||
        fitted.residual.p_value < std::min(kFit.beyond_doubt, kFit.part_of_level * level))
        return;
    const double score = fitted.score; // of others, with fewer replicates, that it is compared with
    judge(fitted, fitted.model.replicates(), kFit.confirming * options_.model_replicates, at, at);
    fitted.score = score;
}

Eigen::VectorXd ModelFit::model_error(const FittedModel &fitted) const {
    // No simulator has an effect exactly as a camera has it: a part of each change is left to that.
    const Eigen::VectorXd of_effects = simulator_error(runner_.list(), fitted.change).cwiseAbs() +
                                       reading_tolerance(runner_.list(), runner_.layout(), fitted.effects,
                                                         fitted.columns, fitted.change, fitted.jacobian);
    return (of_effects.cwiseAbs2() + border_error_.cwiseAbs2()).cwiseSqrt();
}

Eigen::VectorXd ModelFit::with_unexplained(const Eigen::VectorXd &error) const {
    return unexplained_.size() ? Eigen::VectorXd((error.cwiseAbs2() + unexplained_.cwiseAbs2()).cwiseSqrt()) : error;
}

void ModelFit::judge(FittedModel &fitted, Replicates replicates, std::uint32_t count, double from, double to) {
    if (replicates.draws.size() >= count)
        return;
    replicate(replicates, count, from, to);
    judge_by(fitted, std::move(replicates));
}

void ModelFit::judge_by(FittedModel &fitted, Replicates replicates) const {
    fitted.model = GapModel(runner_, std::move(replicates), options_.residual_level, fitted.jacobian,
                            with_unexplained(model_error(fitted)));
    const Covariance &covariance = fitted.model.full();
    Eigen::VectorXd step = fitted.model.coefficients(covariance, runner_.real().mean() - covariance.mean());
    step = step.cwiseMax(-kFit.largest_step).cwiseMin(kFit.largest_step);
    stop_where_nothing_shows(fitted.columns, whiten_columns(covariance, fitted.jacobian), step);
    fitted.step = step;
    fitted.correction = fitted.jacobian * step;
    fitted.residual = fitted.model.test(runner_.real());
    fitted.score = held_out(fitted) + 4.0 * fitted.model.fold().deviation().array().log().sum();
}

FittedModel ModelFit::part_of(const FittedModel &whole, const Pool &pool, const EffectModel &part) {
    FittedModel fitted;
    fitted.effects = part.settings();
    report(0.0, "simulating " + label(fitted.effects));
    const auto count = static_cast<Eigen::Index>(part.strengths.size());
    fitted.jacobian = whole.jacobian.leftCols(count);
    fitted.columns = part.strengths;
    fitted.part = whole.part;
    const Pool of_part = simulate_pool(runner_, fitted.effects, options_.seed, options_.pool_seeds);
    fitted.change = of_part.mean(options_.pool_seeds) - baseline_pool_.mean(options_.pool_seeds);
    const Eigen::VectorXd without_others = of_part.mean(options_.pool_seeds) - pool.mean(options_.pool_seeds);
    Replicates replicates{fitted.effects, of_part.levels, whole.model.replicates().draws};
    for (FoldStatistics &draw : replicates.draws) {
        draw.first += without_others;
        draw.second += without_others;
    }
    judge_by(fitted, std::move(replicates));
    return fitted;
}

void ModelFit::judge_by_all(FittedModel &fitted) const {
    if (!unexplained_.size() || fitted.effects.empty())
        return;
    fitted.model = GapModel(runner_, fitted.model.replicates(), options_.residual_level, fitted.jacobian,
                            model_error(fitted), unexplained_);
    fitted.residual = fitted.model.test(runner_.real());
}

Eigen::VectorXd ModelFit::measured_slope(const Replicates &replicates, const EffectModel &model, Eigen::Index strength,
                                         double part) const {
    const Strength &moved_one = model.strengths[static_cast<std::size_t>(strength)];
    // A step of a whole number is no small one: the other side's is another one.
    const bool whole = model.effects[moved_one.effect].candidate->parameters[moved_one.parameter].whole;
    Eigen::MatrixXd slopes(replicates.draws.front().first.size(), 0), sides = slopes;
    const auto measure = [&](std::size_t side) {
        EffectModel moved = model;
        const double step = move_one(moved, strength, side == 0 || whole ? part : -part);
        const EffectSettings settings = moved.settings();
        const CalibratedLevels levels =
            runner_.calibrate(settings, concerned(model.id_of(strength)), &replicates.levels);
        std::vector<std::uint64_t> seeds(kFit.slope_seeds); // those of the first replicates, others for each side
        std::iota(seeds.begin(), seeds.end(), options_.seed + 1 + side * kFit.slope_seeds);
        const std::vector<FoldStatistics> draws = runner_.replicates(settings, levels, seeds, {});
        Eigen::MatrixXd of_side(slopes.rows(), static_cast<Eigen::Index>(kFit.slope_seeds));
        for (std::size_t r = 0; r < kFit.slope_seeds; ++r)
            of_side.col(static_cast<Eigen::Index>(r)) =
                (draws[r].mean() - replicates.draws[side * kFit.slope_seeds + r].mean()) / step;
        slopes.conservativeResize(Eigen::NoChange, slopes.cols() + of_side.cols());
        slopes.rightCols(of_side.cols()) = of_side;
        sides.conservativeResize(Eigen::NoChange, sides.cols() + 1);
        sides.rightCols<1>() = of_side.rowwise().mean();
    };
    for (std::size_t side = 0; side < 2; ++side)
        possible([&] { measure(side); }); // or the other side alone
    if (slopes.cols() == 0)
        return {};
    const Eigen::ArrayXd mean = slopes.rowwise().mean().array();
    const double count = static_cast<double>(slopes.cols());
    const Eigen::ArrayXd square =
        (slopes.colwise() - mean.matrix()).array().square().rowwise().sum() / (count * (count - 1.0)) +
        0.25 * (sides.leftCols<1>() - sides.rightCols<1>()).array().square();
    // What is no larger than its error says nothing, and would say it with a weight (James and Stein's estimate).
    return mean * (1.0 - square / mean.square().max(1e-300)).max(0.0);
}

void ModelFit::measure_parameters(FittedModel &fitted, const EffectModel &model, double at) {
    const Replicates &replicates = fitted.model.replicates();
    Eigen::MatrixXd jacobian = fitted.jacobian;
    for (Eigen::Index p = 0; p < jacobian.cols(); ++p) {
        report(at, "measuring " + model.id_of(p));
        const Eigen::VectorXd measured = measured_slope(replicates, model, p, fitted.part);
        if (measured.size())
            jacobian.col(p) = measured;
    }
    const GapModel model_of_changes(runner_, replicates, options_.residual_level, jacobian,
                                    fitted.model.full().tolerance());
    const Covariance &covariance = model_of_changes.full();
    Eigen::VectorXd strengths = model_of_changes.coefficients(covariance, runner_.real().mean() - covariance.mean())
                                    .cwiseMax(-kFit.largest_step)
                                    .cwiseMin(kFit.largest_step);
    for (Eigen::Index p = 0; p < strengths.size(); ++p) {
        const Strength &s = model.strengths[static_cast<std::size_t>(p)];
        const ModelEffect &effect = model.effects[s.effect];
        strengths[p] = effect.candidate->snapped(s.parameter, s.strength + strengths[p], effect.sign);
    }
    const Eigen::MatrixXd strays = model_of_changes.strays(runner_, GapModel::Fit::kBoth);
    const Eigen::VectorXd deviations =
        strength_deviations(model_of_changes, strays, simulator_error(runner_.list(), fitted.change));
    // What fits do not go by says that the model is wrong, too.
    const GapModel by_all(runner_, replicates, options_.residual_level, jacobian, model_error(fitted), unexplained_);
    fitted.parameters =
        fitted_parameters(model, strengths, deviations.cwiseProduct(by_all.birge_ratios(runner_.real())),
                          static_cast<double>(strays.rows()));
}

} // namespace clsp
