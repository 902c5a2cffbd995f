#include "inference/search.hpp"

#include "inference/least_squares.hpp"
#include "inference/swap.hpp"
#include "inference/thresholds.hpp"
#include "statistics/distributions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
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

struct Refined {
    const Candidate *candidate;
    double sign = 1.0;
    double strength = 0.5;
    double gain = 0.0;  // screening, then held-out
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
    keep_one_of_each(refined, [](const Refined &one) { return std::pair(one.candidate->id, one.candidate->form); });
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

// Leaves one form of each effect, by their fits: the catalogue's own unless another is clearly better.
void decide_forms(std::vector<Refined> &refined) {
    const auto worth = [](const Refined &form) {
        return (form.fitted ? form.gain : 0.0) - (form.candidate->form ? kFit.form_margin : 0.0);
    };
    const auto is_before = [&](const Refined &form, const Refined &other) {
        const double here = worth(form), there = worth(other);
        return here != there ? here > there : form.candidate->form < other.candidate->form;
    };
    std::vector<const Candidate *> out;
    for (const Refined &form : refined)
        if (std::any_of(refined.begin(), refined.end(),
                        [&](const Refined &other) { return are_forms(form, other) && is_before(other, form); }))
            out.push_back(form.candidate);
    const auto is_out = [&](const Refined &one) {
        return std::find(out.begin(), out.end(), one.candidate) != out.end();
    };
    refined.erase(std::remove_if(refined.begin(), refined.end(), is_out), refined.end());
}

// Where the capture does not tell which form an effect has, each of its parameters may be what it is in another one,
// too.
void include_other_forms(SearchState &state) {
    for (const ModelEffect &effect : state.model.effects) {
        const Candidate &candidate = *effect.candidate;
        for (const std::vector<double> &other : state.other_forms[candidate.id])
            for (FittedParameter &parameter : state.models.back().parameters)
                for (std::size_t p = 0; p < candidate.parameters.size(); ++p)
                    if (parameter.effect == candidate.id && parameter.name == candidate.parameters[p].name) {
                        parameter.low = std::min(parameter.low, other[p]);
                        parameter.high = std::max(parameter.high, other[p]);
                    }
    }
}

class Search {
  public:
    Search(ModelFit &fits, const std::vector<const Candidate *> &candidates, const SearchStart &start)
        : fits_(fits), runner_(fits.runner()), candidates_(candidates), start_(start) {}

    // Looks for what explains the capture; what it comes to, with its parameters measured, is asked for once.
    void find();
    SearchResult result();

    double p_left() const { return p_left_; }
    // By statistic, as SearchStart has it.
    Eigen::VectorXd left() const;
    const SearchState &found() const { return state_; }
    const std::vector<ScreenedEffect> &screened() const { return screened_; }

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
        // Where the model is known to be wrong somewhere, what is left elsewhere may be of the same cause.
        const GapTest &left = state.models.back().residual;
        return !left.detected || (start_.unexplained.size() && left.p_value > kFit.beyond_doubt);
    }

    // Little of the excess that the search began with is left, but what is left is seldom by chance.
    bool nearly_explained(const FittedModel &fitted) const {
        return fitted.residual.p_value <= kFit.seldom &&
               fits_.excess_square(fitted) <= kGrowth.little_left * begin_excess_;
    }

    ModelFit &fits_;
    // The excess is so large that effects bend on their way to it.
    bool is_large() const { return begin_excess_ > kScreening.large * static_cast<double>(runner_.count()); }

    double begin_excess_ = 0.0;
    int swaps_ = 0;        // that were tried while effects were added
    bool patient_ = false; // first effects are screened along lines in any case, and more of them get a fit
    std::vector<ScreenedEffect> screened_;
    ReplicateRunner &runner_;
    const std::vector<const Candidate *> &candidates_;
    const SearchStart &start_;
    std::optional<SearchState> begin_; // the start, fitted
    FittedModel baseline_;
    SearchState state_;
    double p_left_ = 1.0; // SearchResult::p_left
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
        refined.response = Response(candidate.weakest(0));
        refined.concerned = fits_.concerned(candidate.id);
        if (model.has(candidate) ||
            std::none_of(refined.concerned.begin(), refined.concerned.end(), [](bool c) { return c; }))
            continue;
        const auto known = state.screened.find(&candidate);
        refined.gain = fresh || known == state.screened.end() ? 1e300 : gain_of(known->second, refined.sign);
        if (refined.gain > kScreening.least_promise)
            result.push_back(std::move(refined));
    }
    if (!state.screened.empty() && !fresh) {
        sort_by_gain(result);
        keep_effects(result, kScreening.most);
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
                                             fits_.options().seed, kFit.search_seeds);
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
    const bool poor = best != result.end() && best->gain < kScreening.poor * target.squaredNorm();
    if ((poor || (patient_ && model.effects.size() == start_.model.effects.size())) &&
        fits_.excess_square(fitted) > kScreening.large * static_cast<double>(runner_.count()))
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
                lines.push_back(
                    {i, sign, 0.0,
                     sign == refined[i].sign ? refined[i].response : Response(refined[i].candidate->weakest(0))});
    }
    const double before = fits_.held_out(fitted);
    runner_.side_by_side(lines.size(), [&](ReplicateRunner &runner, std::size_t k) {
        Line &line = lines[k];
        const Refined &of = refined[line.place];
        if (runner.on_callers_thread())
            fits_.report(0.0, "screening " + of.candidate->id);
        possible([&] {
            for (const double asked : kScreening.line_strengths) {
                const double strength = of.candidate->snapped(0, asked, line.sign);
                if (!line.response.empty() && line.response.distance(strength) <= kStrengths.near)
                    continue;
                EffectModel with = state.model;
                with.add(*of.candidate, line.sign, strength);
                line.response.add(strength, simulate_change(runner, state.pool, with.settings(), of.concerned,
                                                            fits_.options().seed, kFit.search_seeds));
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
        return simulate_change(runner, pool, with.settings(), refined.concerned, fits_.options().seed,
                               kFit.search_seeds);
    };
    std::vector<double> strengths;
    for (const double asked : {0.0, 0.5, 1.0}) {
        const double strength = refined.candidate->snapped(0, asked, refined.sign);
        if ((refined.response.empty() || refined.response.distance(strength) > kStrengths.near) &&
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
        if (round == kGrowth.fit_rounds || refined.response.distance(refined.strength) < kStrengths.near)
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
    const double least_screened = kScreening.least_gain_part * (patient_ ? kScreening.patient_gain_part : 1.0);
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
        const std::uint32_t most =
            fits_.options().refined * (borne_out > 0.0 && !patient_ ? 1 : kScreening.more_patient);
        if (!is_form &&
            (screened < least_screened * borne_out || tried >= most ||
             (explained > kScreening.nearly_all * excess && screened < kScreening.least_beside_that * best_screened)))
            continue;
        fits_.report(at, "fitting " + candidate.candidate->id);
        candidate.fitted = possible([&] { refine(candidate, state.model, current, state.pool); });
        if (!candidate.fitted) {
            candidate.gain = 0.0;
            continue;
        }
        tried += is_form ? 0 : 1;
        explained = std::max(explained, candidate.gain);
        if (candidate.gain >= kGrowth.least_gain)
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
    const bool little = excess <= kGrowth.little_left * begin_excess_, stale = !state.screened.empty();
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
    const double margin = std::max(kGrowth.final_margin, kGrowth.final_margin_share * best_gain);
    const bool doubtful = best_gain < kGrowth.doubtful * excess;
    const auto is_near = [&](const Refined &candidate) { return candidate.gain >= best_gain - margin; };
    const auto contends = [&](const Refined &candidate) {
        return candidate.gain >= kGrowth.least_gain && (doubtful || is_near(candidate));
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
        options.known = known_changes(current, state.model, with);
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
    const double gain = fits_.gain_over(current, fits[best]);
    const double least_share = little ? kGrowth.least_share_of_little : kGrowth.least_share;
    if (gain < kGrowth.least_gain || (fits[best].residual.detected && gain < least_share * excess))
        return false;
    state.steps.push_back(described(refined, finalists, fits, best, current));
    state.model = std::move(models[best]);
    state.pool = std::move(pools[best]);
    state.models.push_back(std::move(fits[best]));
    return true;
}

bool is_far(const EffectModel &model, const Strength &s) {
    const HypothesisParameter &p = model.effects[s.effect].candidate->parameters[s.parameter];
    return p.weak != p.strong && s.strength > kStrengths.common;
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
        if (!is_at(s.strength, kStrengths.common) || common.models.back().step[static_cast<Eigen::Index>(k)] <= 0.0)
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
    while (!is_explained(state) && fits_.may_go_on()) {
        if (until == Until::kFar && goes_far(state))
            return false;
        // Where little is left, an early choice that was wrong is as likely as an effect that is missing.
        if (state.models.size() > 1 && nearly_explained(state.models.back()) && swaps_++ < kGrowth.most_swaps) {
            // As they are beside all the others: what was put aside early may have changed most.
            screen(state, state.models.back(), true);
            if (swap(fits_, state, state.progress))
                continue;
        }
        const double share = 0.5 * (state.progress_end - state.progress);
        const FittedModel current = state.models.empty() ? baseline : state.models.back();
        if (state.model.effects.size() >= most_effects(fits_, state) || !grow(state, current, state.progress, share))
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
            begin_->given = model.effects.size();
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
    // Forms were chosen when other effects were missing, and none says how near the others are.
    if (!state.models.empty() && fits_.may_go_on() && swap_forms(fits_, state, candidates_, state.progress) &&
        !is_explained(state))
        grow_all(state, baseline, Until::kDone);
    for (int swaps = 0; swaps < kGrowth.most_swaps && state.models.size() > 1 && is_explained(state); ++swaps) {
        SearchState before = state;
        if (!fits_.may_go_on() || !swap_confusable_effects(fits_, state, state.progress))
            break;
        if (!is_explained(state)) { // likelier, and yet not all
            state = std::move(before);
            break;
        }
    }
    if (is_explained(state) && state.models.size() > 1)
        prune(fits_, state, state.progress);
}

SearchState Search::explain(const FittedModel &baseline) {
    // A flexible effect far beyond its range imitates others that are within theirs, and those are likelier. But one
    // that the common range only holds back is not within it: the last step makes up for what is missing, or goes too
    // far, or another effect does.
    SearchState common;
    bool held_back = false;
    const auto common_explains = [&](const SearchState &wide) {
        fits_.set_strongest(kStrengths.common);
        common = first_state(kSecond, kEnd);
        grow_all(common, baseline, Until::kDone);
        finish(common, baseline);
        fits_.set_strongest(kStrengths.strongest);
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

void Search::find() {
    baseline_ = fits_.fit_baseline(kBegin);
    p_left_ = baseline_.residual.p_value;
    if (!baseline_.residual.detected)
        return;
    const SearchState begin = first_state(kBegin, kSecond);
    begin_excess_ = fits_.excess_square(begin.models.empty() ? baseline_ : begin.models.back());
    state_ = explain(baseline_);
    // Another first effect explains no more of what a part of the capture had left alone.
    const bool may_be_explained = start_.unexplained.size() == 0;
    if (may_be_explained && is_large() && fits_.may_go_on() && !is_explained(state_)) {
        patient_ = true;
        SearchState first = first_state(kSecond, kEnd);
        const FittedModel current = first.models.empty() ? baseline_ : first.models.back();
        if (grow(first, current, kSecond, kEnd - kSecond) && begins_elsewhere(first, state_)) {
            SearchState again = explain(baseline_);
            if (is_explained(again))
                state_ = std::move(again);
        }
    }
    if (state_.models.empty())
        return;
    fits_.set_strongest(state_.strongest);
    state_.model.hold(false);
    fits_.judge(state_.models.back(), state_.models.back().model.replicates(), fits_.options().model_replicates, kEnd,
                kEnd);
    fits_.confirm(state_.models.back(), kEnd);
    p_left_ = state_.models.back().residual.p_value;
}

SearchResult Search::result() {
    SearchResult result;
    if (!state_.models.empty()) {
        if (fits_.options().whole) {
            complete(fits_, state_, baseline_);
            fits_.measure_parameters(state_.models.back(), state_.model, kEnd);
            include_other_forms(state_);
        }
        for (FittedModel &model : state_.models)
            fits_.judge_by_all(model);
    }
    result.baseline = std::move(baseline_);
    result.p_left = p_left_;
    result.model = std::move(state_.model);
    result.steps = std::move(state_.steps);
    result.models = std::move(state_.models);
    result.ended_early = fits_.ended_early();
    fits_.report(1.0, "done");
    return result;
}

Eigen::VectorXd Search::left() const {
    FittedModel last = state_.models.empty() ? baseline_ : state_.models.back();
    fits_.judge_by_all(last);
    return left_by(last, fits_.options().residual_level);
}

// A search from a start that it keeps.
struct Attempt {
    Attempt(ReplicateRunner &runner, const std::vector<const Candidate *> &candidates, SearchStart from,
            const SearchOptions &options, const Progress &progress)
        : start(std::move(from)), fits(runner, options, progress, start.unexplained), search(fits, candidates, start) {
        search.find();
    }
    SearchStart start;
    ModelFit fits;
    Search search;
};

} // namespace

Eigen::VectorXd left_by(const FittedModel &last, double level) {
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
    std::vector<ScreenedEffect> screened;
    const auto attempt = [&](SearchStart from, double begin, double end) {
        auto made = std::make_unique<Attempt>(runner, candidates, std::move(from), options,
                                              [&, begin, end](const std::string &what, double part) {
                                                  if (progress)
                                                      progress(what, begin + (end - begin) * part);
                                              });
        if (screened.empty())
            screened = made->search.screened();
        return made;
    };
    const auto first = attempt(start, 0.0, kFirstSearch);
    // The parameters are measured of what is taken alone.
    const auto taken = [&](Attempt &one) {
        SearchResult result = one.search.result();
        result.screened = std::move(screened);
        result.work = first->fits.work();
        return result;
    };
    // What may be chance has no pull to speak of.
    if (first->search.p_left() > kFit.beyond_doubt || first->fits.ended_early())
        return taken(*first);
    const auto second = attempt({start.model, start.steps, first->search.left()}, kFirstSearch, kSecondSearch);
    if (second->search.found().models.empty())
        return taken(*first);
    const SearchState &found = second->search.found();
    const auto third = attempt({found.model, found.steps, start.unexplained}, kSecondSearch, 1.0);
    return taken(third->search.p_left() > options.residual_level ? *third : *second);
}

} // namespace clsp
