#include "attribution/search.hpp"

#include "attribution/least_squares.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

namespace clsp {
namespace {

constexpr int kFitRounds = 3;
// Effects whose gain at a first look is less than that part of the best one's are not fitted.
constexpr double kLeastLook = 0.2;
// Of the pool's seeds, for the search; fits use all.
constexpr std::uint32_t kSearchSeeds = 1;
// Where the squared distance fell below that part and is still too large, effects are exchanged.
constexpr double kExchangeBelow = 0.02;
constexpr std::size_t kEarliest = 2;
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
    Replicates replicate(const EffectSettings &effects, const CalibratedLevels &levels, std::uint32_t count, double from,
                         double to, const std::string &what);
    Differences differences(const GapModel &model, const Eigen::VectorXd &correction) const;
    std::vector<bool> concerned(const std::string &id) const;
    std::vector<Refined> screen(const EffectModel &model, const FittedModel &fitted, const Pool &pool);
    void refine(Refined &refined, const EffectModel &model, const FittedModel &fitted, const Pool &pool);
    double held_out(const FittedModel &fitted, const Response *response, double *strength) const;
    FittedModel fit(EffectModel &model, Pool &pool, double from, double to);
    SearchStep described(const std::vector<Refined> &refined, const std::vector<const Refined *> &finalists,
                         const std::vector<FittedModel> &fits, std::size_t best, const FittedModel &current) const;
    // Adds the effect that explains most of what `current`, fitted to the path's model, leaves. False if none does.
    bool grow(Path &path, const FittedModel &current, double from, double share);
    void exchange(Path &path, double from);
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

Replicates Search::replicate(const EffectSettings &effects, const CalibratedLevels &levels, std::uint32_t count,
                             double from, double to, const std::string &what) {
    Replicates result{effects, levels, {}};
    for (std::uint32_t r = 0; r < count; ++r) {
        report(from + (to - from) * r / count, what);
        result.draws.push_back(experiment_.replicate(effects, levels, options_.seed + 1 + r));
    }
    return result;
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

std::vector<Refined> Search::screen(const EffectModel &model, const FittedModel &fitted, const Pool &pool) {
    const Covariance &covariance = fitted.model.fold();
    const Eigen::MatrixXd jacobian = whiten_columns(covariance, fitted.jacobian);
    const Eigen::VectorXd target = covariance.whiten(differences(fitted.model, fitted.correction).mean());
    const double before = residual_square(jacobian, target);
    std::vector<Refined> result;
    for (const Candidate &candidate : candidates_) {
        Refined refined;
        refined.candidate = &candidate;
        refined.concerned = concerned(candidate.id);
        if (model.has(candidate) || std::none_of(refined.concerned.begin(), refined.concerned.end(), [](bool c) { return c; }))
            continue;
        report(0.0, "screening " + candidate.id);
        EffectModel with = model;
        with.add(candidate, 1.0, 0.5);
        Change change;
        if (!possible([&] {
                change = simulate_change(experiment_, pool, with.settings(), refined.concerned, options_.seed, kSearchSeeds);
            }))
            continue;
        Eigen::MatrixXd columns(jacobian.rows(), jacobian.cols() + 1);
        columns << covariance.whiten(change.mean), jacobian;
        const Eigen::VectorXd coefficients = solve_least_squares(columns, target);
        refined.gain = before - (target - columns * coefficients).squaredNorm();
        if (coefficients[0] < 0.0) {
            // The other direction of an effect that has one; others cannot be negative.
            const HypothesisParameter &p = candidate.parameters.front();
            if (p.minimum < 0.0 && p.weak > 0.0)
                refined.sign = -1.0;
            else
                refined.gain = 0.0;
        } else {
            refined.response.add(0.5, std::move(change));
        }
        result.push_back(std::move(refined));
    }
    std::stable_sort(result.begin(), result.end(), [](const Refined &a, const Refined &b) { return a.gain > b.gain; });
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

// Strengths by Gauss-Newton rounds, then replicates at the fitted strengths and a last, linear step.
FittedModel Search::fit(EffectModel &model, Pool &pool, double from, double to) {
    const Eigen::Index parameters = static_cast<Eigen::Index>(model.strengths.size());
    const auto move = [&](const Eigen::VectorXd &step) {
        double largest = 0.0;
        for (Eigen::Index p = 0; p < parameters; ++p) {
            const double bounded = std::clamp(step[p], -kLargestStep, kLargestStep);
            model.strengths[p].strength = std::clamp(model.strengths[p].strength + bounded, kWeakest, kStrongest);
            largest = std::max(largest, std::abs(bounded));
        }
        return largest;
    };
    EffectSettings settings;
    Eigen::MatrixXd jacobian(static_cast<Eigen::Index>(experiment_.count()), parameters);
    const int rounds = parameters == 1 ? 1 : kGaussNewtonRounds;
    for (int round = 0; round < rounds; ++round) {
        settings = model.settings();
        pool = simulate_pool(experiment_, settings, options_.seed, options_.pool_seeds);
        for (Eigen::Index p = 0; p < parameters; ++p) {
            report(from, "fitting " + model.id_of(p));
            EffectModel moved = model;
            double step = moved.strengths[p].strength > 0.9 ? -kDifference : kDifference;
            moved.strengths[p].strength += step;
            if (moved.settings() == settings) { // at the end of its range
                step = -step;
                moved.strengths[p].strength = model.strengths[p].strength + step;
            }
            jacobian.col(p) = simulate_change(experiment_, pool, moved.settings(), concerned(model.id_of(p)), options_.seed,
                                              options_.pool_seeds).mean / step;
        }
        if (round + 1 == rounds)
            break;
        // Common random numbers: the pool's change from the baseline's pool, on the mean of the baseline's replicates.
        const Covariance &covariance = baseline_->model.full();
        const Eigen::VectorXd mean = covariance.mean() + pool_mean(pool) - pool_mean(baseline_pool_);
        const Eigen::VectorXd target = covariance.whiten(experiment_.real().mean() - mean);
        if (move(solve_least_squares(whiten_columns(covariance, jacobian), target)) < kNear)
            break;
    }
    const CalibratedLevels levels = pool.levels;
    FittedModel fitted;
    fitted.effects = settings;
    // No simulator has an effect exactly as a camera has it: a part of each change is left to that.
    const Eigen::VectorXd change = pool_mean(pool) - pool_mean(baseline_pool_);
    const Eigen::VectorXd tolerance = kModelError * change.cwiseAbs();
    fitted.model = GapModel(experiment_,
                            replicate(settings, levels, options_.model_replicates, from, to, "simulating " + label(settings)),
                            options_.residual_level, jacobian, tolerance);
    fitted.jacobian = jacobian;
    const Covariance &covariance = fitted.model.full();
    Eigen::VectorXd step = fitted.model.coefficients(covariance, experiment_.real().mean() - covariance.mean());
    step = step.cwiseMax(-kLargestStep).cwiseMin(kLargestStep);
    fitted.correction = jacobian * step;
    fitted.residual = fitted.model.test(experiment_.real());
    const Eigen::MatrixXd strays = fitted.model.strays(GapModel::Fit::kBoth);
    Eigen::VectorXd strengths = step;
    for (Eigen::Index p = 0; p < parameters; ++p)
        strengths[p] += model.strengths[static_cast<std::size_t>(p)].strength;
    fitted.parameters = fitted_parameters(model, strengths, strength_deviations(fitted.model, strays, change),
                                          static_cast<double>(strays.rows()));
    fitted.score = held_out(fitted, nullptr, nullptr) + 4.0 * fitted.model.fold().deviation().array().log().sum();
    return fitted;
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
    std::vector<Refined> refined = screen(path.model, current, path.pool);
    if (refined.size() > options_.refined)
        refined.resize(options_.refined);
    while (refined.size() > 1 && refined.back().gain < kLeastLook * refined.front().gain)
        refined.pop_back();
    const double excess = excess_square(current);
    double explained = 0.0;
    for (Refined &candidate : refined) {
        // Where one effect explains nearly all, those that were not even half as good at a first look need no fit.
        if (explained > kNearlyAll * excess && candidate.gain < kFirstLook * refined.front().gain) {
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
    for (const Refined &candidate : refined) {
        const double margin = std::max(kFinalMargin, kFinalMarginShare * refined.front().gain);
        if (models.size() == options_.finalists || candidate.gain < kLeastGain || candidate.gain < refined.front().gain - margin)
            break;
        const double begin = from + share * (0.4 + 0.6 * static_cast<double>(models.size()) / options_.finalists);
        EffectModel with = path.model;
        with.add(*candidate.candidate, candidate.sign, candidate.strength);
        Pool own;
        FittedModel fitted;
        if (!possible([&] { fitted = fit(with, own, begin, begin + 0.6 * share / options_.finalists); }))
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

// Several effects may share what a missing one causes: the earliest ones were chosen without those that came later. Each of them in turn is
// taken out, and the search goes on from the others where they leave a residual.
void Search::exchange(Path &path, double from) {
    const std::size_t kept = path.model.effects.size() - 1;
    const bool explained = !path.models.back().residual.detected;
    for (std::size_t out = 0; out < std::min(kEarliest, kept); ++out) {
        Path other;
        other.model = path.model.without(out);
        other.steps = path.steps;
        other.steps.erase(other.steps.begin() + static_cast<std::ptrdiff_t>(out));
        FittedModel start;
        if (!possible([&] { start = fit(other.model, other.pool, from, from); }))
            continue;
        // An effect that only stood for others is left out; any other explanation must be better.
        const bool leaves_out = !start.residual.detected;
        while (!explained && other.model.effects.size() < options_.max_effects &&
               (other.models.empty() ? start : other.models.back()).residual.detected) {
            const FittedModel current = other.models.empty() ? start : other.models.back();
            if (!grow(other, current, from, 0.0) ||
                (other.models.size() == 1 && other.steps.back().added == path.steps[out].added)) // as before
                break;
        }
        if (!leaves_out && other.models.empty())
            continue;
        const double score = (other.models.empty() ? start : other.models.back()).score;
        if (score > path.models.back().score + (leaves_out ? kLeastGain : -kLeastGain))
            continue;
        // The models on the way, for what each effect takes away.
        std::vector<FittedModel> models(path.models.begin(), path.models.begin() + static_cast<std::ptrdiff_t>(out));
        bool complete = true;
        for (std::size_t n = out + 1; n < kept && complete; ++n) {
            EffectModel part = other.model.first(n);
            Pool pool;
            FittedModel fitted;
            complete = possible([&] { fitted = fit(part, pool, from, from); });
            models.push_back(std::move(fitted));
        }
        if (!complete)
            continue;
        models.push_back(std::move(start));
        models.insert(models.end(), std::make_move_iterator(other.models.begin()), std::make_move_iterator(other.models.end()));
        for (std::size_t n = 0; n < models.size(); ++n)
            other.steps[n].residual = models[n].residual;
        other.models = std::move(models);
        path = std::move(other);
        return;
    }
}

SearchResult Search::run() {
    SearchResult result;
    const std::vector<bool> all(experiment_.layout().sequences.size(), true);
    report(0.0, "calibrating the baseline");
    const CalibratedLevels levels = experiment_.calibrate({}, all, nullptr);
    const Eigen::MatrixXd none(static_cast<Eigen::Index>(experiment_.count()), 0);
    FittedModel &baseline = result.baseline;
    baseline.jacobian = none;
    baseline.model = GapModel(experiment_, replicate({}, levels, options_.null_replicates, 0.0, 0.3, "simulating the baseline"),
                              options_.level, none, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(experiment_.count())));
    baseline.residual = baseline.model.test(experiment_.real());
    baseline.score = held_out(baseline, nullptr, nullptr) + 4.0 * baseline.model.fold().deviation().array().log().sum();
    baseline_ = &baseline;
    if (baseline.residual.detected) {
        Path path;
        path.pool = simulate_pool(experiment_, {}, options_.seed, options_.pool_seeds, &levels);
        baseline_pool_ = path.pool;
        double progress = 0.3;
        bool explained = false;
        while (!explained && path.model.effects.size() < options_.max_effects) {
            const double share = 0.5 * (1.0 - progress);
            const FittedModel current = path.models.empty() ? baseline : path.models.back();
            if (!grow(path, current, progress, share))
                break;
            progress += share;
            explained = !path.models.back().residual.detected;
        }
        const bool nearly = path.models.size() > 1 && excess_square(path.models.back()) < kExchangeBelow * excess_square(baseline);
        if (explained ? path.models.size() > 2 : nearly)
            exchange(path, progress);
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
