// Verdicts scene by scene: names that survive an unknown elsewhere. Captures of the simulator's own, changed by hand.
#include "diagnosis/inference/attribution_support.hpp"
#include "run/diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <string>
#include <vector>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

const EffectSettings kSensor = {{"dsnu", {3.0}}, {"row_noise", {2.0}}, {"prnu", {0.02}}};

DiagnosisResult diagnosed(const Capture &capture) {
    DiagnosisOptions options;
    options.seed = 5;
    options.null_replicates = 24;
    options.threads = 2;
    options.evidence = false;
    return diagnose(context(), capture, options);
}

const RungResult &rung_of(const DiagnosisResult &result, CaptureScene scene) {
    return *std::find_if(result.rungs.begin(), result.rungs.end(),
                         [&](const RungResult &rung) { return rung.scene == scene; });
}
std::vector<std::string> sorted(std::vector<std::string> names) {
    std::sort(names.begin(), names.end());
    return names;
}

TEST(Rungs, EachSceneHasItsEffects) {
    EffectSettings effects = kSensor;
    effects.push_back({"depolarization", {0.3}});
    const DiagnosisResult result = diagnosed(simulated(effects, kCaptureSeed + 31));
    EXPECT_EQ(result.verdict, Verdict::kNamed);
    EXPECT_EQ(sorted(result.effects), (std::vector<std::string>{"depolarization", "dsnu", "prnu", "row_noise"}));
    const RungResult &dark = rung_of(result, CaptureScene::kDark);
    EXPECT_EQ(dark.verdict, Verdict::kNamed);
    EXPECT_EQ(sorted(dark.effects), (std::vector<std::string>{"dsnu", "row_noise"}));
    EXPECT_LT(dark.distance_after, 0.1 * dark.distance_before);
    EXPECT_EQ(rung_of(result, CaptureScene::kFlat).verdict, Verdict::kNamed);
    EXPECT_EQ(rung_of(result, CaptureScene::kBoard).verdict, Verdict::kNamed);
}

// Rows of the board are brighter by turns: in no catalogue.
TEST(Rungs, NamesSurviveAnUnknownElsewhere) {
    Capture capture = simulated(kSensor, kCaptureSeed + 32);
    const std::size_t width = capture.layout.width;
    for (std::size_t i = 0; i < capture.codes[2].size(); ++i)
        if (i / width % 5 == 0)
            capture.codes[2][i] = static_cast<std::uint16_t>(std::min(1023, capture.codes[2][i] + 25));
    const DiagnosisResult result = diagnosed(capture);
    EXPECT_EQ(result.verdict, Verdict::kUnknown);
    EXPECT_TRUE(result.residual_detected);
    EXPECT_EQ(rung_of(result, CaptureScene::kBoard).verdict, Verdict::kUnknown);
    EXPECT_EQ(rung_of(result, CaptureScene::kDark).verdict, Verdict::kNamed);
    EXPECT_EQ(rung_of(result, CaptureScene::kFlat).verdict, Verdict::kNamed);
    for (const char *effect : {"dsnu", "row_noise", "prnu"})
        EXPECT_EQ(std::count(result.effects.begin(), result.effects.end(), effect), 1) << effect;
}

// What the dark frames leave unexplained is left in the end, too, and takes no effect of the flats away.
TEST(Rungs, AnUnknownBelowStays) {
    Capture capture = simulated({{"prnu", {0.02}}}, kCaptureSeed + 33);
    const std::size_t width = capture.layout.width, pixels = capture.layout.pixel_count();
    for (std::size_t i = 0; i < capture.codes[0].size(); ++i) // each frame is denoised along its rows
        if (i % width && i % pixels)
            capture.codes[0][i] = static_cast<std::uint16_t>((capture.codes[0][i] + capture.codes[0][i - 1] + 1) / 2);
    const DiagnosisResult result = diagnosed(capture);
    EXPECT_EQ(result.verdict, Verdict::kUnknown);
    EXPECT_TRUE(result.residual_detected);
    EXPECT_LE(result.residual_p_value, 0.005);
    EXPECT_EQ(rung_of(result, CaptureScene::kDark).verdict, Verdict::kUnknown);
}

// A converter whose multiples of four take half of the codes above them: in no catalogue, and dozens of deviations off
// in dark and flat. The gain is what it was, within its interval and 7 %: so it ends in 12 of 14 captures.
TEST(Rungs, WhatNothingExplainsHasNoPull) {
    constexpr double kGain = 0.28;
    CaptureLayout layout = small_layout();
    layout.sequences.pop_back();
    for (const char *name : {"flat_1", "flat_2"}) {
        layout.sequences.push_back(layout.sequences[1]);
        layout.sequences.back().name = name;
    }
    Capture capture = simulated({{"shot_noise", {kGain}}, {"prnu", {0.01}}}, kCaptureSeed + 35, {}, layout);
    for (auto &codes : capture.codes)
        for (std::size_t i = 0; i < codes.size(); ++i)
            codes[i] = static_cast<std::uint16_t>(codes[i] - (codes[i] % 4 == 1 && i % 2));
    const DiagnosisResult result = diagnosed(capture);
    EXPECT_EQ(result.verdict, Verdict::kUnknown);
    const auto gain = std::find_if(result.parameters.begin(), result.parameters.end(),
                                   [](const FittedParameter &p) { return p.effect == "shot_noise"; });
    ASSERT_NE(gain, result.parameters.end());
    EXPECT_NEAR(gain->value, kGain, 0.07 * kGain);
    EXPECT_LE(gain->low, kGain);
    EXPECT_GE(gain->high, kGain);
}

// Light leaks into the corner of a camera that was covered for its dark frames: in no catalogue. An effect that is
// named takes a part of the gap away, on frames that its fit has not seen.
TEST(Rungs, WhatIsNamedTakesSomethingAway) {
    Capture capture = simulated({}, kCaptureSeed + 37);
    const std::size_t width = capture.layout.width, pixels = capture.layout.pixel_count();
    for (std::size_t i = 0; i < capture.codes[0].size(); ++i) {
        const double x = static_cast<double>(i % width), y = static_cast<double>(i % pixels / width);
        const double away = std::hypot(x - 63.0, y - 47.0);
        const double leaked = 24.0 * std::exp(-away / 14.0);
        capture.codes[0][i] = static_cast<std::uint16_t>(std::lround(capture.codes[0][i] + leaked));
    }
    const DiagnosisResult result = diagnosed(capture);
    EXPECT_EQ(result.verdict, Verdict::kUnknown);
    EXPECT_TRUE(result.residual_detected);
    double before = result.distance_before;
    for (const ShrinkStep &step : result.steps) {
        const bool named = std::count(result.effects.begin(), result.effects.end(), step.effect) > 0;
        EXPECT_TRUE(!named || step.distance_after < before)
            << step.effect << ": " << before << " to " << step.distance_after;
        before = step.distance_after;
    }
    EXPECT_GT(result.steps.size(), result.effects.size()) << "and some are not named";
    for (const std::string &effect : result.effects)
        EXPECT_TRUE(std::any_of(result.steps.begin(), result.steps.end(),
                                [&](const ShrinkStep &step) { return step.effect == effect; }))
            << effect << " has a step";
}

TEST(Rungs, NoGapNoRungs) {
    const DiagnosisResult result = diagnosed(simulated({}, kCaptureSeed + 34));
    EXPECT_EQ(result.verdict, Verdict::kNone);
    EXPECT_TRUE(result.rungs.empty());
}

} // namespace
