#include "inference/swap.hpp"

#include "inference/least_squares.hpp"
#include "inference/thresholds.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

namespace clsp {
namespace {

// A swap to be tried: the effect at `place` goes, the other one is put at the end. place: the number of effects where
// none goes.
struct Move {
    std::size_t place;
    const Candidate *candidate;
    double sign;
    double gain;    // of the squared distance, once all strengths follow, by the other's change at one strength
    double made_up; // the part of what is lost with the effect that goes
};

// The changes by the strengths of all effects but one.
Eigen::MatrixXd columns_without(const SearchState &state, std::size_t out) {
    const Eigen::MatrixXd &all = state.models.back().jacobian;
    Eigen::MatrixXd result(all.rows(), all.cols());
    Eigen::Index columns = 0;
    for (std::size_t p = 0; p < state.model.strengths.size(); ++p)
        if (state.model.strengths[p].effect != out)
            result.col(columns++) = all.col(static_cast<Eigen::Index>(p));
    return result.leftCols(columns);
}

// How the statistics change where an effect goes; nothing if the simulator refuses the others.
Eigen::VectorXd change_without(const ModelFit &fits, ReplicateRunner &runner, const SearchState &state,
                               std::size_t out) {
    Eigen::VectorXd result;
    possible([&] {
        result = simulate_change(runner, state.pool, state.model.without(out).settings(),
                                 fits.concerned(state.model.effects[out].candidate->id), fits.options().seed,
                                 kFit.search_seeds)
                     .mean;
    });
    return result;
}

// Where an effect begins in another one's place: where the catalogue has it, if that is one value, else half way.
double begin_of(const Candidate &candidate, double sign) {
    const HypothesisParameter &first = candidate.parameters.front();
    return first.weak == first.strong ? candidate.strength(0, candidate.usual(0, sign), sign) : 0.5;
}

// How the statistics change where an effect stands in the place of another, beside what `loss` changes without it;
// nothing if the simulator refuses.
Eigen::VectorXd change_in_place(const ModelFit &fits, ReplicateRunner &runner, const SearchState &state,
                                const Move &move, const Eigen::VectorXd &loss) {
    EffectModel model = state.model.without(move.place);
    model.add(*move.candidate, move.sign, begin_of(*move.candidate, move.sign));
    std::vector<bool> concerned = fits.concerned(move.candidate->id);
    const std::vector<bool> besides = fits.concerned(state.model.effects[move.place].candidate->id);
    for (std::size_t i = 0; i < concerned.size(); ++i)
        concerned[i] = concerned[i] || besides[i];
    Eigen::VectorXd result;
    possible([&] {
        result =
            simulate_change(runner, state.pool, model.settings(), concerned, fits.options().seed, kFit.search_seeds)
                .mean -
            loss;
    });
    return result;
}

// The screened effects that promise most in the place of each effect that the search has added, and beside all of them.
std::vector<Move> moves_of(const ModelFit &fits, const SearchState &state, bool adds) {
    const FittedModel &whole = state.models.back();
    const Covariance &covariance = whole.model.full();
    const std::size_t effects = state.model.effects.size();
    const double now =
        residual_square(whiten_columns(covariance, whole.jacobian), covariance.whiten(fits.differences(whole).mean()));
    std::vector<std::vector<Move>> of_place(effects + (adds ? 1 : 0));
    fits.runner().side_by_side(of_place.size() - state.given, [&](ReplicateRunner &runner, std::size_t i) {
        const std::size_t place = state.given + i;
        Eigen::VectorXd target = fits.differences(whole).mean();
        Eigen::MatrixXd others = whole.jacobian;
        Eigen::VectorXd loss;
        if (place < effects) {
            loss = change_without(fits, runner, state, place);
            if (loss.size() == 0)
                return;
            target -= loss;
            others = columns_without(state, place);
        }
        target = covariance.whiten(target);
        others = whiten_columns(covariance, others);
        const double lost = std::max(1e-9, residual_square(others, target) - now);
        std::vector<Move> &moves = of_place[place];
        for (const auto &[candidate, screened] : state.screened) {
            if (state.model.has(*candidate))
                continue;
            const Promise promise = promise_of(covariance.whiten(screened), others, target);
            const double sign = promise.coefficient < 0.0 ? -1.0 : 1.0;
            if (sign > 0.0 || candidate->has_direction())
                moves.push_back({place, candidate, sign, promise.gain, promise.gain / lost});
        }
        const auto keep = [&moves](std::size_t most) {
            std::sort(moves.begin(), moves.end(), [](const Move &a, const Move &b) {
                return a.gain != b.gain ? a.gain > b.gain : before(*a.candidate, *b.candidate);
            });
            keep_one_of_each(moves,
                             [](const Move &move) { return std::pair(move.candidate->id, move.candidate->form); });
            if (moves.size() > most)
                moves.erase(moves.begin() + static_cast<std::ptrdiff_t>(most), moves.end());
        };
        if (place == effects) {
            keep(kSwap.most_added);
            return;
        }
        // They were screened beside the effect that goes: what each changes without it is simulated.
        keep(kSwap.most_simulated);
        for (Move &move : moves) {
            const Eigen::VectorXd change = change_in_place(fits, runner, state, move, loss);
            const Promise promise = change.size() ? promise_of(covariance.whiten(change), others, target) : Promise{};
            move.gain = promise.coefficient > 0.0 ? promise.gain : 0.0;
            move.made_up = move.gain / lost;
        }
        keep(kSwap.most_in_place);
    });
    std::vector<Move> result;
    for (const std::vector<Move> &moves : of_place)
        result.insert(result.end(), moves.begin(), moves.end());
    return result;
}

// By how much a quick fit may leave more than a whole one.
double quick_error(const ModelFit &fits) {
    return kSwap.quick_error * static_cast<double>(fits.runner().count());
}

// What a swap must leave to be worth a fit, where the squared distance is `now`.
double worth_of(const ModelFit &fits, double now) {
    return (1.0 - kSwap.least_explained) * now + quick_error(fits);
}

// What a few rounds of a fit reach, by common random numbers from the state's model, whose squared distance is `now`.
GaussNewtonFit quick_fit(ReplicateRunner &runner, const ModelFit &fits, const EffectModel &model,
                         const SearchState &state, double now) {
    const FittedModel &start = state.models.back();
    GaussNewtonOptions options;
    options.seed = fits.options().seed;
    options.seeds = kFit.search_seeds;
    options.secant_rounds = kSwap.quick_rounds;
    options.near = options.far = kStrengths.near;
    options.strongest = fits.strongest();
    options.give_up_square = kSwap.give_up * now;
    options.least_gain = kSwap.least_round_gain;
    return gauss_newton(runner, model, {start.model.full(), state.pool}, known_changes(start, state.model, model),
                        options, {});
}

// A move, the model with it, and the squared distance that a quick fit leaves.
struct Promising {
    const Move *move;
    EffectModel model;
    double square;
};

// Of some moves the best and those that a quick fit does not tell from it, by less than `alike`, where they leave a
// squared distance below `least`.
std::vector<Promising> best_moves(ModelFit &fits, const SearchState &state, const std::vector<Move> &tried,
                                  double least, double alike, double at) {
    const FittedModel &whole = state.models.back();
    const double now = fits.square_by(whole.model.full(), whole);
    std::vector<GaussNewtonFit> reached(tried.size());
    fits.runner().side_by_side(tried.size(), [&](ReplicateRunner &runner, std::size_t i) {
        const Move &move = tried[i];
        const bool adds = move.place == state.model.effects.size();
        const std::string what =
            "swapping " + (adds ? std::string("nothing") : state.model.effects[move.place].candidate->id);
        if (runner.on_callers_thread())
            fits.report(at, what + " for " + move.candidate->id);
        EffectModel model = state.model;
        if (!adds)
            model = model.without(move.place);
        model.add(*move.candidate, move.sign, adds ? 0.0 : begin_of(*move.candidate, move.sign));
        possible([&] {
            reached[i] = quick_fit(runner, fits, model, state, now);
            reached[i].square += adds ? kGrowth.least_gain : 0.0;
        });
    });
    std::vector<Promising> result;
    for (std::size_t i = 0; i < tried.size(); ++i)
        if (reached[i].square < least)
            result.push_back({&tried[i], std::move(reached[i].model), reached[i].square});
    std::stable_sort(result.begin(), result.end(),
                     [](const Promising &a, const Promising &b) { return a.square < b.square; });
    result.erase(std::remove_if(result.begin(), result.end(),
                                [most = alike + (result.empty() ? 0.0 : result.front().square)](const Promising &one) {
                                    return one.square > most;
                                }),
                 result.end());
    if (result.size() > kSwap.most_whole)
        result.erase(result.begin() + kSwap.most_whole, result.end());
    return result;
}

// An effect that would have done nearly as well in the place of the one that is there: the data may not tell which.
void note_rival(SearchStep &step, const std::string &effect, const FittedModel &fitted, double behind) {
    double chosen = 0.0;
    for (const RankedEffect &ranked : step.ranking)
        if (ranked.effect == step.added)
            chosen = ranked.gain;
    RankedEffect rival;
    rival.effect = effect;
    rival.values = fitted.effects.back().values;
    rival.distance_after = fitted.residual.distance;
    rival.simulated = true;
    rival.gain = std::min(chosen, chosen - behind);
    const auto known = std::find_if(step.ranking.begin(), step.ranking.end(),
                                    [&](const RankedEffect &ranked) { return ranked.effect == effect; });
    if (known == step.ranking.end())
        step.ranking.push_back(rival);
    else if (known->gain < rival.gain)
        *known = rival;
    weigh(step.ranking);
}

// A state's models before an effect, and none yet for those from there on.
std::vector<FittedModel> models_until(const SearchState &state, std::size_t effect, std::size_t count) {
    std::vector<FittedModel> result(state.models.begin(), state.models.begin() + static_cast<std::ptrdiff_t>(effect));
    result.resize(count);
    return result;
}

// No form of that effect is tried until effects are screened anew.
void forget(SearchState &state, const std::string &effect) {
    for (auto one = state.screened.begin(); one != state.screened.end();)
        one = one->first->id == effect ? state.screened.erase(one) : std::next(one);
}

// A state after a move, and what it is better by; less than 0: what it is worse by.
struct Moved {
    const Move *move;
    SearchState state;
    double gain;
};

// The state after a move; nothing where the simulator refuses it, or what it leaves is not worth being judged.
// explained: nothing is left to be gained.
std::optional<Moved> moved(ModelFit &fits, SearchState &state, const Move &move, EffectModel model, bool explained,
                           double at) {
    FittedModel &whole = state.models.back();
    SearchState other;
    other.given = state.given;
    other.screened = state.screened;
    if (move.place < state.model.effects.size()) // of two that do as well, a fit's rest would swap again and again
        forget(other, state.model.effects[move.place].candidate->id);
    other.other_forms = state.other_forms;
    other.progress = state.progress;
    other.progress_end = state.progress_end;
    other.strongest = state.strongest;
    other.model = std::move(model);
    FittedModel fitted;
    const Origin origin{whole.model.full(), state.pool};
    FitOptions options;
    options.replicates = fits.options().model_replicates;
    options.from = options.to = at;
    options.near = true;
    options.known = known_changes(whole, state.model, other.model, true);
    options.worth = worth_of(fits, fits.square_by(whole.model.full(), whole));
    if (!possible([&] { fitted = fits.fit(other.model, other.pool, options, &origin); }) || fitted.effects.empty())
        return {};
    if (fitted.score < whole.score + kSwap.give_up_form)
        fits.polish(other.model, other.pool, fitted, at);
    // A score depends on how many replicates there are.
    const auto count = static_cast<std::uint32_t>(whole.model.replicates().draws.size());
    const std::uint32_t least = (explained ? kFit.confirming : 1) * fits.options().model_replicates;
    for (FittedModel *one : {&whole, &fitted})
        fits.judge(*one, one->model.replicates(), std::max(count, least), at, at);
    double gain = whole.score - fitted.score;
    if (explained) {
        // Both have the capture's noise, so what their covariances differ by is chance.
        gain = fits.gain_by_common(whole, fitted) + state.model.unlikelihood(move.place) -
               other.model.unlikelihood(other.model.effects.size() - 1);
    }
    RankedEffect ranked;
    ranked.effect = move.candidate->id;
    ranked.values = fitted.effects.back().values;
    ranked.distance_after = fitted.residual.distance;
    ranked.simulated = true;
    ranked.gain = gain;
    SearchStep step;
    step.added = ranked.effect;
    other.steps = state.steps;
    const std::size_t begin = move.place;
    if (begin < state.models.size()) {
        // What the effect that goes out was worth, and more.
        step.ranking = state.steps[begin].ranking;
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
    other.models = models_until(state, begin, other.steps.size());
    other.steps.back().residual = fitted.residual;
    other.models.back() = std::move(fitted);
    return Moved{&move, std::move(other), gain};
}

// Makes the best of some moves by their own replicates; false if none is better than what is there. explained: nothing
// is left to be gained. Then the likelier is better, however little, as no parameter comes to it; and likelier is what
// is as the catalogue has it.
bool make_best(ModelFit &fits, SearchState &state, std::vector<Promising> moves, bool explained, double at) {
    std::vector<Moved> tried;
    for (Promising &one : moves)
        if (std::optional<Moved> other = moved(fits, state, *one.move, std::move(one.model), explained, at))
            tried.push_back(std::move(*other));
    const auto best =
        std::max_element(tried.begin(), tried.end(), [](const Moved &a, const Moved &b) { return a.gain < b.gain; });
    const bool better = best != tried.end() && best->gain >= (explained ? 0.0 : kGrowth.least_gain);
    for (const Moved &one : tried) {
        const std::size_t place = one.move->place;
        const FittedModel &fitted = one.state.models.back();
        if (!better && place < state.steps.size()) {
            note_rival(state.steps[place], one.move->candidate->id, fitted, -one.gain);
        } else if (better && &one != &*best && place == best->move->place) {
            // What it has lost against stands there now. Other places were judged beside an effect that is gone.
            note_rival(best->state.steps.back(), one.move->candidate->id, fitted, best->gain - one.gain);
            forget(best->state, one.move->candidate->id);
        }
    }
    if (better)
        state = std::move(best->state);
    return better;
}

// The squared distance that is lost at once with an effect, as far as the others' strengths do not make up for it.
double loss_without(const ModelFit &fits, const SearchState &state, std::size_t out, const EffectModel &others) {
    const FittedModel &whole = state.models.back();
    const Covariance &covariance = whole.model.full();
    const std::vector<bool> concerned = fits.concerned(state.model.effects[out].candidate->id);
    const Change loss = simulate_change(fits.runner(), state.pool, others.settings(), concerned, fits.options().seed,
                                        fits.options().pool_seeds);
    return residual_square(whiten_columns(covariance, columns_without(state, out)), covariance.whiten(loss.mean));
}

} // namespace

bool swap(ModelFit &fits, SearchState &state, double at) {
    const FittedModel &whole = state.models.back();
    const bool adds = whole.residual.detected && state.model.effects.size() < most_effects(fits, state);
    const double least = worth_of(fits, fits.square_by(whole.model.full(), whole));
    const std::vector<Move> tried = moves_of(fits, state, adds);
    return make_best(fits, state, best_moves(fits, state, tried, least, kSwap.quickly_alike, at), false, at);
}

bool swap_confusable_effects(ModelFit &fits, SearchState &state, double at) {
    std::vector<Move> tried = moves_of(fits, state, false);
    tried.erase(
        std::remove_if(tried.begin(), tried.end(), [](const Move &move) { return move.made_up < kSwap.confusable; }),
        tried.end());
    if (tried.empty())
        return false;
    // Beside what the same few random numbers leave of the effects that are there.
    const FittedModel &whole = state.models.back();
    const double now = fits.square_by(whole.model.full(), whole);
    double least = now;
    if (!possible([&] { least = quick_fit(fits.runner(), fits, state.model, state, now).square; }))
        return false;
    const double alike = quick_error(fits);
    return make_best(fits, state, best_moves(fits, state, tried, least + alike, alike, at), true, at);
}

bool swap_forms(ModelFit &fits, SearchState &state, const std::vector<const Candidate *> &candidates, double at) {
    bool changed = false;
    for (std::size_t place = 0; place < state.model.effects.size(); ++place) {
        const Candidate &first = *state.model.effects[place].candidate;
        struct Tried {
            double behind; // what it is worse by than the one that is taken
            std::vector<double> values;
        };
        std::vector<Tried> tried;
        // Of a wrong model distances count by what it leaves of each statistic (Birge's ratio).
        double error = 1.0;
        for (const Candidate *const other : candidates) {
            const Candidate &form = *other;
            if (form.id != first.id || form.form == first.form)
                continue;
            fits.report(at, "another form of " + form.id);
            FittedModel &whole = state.models.back();
            EffectModel model = state.model;
            model.effects[place].candidate = &form;
            Pool pool;
            FittedModel fitted;
            const Origin origin{whole.model.full(), state.pool};
            const double left = fits.square_by(whole.model.full(), whole);
            error = std::max(1.0, left / static_cast<double>(fits.runner().count()));
            FitOptions options;
            options.replicates = fits.options().model_replicates;
            options.from = options.to = at;
            options.known = known_changes(whole, state.model, model, true);
            options.worth = left + kSwap.give_up_form * error;
            if (!possible([&] { fitted = fits.fit(model, pool, options, &origin); }) || fitted.effects.empty())
                continue;
            // A score depends on how many replicates there are.
            const auto count = static_cast<std::uint32_t>(fitted.model.replicates().draws.size());
            fits.judge(whole, whole.model.replicates(), count, at, at);
            if (fitted.score > whole.score + kSwap.give_up_form * error)
                continue;
            if (fitted.residual.p_value <= kFit.seldom)
                fits.polish(model, pool, fitted, at);
            // What is not clearly worse is as likely, and the catalogue's own stays unless another is clearly better.
            const double gain = whole.score - fitted.score;
            const auto margin = [](const Candidate &of) { return of.form ? kFit.form_margin : 0.0; };
            const bool is_taken = gain >= margin(form) - margin(*state.model.effects[place].candidate);
            const FittedModel &passed_over = is_taken ? whole : fitted;
            for (Tried &one : tried)
                one.behind += is_taken ? gain : 0.0;
            tried.push_back({is_taken ? gain : -gain, passed_over.effects[place].values});
            if (!is_taken)
                continue;
            for (RankedEffect &ranked : state.steps[place].ranking)
                if (ranked.effect == form.id)
                    ranked.values = fitted.effects[place].values;
            state.model = std::move(model);
            state.pool = std::move(pool);
            state.models = models_until(state, place, state.models.size());
            state.steps.back().residual = fitted.residual;
            state.models.back() = std::move(fitted);
            changed = true;
        }
        std::vector<std::vector<double>> &as_likely = state.other_forms[first.id];
        as_likely.clear();
        for (Tried &one : tried)
            if (one.behind < kFit.form_margin * error)
                as_likely.push_back(std::move(one.values));
    }
    return changed;
}

void prune(ModelFit &fits, SearchState &state, double at) {
    for (std::size_t out = 0; out + 1 < state.model.effects.size();) {
        EffectModel others = state.model.without(out);
        Pool pool;
        FittedModel fitted;
        const auto explains = [&] {
            const FittedModel &whole = state.models.back();
            const Covariance &covariance = whole.model.full();
            const double now = fits.square_by(covariance, whole);
            const Origin origin{covariance, state.pool};
            FitOptions options;
            options.replicates = fits.options().model_replicates;
            options.from = options.to = at;
            options.known = known_changes(whole, state.model, others);
            options.worth = now + kSwap.least_needed;
            fitted = fits.fit(others, pool, options, &origin);
            if (!fitted.effects.empty())
                fits.confirm(fitted, at);
            return !fitted.effects.empty() && !fitted.residual.detected &&
                   fits.square_by(covariance, fitted) <= now + kSwap.least_worth;
        };
        bool needless = false;
        possible([&] { needless = loss_without(fits, state, out, others) <= kSwap.least_needed && explains(); });
        if (!needless) {
            ++out;
            continue;
        }
        state.model = std::move(others);
        state.pool = std::move(pool);
        state.models = models_until(state, out, state.models.size() - 1);
        state.steps.erase(state.steps.begin() + static_cast<std::ptrdiff_t>(out));
        state.given -= out < state.given ? 1 : 0;
        state.steps.back().residual = fitted.residual;
        state.models.back() = std::move(fitted);
    }
}

} // namespace clsp
