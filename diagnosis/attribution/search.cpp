#include "attribution/search.hpp"

#include "attribution/least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string>

namespace clsp {
namespace {

constexpr int kFitRounds = 3;
// Effects whose gain at a first look is less than that part of the best one's are not fitted.
constexpr double kLeastLook = 0.2;
// Of the pool's seeds, for the search; fits use all.
constexpr std::uint32_t kSearchSeeds = 1;
// Where the squared distance fell below that part and is still too large, effects are exchanged for others that resemble them: those of
// the second number that do most, if the cosine of the angle between their changes is above the third.
constexpr double kExchangeBelow = 0.02;
constexpr std::size_t kMostAlike = 2;
constexpr double kLeastAlike = 0.5;
constexpr int kExchangeRounds = 6, kMostExchanges = 3;
constexpr double kHopeless = 4.0;    // after the first round
constexpr double kStillBetter = 0.9; // than the round before
// What taking an effect out may cost at a first look, in units of the squared distance, for a fit without it.
constexpr double kLeastNeeded = 60.0;
// Later looks take the effects whose change at the last look promises most, and those only of which it promises anything.
constexpr std::size_t kMostLooks = 14;
constexpr double kLeastPromise = 4.0;
// Models on the way are judged by some of the replicates, if those leave no doubt that a residual remains.
constexpr double kNoDoubt = 1e-9;
// A round of a fit is taken back where the squared distance grew by that factor.
constexpr double kMuchWorse = 1.5;
// Effects whose held-out gain is that near to the best one's are compared by replicates of their own.
constexpr double kFinalMargin = 20.0, kFinalMarginShare = 0.03;

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

// The two halves' differences from a model.
struct Differences {
    Eigen::VectorXd first, second;
    Eigen::VectorXd mean() const { return 0.5 * (first + second); }
};

struct Refined {
    const Candidate *candidate;
    double sign = 1.0;
    double strength = 0.5;
    double gain = 0.0; // screening, then held-out
    bool fitted = false;
    std::vector<bool> concerned;
    Response response;
};

// Effects in the order in which they were found.
struct Path {
    EffectModel model;
    Pool pool; // of the whole model
    std::map<const Candidate *, Eigen::VectorXd> looks; // each other effect's change of the statistics when it was last looked at
    std::vector<SearchStep> steps;
    std::vector<FittedModel> models; // after each step
};

class Search {
  public:
    Search(Experiment &experiment, const std::vector<Candidate> &candidates, const SearchOptions &options,
           const Progress &progress)
        : experiment_(experiment), candidates_(candidates), options_(options), progress_(progress) {}

    SearchResult run();

  private:
    // Draws replicates until there are `count`.
    void replicate(Replicates &replicates, std::uint32_t count, double from, double to);
    Differences differences(const GapModel &model, const Eigen::VectorXd &correction) const;
    std::vector<bool> concerned(const std::string &id) const;
    std::vector<Refined> screen(Path &path, const FittedModel &fitted);
    void refine(Refined &refined, const EffectModel &model, const FittedModel &fitted, const Pool &pool);
    double held_out(const FittedModel &fitted, const Response *response, double *strength) const;
    // known: the changes by the model's first parameters when they were last fitted, for the first round; may have no columns.
    // replicates: that many judge the model, or all that the options say where they leave a doubt.
    FittedModel fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, std::uint32_t replicates, double from, double to);
    // The rest of a fit, by `count` replicates.
    void judge(FittedModel &fitted, const EffectModel &model, Replicates replicates, std::uint32_t count, double from, double to);
    std::uint32_t few_replicates() const { return std::min(options_.model_replicates, std::max(12u, options_.model_replicates / 2)); }
    SearchStep described(const std::vector<Refined> &refined, const std::vector<const Refined *> &finalists,
                         const std::vector<FittedModel> &fits, std::size_t best, const FittedModel &current) const;
    // Adds the effect that explains most of what `current`, fitted to the path's model, leaves. False if none does.
    bool grow(Path &path, const FittedModel &current, double from, double share);
    // Leaves out effects that others have made needless: an effect is chosen without those that come after it.
    void prune(Path &path, double from);
    // Exchanges an effect for one that resembles it, or adds such a one and shares the strength. False if nothing is better by it.
    bool exchange(Path &path, double from);
    // An exchange to be tried: the effect at `place` goes (or, `shares`, gives half of its strength), the other one is put at the end.
    struct Move {
        std::size_t place;
        const Candidate *candidate;
        double sign, alike;
        bool shares;
    };
    std::vector<Move> moves(const Path &path, bool share);
    // Which effect a move takes out: where there are as many as there may be, sharing takes the place of the last one, which did least.
    std::size_t goes_out(const Path &path, const Move &move) const {
        if (!move.shares)
            return move.place;
        return path.model.effects.size() < options_.max_effects ? path.model.effects.size() : path.model.effects.size() - 1;
    }
    // The best of some moves, if one is better than what there is: the model with it.
    const Move *best_move(const Path &path, const std::vector<Move> &tried, EffectModel &best, double from);
    bool make_move(Path &path, const Move &move, EffectModel model, double from);
    // The squared distance that a few rounds of a fit reach, by common random numbers from the path's model, where it is `now`.
    double quick_fit(EffectModel &model, const Path &path, double now);
    // The models after each of the model's effects from `begin` on, but the last, which is `last`. False if one cannot be simulated.
    bool fit_prefixes(const EffectModel &model, std::size_t begin, std::vector<FittedModel> &models, FittedModel last, double from);
    // A step of strengths, bounded; the largest one.
    static double move_strengths(EffectModel &model, const Eigen::VectorXd &step);
    // The column of the Jacobian of a strength, by a finite difference from the pool of the model.
    Eigen::VectorXd slope(const EffectModel &model, Eigen::Index p, const Pool &pool, std::uint32_t seeds);
    // What the squared distance of both halves has beyond chance.
    double excess_square(const FittedModel &fitted) const {
        return held_out(fitted, nullptr, nullptr) - 2.0 * static_cast<double>(experiment_.count());
    }
    void report(double fraction, const std::string &what) const {
        if (progress_)
            progress_(what, fraction);
    }

    Experiment &experiment_;
    const std::vector<Candidate> &candidates_;
    SearchOptions options_;
    Progress progress_;
    const FittedModel *baseline_ = nullptr;
    Pool baseline_pool_;
};

void Search::replicate(Replicates &replicates, std::uint32_t count, double from, double to) {
    const std::string what = "simulating " + (replicates.effects.empty() ? "the baseline" : label(replicates.effects));
    for (std::uint32_t r = static_cast<std::uint32_t>(replicates.draws.size()); r < count; ++r) {
        report(from + (to - from) * r / count, what);
        replicates.draws.push_back(experiment_.replicate(replicates.effects, replicates.levels, options_.seed + 1 + r));
    }
}

Differences Search::differences(const GapModel &model, const Eigen::VectorXd &correction) const {
    Differences result{experiment_.real().first - model.first_mean(), experiment_.real().second - model.second_mean()};
    if (correction.size()) {
        result.first -= correction;
        result.second -= correction;
    }
    return result;
}

std::vector<bool> Search::concerned(const std::string &id) const {
    std::vector<bool> result;
    for (std::size_t s = 0; s < experiment_.layout().sequences.size(); ++s)
        result.push_back(experiment_.simulator().concerns(id, s));
    return result;
}

// Squared distance of each half after the fit to the other half, summed. Without a response: of the model as it is.
double Search::held_out(const FittedModel &fitted, const Response *response, double *strength) const {
    const Covariance &covariance = fitted.model.fold();
    const Eigen::MatrixXd jacobian = whiten_columns(covariance, fitted.jacobian);
    const Differences d = differences(fitted.model, fitted.correction);
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

std::vector<Refined> Search::screen(Path &path, const FittedModel &fitted) {
    const EffectModel &model = path.model;
    const Covariance &covariance = fitted.model.fold();
    const Eigen::MatrixXd jacobian = whiten_columns(covariance, fitted.jacobian);
    const Eigen::VectorXd target = covariance.whiten(differences(fitted.model, fitted.correction).mean());
    const double before = residual_square(jacobian, target);
    // What a change, as much of it as fits best, takes away beside the parameters that are there; its sign.
    const auto gain_of = [&](const Eigen::VectorXd &change, double &sign) {
        Eigen::MatrixXd columns(jacobian.rows(), jacobian.cols() + 1);
        columns << covariance.whiten(change), jacobian;
        const Eigen::VectorXd coefficients = solve_least_squares(columns, target);
        sign = coefficients[0] < 0.0 ? -1.0 : 1.0;
        return before - (target - columns * coefficients).squaredNorm();
    };
    std::vector<Refined> result;
    for (const Candidate &candidate : candidates_) {
        Refined refined;
        refined.candidate = &candidate;
        refined.concerned = concerned(candidate.id);
        if (model.has(candidate) || std::none_of(refined.concerned.begin(), refined.concerned.end(), [](bool c) { return c; }))
            continue;
        const auto look = path.looks.find(&candidate);
        refined.gain = look == path.looks.end() ? 1e300 : gain_of(look->second, refined.sign);
        if (refined.gain > kLeastPromise)
            result.push_back(std::move(refined));
    }
    const auto by_gain = [](const Refined &a, const Refined &b) { return a.gain > b.gain; };
    if (!path.looks.empty()) {
        std::stable_sort(result.begin(), result.end(), by_gain);
        result.resize(std::min(result.size(), kMostLooks));
    }
    for (Refined &refined : result) {
        const Candidate &candidate = *refined.candidate;
        report(0.0, "screening " + candidate.id);
        refined.gain = 0.0;
        EffectModel with = model;
        with.add(candidate, 1.0, 0.5);
        Change change;
        if (!possible([&] {
                change = simulate_change(experiment_, path.pool, with.settings(), refined.concerned, options_.seed, kSearchSeeds);
            }))
            continue;
        path.looks[&candidate] = change.mean;
        const double gain = gain_of(change.mean, refined.sign);
        if (refined.sign > 0.0) {
            refined.gain = gain;
            refined.response.add(0.5, std::move(change));
        } else {
            // The other direction of an effect that has one; others cannot be negative.
            const HypothesisParameter &p = candidate.parameters.front();
            if (p.minimum < 0.0 && p.weak > 0.0)
                refined.gain = gain;
            else
                refined.sign = 1.0;
        }
    }
    std::stable_sort(result.begin(), result.end(), by_gain);
    return result;
}

void Search::refine(Refined &refined, const EffectModel &model, const FittedModel &fitted, const Pool &pool) {
    const auto simulate = [&](double strength) {
        EffectModel with = model;
        with.add(*refined.candidate, refined.sign, strength);
        refined.response.add(strength, simulate_change(experiment_, pool, with.settings(), refined.concerned, options_.seed,
                                                       kSearchSeeds));
    };
    for (const double strength : {0.0, 0.5, 1.0})
        if (refined.response.empty() || refined.response.distance(strength) > kNear)
            simulate(strength);
    const double before = held_out(fitted, nullptr, nullptr);
    for (int round = 0;; ++round) {
        const double after = held_out(fitted, &refined.response, &refined.strength);
        refined.gain = before - after;
        if (round == kFitRounds || refined.response.distance(refined.strength) < kNear)
            break;
        simulate(refined.strength);
    }
}

double Search::move_strengths(EffectModel &model, const Eigen::VectorXd &step) {
    double largest = 0.0;
    for (std::size_t p = 0; p < model.strengths.size(); ++p) {
        const double bounded = std::clamp(step[static_cast<Eigen::Index>(p)], -kLargestStep, kLargestStep);
        model.strengths[p].strength = std::clamp(model.strengths[p].strength + bounded, kWeakest, kStrongest);
        largest = std::max(largest, std::abs(bounded));
    }
    return largest;
}

Eigen::VectorXd Search::slope(const EffectModel &model, Eigen::Index p, const Pool &pool, std::uint32_t seeds) {
    EffectModel moved = model;
    double &strength = moved.strengths[static_cast<std::size_t>(p)].strength;
    const double at = strength;
    double step = at > 0.9 ? -kDifference : kDifference;
    strength = at + step;
    if (moved.settings() == pool.effects) { // at the end of its range
        step = -step;
        strength = at + step;
    }
    return simulate_change(experiment_, pool, moved.settings(), concerned(model.id_of(p)), options_.seed, seeds).mean / step;
}

// Strengths by Gauss-Newton rounds, then replicates at the fitted strengths and a last, linear step.
FittedModel Search::fit(EffectModel &model, Pool &pool, const Eigen::MatrixXd &known, std::uint32_t replicates, double from, double to) {
    const Eigen::Index parameters = static_cast<Eigen::Index>(model.strengths.size());
    FittedModel fitted;
    Eigen::MatrixXd &jacobian = fitted.jacobian;
    jacobian.resize(static_cast<Eigen::Index>(experiment_.count()), parameters);
    const int rounds = parameters == 1 ? 1 : kGaussNewtonRounds;
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
            jacobian.col(p) = slope(model, p, pool, options_.pool_seeds);
        }
        // Common random numbers: the pool's change from the baseline's pool, on the mean of the baseline's replicates.
        const Covariance &covariance = baseline_->model.full();
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
        if (move_strengths(model, step) < kNear && known.cols() == 0) {
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

void Search::judge(FittedModel &fitted, const EffectModel &model, Replicates replicates, std::uint32_t count, double from, double to) {
    if (replicates.draws.size() >= count)
        return;
    replicate(replicates, count, from, to);
    // No simulator has an effect exactly as a camera has it: a part of each change is left to that.
    const Eigen::VectorXd tolerance = kModelError * fitted.change.cwiseAbs() + reading_tolerance(experiment_.list(), fitted.effects);
    fitted.model = GapModel(experiment_, std::move(replicates), options_.residual_level, fitted.jacobian, tolerance);
    const Covariance &covariance = fitted.model.full();
    Eigen::VectorXd step = fitted.model.coefficients(covariance, experiment_.real().mean() - covariance.mean());
    step = step.cwiseMax(-kLargestStep).cwiseMin(kLargestStep);
    fitted.correction = fitted.jacobian * step;
    fitted.residual = fitted.model.test(experiment_.real());
    const Eigen::MatrixXd strays = fitted.model.strays(GapModel::Fit::kBoth);
    Eigen::VectorXd strengths = step;
    for (Eigen::Index p = 0; p < strengths.size(); ++p)
        strengths[p] += model.strengths[static_cast<std::size_t>(p)].strength;
    fitted.parameters = fitted_parameters(model, strengths, strength_deviations(fitted.model, strays, fitted.change),
                                          static_cast<double>(strays.rows()));
    fitted.score = held_out(fitted, nullptr, nullptr) + 4.0 * fitted.model.fold().deviation().array().log().sum();
}

SearchStep Search::described(const std::vector<Refined> &refined, const std::vector<const Refined *> &finalists,
                             const std::vector<FittedModel> &fits, std::size_t best, const FittedModel &current) const {
    const double gain = current.score - fits[best].score, excess = excess_square(current);
    SearchStep step;
    step.added = finalists[best]->candidate->id;
    step.residual = fits[best].residual;
    for (const Refined &candidate : refined) {
        if (!candidate.fitted)
            continue;
        RankedEffect ranked;
        ranked.effect = candidate.candidate->id;
        const std::size_t place = std::find(finalists.begin(), finalists.end(), &candidate) - finalists.begin();
        ranked.simulated = place < finalists.size();
        // The held-out gain of a fit, put on the scale of the replicates' by the best one's.
        ranked.gain = ranked.simulated ? current.score - fits[place].score
                                       : std::min(candidate.gain - finalists[best]->gain + gain, gain);
        if (ranked.simulated) {
            ranked.values = fits[place].effects.back().values;
            ranked.distance_after = fits[place].residual.distance;
        } else {
            EffectModel with;
            with.add(*candidate.candidate, candidate.sign, candidate.strength);
            ranked.values = with.settings().back().values;
            ranked.distance_after = std::sqrt(std::max(0.0, (excess - ranked.gain) / (2.0 * static_cast<double>(experiment_.count()))));
        }
        step.ranking.push_back(ranked);
    }
    weigh(step.ranking);
    return step;
}

bool Search::grow(Path &path, const FittedModel &current, double from, double share) {
    std::vector<Refined> refined = screen(path, current);
    if (refined.size() > options_.refined)
        refined.resize(options_.refined);
    while (refined.size() > 1 && refined.back().gain < kLeastLook * refined.front().gain)
        refined.pop_back();
    const double excess = excess_square(current);
    const double first_look = refined.empty() ? 0.0 : refined.front().gain;
    double explained = 0.0;
    for (Refined &candidate : refined) {
        // Where one effect explains nearly all, those that were not even half as good at a first look need no fit.
        if (explained > kNearlyAll * excess && candidate.gain < kFirstLook * first_look) {
            candidate.gain = 0.0;
            continue;
        }
        report(from + 0.2 * share, "fitting " + candidate.candidate->id);
        candidate.fitted = possible([&] { refine(candidate, path.model, current, path.pool); });
        if (!candidate.fitted)
            candidate.gain = 0.0;
        explained = std::max(explained, candidate.gain);
    }
    std::stable_sort(refined.begin(), refined.end(), [](const Refined &a, const Refined &b) { return a.gain > b.gain; });
    // Those that the last comparison must decide between: by replicates of their own.
    std::vector<EffectModel> models;
    std::vector<Pool> pools;
    std::vector<FittedModel> fits;
    std::vector<const Refined *> finalists;
    const double margin = refined.empty() ? 0.0 : std::max(kFinalMargin, kFinalMarginShare * refined.front().gain);
    const auto contends = [&](const Refined &candidate) {
        return candidate.gain >= kLeastGain && candidate.gain >= refined.front().gain - margin;
    };
    const bool contested = refined.size() > 1 && contends(refined[1]);
    for (const Refined &candidate : refined) {
        if (models.size() == options_.finalists || !contends(candidate))
            break;
        const double begin = from + share * (0.4 + 0.6 * static_cast<double>(models.size()) / options_.finalists);
        EffectModel with = path.model;
        with.add(*candidate.candidate, candidate.sign, candidate.strength);
        Pool own;
        FittedModel fitted;
        if (!possible([&] {
                fitted = fit(with, own, current.jacobian, contested ? options_.model_replicates : few_replicates(), begin,
                             begin + 0.6 * share / options_.finalists);
            }))
            continue;
        finalists.push_back(&candidate);
        models.push_back(std::move(with));
        pools.push_back(std::move(own));
        fits.push_back(std::move(fitted));
    }
    if (fits.empty())
        return false;
    std::size_t best = 0;
    for (std::size_t i = 1; i < fits.size(); ++i)
        if (fits[i].score < fits[best].score)
            best = i;
    const double gain = current.score - fits[best].score;
    if (gain < kLeastGain || (fits[best].residual.detected && gain < kLeastShare * excess))
        return false;
    path.steps.push_back(described(refined, finalists, fits, best, current));
    path.model = std::move(models[best]);
    path.pool = std::move(pools[best]);
    path.models.push_back(std::move(fits[best]));
    return true;
}

bool Search::fit_prefixes(const EffectModel &model, std::size_t begin, std::vector<FittedModel> &models, FittedModel last, double from) {
    const Eigen::MatrixXd none(static_cast<Eigen::Index>(experiment_.count()), 0);
    models.resize(begin);
    for (std::size_t n = begin + 1; n < model.effects.size(); ++n) {
        EffectModel part = model.first(n);
        Pool pool;
        if (!possible([&] { models.push_back(fit(part, pool, none, few_replicates(), from, from)); }))
            return false;
    }
    models.push_back(std::move(last));
    return true;
}

void Search::prune(Path &path, double from) {
    const Eigen::MatrixXd none(static_cast<Eigen::Index>(experiment_.count()), 0);
    for (std::size_t out = 0; out + 1 < path.model.effects.size();) {
        const FittedModel &whole = path.models.back();
        EffectModel others = path.model.without(out);
        // What is lost at once, as far as the others' strengths do not make up for it.
        const Covariance &covariance = whole.model.full();
        Eigen::VectorXd loss;
        const bool simulated = possible([&] {
            loss = simulate_change(experiment_, path.pool, others.settings(), concerned(path.model.effects[out].candidate->id), options_.seed,
                                   options_.pool_seeds).mean;
        });
        Eigen::MatrixXd jacobian(whole.jacobian.rows(), static_cast<Eigen::Index>(others.strengths.size()));
        Eigen::Index column = 0;
        for (std::size_t p = 0; p < path.model.strengths.size(); ++p)
            if (path.model.strengths[p].effect != out)
                jacobian.col(column++) = whole.jacobian.col(static_cast<Eigen::Index>(p));
        Pool pool;
        FittedModel fitted;
        std::vector<FittedModel> models = path.models;
        if (!simulated || residual_square(whiten_columns(covariance, jacobian), covariance.whiten(loss)) > kLeastNeeded ||
            !possible([&] { fitted = fit(others, pool, none, few_replicates(), from, from); }) || fitted.residual.detected ||
            fitted.score > whole.score + kLeastGain || !fit_prefixes(others, out, models, std::move(fitted), from)) {
            ++out;
            continue;
        }
        path.model = std::move(others);
        path.pool = std::move(pool);
        path.models = std::move(models);
        path.steps.erase(path.steps.begin() + static_cast<std::ptrdiff_t>(out));
        for (std::size_t n = out; n < path.models.size(); ++n)
            path.steps[n].residual = path.models[n].residual;
    }
}

std::vector<Search::Move> Search::moves(const Path &path, bool share) {
    const FittedModel &whole = path.models.back();
    const Covariance &covariance = whole.model.full();
    std::vector<Move> result;
    for (std::size_t place = 0; place < path.model.effects.size(); ++place) {
        std::vector<Move> alike;
        for (const auto &[candidate, look] : path.looks) {
            if (path.model.has(*candidate))
                continue;
            const Eigen::VectorXd change = covariance.whiten(look);
            Move best{place, candidate, 1.0, 0.0, share};
            for (std::size_t p = 0; p < path.model.strengths.size(); ++p) {
                if (path.model.strengths[p].effect != place)
                    continue;
                const Eigen::VectorXd column = covariance.whiten(whole.jacobian.col(static_cast<Eigen::Index>(p)));
                const double cosine = change.dot(column) / std::max(1e-30, change.norm() * column.norm());
                const HypothesisParameter &first = candidate->parameters.front();
                if (cosine < 0.0 && !(first.minimum < 0.0 && first.weak > 0.0))
                    continue;
                if (std::abs(cosine) > best.alike) {
                    best.alike = std::abs(cosine);
                    best.sign = cosine < 0.0 ? -1.0 : 1.0;
                }
            }
            if (best.alike > kLeastAlike && goes_out(path, best) != (share ? place : path.model.effects.size()))
                alike.push_back(best);
        }
        std::sort(alike.begin(), alike.end(), [](const Move &a, const Move &b) {
            return a.alike != b.alike ? a.alike > b.alike : a.candidate->id < b.candidate->id;
        });
        for (std::size_t i = 0; i < std::min(alike.size(), kMostAlike); ++i)
            result.push_back(alike[i]);
    }
    return result;
}

double Search::quick_fit(EffectModel &model, const Path &path, double now) {
    const FittedModel &start = path.models.back();
    const Covariance &covariance = start.model.full();
    const Eigen::VectorXd real = experiment_.real().mean() - covariance.mean();
    const Eigen::Index parameters = static_cast<Eigen::Index>(model.strengths.size());
    Eigen::MatrixXd jacobian(static_cast<Eigen::Index>(experiment_.count()), parameters);
    double square = 1e300;
    EffectModel best = model;
    for (int round = 0; round < kExchangeRounds; ++round) {
        const Pool pool = simulate_pool(experiment_, model.settings(), options_.seed, kSearchSeeds);
        for (Eigen::Index p = 0; p < parameters; ++p)
            jacobian.col(p) = slope(model, p, pool, kSearchSeeds);
        const Eigen::VectorXd target = covariance.whiten(real - (pool.statistics.front() - path.pool.statistics.front()));
        const Eigen::MatrixXd columns = whiten_columns(covariance, jacobian);
        const Eigen::VectorXd step = solve_least_squares(columns, target);
        const double reached = (target - columns * step).squaredNorm();
        const bool better = reached < kStillBetter * square;
        const double moved = move_strengths(model, step);
        if (reached < square) {
            square = reached;
            best = model;
        }
        if (moved < kNear || square > kHopeless * now || !better)
            break;
    }
    model = std::move(best);
    return square;
}

const Search::Move *Search::best_move(const Path &path, const std::vector<Move> &tried, EffectModel &best, double from) {
    const FittedModel &whole = path.models.back();
    const Covariance &covariance = whole.model.full();
    const double now = residual_square(whiten_columns(covariance, whole.jacobian), covariance.whiten(experiment_.real().mean() - covariance.mean()));
    double best_square = now - kLeastGain;
    const Move *chosen = nullptr;
    for (const Move &move : tried) {
        report(from, "exchanging " + path.model.effects[move.place].candidate->id + " for " + move.candidate->id);
        EffectModel model = path.model;
        for (Strength &s : model.strengths) {
            const Candidate &candidate = *model.effects[s.effect].candidate;
            if (move.shares && s.effect == move.place && candidate.parameters[s.parameter].weak != candidate.parameters[s.parameter].strong)
                s.strength = std::max(kWeakest, candidate.strength(s.parameter, 0.5 * candidate.value(s.parameter, s.strength)));
        }
        if (const std::size_t out = goes_out(path, move); out < model.effects.size())
            model = model.without(out);
        model.add(*move.candidate, move.sign, 0.5);
        double square = 1e300;
        if (!possible([&] { square = quick_fit(model, path, now); }) || square >= best_square)
            continue;
        best_square = square;
        best = std::move(model);
        chosen = &move;
    }
    return chosen;
}

bool Search::exchange(Path &path, double from) {
    for (const bool share : {false, true}) {
        const std::vector<Move> tried = moves(path, share);
        EffectModel best;
        const Move *move = best_move(path, tried, best, from);
        if (move && make_move(path, *move, std::move(best), from))
            return true;
    }
    return false;
}

bool Search::make_move(Path &path, const Move &move, EffectModel model, double from) {
    const FittedModel &whole = path.models.back();
    Path other;
    other.looks = path.looks;
    other.model = std::move(model);
    FittedModel fitted;
    const Eigen::MatrixXd none(static_cast<Eigen::Index>(experiment_.count()), 0);
    if (!possible([&] { fitted = fit(other.model, other.pool, none, options_.model_replicates, from, from); }) ||
        fitted.score > whole.score - kLeastGain)
        return false;
    const double gain = whole.score - fitted.score;
    RankedEffect ranked;
    ranked.effect = move.candidate->id;
    ranked.values = fitted.effects.back().values;
    ranked.distance_after = fitted.residual.distance;
    ranked.simulated = true;
    ranked.gain = gain;
    SearchStep step;
    step.added = ranked.effect;
    other.steps = path.steps;
    const std::size_t begin = goes_out(path, move);
    if (begin < path.models.size()) {
        // What the effect that goes out was worth, and more.
        step.ranking = path.steps[begin].ranking;
        step.ranking.erase(std::remove_if(step.ranking.begin(), step.ranking.end(),
                                          [&](const RankedEffect &r) { return r.effect == ranked.effect; }),
                           step.ranking.end());
        double worth = 0.0;
        for (const RankedEffect &r : step.ranking)
            worth = std::max(worth, r.gain);
        ranked.gain += worth;
        other.steps.erase(other.steps.begin() + static_cast<std::ptrdiff_t>(begin));
    }
    step.ranking.push_back(ranked);
    weigh(step.ranking);
    other.steps.push_back(std::move(step));
    other.models.assign(path.models.begin(), path.models.begin() + static_cast<std::ptrdiff_t>(begin));
    if (!fit_prefixes(other.model, begin, other.models, std::move(fitted), from))
        return false;
    for (std::size_t n = begin; n < other.models.size(); ++n)
        other.steps[n].residual = other.models[n].residual;
    path = std::move(other);
    return true;
}

SearchResult Search::run() {
    SearchResult result;
    const std::vector<bool> all(experiment_.layout().sequences.size(), true);
    report(0.0, "calibrating the baseline");
    const CalibratedLevels levels = experiment_.calibrate({}, all, nullptr);
    const Eigen::MatrixXd none(static_cast<Eigen::Index>(experiment_.count()), 0);
    FittedModel &baseline = result.baseline;
    baseline.jacobian = none;
    Replicates replicates{{}, levels, {}};
    replicate(replicates, options_.null_replicates, 0.0, 0.3);
    baseline.model = GapModel(experiment_, std::move(replicates), options_.level, none,
                              Eigen::VectorXd::Zero(static_cast<Eigen::Index>(experiment_.count())));
    baseline.residual = baseline.model.test(experiment_.real());
    baseline.score = held_out(baseline, nullptr, nullptr) + 4.0 * baseline.model.fold().deviation().array().log().sum();
    baseline_ = &baseline;
    if (baseline.residual.detected) {
        Path path;
        path.pool = simulate_pool(experiment_, {}, options_.seed, options_.pool_seeds, &levels);
        baseline_pool_ = path.pool;
        double progress = 0.3;
        const auto explained = [&] { return !path.models.empty() && !path.models.back().residual.detected; };
        const auto explain = [&] {
            while (!explained() && path.model.effects.size() < options_.max_effects) {
                const double share = 0.5 * (1.0 - progress);
                const FittedModel current = path.models.empty() ? baseline : path.models.back();
                if (!grow(path, current, progress, share))
                    break;
                progress += share;
            }
        };
        explain();
        for (int exchanges = 0; exchanges < kMostExchanges; ++exchanges) {
            if (explained() || path.models.size() < 2 || excess_square(path.models.back()) > kExchangeBelow * excess_square(baseline) ||
                !exchange(path, progress))
                break;
            explain();
        }
        if (explained() && path.models.size() > 2)
            prune(path, progress);
        if (!path.models.empty())
            judge(path.models.back(), path.model, path.models.back().model.replicates(), options_.model_replicates, progress, 1.0);
        result.steps = std::move(path.steps);
        result.models = std::move(path.models);
    }
    report(1.0, "done");
    baseline_ = nullptr;
    return result;
}

} // namespace

SearchResult search(Experiment &experiment, const std::vector<Candidate> &candidates, const SearchOptions &options,
                    const Progress &progress) {
    return Search(experiment, candidates, options, progress).run();
}

} // namespace clsp
