#include "attribution/model_fit.hpp"

#include "attribution/least_squares.hpp"

#include <cmath>
#include <utility>

namespace clsp {
namespace {

// Models on the way are judged by some of the replicates, if those leave no doubt that a residual remains.
constexpr double kNoDoubt = 1e-9;
// A round of a fit is taken back where the squared distance grew by that factor.
constexpr double kMuchWorse = 1.5;
// Of a strength: a last step that is smaller needs no other fit; the differences of one that does, as a part of the
// usual ones.
constexpr double kNothingMoved = 0.004, kFine = 0.15;

Eigen::VectorXd pool_mean(const Pool &pool) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(pool.statistics.front().size());
    for (const Eigen::VectorXd &statistics : pool.statistics)
        sum += statistics;
    return sum / static_cast<double>(pool.statistics.size());
}

std::string label(const EffectSettings &effects) {
    std::string result;
    for (const EffectSetting &effect : effects)
        result += (result.empty() ? "" : " + ") + effect.id;
    return result;
}

} // namespace

void ModelFit::replicate(Replicates &replicates, std::uint32_t count, double from, double to) const {
    const std::string what = "simulating " + (replicates.effects.empty() ? "the baseline" : label(replicates.effects));
    for (std::uint32_t r = static_cast<std::uint32_t>(replicates.draws.size()); r < count; ++r) {
        report(from + (to - from) * r / count, what);
        replicates.draws.push_back(experiment_.replicate(replicates.effects, replicates.levels, options_.seed + 1 + r));
    }
}

Differences ModelFit::differences(const FittedModel &fitted) const {
    Differences result{experiment_.real().first - fitted.model.first_mean(),
                       experiment_.real().second - fitted.model.second_mean()};
    if (fitted.correction.size()) {
        result.first -= fitted.correction;
        result.second -= fitted.correction;
    }
    return result;
}

std::vector<bool> ModelFit::concerned(const std::string &id) const {
    std::vector<bool> result;
    for (std::size_t s = 0; s < experiment_.layout().sequences.size(); ++s)
        result.push_back(experiment_.simulator().concerns(id, s));
    return result;
}

double ModelFit::held_out(const FittedModel &fitted, const Response *response, double *strength) const {
    const Covariance &covariance = fitted.model.fold();
    const Eigen::MatrixXd jacobian = whiten_columns(covariance, fitted.jacobian);
    const Differences d = differences(fitted);
    const Eigen::VectorXd halves[2] = {covariance.whiten(d.first), covariance.whiten(d.second)};
    const Eigen::VectorXd both = 0.5 * (halves[0] + halves[1]);
    if (!response) {
        double sum = 0.0;
        for (int h = 0; h < 2; ++h)
            sum += (halves[1 - h] - jacobian * solve_least_squares(jacobian, halves[h])).squaredNorm();
        return sum;
    }
    double best[3] = {1e300, 1e300, 1e300}, at[3] = {0.5, 0.5, 0.5};
    for (double u = kWeakest; u <= kStrongest; u += kStrengthStep) {
        const Eigen::VectorXd change = covariance.whiten(response->at(u));
        for (int h = 0; h < 3; ++h) {
            const double square = residual_square(jacobian, (h < 2 ? halves[h] : both) - change);
            if (square < best[h]) {
                best[h] = square;
                at[h] = u;
            }
        }
    }
    if (strength)
        *strength = at[2];
    double sum = 0.0;
    for (int h = 0; h < 2; ++h) {
        const Eigen::VectorXd change = covariance.whiten(response->at(at[h]));
        const Eigen::VectorXd beta = solve_least_squares(jacobian, halves[h] - change);
        Eigen::VectorXd rest = halves[1 - h] - change;
        if (beta.size())
            rest -= jacobian * beta;
        sum += rest.squaredNorm();
    }
    return sum;
}

Eigen::VectorXd ModelFit::slope(const EffectModel &model, Eigen::Index p, const Pool &pool, std::uint32_t seeds,
                                double part) const {
    EffectModel moved = model;
    double &strength = moved.strengths[static_cast<std::size_t>(p)].strength;
    const double at = strength;
    double step = model.difference(p, part);
    strength = at + step;
    if (moved.settings() == pool.effects) { // at the end of its range
        step = -step;
        strength = at + step;
    }
    return simulate_change(experiment_, pool, moved.settings(), concerned(model.id_of(p)), options_.seed, seeds).mean /
           step;
}

FittedModel ModelFit::fit_baseline(double to) {
    const std::vector<bool> all(experiment_.layout().sequences.size(), true);
    const Eigen::Index count = static_cast<Eigen::Index>(experiment_.count());
    report(0.0, "calibrating the baseline");
    Replicates replicates{{}, experiment_.calibrate({}, all, nullptr), {}};
    const CalibratedLevels levels = replicates.levels;
    replicate(replicates, options_.null_replicates, 0.0, to);
    FittedModel baseline;
    baseline.jacobian.resize(count, 0);
    baseline.model =
        GapModel(experiment_, std::move(replicates), options_.level, baseline.jacobian, Eigen::VectorXd::Zero(count));
    baseline.residual = baseline.model.test(experiment_.real());
    baseline.score = held_out(baseline) + 4.0 * baseline.model.fold().deviation().array().log().sum();
    baseline_ = baseline.model;
    if (baseline.residual.detected)
        baseline_pool_ = simulate_pool(experiment_, {}, options_.seed, options_.pool_seeds, &levels);
    return baseline;
}

FittedModel ModelFit::fit(EffectModel &model, Pool &pool, std::uint32_t replicates, double at) {
    return fit(model, pool, Eigen::MatrixXd(static_cast<Eigen::Index>(experiment_.count()), 0), replicates, at, at);
}

FittedModel ModelFit::fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, std::uint32_t replicates,
                          double from, double to) {
    return fit(model, pool, known, model.strengths.size() == 1 ? 1 : kGaussNewtonRounds, 1.0, replicates, from, to);
}

void ModelFit::polish(EffectModel &model, Pool &pool, FittedModel &fitted, double at) {
    EffectModel moved = model;
    if (move_strengths(moved, fitted.step) < kNothingMoved)
        return;
    Pool own;
    FittedModel again;
    const Eigen::MatrixXd unknown(static_cast<Eigen::Index>(experiment_.count()), 0);
    if (!possible(
            [&] { again = fit(moved, own, unknown, kGaussNewtonRounds, kFine, options_.model_replicates, at, at); }) ||
        again.score >= fitted.score)
        return;
    model = std::move(moved);
    pool = std::move(own);
    fitted = std::move(again);
}

// Strengths by Gauss-Newton rounds, then replicates at the fitted strengths and a last, linear step.
FittedModel ModelFit::fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, int rounds, double part,
                          std::uint32_t replicates, double from, double to) {
    const Eigen::Index parameters = static_cast<Eigen::Index>(model.strengths.size());
    FittedModel fitted;
    Eigen::MatrixXd &jacobian = fitted.jacobian;
    jacobian.resize(static_cast<Eigen::Index>(experiment_.count()), parameters);
    // Where the round before was, and how near it came.
    EffectModel before = model;
    Pool pool_before;
    Eigen::MatrixXd jacobian_before;
    double square_before = 1e300;
    for (int round = 0; round < rounds; ++round) {
        fitted.effects = model.settings();
        pool = simulate_pool(experiment_, fitted.effects, options_.seed, options_.pool_seeds);
        for (Eigen::Index p = 0; p < parameters; ++p) {
            if (round == 0 && p < known.cols()) {
                jacobian.col(p) = known.col(p);
                continue;
            }
            report(from, "fitting " + model.id_of(p));
            jacobian.col(p) = slope(model, p, pool, options_.pool_seeds, part);
        }
        // Common random numbers: the pool's change from the baseline's pool, on the mean of the baseline's replicates.
        const Covariance &covariance = baseline_.full();
        const Eigen::VectorXd mean = covariance.mean() + pool_mean(pool) - pool_mean(baseline_pool_);
        const Eigen::VectorXd target = covariance.whiten(experiment_.real().mean() - mean);
        const Eigen::MatrixXd columns = whiten_columns(covariance, jacobian);
        const Eigen::VectorXd step = solve_least_squares(columns, target);
        const double square = (target - columns * step).squaredNorm();
        if (square > kMuchWorse * square_before) { // a step too far, of a parameter that works in jumps
            model = before;
            fitted.effects = model.settings();
            pool = std::move(pool_before);
            jacobian = std::move(jacobian_before);
            break;
        }
        if (round + 1 == rounds)
            break;
        before = model;
        pool_before = pool;
        jacobian_before = jacobian;
        square_before = square;
        if (move_strengths(model, step) < part * kNear && known.cols() == 0) {
            model = before;
            break;
        }
    }
    fitted.change = pool_mean(pool) - pool_mean(baseline_pool_);
    judge(fitted, model, {fitted.effects, pool.levels, {}}, std::min(replicates, options_.model_replicates), from, to);
    if (fitted.residual.p_value > kNoDoubt)
        judge(fitted, model, fitted.model.replicates(), options_.model_replicates, from, to);
    return fitted;
}

void ModelFit::judge(FittedModel &fitted, const EffectModel &model, Replicates replicates, std::uint32_t count,
                     double from, double to) {
    if (replicates.draws.size() >= count)
        return;
    replicate(replicates, count, from, to);
    // No simulator has an effect exactly as a camera has it: a part of each change is left to that.
    const Eigen::VectorXd tolerance =
        kModelError * fitted.change.cwiseAbs() + reading_tolerance(experiment_.list(), fitted.effects);
    fitted.model = GapModel(experiment_, std::move(replicates), options_.residual_level, fitted.jacobian, tolerance);
    const Covariance &covariance = fitted.model.full();
    Eigen::VectorXd step = fitted.model.coefficients(covariance, experiment_.real().mean() - covariance.mean());
    step = step.cwiseMax(-kLargestStep).cwiseMin(kLargestStep);
    fitted.step = step;
    fitted.correction = fitted.jacobian * step;
    fitted.residual = fitted.model.test(experiment_.real());
    const Eigen::MatrixXd strays = fitted.model.strays(GapModel::Fit::kBoth);
    Eigen::VectorXd strengths = step;
    for (Eigen::Index p = 0; p < strengths.size(); ++p)
        strengths[p] += model.strengths[static_cast<std::size_t>(p)].strength;
    fitted.parameters = fitted_parameters(model, strengths, strength_deviations(fitted.model, strays, fitted.change),
                                          static_cast<double>(strays.rows()));
    fitted.score = held_out(fitted) + 4.0 * fitted.model.fold().deviation().array().log().sum();
}

bool ModelFit::fit_prefixes(const EffectModel &model, std::size_t begin, std::vector<FittedModel> &models,
                            FittedModel last, double at) {
    models.resize(begin);
    for (std::size_t n = begin + 1; n < model.effects.size(); ++n) {
        EffectModel part = model.first(n);
        Pool pool;
        if (!possible([&] { models.push_back(fit(part, pool, few_replicates(), at)); }))
            return false;
    }
    models.push_back(std::move(last));
    return true;
}

} // namespace clsp
