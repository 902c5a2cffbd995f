#include "attribution/model_fit.hpp"

#include "attribution/least_squares.hpp"

#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

namespace clsp {
namespace {

// Models on the way are judged by some of the replicates, if those leave no doubt that a residual remains.
constexpr double kNoDoubt = 1e-9;
// Of a strength: a last step that is smaller needs no other fit; the differences of one that does, as a part of the
// usual ones.
constexpr double kNothingMoved = 0.004, kFine = 0.15;
// Rounds beyond those with a Jacobian of their own, where a step is longer than the last, linear one may well be.
constexpr int kSecantRounds = 4;
constexpr double kFar = 0.15;

std::string label(const EffectSettings &effects) {
    std::string result;
    for (const EffectSetting &effect : effects)
        result += (result.empty() ? "" : " + ") + effect.id;
    return result;
}

} // namespace

void ModelFit::replicate(Replicates &replicates, std::uint32_t count, double from, double to) const {
    const std::string what = "simulating " + (replicates.effects.empty() ? "the baseline" : label(replicates.effects));
    const std::size_t first = replicates.draws.size();
    if (first >= count)
        return;
    std::vector<std::uint64_t> seeds(count - first);
    std::iota(seeds.begin(), seeds.end(), options_.seed + 1 + first);
    std::vector<FoldStatistics> draws =
        experiment_.replicates(replicates.effects, replicates.levels, seeds, [&](std::size_t r) {
            report(from + (to - from) * static_cast<double>(first + r) / count, what);
        });
    std::move(draws.begin(), draws.end(), std::back_inserter(replicates.draws));
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
    return concerned_sequences(experiment_, id);
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
    for (double u = kWeakest; u <= strongest_; u += kStrengthStep) {
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

FittedModel ModelFit::fit(EffectModel &model, Pool &pool, std::uint32_t replicates, double at, const Origin *origin) {
    const Eigen::MatrixXd unknown(static_cast<Eigen::Index>(experiment_.count()), 0);
    return fit(model, pool, unknown, replicates, at, at, origin);
}

FittedModel ModelFit::fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, std::uint32_t replicates,
                          double from, double to, const Origin *origin) {
    return fit(model, pool, known, model.strengths.size() == 1 ? 1 : kGaussNewtonRounds, 1.0, replicates, from, to,
               origin);
}

void ModelFit::polish(EffectModel &model, Pool &pool, FittedModel &fitted, double at) {
    EffectModel moved = model;
    if (move_strengths(moved, fitted.step, strongest_) < kNothingMoved)
        return;
    Pool own;
    FittedModel again;
    const Eigen::MatrixXd unknown(static_cast<Eigen::Index>(experiment_.count()), 0);
    const Origin origin{fitted.model.full(), pool};
    if (!possible([&] {
            again = fit(moved, own, unknown, kGaussNewtonRounds, kFine, options_.model_replicates, at, at, &origin);
        }) ||
        again.score >= fitted.score)
        return;
    model = std::move(moved);
    pool = std::move(own);
    fitted = std::move(again);
}

// Strengths by Gauss-Newton rounds, then replicates at the fitted strengths and a last, linear step.
FittedModel ModelFit::fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, int rounds, double part,
                          std::uint32_t replicates, double from, double to, const Origin *origin) {
    GaussNewtonOptions options;
    options.seed = options_.seed;
    options.seeds = options_.pool_seeds;
    options.rounds = rounds;
    options.secant_rounds = kSecantRounds;
    options.part = part;
    options.near = part * kNear;
    options.far = part * kFar;
    options.strongest = strongest_;
    std::vector<Eigen::VectorXd> columns;
    for (Eigen::Index p = 0; p < known.cols(); ++p)
        columns.push_back(known.col(p));
    const Origin baseline{baseline_.full(), baseline_pool_};
    GaussNewtonFit reached = gauss_newton(experiment_, model, origin ? *origin : baseline, columns, options,
                                          [&](Eigen::Index p) { report(from, "fitting " + model.id_of(p)); });
    model = std::move(reached.model);
    pool = std::move(reached.pool);
    FittedModel fitted;
    fitted.effects = model.settings();
    fitted.jacobian = std::move(reached.jacobian);
    fitted.change = pool.mean(options_.pool_seeds) - baseline_pool_.mean(options_.pool_seeds);
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
        kModelError * fitted.change.cwiseAbs() +
        reading_tolerance(experiment_.list(), experiment_.layout(), fitted.effects, fitted.change);
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
