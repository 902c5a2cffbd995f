// Early choices that were wrong or needless: a state is begun with them, and must come out right. Captures of the
// simulator's own.
#include "diagnosis/inference/attribution_support.hpp"
#include "inference/candidate.hpp"
#include "inference/swap.hpp"
#include "inference/thresholds.hpp"
#include "measure/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <map>
#include <string>
#include <vector>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

// "tilt", which makes light rise to one side, and another one that bends it on the way.
std::vector<Hypothesis> tilts(const char *other, double bent) {
    const auto tilt = [](const char *id, double bend) {
        Hypothesis result;
        result.id = id;
        result.stage = "optics";
        result.parameters = {{"share", "1", 0.0, 1.0, 0.05, 0.5}};
        result.apply = [bend](const HypothesisFrame &frame) {
            for (std::uint32_t y = 0, at = 0; y < frame.layout->height; ++y)
                for (std::uint32_t x = 0; x < frame.layout->width; ++x, ++at) {
                    const double u = double(x) / frame.layout->width - 0.5;
                    frame.pixels[at] *= static_cast<float>(1.0 + frame.values[0] * (u + bend * (u * u - 1.0 / 12.0)));
                }
        };
        return result;
    };
    return {tilt("tilt", 0.0), tilt(other, bent)};
}

class Swap : public testing::Test {
  protected:
    SearchOptions options() const {
        SearchOptions result;
        result.seed = 3;
        result.null_replicates = 24;
        return result;
    }
    static FitOptions all_replicates(const ModelFit &fits) {
        FitOptions result;
        result.replicates = fits.options().model_replicates;
        return result;
    }
    std::vector<const Candidate *> every() const {
        std::vector<const Candidate *> result;
        for (const Candidate &one : all)
            result.push_back(&one);
        return result;
    }
    const Candidate &candidate(const std::string &id) const {
        return *std::find_if(all.begin(), all.end(), [&](const Candidate &c) { return c.id == id; });
    }
    // The effects in this order, fitted one after the other; those named besides are screened.
    SearchState state_of(ModelFit &fits, const std::vector<std::string> &effects,
                         const std::vector<std::string> &screened, double first_strength = 0.5) {
        SearchState state;
        for (const std::string &id : effects) {
            state.model.add(candidate(id), 1.0, state.steps.empty() ? first_strength : 0.5);
            state.models.push_back(fits.fit(state.model, state.pool, all_replicates(fits)));
            SearchStep step;
            step.added = id;
            step.residual = state.models.back().residual;
            RankedEffect ranked;
            ranked.effect = id;
            ranked.gain = 1000.0;
            step.ranking = {ranked};
            weigh(step.ranking);
            state.steps.push_back(step);
        }
        for (const std::string &id : screened) {
            EffectModel with = state.model;
            with.add(candidate(id), 1.0, 0.5);
            state.screened[&candidate(id)] = simulate_change(fits.runner(), state.pool, with.settings(),
                                                             fits.concerned(id), fits.options().seed, kFit.search_seeds)
                                                 .mean;
        }
        return state;
    }
    static std::vector<std::string> names(const SearchState &state) {
        std::vector<std::string> result;
        for (const ModelEffect &effect : state.model.effects)
            result.push_back(effect.candidate->id);
        return result;
    }
    // Steps, models and effects say the same.
    static void expect_consistent(ModelFit &fits, SearchState state, const FittedModel &baseline) {
        const double work = fits.work();
        complete(fits, state, baseline);
        // Two halves of a capture for each step, and what its levels take: no replicates.
        EXPECT_LE(fits.work() - work, 1.5 * static_cast<double>(state.models.size() - 1));
        ASSERT_EQ(state.steps.size(), state.model.effects.size());
        ASSERT_EQ(state.models.size(), state.model.effects.size());
        for (std::size_t n = 0; n < state.steps.size(); ++n) {
            EXPECT_EQ(state.steps[n].added, state.model.effects[n].candidate->id);
            EXPECT_EQ(state.steps[n].ranking.front().effect, state.steps[n].added);
            EXPECT_EQ(state.models[n].effects.size(), n + 1);
            EXPECT_EQ(state.steps[n].residual.distance, state.models[n].residual.distance);
        }
        EXPECT_EQ(state.pool.effects, state.models.back().effects);
    }
    std::vector<Candidate> all = candidates({}, {});
};

// 14 of 16 captures end so.
TEST_F(Swap, AnEffectThatResemblesTheTrueOne) {
    ReplicateRunner runner(context(), simulated({{"crosstalk", {0.22}}, {"row_noise", {2.0}}}, kCaptureSeed + 2), {},
                           2);
    ModelFit fits(runner, options(), {});
    const FittedModel baseline = fits.fit_baseline(0.0);
    SearchState state = state_of(fits, {"linewidth", "row_noise"}, {"crosstalk", "defocus", "prnu"});
    ASSERT_TRUE(state.models.back().residual.detected);
    EXPECT_TRUE(swap(fits, state, 0.0));
    EXPECT_EQ(names(state), (std::vector<std::string>{"row_noise", "crosstalk"}));
    EXPECT_FALSE(state.models.back().residual.detected);
    fits.measure_parameters(state.models.back(), state.model, 0.0);
    EXPECT_NEAR(state.models.back().parameters.back().value, 0.22, 0.03);
    expect_consistent(fits, state, baseline);
}

TEST_F(Swap, WhatIsMissingIsAdded) {
    ReplicateRunner runner(context(), simulated({{"vignetting", {0.3}}, {"crosstalk", {0.15}}}, kCaptureSeed + 9), {},
                           2);
    for (const std::uint32_t most : {1u, 6u}) {
        SearchOptions limited = options();
        limited.max_effects = most;
        ModelFit fits(runner, limited, {});
        const FittedModel baseline = fits.fit_baseline(0.0);
        SearchState state = state_of(fits, {"vignetting"}, {"crosstalk", "prnu"});
        ASSERT_TRUE(state.models.back().residual.detected);
        EXPECT_EQ(swap(fits, state, 0.0), most > 1);
        expect_consistent(fits, state, baseline);
        if (most == 1)
            continue;
        EXPECT_EQ(names(state), (std::vector<std::string>{"vignetting", "crosstalk"}));
        EXPECT_FALSE(state.models.back().residual.detected);
        fits.measure_parameters(state.models.back(), state.model, 0.0);
        EXPECT_NEAR(state.models.back().parameters.back().value, 0.15, 0.02);
    }
}

TEST_F(Swap, NothingForWhatIsRight) {
    ReplicateRunner runner(context(), simulated({{"crosstalk", {0.22}}, {"row_noise", {2.0}}}, kCaptureSeed + 2), {},
                           2);
    ModelFit fits(runner, options(), {});
    const FittedModel baseline = fits.fit_baseline(0.0);
    SearchState state = state_of(fits, {"crosstalk", "row_noise"}, {"linewidth", "pixel_integration", "prnu"});
    EXPECT_FALSE(swap(fits, state, 0.0));
    EXPECT_EQ(names(state), (std::vector<std::string>{"crosstalk", "row_noise"}));
    expect_consistent(fits, state, baseline);
}

// Two names for one thing: nothing is swapped, but the choice is no certain one any more. 13 of 16 captures end so.
TEST_F(Swap, WhatDoesAsWellIsARival) {
    const std::vector<Hypothesis> twins = tilts("slope", 0.0);
    ReplicateRunner runner(context(), simulated({{"tilt", {0.3}}, {"row_noise", {2.0}}}, kCaptureSeed + 3, twins),
                           twins, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    all = candidates(twins, {});
    SearchState state = state_of(fits, {"tilt", "row_noise"}, {"slope"});
    EXPECT_FALSE(swap(fits, state, 0.0));
    EXPECT_EQ(names(state), (std::vector<std::string>{"tilt", "row_noise"}));
    const std::vector<RankedEffect> &ranking = state.steps.front().ranking;
    ASSERT_EQ(2u, ranking.size());
    EXPECT_EQ(1u, state.steps.back().ranking.size());
    for (const RankedEffect &ranked : ranking) {
        EXPECT_TRUE(ranked.effect == "tilt" || ranked.effect == "slope");
        EXPECT_GT(ranked.probability, 0.1);
    }
    DiagnosisResult result;
    name_effects(state.steps, {}, result);
    EXPECT_EQ(Verdict::kAmbiguous, result.verdict);
    EXPECT_EQ((std::vector<std::string>{"tilt", "row_noise"}), result.effects);
    EXPECT_EQ(2u, result.equivalent.size());
}

// Of two that leave nothing the likelier is taken, though it gains less than a parameter is worth: none is added.
TEST_F(Swap, TheLikelierOfTwoThatExplainAll) {
    const std::vector<Hypothesis> twins = tilts("bend", 0.01);
    ReplicateRunner runner(context(), simulated({{"tilt", {0.3}}, {"row_noise", {2.0}}}, kCaptureSeed + 3, twins),
                           twins, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    all = candidates(twins, {});
    SearchState state = state_of(fits, {"bend", "row_noise"}, {"tilt"});
    ASSERT_FALSE(state.models.back().residual.detected);
    state.screened[&candidate("bend")] = state.screened.at(&candidate("tilt")); // before it was added
    EXPECT_TRUE(swap_confusable_effects(fits, state, 0.0));
    EXPECT_EQ(names(state), (std::vector<std::string>{"row_noise", "tilt"}));
    EXPECT_EQ(state.screened.count(&candidate("bend")), 0u) << "they would swap again and again";
    const std::vector<RankedEffect> &ranking = state.steps.back().ranking;
    ASSERT_EQ(2u, ranking.size());
    EXPECT_EQ("tilt", ranking[0].effect);
    EXPECT_GT(ranking[0].gain - ranking[1].gain, 0.0);
    EXPECT_LT(ranking[0].gain - ranking[1].gain, kGrowth.least_gain);
    // And it stays.
    state.screened = {{&candidate("bend"), state.models.back().jacobian.col(1)}};
    EXPECT_FALSE(swap_confusable_effects(fits, state, 0.0));
}

// Of two that are likelier than what is there one is taken. The other has lost against it: it is its rival, and is not
// tried there again.
TEST_F(Swap, WhatLosesAPlaceIsARivalThere) {
    std::vector<Hypothesis> three = tilts("bend", 0.01);
    three.push_back(tilts("bow", 0.006).back());
    ReplicateRunner runner(context(), simulated({{"tilt", {0.3}}, {"row_noise", {2.0}}}, kCaptureSeed + 6, three),
                           three, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    all = candidates(three, {});
    SearchState state = state_of(fits, {"bend", "row_noise"}, {"tilt", "bow"});
    state.screened[&candidate("tilt")] = state.screened[&candidate("bow")] =
        state.models.back().jacobian.col(0); // before the other one was added
    EXPECT_TRUE(swap_confusable_effects(fits, state, 0.0));
    EXPECT_EQ(names(state), (std::vector<std::string>{"row_noise", "tilt"}));
    EXPECT_EQ(state.screened.count(&candidate("bow")), 0u);
    std::map<std::string, double> gains;
    for (const RankedEffect &ranked : state.steps.back().ranking)
        gains[ranked.effect] = ranked.gain;
    ASSERT_EQ(3u, gains.size());
    EXPECT_GT(gains["tilt"], gains["bow"]);
    EXPECT_GT(gains["bow"], gains["bend"]);
    const double work = fits.work();
    EXPECT_FALSE(swap_confusable_effects(fits, state, 0.0));
    EXPECT_LT(fits.work() - work, 10.0) << "nothing is left to try";
}

// What changes nothing beside an effect that is there may do all that it does in its place.
TEST_F(Swap, WhatAnEffectDoesIsSeenInThePlace) {
    std::vector<Hypothesis> twins = tilts("bend", 0.01);
    twins.front().apply = [tilt = twins.front().apply](const HypothesisFrame &frame) {
        const std::uint32_t width = frame.layout->width;
        double left = 0.0, right = 0.0;
        for (std::uint32_t i = 0; i < width * frame.layout->height; ++i)
            (i % width < width / 2 ? left : right) += frame.pixels[i];
        if (right < 1.05 * left)
            tilt(frame);
    };
    ReplicateRunner runner(context(), simulated({{"tilt", {0.3}}, {"row_noise", {2.0}}}, kCaptureSeed + 3, twins),
                           twins, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    all = candidates(twins, {});
    SearchState state = state_of(fits, {"bend", "row_noise"}, {"tilt"});
    // Beside the other one it does nothing, but for frames whose speckle leans to the left.
    ASSERT_LT(state.screened.at(&candidate("tilt")).cwiseAbs().maxCoeff(), 0.3);
    EXPECT_TRUE(swap_confusable_effects(fits, state, 0.0));
    EXPECT_EQ(names(state), (std::vector<std::string>{"row_noise", "tilt"}));
}

// A pixel of a third of its area does what little crosstalk does, and the catalogue has whole ones.
TEST_F(Swap, WhatTheCatalogueHasIsLikelier) {
    ReplicateRunner runner(context(), simulated({{"crosstalk", {0.07}}, {"row_noise", {2.0}}}, kCaptureSeed + 3), {},
                           2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    SearchState state = state_of(fits, {"pixel_integration", "row_noise"}, {"crosstalk"});
    ASSERT_FALSE(state.models.back().residual.detected);
    EXPECT_GT(state.model.unlikelihood(0), 10.0);
    EXPECT_EQ(state.model.unlikelihood(1), 0.0);
    EXPECT_TRUE(swap_confusable_effects(fits, state, 0.0));
    EXPECT_EQ(names(state), (std::vector<std::string>{"row_noise", "crosstalk"}));
    SearchState right = state_of(fits, {"crosstalk", "row_noise"}, {"pixel_integration"});
    EXPECT_FALSE(swap_confusable_effects(fits, right, 0.0));
    EXPECT_GT(right.steps.front().ranking.front().probability, 0.95);
}

// What an explained rung has told stays, and so does what it changes: no fit simulates that again.
TEST_F(Swap, WhatIsHeldKeepsItsChanges) {
    ReplicateRunner runner(context(), simulated({{"vignetting", {0.3}}, {"row_noise", {2.0}}}, kCaptureSeed + 5), {},
                           2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    const SearchState state = state_of(fits, {"row_noise"}, {});
    EffectModel free = state.model;
    free.add(candidate("vignetting"), 1.0, 0.5);
    EXPECT_EQ(known_changes(state.models.back(), state.model, free, true).front().size(), 0);
    EffectModel held = state.model;
    held.hold(true);
    held.add(candidate("vignetting"), 1.0, 0.5);
    const Origin origin{state.models.back().model.full(), state.pool};
    FitOptions options = all_replicates(fits);
    options.known = known_changes(state.models.back(), state.model, free);
    Pool pool;
    const FittedModel freely = fits.fit(free, pool, options, &origin), kept = fits.fit(held, pool, options, &origin);
    EXPECT_NE(freely.jacobian.col(0), options.known.front()) << "two rounds, and the second has its own";
    EXPECT_EQ(kept.jacobian.col(0), options.known.front());
    EXPECT_EQ(held.strengths.front().strength, state.model.strengths.front().strength);
    EXPECT_FALSE(kept.residual.detected);
}

// A residual in doubt is judged by twice as many replicates, and one without any doubt stays as it is.
TEST_F(Swap, ADoubtfulResidualIsConfirmed) {
    ReplicateRunner runner(context(), simulated({{"vignetting", {0.3}}}, kCaptureSeed + 12), {}, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    SearchState state = state_of(fits, {"vignetting"}, {});
    const FittedModel fitted = state.models.back();
    const std::size_t count = fitted.model.replicates().draws.size();
    ASSERT_EQ(count, fits.options().model_replicates);
    for (const double p : {0.5, 1e-9}) {
        FittedModel sure = fitted;
        sure.residual.p_value = p;
        fits.confirm(sure, 0.0);
        EXPECT_EQ(sure.model.replicates().draws.size(), count) << p;
        EXPECT_EQ(sure.residual.p_value, p);
    }
    for (const double p : {0.02, 0.001}) {
        FittedModel doubtful = fitted;
        doubtful.residual.p_value = p;
        doubtful.residual.detected = p < fits.options().residual_level;
        fits.confirm(doubtful, 0.0);
        EXPECT_EQ(doubtful.model.replicates().draws.size(), 2 * count) << p;
        EXPECT_EQ(doubtful.score, fitted.score);
        // The model is right: what p was made to say does not stay.
        EXPECT_GT(doubtful.residual.p_value, fits.options().residual_level);
        EXPECT_FALSE(doubtful.residual.detected);
        // The same replicates, and others.
        for (std::size_t i = 0; i < count; ++i)
            EXPECT_EQ(doubtful.model.replicates().draws[i].first, fitted.model.replicates().draws[i].first);
    }
}

// Bits that an early step of a search took for one too few: no slope leads back from there.
TEST_F(Swap, WholeNumbersGoOneFurther) {
    ReplicateRunner runner(context(), simulated({{"adc_bits", {8.0}}, {"vignetting", {0.3}}}, kCaptureSeed + 14), {},
                           2);
    for (const double bits : {7.0, 8.0}) {
        ModelFit fits(runner, options(), {});
        fits.fit_baseline(0.0);
        EffectModel model;
        model.add(candidate("adc_bits"), 1.0, candidate("adc_bits").strength(0, bits));
        model.add(candidate("vignetting"), 1.0, candidate("vignetting").strength(0, 0.3));
        const std::uint32_t seeds = fits.options().pool_seeds, count = fits.options().model_replicates;
        Pool pool = simulate_pool(runner, model.settings(), fits.options().seed, seeds, nullptr);
        FittedModel fitted;
        fitted.effects = model.settings();
        fitted.jacobian = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(runner.count()), 2);
        fitted.columns = model.strengths;
        fitted.change = pool.mean(seeds) - fits.baseline_pool().mean(seeds);
        fits.judge(fitted, {fitted.effects, pool.levels, {}}, count, 0.0, 0.0);
        ASSERT_EQ(fitted.residual.detected, bits != 8.0);
        const double before = fitted.score;
        fits.step_whole_numbers(model, pool, fitted, 0.0);
        EXPECT_EQ(model.settings()[0].values[0], 8.0) << bits;
        EXPECT_EQ(fitted.effects, model.settings());
        EXPECT_EQ(pool.effects, model.settings());
        EXPECT_FALSE(fitted.residual.detected) << bits;
        EXPECT_EQ(fitted.score < before, bits != 8.0);
    }
}

TEST_F(Swap, ASearchEndsAtItsMostWork) {
    const Capture capture =
        simulated({{"vignetting", {0.3}}, {"crosstalk", {0.2}}, {"row_noise", {2.0}}}, kCaptureSeed + 13);
    const auto found = [&](double most_work, std::uint32_t null_replicates) {
        ReplicateRunner runner(context(), capture, {}, 2);
        SearchOptions limited = options();
        limited.most_work = most_work;
        limited.null_replicates = null_replicates;
        return search(runner, every(), {}, limited, {});
    };
    const SearchResult whole = found(3000.0, 24), little = found(10.0, 24);
    EXPECT_FALSE(whole.ended_early);
    EXPECT_EQ(whole.models.size(), 3u);
    // The first step takes more: it is the last one.
    EXPECT_TRUE(little.ended_early);
    EXPECT_EQ(little.models.size(), 1u);
    EXPECT_TRUE(little.models.back().residual.detected);
    // However many replicates the baseline has, they are not the search's work.
    const SearchResult many = found(2.0 * whole.work, 900);
    EXPECT_FALSE(many.ended_early);
    EXPECT_EQ(many.models.size(), 3u);
}

// An effect that only stood for later ones, and is not named, leaves its place to one that is missing.
TEST_F(Swap, SlightEffectsTakeNoPlace) {
    ReplicateRunner runner(context(), simulated({{"vignetting", {0.3}}, {"row_noise", {2.0}}}, kCaptureSeed + 3), {},
                           2);
    SearchOptions few = options();
    few.max_effects = 2;
    ModelFit fits(runner, few, {});
    fits.fit_baseline(0.0);
    const SearchState right = state_of(fits, {"vignetting", "row_noise"}, {});
    EXPECT_EQ(right.model.slight_count(right.models.back().step), 0u);
    EXPECT_EQ(most_effects(fits, right), 2u);
    const SearchState with_slight = state_of(fits, {"depolarization", "vignetting"}, {}, -0.3);
    EXPECT_EQ(with_slight.model.slight_count(with_slight.models.back().step), 1u);
    EXPECT_EQ(most_effects(fits, with_slight), 3u);
    EXPECT_EQ(most_effects(fits, SearchState{}), 2u);
    // By the strength that the last step leads to; and what is slight alone is all that there is.
    EffectModel model;
    model.add(candidate("vignetting"), 1.0, -0.15);
    model.add(candidate("row_noise"), 1.0, 0.5);
    EXPECT_EQ(model.slight_count({}), 0u);
    EXPECT_EQ(model.slight_count(Eigen::Vector2d(-0.2, -0.2)), 1u);
    EXPECT_EQ(model.slight_count(Eigen::Vector2d(-0.2, -1.0)), 0u);
}

TEST_F(Swap, NeedlessEffectsArePruned) {
    ReplicateRunner runner(context(), simulated({{"vignetting", {0.3}}, {"row_noise", {2.0}}}, kCaptureSeed + 3), {},
                           2);
    ModelFit fits(runner, options(), {});
    const FittedModel baseline = fits.fit_baseline(0.0);
    SearchState state = state_of(fits, {"depolarization", "vignetting", "row_noise"}, {}, -0.3); // hardly any
    ASSERT_FALSE(state.models.back().residual.detected); // a flexible effect too many does no harm but for its name
    prune(fits, state, 0.0);
    EXPECT_EQ(names(state), (std::vector<std::string>{"vignetting", "row_noise"}));
    EXPECT_FALSE(state.models.back().residual.detected);
    expect_consistent(fits, state, baseline);
}

// Where light is cut, the shares of bright pixels bend within some DN: the usual differences, 40 DN, look past that and
// may land beside it (here at 389).
TEST_F(Swap, AFitIsPolishedWhereStatisticsBend) {
    ReplicateRunner runner(context(), simulated({{"full_well", {380.0}}}, kCaptureSeed + 8), {}, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    const Candidate &well = candidate("full_well");
    EffectModel model;
    model.add(well, 1.0, well.strength(0, 330.0));
    Pool pool;
    FittedModel fitted = fits.fit(model, pool, all_replicates(fits));
    fits.measure_parameters(fitted, model, 0.0);
    const FittedParameter first = fitted.parameters.front();
    EXPECT_GT(std::abs(first.value - 380.0), 6.0);
    const double score = fitted.score;
    fits.polish(model, pool, fitted, 0.0);
    EXPECT_LT(fitted.score, score - 20.0);
    fits.measure_parameters(fitted, model, 0.0);
    EXPECT_NEAR(fitted.parameters.front().value, 380.0, 4.0);
    EXPECT_LT(fitted.parameters.front().low, 380.0);
    EXPECT_GT(fitted.parameters.front().high, 380.0);
    EXPECT_FALSE(fitted.residual.detected);
    EXPECT_EQ(pool.effects, fitted.effects);
    // What is right becomes no worse.
    const double polished = fitted.score;
    fits.polish(model, pool, fitted, 0.0);
    EXPECT_LE(fitted.score, polished);
}

// A held strength stays in a fit. What is measured of it in the end is right all the same.
TEST_F(Swap, AHeldStrengthStaysAndIsMeasured) {
    ReplicateRunner runner(context(), simulated({{"row_noise", {2.0}}, {"dsnu", {2.0}}}, kCaptureSeed + 9), {}, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    const Candidate &rows = candidate("row_noise");
    EffectModel model;
    model.add(rows, 1.0, rows.strength(0, 2.3));
    model.hold(true);
    model.add(candidate("dsnu"), 1.0, 0.2);
    const double held = model.strengths.front().strength, other = model.strengths.back().strength;
    Pool pool;
    FittedModel fitted = fits.fit(model, pool, all_replicates(fits));
    EXPECT_EQ(held, model.strengths.front().strength);
    EXPECT_NE(other, model.strengths.back().strength);
    fits.polish(model, pool, fitted, 0.0);
    fits.measure_parameters(fitted, model, 0.0);
    EXPECT_NEAR(2.0, fitted.parameters.front().value, 0.15);
    EXPECT_TRUE(model.strengths.front().held);
    EXPECT_FALSE(model.strengths.back().held);
}

// A display's gamma lies beyond where the search for one ends (0.57).
TEST_F(Swap, AFitGoesOnWhereTheSearchEnds) {
    ReplicateRunner runner(context(), simulated({{"gamma", {0.48}}}, kCaptureSeed + 11), {}, 2);
    ModelFit fits(runner, options(), {});
    fits.fit_baseline(0.0);
    EffectModel model;
    model.add(candidate("gamma"), 1.0, 1.6);
    Pool pool;
    FittedModel fitted = fits.fit(model, pool, all_replicates(fits));
    EXPECT_EQ(model.strengths.front().strength, kStrengths.strongest);
    const double score = fitted.score;
    EXPECT_TRUE(fits.go_on(model, pool, fitted, 0.0));
    EXPECT_LT(fitted.score, score);
    EXPECT_EQ(pool.effects, fitted.effects);
    fits.measure_parameters(fitted, model, 0.0);
    EXPECT_LE(fitted.parameters.front().low, 0.48);
    EXPECT_GE(fitted.parameters.front().high, 0.48);
    EXPECT_NEAR(fitted.parameters.front().value, 0.48, 0.02);
    // No later step takes it back, and none takes it out of the parameter's own range.
    EffectModel moved = model;
    move_strengths(moved, Eigen::VectorXd::Zero(1));
    EXPECT_EQ(moved.strengths.front().strength, model.strengths.front().strength);
    for (int i = 0; i < 30; ++i)
        move_strengths(moved, Eigen::VectorXd::Ones(1));
    EXPECT_NEAR(moved.settings().front().values.front(), candidate("gamma").parameters.front().minimum, 1e-12);
    // What ends within the search's range stays as it is.
    EXPECT_FALSE(fits.go_on(model, pool, fitted, 0.0));
    fits.set_strongest(kStrengths.common);
    EffectModel common;
    common.add(candidate("gamma"), 1.0, 1.0);
    Pool own;
    FittedModel held = fits.fit(common, own, all_replicates(fits));
    EXPECT_EQ(common.strengths.front().strength, kStrengths.common);
    EXPECT_FALSE(fits.go_on(common, own, held, 0.0));
}

// Strengths far from where they begin: rounds with secants lead there at one simulation each.
TEST_F(Swap, SecantsReachStrengthsThatAreFar) {
    // One worker, which tells of all columns.
    ReplicateRunner runner(context(), simulated({{"row_noise", {0.9}}, {"crosstalk", {0.3}}}, kCaptureSeed + 7), {}, 1);
    ModelFit fits(runner, options(), {});
    const FittedModel baseline = fits.fit_baseline(0.0);
    EffectModel model;
    model.add(candidate("row_noise"), 1.0, 1.0);
    model.add(candidate("crosstalk"), 1.0, 0.0);
    GaussNewtonOptions rounds;
    rounds.seed = fits.options().seed;
    rounds.seeds = 2;
    rounds.near = rounds.far = 0.02;
    const Origin origin{baseline.model.full(), fits.baseline_pool()};
    const auto values = [](const GaussNewtonFit &fit) {
        const EffectSettings effects = fit.model.settings();
        return std::vector<double>{effects[0].values[0], effects[1].values[0]};
    };
    int columns = 0;
    const auto count = [&](Eigen::Index) { ++columns; };
    const GaussNewtonFit one = gauss_newton(runner, model, origin, {}, rounds, count);
    EXPECT_EQ(values(one)[0], candidate("row_noise").value(0, 1.0)) << "no step was tried";
    rounds.secant_rounds = 10;
    const GaussNewtonFit many = gauss_newton(runner, model, origin, {}, rounds, count);
    EXPECT_EQ(4, columns) << "no column of a Jacobian after the first round";
    // By the baseline's covariance, of twelve captures: 0.97 to 1.03 and 0.31 to 0.33.
    EXPECT_NEAR(values(many)[0], 0.9, 0.15);
    EXPECT_NEAR(values(many)[1], 0.3, 0.04);
    EXPECT_LT(many.square, 0.2 * one.square);
    EXPECT_EQ(many.pool.effects, many.model.settings());
    // Known columns are not simulated again.
    columns = 0;
    gauss_newton(runner, model, origin, {many.jacobian.col(0), many.jacobian.col(1)}, rounds, count);
    EXPECT_EQ(0, columns);
}

} // namespace
