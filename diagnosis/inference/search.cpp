#include "inference/search.hpp"

#include "inference/least_squares.hpp"
#include "inference/swap.hpp"
#include "statistics/distributions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

namespace clsp {
namespace {

// Of the progress: the baseline is simulated; the second search begins, if there is one; the searches end.
constexpr double kBegin = 0.3, kSecond = 0.7, kEnd = 0.98;
// Where a second and a third search follow the first.
constexpr double kFirstSearch = 0.6, kSecondSearch = 0.85;
constexpr int kFitRounds = 3;
// Effects whose gain at screening is less than that part of the best one's are not fitted.
constexpr double kLeastGainPart = 0.2;
// That many times as many are fitted as long as no fit bears out the screening.
constexpr std::uint32_t kMorePatient = 2;
// Later screenings take the effects whose change at the last one promises most, and those only of which it promises
// anything.
constexpr std::size_t kMostScreened = 14;
constexpr double kLeastPromise = 4.0;
// Effects whose held-out gain is that near to the best one's are compared by replicates of their own.
constexpr double kFinalMargin = 20.0, kFinalMarginShare = 0.03;
// So are those farther behind where the best one explains less than that part: what an effect scatters by itself (power
// that flickers) counts as not explained until it is simulated.
constexpr double kDoubtful = 0.25;
// Where the squared distance fell below that part and is still too large, effects are swapped; that often.
constexpr double kLittleLeft = 0.02;
constexpr int kMostSwaps = 3;
// Of an excess beyond that for each statistic, an effect stays that explains the second part by the present model's
// covariance, even if it explains nothing by its own: by that, what other effects do may weigh more than before.
constexpr double kLarge = 200.0, kMostOfLarge = 0.25;
// Of such an excess, where no effect promises that part of the squared distance by its change at one strength, all are
// screened again as they answer to their strength: what goes far bends, and a defocus of 1.3 waves has nothing of one
// of 1.
constexpr double kPoorScreening = 0.5;
constexpr double kLineStrengths[] = {0.5, 1.0};
// A search that explains no such excess is made once more, along those lines in any case and with
// this part of kLeastGainPart: at f/8 a defocus of 0.77 waves has a tenth of what one of 0.95 changes, which promises
// too little for a fit by a little.
constexpr double kPatientGainPart = 0.25;
// There, the effects that are still missing explain less.
constexpr double kLeastShareOfLittle = 0.04;

struct Refined {
    const Candidate *candidate;
    double sign = 1.0;
    double strength = 0.5;
    double gain = 0.0; // screening, then held-out
    double share = 0.0; // of the squared distance, by screening
    bool fitted = false;
    std::vector<bool> concerned;
    Response response;
};

double ratio_of(double part, double whole) {
    return whole > 0.0 ? std::clamp(part / whole, 0.0, 1.0) : 0.0;
}

bool are_forms(const Refined &a, const Refined &b) {
    return a.candidate != b.candidate && a.candidate->id == b.candidate->id;
}

// The best first; of an effect that may begin in several places (with_alternatives) the best alone, but that forms
// which fits tell apart stay.
void sort_by_gain(std::vector<Refined> &refined) {
    std::stable_sort(refined.begin(), refined.end(),
                     [](const Refined &a, const Refined &b) { return a.gain > b.gain; });
    keep_one_of_each(refined,
                     [](const Refined &one) { return std::pair(one.candidate->id, one.candidate->told_by_fit); });
}

// The first entries, so many effects; forms of one count once.
void keep_effects(std::vector<Refined> &refined, std::size_t most) {
    std::size_t kept = 0, effects = 0;
    for (; kept < refined.size(); ++kept) {
        const auto is_form = [&](const Refined &before) { return are_forms(before, refined[kept]); };
        const auto here = refined.begin() + static_cast<std::ptrdiff_t>(kept);
        if (std::none_of(refined.begin(), here, is_form) && ++effects > most)
            break;
    }
    refined.resize(kept);
}

// Leaves one form of each effect, by their fits: the catalogue's own unless the other is clearly better.
void decide_forms(std::vector<Refined> &refined) {
    std::vector<const Candidate *> out;
    for (const Refined &form : refined) {
        if (!form.candidate->told_by_fit)
            continue;
        const auto own =
            std::find_if(refined.begin(), refined.end(), [&](const Refined &other) { return are_forms(form, other); });
        if (own != refined.end())
            out.push_back(form.fitted && form.gain > own->gain + kFormMargin ? own->candidate : form.candidate);
    }
    const auto is_out = [&](const Refined &one) {
        return std::find(out.begin(), out.end(), one.candidate) != out.end();
    };
    refined.erase(std::remove_if(refined.begin(), refined.end(), is_out), refined.end());
}

// Where the capture does not tell which form an effect has, each of its parameters may be what it is in the other one,
// too.
void include_other_forms(SearchState &state) {
    for (std::size_t k = 0; k < state.model.effects.size(); ++k) {
        const Candidate &candidate = *state.model.effects[k].candidate;
        const auto other = state.other_forms.find(candidate.id);
        if (other == state.other_forms.end())
            continue;
        for (FittedParameter &parameter : state.models.back().parameters)
            for (std::size_t p = 0; p < candidate.parameters.size(); ++p)
                if (parameter.effect == candidate.id && parameter.name == candidate.parameters[p].name) {
                    parameter.low = std::min(parameter.low, other->second[p]);
                    parameter.high = std::max(parameter.high, other->second[p]);
                }
    }
}

class Search {
  public:
    Search(ModelFit &fits, const std::vector<const Candidate *> &candidates, const SearchStart &start)
        : fits_(fits), runner_(fits.runner()), candidates_(candidates), start_(start) {}

    SearchResult run();

  private:
    // Effects by what they promise at screening. fresh: none is put aside by its last one.
    std::vector<Refined> screen(SearchState &state, const FittedModel &fitted, bool fresh);
    // Fits the promising ones of them; false if no fit bears out the screening.
    bool refine_all(std::vector<Refined> &refined, const SearchState &state, const FittedModel &current, double at);
    void refine(Refined &refined, const EffectModel &model, const FittedModel &fitted, const Pool &pool);
    // The gain by a straight line from one strength to another, held out, where that is more than at one strength.
    void screen_along_lines(std::vector<Refined> &refined, const SearchState &state, const FittedModel &fitted);
    void remember_screening(const std::vector<Refined> &refined); // the first one
    SearchStep described(const std::vector<Refined> &refined, const std::vector<const Refined *> &finalists,
                         const std::vector<FittedModel> &fits, std::size_t best, const FittedModel &current) const;
    std::size_t best_of(std::vector<FittedModel> &fits, double margin, double at) const;
    // Adds the effect that explains most of what `current`, fitted to the state's model, leaves. False if none does.
    bool grow(SearchState &state, const FittedModel &current, double from, double share);

    // Effects that explain the gap, within the range that is common for each if any do.
    SearchState explain(const FittedModel &baseline);
    // Adds effects until nothing is left or nothing helps; or until one of them goes far: false, and it may go on.
    enum class Until { kFar, kDone };
    bool grow_all(SearchState &state, const FittedModel &baseline, Until until);
    // With the effects that the search begins with. from, to: of the progress.
    SearchState first_state(double from, double to);
    // Swaps effects, adds others, takes out what is needless.
    void finish(SearchState &state, const FittedModel &baseline);
    // An effect is far beyond its range.
    bool goes_far(const SearchState &state) const;
    // A strength stands at the end of the common range, its last step leads out of it, and the wide search found it
    // there.
    static bool leads_out(const SearchState &common, const SearchState &wide);
    bool begins_elsewhere(const SearchState &a, const SearchState &b) const {
        const std::size_t first = start_.steps.size();
        return a.steps.size() <= first || b.steps.size() <= first || a.steps[first].added != b.steps[first].added;
    }
    bool is_explained(SearchState &state) {
        if (state.models.empty())
            return false;
        fits_.confirm(state.models.back(), state.progress);
        return !state.models.back().residual.detected;
    }

    // Little of the excess that the search began with is left, but what is left is seldom by chance.
    bool nearly_explained(const FittedModel &fitted) const {
        return fitted.residual.p_value <= kSeldom && fits_.excess_square(fitted) <= kLittleLeft * begin_excess_;
    }

    ModelFit &fits_;
    // The excess is so large that effects bend on their way to it.
    bool is_large() const { return begin_excess_ > kLarge * static_cast<double>(runner_.count()); }

    double begin_excess_ = 0.0;
    bool patient_ = false; // first effects are screened along lines in any case, and more of them get a fit
    std::vector<ScreenedEffect> screened_;
    ReplicateRunner &runner_;
    const std::vector<const Candidate *> &candidates_;
    const SearchStart &start_;
    std::optional<SearchState> begin_; // the start, fitted
};

std::vector<Refined> Search::screen(SearchState &state, const FittedModel &fitted, bool fresh) {
    const EffectModel &model = state.model;
    const Covariance &covariance = fitted.model.fold();
    const Eigen::MatrixXd jacobian = whiten_columns(covariance, fitted.jacobian);
    const Eigen::VectorXd target = covariance.whiten(fits_.differences(fitted).mean());
    // What a change promises beside the parameters that are there; its sign.
    const auto gain_of = [&](const Eigen::VectorXd &change, double &sign) {
        const Promise promise = promise_of(covariance.whiten(change), jacobian, target);
        sign = promise.coefficient < 0.0 ? -1.0 : 1.0;
        return promise.gain;
    };
    std::vector<Refined> result;
    for (const Candidate *const one : candidates_) {
        const Candidate &candidate = *one;
        Refined refined;
        refined.candidate = one;
        refined.concerned = fits_.concerned(candidate.id);
        if (model.has(candidate) ||
            std::none_of(refined.concerned.begin(), refined.concerned.end(), [](bool c) { return c; }))
            continue;
        const auto known = state.screened.find(&candidate);
        refined.gain = fresh || known == state.screened.end() ? 1e300 : gain_of(known->second, refined.sign);
        if (refined.gain > kLeastPromise)
            result.push_back(std::move(refined));
    }
    if (!state.screened.empty() && !fresh) {
        sort_by_gain(result);
        keep_effects(result, kMostScreened);
    }
    std::vector<Change> changes(result.size()); // of no size where the simulator refuses
    std::vector<double> screened_at(result.size());
    runner_.side_by_side(result.size(), [&](ReplicateRunner &runner, std::size_t i) {
        const Candidate &candidate = *result[i].candidate;
        if (runner.on_callers_thread())
            fits_.report(0.0, "screening " + candidate.id);
        for (const double strength : Candidate::kScreeningStrengths) {
            EffectModel with = model;
            with.add(candidate, 1.0, strength);
            Change change;
            if (!possible([&] {
                    change = simulate_change(runner, state.pool, with.settings(), result[i].concerned,
                                             fits_.options().seed, kSearchSeeds);
                }))
                continue;
            double sign = 1.0;
            const bool nothing = change.mean.isZero(0.0);
            // Where it does nothing half way, it may do the opposite on either side.
            const bool enough =
                !nothing && (strength == Candidate::kScreeningStrengths[0] || gain_of(change.mean, sign) <= 0.0 ||
                             sign > 0.0 || candidate.has_direction());
            if (!nothing || changes[i].mean.size() == 0) {
                changes[i] = std::move(change);
                screened_at[i] = strength;
            }
            if (enough)
                break;
        }
    });
    for (std::size_t i = 0; i < result.size(); ++i) {
        Refined &refined = result[i];
        const Candidate &candidate = *refined.candidate;
        Change &change = changes[i];
        refined.gain = 0.0;
        if (change.mean.size() == 0)
            continue;
        state.screened[&candidate] = change.mean;
        const double gain = gain_of(change.mean, refined.sign);
        if (refined.sign > 0.0) {
            refined.gain = gain;
            refined.response.add(candidate.snapped(0, screened_at[i]), std::move(change));
        } else {
            // The other direction of an effect that has one; others cannot be negative.
            if (candidate.has_direction())
                refined.gain = gain;
            else
                refined.sign = 1.0;
        }
    }
    const auto promised = [](const Refined &a, const Refined &b) { return a.gain < b.gain; };
    const auto best = std::max_element(result.begin(), result.end(), promised);
    const bool poor = best != result.end() && best->gain < kPoorScreening * target.squaredNorm();
    if ((poor || (patient_ && model.effects.size() == start_.model.effects.size())) &&
        fits_.excess_square(fitted) > kLarge * static_cast<double>(runner_.count()))
        screen_along_lines(result, state, fitted);
    sort_by_gain(result);
    for (Refined &refined : result)
        refined.share = ratio_of(refined.gain, target.squaredNorm());
    return result;
}

void Search::screen_along_lines(std::vector<Refined> &refined, const SearchState &state, const FittedModel &fitted) {
    struct Line {
        std::size_t place;
        double sign, gain;
        Response response;
    };
    std::vector<Line> lines;
    for (std::size_t i = 0; i < refined.size(); ++i) {
        const bool turns = refined[i].candidate->has_direction();
        for (const double sign : {1.0, -1.0})
            if (sign > 0.0 || turns)
                lines.push_back({i, sign, 0.0, sign == refined[i].sign ? refined[i].response : Response{}});
    }
    const double before = fits_.held_out(fitted);
    runner_.side_by_side(lines.size(), [&](ReplicateRunner &runner, std::size_t k) {
        Line &line = lines[k];
        const Refined &of = refined[line.place];
        if (runner.on_callers_thread())
            fits_.report(0.0, "screening " + of.candidate->id);
        possible([&] {
            for (const double asked : kLineStrengths) {
                const double strength = of.candidate->snapped(0, asked, line.sign);
                if (!line.response.empty() && line.response.distance(strength) <= kNear)
                    continue;
                EffectModel with = state.model;
                with.add(*of.candidate, line.sign, strength);
                line.response.add(strength, simulate_change(runner, state.pool, with.settings(), of.concerned,
                                                            fits_.options().seed, kSearchSeeds));
            }
            line.gain =
                0.5 * (before - fits_.held_out(fitted, &line.response)); // of two halves, a promise is of their mean
        });
    });
    for (Line &line : lines) {
        Refined &of = refined[line.place];
        if (line.gain <= of.gain)
            continue;
        of.gain = line.gain;
        of.sign = line.sign;
        of.response = std::move(line.response);
    }
}

void Search::remember_screening(const std::vector<Refined> &refined) {
    if (!screened_.empty())
        return;
    for (const Refined &candidate : refined)
        screened_.push_back({candidate.candidate->id, candidate.share, candidate.fitted});
    std::stable_sort(screened_.begin(), screened_.end(),
                     [](const ScreenedEffect &a, const ScreenedEffect &b) { return a.share > b.share; });
}

void Search::refine(Refined &refined, const EffectModel &model, const FittedModel &fitted, const Pool &pool) {
    const auto change_at = [&](ReplicateRunner &runner, double strength) {
        EffectModel with = model;
        with.add(*refined.candidate, refined.sign, strength);
        return simulate_change(runner, pool, with.settings(), refined.concerned, fits_.options().seed, kSearchSeeds);
    };
    std::vector<double> strengths;
    for (const double asked : {0.0, 0.5, 1.0}) {
        const double strength = refined.candidate->snapped(0, asked, refined.sign);
        if ((refined.response.empty() || refined.response.distance(strength) > kNear) &&
            std::find(strengths.begin(), strengths.end(), strength) == strengths.end())
            strengths.push_back(strength);
    }
    std::vector<Change> changes(strengths.size());
    runner_.side_by_side(strengths.size(),
                         [&](ReplicateRunner &runner, std::size_t i) { changes[i] = change_at(runner, strengths[i]); });
    for (std::size_t i = 0; i < strengths.size(); ++i)
        refined.response.add(strengths[i], std::move(changes[i]));
    const double before = fits_.held_out(fitted);
    for (int round = 0;; ++round) {
        const double after = fits_.held_out(fitted, &refined.response, &refined.strength);
        refined.strength = refined.candidate->snapped(0, refined.strength, refined.sign);
        refined.gain = before - after;
        if (round == kFitRounds || refined.response.distance(refined.strength) < kNear)
            break;
        refined.response.add(refined.strength, change_at(runner_, refined.strength));
    }
}

SearchStep Search::described(const std::vector<Refined> &refined, const std::vector<const Refined *> &finalists,
                             const std::vector<FittedModel> &fits, std::size_t best, const FittedModel &current) const {
    const double gain = current.score - fits[best].score, excess = fits_.excess_square(current);
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
            ranked.distance_after =
                std::sqrt(std::max(0.0, (excess - ranked.gain) / (2.0 * static_cast<double>(runner_.count()))));
        }
        step.ranking.push_back(ranked);
    }
    weigh(step.ranking);
    return step;
}

bool Search::refine_all(std::vector<Refined> &refined, const SearchState &state, const FittedModel &current,
                        double at) {
    const double excess = fits_.excess_square(current);
    const double best_screened = refined.empty() ? 0.0 : refined.front().gain;
    // The best gain of a fit, and at screening the best gain that a fit bore out.
    double explained = 0.0, borne_out = 0.0;
    std::uint32_t tried = 0;
    const double least_screened = kLeastGainPart * (patient_ ? kPatientGainPart : 1.0);
    for (Refined &candidate : refined) {
        const double screened = candidate.gain;
        candidate.gain = 0.0;
        if (screened <= 0.0)
            continue;
        // Another form of what was fitted is, too; else what promises enough, and if one effect explains nearly all,
        // was at least half as good at screening.
        const bool is_form = std::any_of(refined.begin(), refined.end(), [&](const Refined &other) {
            return other.fitted && are_forms(other, candidate);
        });
        const std::uint32_t most = fits_.options().refined * (borne_out > 0.0 && !patient_ ? 1 : kMorePatient);
        if (!is_form && (screened < least_screened * borne_out || tried >= most ||
                         (explained > kNearlyAll * excess && screened < kLeastScreened * best_screened)))
            continue;
        fits_.report(at, "fitting " + candidate.candidate->id);
        candidate.fitted = possible([&] { refine(candidate, state.model, current, state.pool); });
        if (!candidate.fitted) {
            candidate.gain = 0.0;
            continue;
        }
        tried += is_form ? 0 : 1;
        explained = std::max(explained, candidate.gain);
        if (candidate.gain >= kLeastGain)
            borne_out = std::max(borne_out, screened);
    }
    decide_forms(refined);
    return borne_out > 0.0;
}

// The best of some models by as many replicates each, as the score depends on how many there are: all that there may be
// where few leave a doubt.
std::size_t Search::best_of(std::vector<FittedModel> &fits, double margin, double at) const {
    std::size_t most = 0;
    for (const FittedModel &fitted : fits)
        most = std::max(most, fitted.model.replicates().draws.size());
    std::vector<std::size_t> running(fits.size());
    std::iota(running.begin(), running.end(), std::size_t{0});
    const auto judge = [&](std::size_t count) {
        for (const std::size_t i : running)
            fits_.judge(fits[i], fits[i].model.replicates(), static_cast<std::uint32_t>(count), at, at);
        std::stable_sort(running.begin(), running.end(),
                         [&](std::size_t a, std::size_t b) { return fits[a].score < fits[b].score; });
    };
    judge(most);
    const double first = fits[running.front()].score;
    const auto is_out = [&](std::size_t i) { return fits[i].score > first + margin; };
    const std::vector<std::size_t> ranked = running;
    running.erase(std::remove_if(running.begin(), running.end(), is_out), running.end());
    if (running.size() > 1) {
        const std::size_t still = running.size();
        judge(fits_.options().model_replicates);
        // The others stay as far behind as they were.
        for (std::size_t i = still; i < ranked.size(); ++i)
            fits[ranked[i]].score += fits[running.front()].score - first;
    }
    return running.front();
}

bool Search::grow(SearchState &state, const FittedModel &current, double from, double share) {
    const double excess = fits_.excess_square(current);
    const bool little = excess <= kLittleLeft * begin_excess_, stale = !state.screened.empty();
    std::vector<Refined> refined = screen(state, current, false);
    const bool borne_out = refine_all(refined, state, current, from + 0.2 * share);
    remember_screening(refined);
    // The last screening may be of another picture: what is lopsided shows late under a defocus.
    if (!borne_out && little && stale) {
        refined = screen(state, current, true);
        refine_all(refined, state, current, from + 0.2 * share);
    }
    std::stable_sort(refined.begin(), refined.end(),
                     [](const Refined &a, const Refined &b) { return a.gain > b.gain; });
    // Those that the last comparison must decide between: by replicates of their own.
    std::vector<EffectModel> models;
    std::vector<Pool> pools;
    std::vector<FittedModel> fits;
    std::vector<const Refined *> finalists;
    const double best_gain = refined.empty() ? 0.0 : refined.front().gain;
    const double margin = std::max(kFinalMargin, kFinalMarginShare * best_gain);
    const bool doubtful = best_gain < kDoubtful * excess;
    const auto is_near = [&](const Refined &candidate) { return candidate.gain >= best_gain - margin; };
    const auto contends = [&](const Refined &candidate) {
        return candidate.gain >= kLeastGain && (doubtful || is_near(candidate));
    };
    for (const Refined &candidate : refined) {
        if (models.size() == fits_.options().finalists || !contends(candidate))
            break;
        const double begin =
            from + share * (0.4 + 0.6 * static_cast<double>(models.size()) / fits_.options().finalists);
        EffectModel with = state.model;
        with.add(*candidate.candidate, candidate.sign, candidate.strength);
        Pool own;
        FittedModel fitted;
        const Origin origin{current.model.full(), state.pool};
        FitOptions options;
        options.replicates = fits_.few_replicates();
        options.from = begin;
        options.to = begin + 0.6 * share / fits_.options().finalists;
        options.known = current.jacobian;
        if (!possible([&] { fitted = fits_.fit(with, own, options, &origin); }) || fitted.effects.empty())
            continue;
        finalists.push_back(&candidate);
        models.push_back(std::move(with));
        pools.push_back(std::move(own));
        fits.push_back(std::move(fitted));
    }
    if (fits.empty())
        return false;
    const std::size_t best = best_of(fits, margin, from + share);
    fits_.go_on(models[best], pools[best], fits[best], from + share);
    if (nearly_explained(fits[best])) {
        fits_.step_whole_numbers(models[best], pools[best], fits[best], from + share);
        fits_.polish(models[best], pools[best], fits[best], from + share);
        // Which may be what led to the search's end.
        if (fits_.go_on(models[best], pools[best], fits[best], from + share))
            fits_.polish(models[best], pools[best], fits[best], from + share);
    }
    const double gain = current.score - fits[best].score;
    // The part of the excess by the present model's covariance: each model has its own, and large gaps are measured by
    // very different ones.
    const double least_share = little ? kLeastShareOfLittle : kLeastShare;
    const bool is_large_part =
        excess > kLarge * static_cast<double>(runner_.count()) && finalists[best]->gain > kMostOfLarge * excess;
    if ((gain < kLeastGain && !is_large_part) ||
        (fits[best].residual.detected && std::max(gain, finalists[best]->gain) < least_share * excess))
        return false;
    state.steps.push_back(described(refined, finalists, fits, best, current));
    state.model = std::move(models[best]);
    state.pool = std::move(pools[best]);
    state.models.push_back(std::move(fits[best]));
    return true;
}

bool is_far(const EffectModel &model, const Strength &s) {
    const HypothesisParameter &p = model.effects[s.effect].candidate->parameters[s.parameter];
    return p.weak != p.strong && s.strength > kCommon;
}

bool Search::goes_far(const SearchState &state) const {
    return std::any_of(state.model.strengths.begin(), state.model.strengths.end(), [&](const Strength &s) {
        return !start_.model.has(*state.model.effects[s.effect].candidate) && is_far(state.model, s);
    });
}

bool Search::leads_out(const SearchState &common, const SearchState &wide) {
    for (std::size_t k = 0; k < common.model.strengths.size(); ++k) {
        const Strength &s = common.model.strengths[k];
        const ModelEffect &effect = common.model.effects[s.effect];
        if (!is_at(s.strength, kCommon) || common.models.back().step[static_cast<Eigen::Index>(k)] <= 0.0)
            continue;
        for (const Strength &other : wide.model.strengths) {
            const ModelEffect &found = wide.model.effects[other.effect];
            if (found.candidate->id == effect.candidate->id && found.sign == effect.sign &&
                other.parameter == s.parameter && is_far(wide.model, other))
                return true;
        }
    }
    return false;
}

bool Search::grow_all(SearchState &state, const FittedModel &baseline, Until until) {
    while (!is_explained(state) && state.model.effects.size() < most_effects(fits_, state) && fits_.may_go_on()) {
        if (until == Until::kFar && goes_far(state))
            return false;
        const double share = 0.5 * (state.progress_end - state.progress);
        const FittedModel current = state.models.empty() ? baseline : state.models.back();
        if (!grow(state, current, state.progress, share))
            break;
        state.progress += share;
    }
    return true;
}

SearchState Search::first_state(double from, double to) {
    if (!begin_) {
        begin_.emplace();
        begin_->pool = fits_.baseline_pool();
        FittedModel fitted;
        FitOptions options;
        options.replicates = fits_.few_replicates();
        options.from = options.to = from;
        EffectModel model = start_.model;
        Pool pool;
        if (!model.effects.empty() && possible([&] { fitted = fits_.fit(model, pool, options); })) {
            begin_->steps = start_.steps;
            begin_->steps.back().residual = fitted.residual;
            begin_->models.resize(begin_->steps.size());
            begin_->models.back() = std::move(fitted);
            begin_->model = std::move(model);
            begin_->pool = std::move(pool);
        }
    }
    SearchState state = *begin_;
    state.strongest = fits_.strongest();
    state.progress = from;
    state.progress_end = to;
    return state;
}

void Search::finish(SearchState &state, const FittedModel &baseline) {
    const auto swap_effects = [&] {
        for (int swaps = 0; swaps < kMostSwaps; ++swaps) {
            if (state.models.size() < 2 || !nearly_explained(state.models.back()) || !fits_.may_go_on() ||
                !swap(fits_, state, state.progress))
                break;
            grow_all(state, baseline, Until::kDone);
        }
    };
    swap_effects();
    // Forms were chosen when other effects were missing.
    const bool is_certain = state.models.empty() || (state.models.size() == 1 && is_explained(state));
    if (!is_certain && fits_.may_go_on() && swap_forms(fits_, state, candidates_, state.progress) &&
        !is_explained(state)) {
        grow_all(state, baseline, Until::kDone);
        swap_effects();
    }
    for (int swaps = 0; swaps < kMostSwaps && state.models.size() > 1 && is_explained(state); ++swaps) {
        SearchState before = state;
        if (!fits_.may_go_on() || !swap_confusable_effects(fits_, state, state.progress))
            break;
        if (!is_explained(state)) { // likelier, and yet not all
            state = std::move(before);
            break;
        }
    }
    if (is_explained(state) && state.models.size() > 2)
        prune(fits_, state, state.progress);
}

SearchState Search::explain(const FittedModel &baseline) {
    // A flexible effect far beyond its range imitates others that are within theirs, and those are likelier. But one
    // that the common range only holds back is not within it: the last step makes up for what is missing, or goes too
    // far, or another effect does.
    SearchState common;
    bool held_back = false;
    const auto common_explains = [&](const SearchState &wide) {
        fits_.set_strongest(kCommon);
        common = first_state(kSecond, kEnd);
        grow_all(common, baseline, Until::kDone);
        finish(common, baseline);
        fits_.set_strongest(kStrongest);
        const bool explained = is_explained(common);
        held_back = explained && leads_out(common, wide);
        return explained && !held_back;
    };
    SearchState state = first_state(kBegin, kSecond);
    const bool grown = grow_all(state, baseline, Until::kFar), far = goes_far(state);
    if (far && fits_.may_go_on() && common_explains(state))
        return common;
    if (!grown)
        grow_all(state, baseline, Until::kDone);
    finish(state, baseline);
    if (!far && goes_far(state) && fits_.may_go_on() && common_explains(state))
        return common;
    if (held_back)
        return is_explained(state) ? state : common;
    // Neither need explain the gap, and either may have come farther.
    const bool common_is_better =
        !common.models.empty() && (state.models.empty() || common.models.back().score < state.models.back().score);
    return common_is_better && !is_explained(state) ? common : state;
}

SearchResult Search::run() {
    SearchResult result;
    result.baseline = fits_.fit_baseline(kBegin);
    const FittedModel &baseline = result.baseline;
    result.p_left = baseline.residual.p_value;
    if (baseline.residual.detected) {
        const SearchState begin = first_state(kBegin, kSecond);
        begin_excess_ = fits_.excess_square(begin.models.empty() ? baseline : begin.models.back());
        SearchState state = explain(baseline);
        if (is_large() && fits_.may_go_on() && !is_explained(state)) {
            patient_ = true;
            SearchState first = first_state(kSecond, kEnd);
            const FittedModel current = first.models.empty() ? baseline : first.models.back();
            if (grow(first, current, kSecond, kEnd - kSecond) && begins_elsewhere(first, state)) {
                SearchState again = explain(baseline);
                if (is_explained(again))
                    state = std::move(again);
            }
        }
        if (!state.models.empty()) {
            fits_.set_strongest(state.strongest);
            if (fits_.options().whole)
                complete(fits_, state, baseline, state.progress);
            fits_.judge(state.models.back(), state.models.back().model.replicates(), fits_.options().model_replicates,
                        0.98, 0.99);
            fits_.confirm(state.models.back(), 0.99);
            if (fits_.options().whole) {
                fits_.measure_parameters(state.models.back(), state.model, 0.99);
                include_other_forms(state);
            }
            result.p_left = state.models.back().residual.p_value;
            for (FittedModel &model : state.models)
                fits_.judge_by_all(model);
        }
        result.model = std::move(state.model);
        result.steps = std::move(state.steps);
        result.models = std::move(state.models);
        result.screened = std::move(screened_);
        result.ended_early = fits_.ended_early();
        result.work = fits_.work();
    }
    fits_.report(1.0, "done");
    return result;
}

} // namespace

Eigen::VectorXd left_by(const SearchResult &found, double level) {
    const FittedModel &last = found.last();
    if (last.residual.p_value > level)
        return {};
    const double freedom = static_cast<double>(last.model.replicates().draws.size()) - 1.0;
    Eigen::VectorXd left = last.residual.z.cwiseAbs().cwiseProduct(last.model.full().deviation());
    for (Eigen::Index k = 0; k < left.size(); ++k)
        if (student_two_sided(last.residual.z[k], freedom) > level)
            left[k] = 0.0;
    return left;
}

SearchResult search(ReplicateRunner &runner, const std::vector<const Candidate *> &candidates, const SearchStart &start,
                    const SearchOptions &options, const Progress &progress) {
    const auto attempt = [&](const SearchStart &from, double begin, double end) {
        ModelFit fits(
            runner, options,
            [&](const std::string &what, double part) {
                if (progress)
                    progress(what, begin + (end - begin) * part);
            },
            from.unexplained);
        return Search(fits, candidates, from).run();
    };
    SearchResult found = attempt(start, 0.0, kFirstSearch);
    const Eigen::VectorXd left = left_by(found, options.residual_level);
    // What may be chance has no pull to speak of.
    if (found.p_left > kBeyondDoubt || found.ended_early)
        return found;
    const auto take = [&](SearchResult &other) {
        other.screened = std::move(found.screened);
        found = std::move(other);
    };
    const double work = found.work;
    SearchResult second = attempt({start.model, start.steps, left}, kFirstSearch, kSecondSearch);
    if (second.models.empty()) {
        found.work = work + second.work;
        return found;
    }
    take(second);
    SearchResult third = attempt({found.model, found.steps, start.unexplained}, kSecondSearch, 1.0);
    const double all_work = work + found.work + third.work;
    if (third.p_left > options.residual_level)
        take(third);
    found.work = all_work;
    return found;
}

} // namespace clsp
