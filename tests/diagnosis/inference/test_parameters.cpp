// Parameters and their intervals where changes of the statistics are hard to tell: of an effect that is a few draws
// itself, and where statistics bend sharply. Captures of the simulator's own.
#include "diagnosis/inference/attribution_support.hpp"
#include "inference/model_fit.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <string>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

// Of `count` captures with an effect at a value, by whose intervals it is held; the fits begin at a strength.
struct Held {
    int held = 0;
    double mean_log = 0.0; // of the fitted over the true value
};
Held intervals_of(const CaptureLayout &layout, const std::string &id, double value, double strength, int count) {
    const std::vector<Candidate> all = candidates({}, {});
    const Candidate &candidate =
        *std::find_if(all.begin(), all.end(), [&](const Candidate &c) { return c.id == id; });
    Held result;
    for (int k = 0; k < count; ++k) {
        ReplicateRunner runner(context(), simulated({{id, {value}}}, kCaptureSeed + 100 + k, {}, layout), {}, 2);
        SearchOptions search;
        search.seed = 3;
        search.null_replicates = 24;
        ModelFit fits(runner, search, {});
        EXPECT_TRUE(fits.fit_baseline(0.0).residual.detected); // or there is nothing to fit
        EffectModel model;
        model.add(candidate, 1.0, strength);
        Pool pool;
        FitOptions options;
        options.replicates = search.model_replicates;
        FittedModel fitted = fits.fit(model, pool, options);
        fits.polish(model, pool, fitted, 0.0);
        fits.measure_parameters(fitted, model, 0.0);
        const FittedParameter &p = fitted.parameters.front();
        EXPECT_LT(p.low, p.value);
        EXPECT_LT(p.value, p.high);
        result.held += p.low <= value && value <= p.high;
        result.mean_log += std::log(p.value / value) / count;
    }
    return result;
}

// Twelve powers of a laser say its scatter to 1 / sqrt(2 * 11) = 21 %. Of 20 intervals of 95 %, 16 or more hold the
// truth in 99.7 % of all cases; of intervals that hold in 70 %, in 24 % (by the changes that the fit went by 12 do).
TEST(Parameters, OfPowerThatFlickers) {
    CaptureLayout layout = small_layout();
    layout.sequences.back().moving = false; // the grain of a moving board flickers more
    const Held intervals = intervals_of(layout, "power_flicker", 0.06, 0.3, 20);
    EXPECT_GE(intervals.held, 16);
    // They scatter by 35 %, their mean by 8 %.
    EXPECT_NEAR(0.0, intervals.mean_log, 0.25);
}

// Light is cut just below half of the range, above which pixels are counted: a well a little larger would have them all
// counted. Of 10 intervals of 95 %, 7 or more hold the truth in 99.9 % of all cases.
TEST(Parameters, WhereAStatisticBendsSharply) {
    const Held intervals = intervals_of(small_layout(), "full_well", 504.0, 0.52, 10);
    EXPECT_GE(intervals.held, 7);
    EXPECT_NEAR(0.0, intervals.mean_log, 0.01);
}

// Beside an effect that explains all, one that does nothing: any of its values would.
TEST(Parameters, OfWhichTheCaptureSaysNothing) {
    Hypothesis nothing;
    nothing.id = "nothing";
    nothing.stage = "sensor";
    nothing.point = HypothesisPoint::kIntensity;
    nothing.parameters = {{"amount", "1", 0.01, 8.0, 0.1, 1.0}};
    nothing.apply = [](const HypothesisFrame &) {};
    const std::vector<Candidate> all = candidates({nothing}, {});
    const auto find = [&](const std::string &id) -> const Candidate & {
        return *std::find_if(all.begin(), all.end(), [&](const Candidate &c) { return c.id == id; });
    };
    ReplicateRunner runner(context(), simulated({{"vignetting", {0.3}}}, kCaptureSeed + 700, {}, small_layout()),
                           {nothing}, 1);
    SearchOptions search;
    search.null_replicates = 16;
    search.model_replicates = 12;
    ModelFit fits(runner, search, {});
    fits.fit_baseline(0.0);
    EffectModel model;
    model.add(find("vignetting"), 1.0, 0.5);
    model.add(find("nothing"), 1.0, 0.5);
    Pool pool;
    FitOptions options;
    options.replicates = search.model_replicates;
    FittedModel fitted = fits.fit(model, pool, options);
    fits.measure_parameters(fitted, model, 0.0);
    ASSERT_EQ(fitted.parameters.size(), 2u);
    EXPECT_LT(fitted.parameters[0].high - fitted.parameters[0].low, 0.1);
    EXPECT_EQ(fitted.parameters[1].low, 0.01);
    EXPECT_EQ(fitted.parameters[1].high, 8.0);
}

// Row noise that no effect of the model explains makes the interval of crosstalk wider; with it all is explained, and
// nothing does: where nothing is left, something significant is found in 1 of 200 captures.
TEST(Parameters, WhatIsLeftMakesIntervalsWider) {
    const std::vector<Candidate> all = candidates({}, {});
    const auto find = [&](const std::string &id) -> const Candidate & {
        return *std::find_if(all.begin(), all.end(), [&](const Candidate &c) { return c.id == id; });
    };
    ReplicateRunner runner(context(), simulated({{"crosstalk", {0.22}}, {"row_noise", {5.0}}}, kCaptureSeed + 800), {},
                           2);
    SearchOptions search;
    search.null_replicates = search.model_replicates = 24;
    ModelFit fits(runner, search, {});
    fits.fit_baseline(0.0);
    EffectModel model;
    Pool pool;
    FitOptions options;
    options.replicates = search.model_replicates;
    double width = 0.0;
    for (const char *const id : {"crosstalk", "row_noise"}) {
        model.add(find(id), 1.0, 0.5);
        FittedModel fitted = fits.fit(model, pool, options);
        fits.measure_parameters(fitted, model, 0.0);
        const Eigen::VectorXd ratios = fitted.model.birge_ratios(runner.real());
        const FittedParameter &crosstalk = fitted.parameters.front();
        if (model.effects.size() == 1) {
            ASSERT_TRUE(fitted.residual.detected);
            EXPECT_GT(ratios[0], 1.3);
            width = crosstalk.high - crosstalk.low;
        } else {
            ASSERT_FALSE(fitted.residual.detected);
            EXPECT_EQ(ratios, Eigen::VectorXd::Ones(2));
            EXPECT_LT(crosstalk.high - crosstalk.low, width / 1.3);
            EXPECT_LT(crosstalk.low, 0.22);
            EXPECT_GT(crosstalk.high, 0.22);
        }
    }
}

} // namespace
