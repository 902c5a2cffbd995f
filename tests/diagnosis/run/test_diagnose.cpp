// Verdicts on captures of the simulator itself. Those against an independent generator are the withheld check's
// (validation/gap_check).
#include "diagnosis/inference/attribution_support.hpp"
#include "report/advice.hpp"
#include "report/report_html.hpp"
#include "report/report_json.hpp"
#include "run/diagnose.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

TEST(Advice, NamesACaptureForConfusableEffects) {
    EXPECT_TRUE(advice_for({}).empty());
    EXPECT_TRUE(advice_for({"linewidth"}).empty());
    const auto advice = advice_for({"depolarization", "linewidth"});
    ASSERT_EQ(advice.size(), 1u);
    EXPECT_NE(advice[0].capture.find("analyser"), std::string::npos);
}

DiagnosisOptions quick(std::uint64_t seed) {
    DiagnosisOptions options;
    options.seed = seed;
    options.null_replicates = 24;
    options.max_effects = 2;
    options.threads = 2;
    options.evidence = false;
    return options;
}

TEST(Diagnosis, NothingIsFoundWhereNothingIs) {
    // 18 of 400 such captures give an alarm (24 replicates know the tails less well than the usual 48, by which 3 % of
    // 500 did): three or more of eight do by chance once in 200.
    int alarms = 0;
    for (std::uint64_t i = 0; i < 8; ++i)
        alarms += diagnose(context(), simulated({}, kCaptureSeed + i), quick(i)).detected;
    EXPECT_LE(alarms, 2);
}

TEST(Diagnosis, NamesTheEffectAndItsParameter) {
    const struct {
        const char *id;
        double value;
    } cases[] = {{"row_noise", 2.0}, {"depolarization", 0.3}, {"vignetting", 0.3}};
    for (const auto &c : cases) {
        const DiagnosisResult result =
            diagnose(context(), simulated({{c.id, {c.value}}}, kCaptureSeed + 100), quick(1));
        EXPECT_EQ(result.verdict, Verdict::kNamed) << c.id;
        ASSERT_EQ(result.effects, std::vector<std::string>{c.id});
        EXPECT_FALSE(result.residual_detected);
        ASSERT_EQ(result.parameters.size(), 1u);
        EXPECT_NEAR(result.parameters[0].value, c.value, 0.2 * c.value) << c.id;
        EXPECT_LT(result.parameters[0].low, result.parameters[0].value);
        EXPECT_GT(result.parameters[0].high, result.parameters[0].value);
        EXPECT_GT(result.fraction, 0.8) << c.id;
        EXPECT_GT(result.fraction_95[1], result.fraction_95[0]);
    }
}

// A response that bends upwards, a lens that opens wider than it says: the catalogue's ranges lie on the other side of
// 1. Whether a residual is seen in so small a capture is the null's matter.
TEST(Diagnosis, NamesARatioOnTheOtherSideOfOne) {
    const struct {
        const char *id;
        double value;
    } cases[] = {{"gamma", 1.2}, {"aperture_mismatch", 0.8}, {"aperture_mismatch", 0.7}};
    for (const auto &c : cases) {
        const DiagnosisResult result =
            diagnose(context(), simulated({{c.id, {c.value}}}, kCaptureSeed + 170), quick(1));
        ASSERT_EQ(result.effects, std::vector<std::string>{c.id});
        EXPECT_NEAR(result.parameters[0].value, c.value, 0.03) << c.id;
        EXPECT_LT(result.parameters[0].low, result.parameters[0].value);
        EXPECT_GT(result.parameters[0].high, result.parameters[0].value);
    }
}

CaptureLayout larger_layout() {
    CaptureLayout layout = small_layout();
    layout.width = 96;
    layout.height = 80;
    layout.principal_point_px = {47.5, 39.5};
    return layout;
}

// Dots that are lopsided along another axis than x, and against it.
TEST(Diagnosis, NamesASkewAlongAnyAxis) {
    CaptureLayout layout = larger_layout();
    layout.dots = CaptureDots{2.2, {}};
    for (int y = 12; y < 80; y += 14)
        for (int x = 12; x < 96; x += 14)
            layout.dots->positions_px.push_back({x + 0.3, y - 0.2});
    SequenceLayout dots = layout.sequences.back();
    dots.name = "dots_moving";
    dots.scene = CaptureScene::kDots;
    dots.frame_count = 24;
    layout.sequences.push_back(dots);
    for (const double angle : {1.3, -2.4, -3.1}) {
        const EffectSettings skew = {{"beam_skew", {1.2, angle}}};
        const DiagnosisResult result = diagnose(context(), simulated(skew, kCaptureSeed + 190, {}, layout), quick(1));
        ASSERT_EQ(result.effects, std::vector<std::string>{"beam_skew"}) << angle;
        ASSERT_EQ(result.parameters.size(), 2u);
        // -s along an axis is s against it.
        const double found = result.parameters[1].value + (result.parameters[0].value < 0.0 ? 3.14159265 : 0.0);
        EXPECT_NEAR(std::abs(result.parameters[0].value), 1.2, 0.25) << angle;
        EXPECT_NEAR(std::remainder(found - angle, 2.0 * 3.14159265), 0.0, 0.2) << angle;
        for (const RankedEffect &ranked : result.ranking)
            EXPECT_EQ(std::count_if(result.ranking.begin(), result.ranking.end(),
                                    [&](const RankedEffect &r) { return r.effect == ranked.effect; }),
                      1);
    }
}

// Greens on the other diagonal of the mosaic.
TEST(Diagnosis, NamesOtherFormsOfAnEffect) {
    const DiagnosisResult mosaic =
        diagnose(context(), simulated({{"bayer_mismatch", {0.04, 1.0}}}, kCaptureSeed + 180), quick(1));
    ASSERT_EQ(mosaic.effects, std::vector<std::string>{"bayer_mismatch"});
    EXPECT_FALSE(mosaic.residual_detected);
    ASSERT_EQ(mosaic.parameters.size(), 2u);
    EXPECT_NEAR(mosaic.parameters[0].value, 0.04, 0.004);
    EXPECT_EQ(mosaic.parameters[1].value, 1.0);
}

// A pixel that is sensitive in half of its area (0.71 x 0.71), which crosstalk imitates.
TEST(Diagnosis, ThePixelsAreaIsFittedFromTheFirstScreeningOn) {
    CaptureLayout layout = small_layout();
    layout.f_number = 5.6;
    layout.width = 96;
    layout.height = 80;
    layout.principal_point_px = {47.5, 39.5};
    for (SequenceLayout &sequence : layout.sequences)
        sequence.f_number = 5.6;
    const DiagnosisResult area =
        diagnose(context(), simulated({{"pixel_integration", {0.71}}}, kCaptureSeed + 190, {}, layout), quick(1));
    ASSERT_FALSE(area.ranking.empty());
    const auto ranked = std::find_if(area.ranking.begin(), area.ranking.end(),
                                     [](const RankedEffect &r) { return r.effect == "pixel_integration"; });
    ASSERT_NE(ranked, area.ranking.end());
    EXPECT_GT(ranked->probability, 0.05); // the name, or among the equivalents
    EXPECT_NEAR(ranked->values.front(), 0.71, 0.05);
    EXPECT_FALSE(area.residual_detected);
}

// Few small frames, two of which stand still, and a gap that is large: what two captures of common random numbers say
// of a change is no measure of it: a fit that went by two stopped at 0.65, and a significant gap remained. Of 20 such
// captures two keep a residual; of the ten here more than two would by chance once in fourteen draws (seeds are fixed:
// none does). They lie between 0.618 and 0.646, and half of their intervals miss 0.62: the bound below only holds them
// apart from worse, it does not show that they are unbiased.
TEST(Diagnosis, SmallCapturesAreFittedByMoreRandomNumbers) {
    CaptureLayout layout = larger_layout();
    layout.f_number = 5.6;
    SequenceLayout resting = layout.sequences.back();
    resting.name = "board_static";
    resting.moving = false;
    layout.sequences.push_back(resting);
    for (SequenceLayout &sequence : layout.sequences) {
        sequence.frame_count = 8;
        sequence.f_number = 5.6;
    }
    int residuals = 0;
    for (std::uint64_t i = 0; i < 10; ++i) {
        const DiagnosisResult result = diagnose(
            context(), simulated({{"aperture_mismatch", {0.62}}}, kCaptureSeed + 180 + i, {}, layout), quick(i));
        ASSERT_EQ(result.effects, std::vector<std::string>{"aperture_mismatch"}) << i;
        EXPECT_NEAR(result.parameters[0].value, 0.62, 0.028) << i;
        residuals += result.residual_detected ? 1 : 0;
    }
    EXPECT_LE(residuals, 2);
}

CaptureLayout without_dark() {
    CaptureLayout layout = small_layout();
    layout.sequences.erase(layout.sequences.begin());
    return layout;
}

// The data sheet says 64 and 4 DN and is good to a few DN and about 15 %. With sheets taken for exact all 20 are
// alarms; of a test at 0.02, three or more are seen once in 140.
TEST(Diagnosis, WithoutDarkFramesADataSheetIsNoCertainty) {
    CaptureLayout board = without_dark();
    board.sequences.erase(board.sequences.begin());
    int alarms = 0;
    for (std::uint64_t i = 0; i < 5; ++i)
        for (const auto &[black_level_dn, read_noise_dn] : {std::pair{61.4, 4.5}, std::pair{66.2, 3.6}})
            for (const CaptureLayout &layout : {without_dark(), board})
                alarms +=
                    diagnose(context(),
                             simulated({}, kCaptureSeed + 300 + i, {}, layout, black_level_dn, read_noise_dn), quick(i))
                        .verdict != Verdict::kNone;
    EXPECT_LE(alarms, 2);
}

TEST(Diagnosis, WithoutDarkFramesEffectsAreStillNamed) {
    for (const auto &[effect, value] : {std::pair{"depolarization", 0.4}, std::pair{"vignetting", 0.3}}) {
        const DiagnosisResult result = diagnose(
            context(), simulated({{effect, {value}}}, kCaptureSeed + 320, {}, without_dark(), 65.5, 4.4), quick(1));
        ASSERT_EQ(result.effects, std::vector<std::string>{effect});
        EXPECT_LE(result.parameters[0].low, value);
        EXPECT_GE(result.parameters[0].high, value);
    }
}

// Alone, a moving board shows a contrast: weak depolarization is one of three effects that lower it. All three are to
// be fitted, though others promise more at screening: otherwise the wrong one was named in half of such captures, and
// the right one was never among the equivalent ones. (Of what a twentieth is likely, a twentieth is not listed.)
TEST(Diagnosis, ConfusableEffectsOfOneSequenceAreFittedToo) {
    CaptureLayout layout = larger_layout();
    layout.sequences.erase(layout.sequences.begin() + 1);
    for (SequenceLayout &sequence : layout.sequences)
        sequence.frame_count = 16;
    int held = 0, other = 0;
    for (std::uint64_t i = 0; i < 6; ++i) {
        const DiagnosisResult result =
            diagnose(context(), simulated({{"depolarization", {0.9}}}, kCaptureSeed + 1340 + i, {}, layout), quick(i));
        const auto has = [](const std::vector<std::string> &effects) {
            return std::find(effects.begin(), effects.end(), "depolarization") != effects.end();
        };
        EXPECT_TRUE(std::any_of(result.ranking.begin(), result.ranking.end(), [](const RankedEffect &ranked) {
            return ranked.effect == "depolarization";
        })) << i;
        held += has(result.effects) || has(result.equivalent) ? 1 : 0;
        other += result.verdict != Verdict::kAmbiguous && !has(result.effects) ? 1 : 0;
    }
    // Three effects are within some 20 of 3000 in twice the log likelihood: chance may leave the true one behind.
    EXPECT_LE(other, 1);
    EXPECT_GE(held, 4);
}

// One frame of speckle: rows that differ may be the surface's, and the coverage says that row noise cannot be told
// there. A verdict that named it all the same (it had, of a published image of ground glass) would contradict its own
// report.
TEST(Diagnosis, NamesNothingThatCannotShow) {
    CaptureLayout layout = larger_layout();
    layout.sequences.erase(layout.sequences.begin(), layout.sequences.end() - 1);
    layout.sequences.front().scene = CaptureScene::kBoard;
    layout.sequences.front().moving = false;
    layout.sequences.front().frame_count = 1;
    const DiagnosisResult result =
        diagnose(context(), simulated({{"row_noise", {25.0}}}, kCaptureSeed + 370, {}, layout), quick(1));
    const auto has = [](const std::vector<std::string> &effects, const std::string &id) {
        return std::find(effects.begin(), effects.end(), id) != effects.end();
    };
    EXPECT_TRUE(result.detected);
    EXPECT_TRUE(has(result.untested_effects, "row_noise"));
    EXPECT_FALSE(has(result.effects, "row_noise"));
    EXPECT_FALSE(has(result.equivalent, "row_noise"));
    for (const RankedEffect &ranked : result.ranking)
        EXPECT_FALSE(has(result.untested_effects, ranked.effect)) << ranked.effect;
}

// Hot pixels scatter in each channel of a mosaic alike: by the covariance of a camera with the mosaic they weigh more
// than before, so that either effect alone seemed to make the gap wider, and neither was named.
TEST(Diagnosis, LargeGapsAreExplainedPartByPart) {
    const EffectSettings both = {{"bayer_mismatch", {0.036}}, {"hot_pixels", {0.009, 150.0}}};
    CaptureLayout layout = larger_layout();
    int right = 0;
    for (std::uint64_t i = 0; i < 3; ++i) {
        const DiagnosisResult result =
            diagnose(context(), simulated(both, kCaptureSeed + 1360 + i, {}, layout), quick(i));
        right +=
            result.verdict == Verdict::kNamed && std::set<std::string>(result.effects.begin(), result.effects.end()) ==
                                                     std::set<std::string>{"bayer_mismatch", "hot_pixels"};
    }
    EXPECT_GE(right, 2) << "9 of 10 such captures are right, so that 97 % of three have two";
}

// A lamp and a beam that are brightest near the axis: what they share of the fall-off looks like the lens's, and the
// interval says so. Where both are even, it is as narrow as the fit.
TEST(Diagnosis, AFallOffThatTheLightsShareIsInTheInterval) {
    for (const bool even : {false, true}) {
        CaptureLayout layout = larger_layout();
        const double corner = layout.farthest_corner_px();
        if (!even)
            for (SequenceLayout &sequence : layout.sequences) {
                if (sequence.scene == CaptureScene::kFlat)
                    sequence.illumination = {layout.principal_point_px, corner, {0.08, 0.0, -0.05, 0.0, -0.05}};
                if (sequence.scene == CaptureScene::kBoard)
                    sequence.illumination = {layout.principal_point_px, corner, {0.0, 0.06, -0.2, 0.0, -0.2}};
            }
        Capture capture = simulated({{"vignetting", {0.25}}}, kCaptureSeed + 370, {}, layout);
        for (SequenceLayout &sequence : capture.layout.sequences)
            sequence.illumination = {};
        const DiagnosisResult result = diagnose(context(), capture, quick(1));
        ASSERT_EQ(result.effects, std::vector<std::string>{"vignetting"}) << even;
        ASSERT_EQ(result.parameters.size(), 1u);
        const FittedParameter &loss = result.parameters[0];
        EXPECT_LE(loss.low, 0.25) << even;
        EXPECT_GE(loss.high, 0.25) << even;
        EXPECT_EQ(loss.value > 0.28, !even) << loss.value;
        EXPECT_EQ(loss.high - loss.low > 0.1, !even) << loss.low << " to " << loss.high;
    }
}

// Speckle that lives 150 times as long as the catalogue's weakest: seen in the noise of neighbours, and not to be taken
// for photons, of which the same capture has some.
TEST(Diagnosis, AnEffectFadesBelowTheCatalogue) {
    CaptureLayout layout = larger_layout();
    add_sequence(layout, "board_static", CaptureScene::kBoard, false, 24);
    layout.f_number = 16.0;
    layout.read_noise_dn = 0.5;
    const double frames = 9000.0, gain = 0.02;
    const EffectSettings effects = {{"shot_noise", {gain}}, {"surface_boiling", {frames}}};
    const Capture capture = simulated(effects, kCaptureSeed + 310, {}, layout, 63.2, 0.5);
    DiagnosisOptions options = quick(1);
    options.without = {"airflow", "vibration"};
    const DiagnosisResult result = diagnose(context(), capture, options);
    const auto value = [&](const char *effect) {
        for (const FittedParameter &p : result.parameters)
            if (p.effect == effect)
                return p.value;
        return 0.0;
    };
    EXPECT_NEAR(value("shot_noise"), gain, 0.05 * gain);
    EXPECT_NEAR(value("surface_boiling"), frames, 0.1 * frames);
    EXPECT_FALSE(result.residual_detected);
}

// Beyond the common range (0.67), whose end with a last step from there once counted as an explanation: one that went
// too far, to 0.98, or beside a second effect. 1 is all that there can be.
TEST(Diagnosis, AValueNearTheEndOfItsRangeHasAnInterval) {
    for (std::uint64_t i = 0; i < 8; ++i) {
        const DiagnosisResult result =
            diagnose(context(), simulated({{"vignetting", {0.9}}}, kCaptureSeed + 165 + i), quick(1 + i));
        EXPECT_EQ(result.verdict, Verdict::kNamed) << i;
        EXPECT_EQ(result.effects, std::vector<std::string>{"vignetting"}) << i;
        ASSERT_EQ(result.parameters.size(), 1u) << i;
        EXPECT_LE(result.parameters[0].low, 0.9) << i;
        EXPECT_GE(result.parameters[0].high, 0.9) << i;
        EXPECT_GT(result.parameters[0].high - result.parameters[0].low, 0.001) << i;
    }
}

// Steps of 16 DN at a read noise of 4.3 DN: dark and even frames have two codes, and their mean goes up in stairs with
// the level. They say nothing of the noise, which the data sheet has 7 % too low: speckle at rest does.
TEST(Diagnosis, ACoarseConverterIsCalibrated) {
    CaptureLayout layout = small_layout();
    SequenceLayout resting = layout.sequences.back();
    resting.name = "board_static";
    resting.moving = false;
    layout.sequences.push_back(resting);
    for (const double bits : {7.0, 6.0}) {
        const DiagnosisResult result =
            diagnose(context(), simulated({{"adc_bits", {bits}}}, kCaptureSeed + 150, {}, layout), quick(1));
        EXPECT_EQ(result.verdict, Verdict::kNamed) << bits;
        ASSERT_EQ(result.effects, std::vector<std::string>{"adc_bits"});
        EXPECT_FALSE(result.residual_detected) << bits;
        ASSERT_EQ(result.parameters.size(), 1u);
        EXPECT_EQ(result.parameters[0].value, bits);
        EXPECT_EQ(result.parameters[0].low, bits);
        EXPECT_EQ(result.parameters[0].high, bits);
    }
}

// With the data sheet's 4.0 DN for 4.3 DN five deviations of the flat's variance over time remain, and 7 of the 10
// seeds from 160 on are unknown, all of these three.
TEST(Diagnosis, ACoarseConverterIsCalibratedWithoutSpeckleAtRest) {
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        const DiagnosisResult result =
            diagnose(context(), simulated({{"adc_bits", {6.0}}}, kCaptureSeed + 162 + seed), quick(1));
        EXPECT_EQ(result.verdict, Verdict::kNamed) << seed;
        EXPECT_EQ(result.effects, std::vector<std::string>{"adc_bits"}) << seed;
        EXPECT_FALSE(result.residual_detected) << seed;
    }
}

TEST(Diagnosis, SaysWhatWasCalibrated) {
    DiagnosisOptions options;
    options.null_replicates = 12;
    options.evidence = false;
    // Black level 63.2 DN, read noise 4.3 DN, light of 300 and 120 DN (attribution_support.hpp); the corners lose light
    // of both.
    const nlohmann::json report = nlohmann::json::parse(
        report_json(diagnose(context(), simulated({{"vignetting", {0.4}}}, kCaptureSeed), options)));
    const nlohmann::json &calibration = report["calibration"];
    EXPECT_NEAR(calibration["black_level_dn"].get<double>(), 63.2, 0.1);
    EXPECT_NEAR(calibration["read_noise_dn"].get<double>(), 4.3, 0.1);
    ASSERT_EQ(calibration["sequences"].size(), 3u);
    EXPECT_EQ(calibration["sequences"][0]["name"], "dark");
    EXPECT_EQ(calibration["sequences"][0]["light_dn"], 0.0);
    const nlohmann::json &flat = calibration["sequences"][1];
    EXPECT_NEAR(flat["light_dn"].get<double>(), flat["mean_dn"].get<double>() - 63.2, 0.5);
    EXPECT_NEAR(flat["share"].get<double>(), 1.0, 0.01);
    EXPECT_LT(flat["light_dn"].get<double>(), 280.0);
    EXPECT_NEAR(calibration["with_effects"]["black_level_dn"].get<double>(), 63.2, 0.1);
}

TEST(Diagnosis, SameSeedSameReport) {
    const Capture capture = simulated({{"row_noise", {3.0}}}, kCaptureSeed + 200);
    auto options = quick(5);
    options.max_effects = 1;
    const std::string first = report_json(diagnose(context(), capture, options));
    options.threads = 1;
    EXPECT_EQ(first, report_json(diagnose(context(), capture, options)));
}

TEST(Diagnosis, SameSeedSameReportOfEffectsWithFormsAndReadings) {
    const Capture capture = simulated({{"bayer_mismatch", {0.05, 1.0}}, {"image_lag", {0.12}}}, kCaptureSeed + 250);
    auto options = quick(5);
    options.max_effects = 2;
    const DiagnosisResult result = diagnose(context(), capture, options);
    EXPECT_EQ(result.steps.size(), 2u) << report_json(result);
    const std::string first = report_json(result);
    options.threads = 1;
    EXPECT_EQ(first, report_json(diagnose(context(), capture, options)));
}

TEST(Diagnosis, WithoutTheEffectItIsNotNamed) {
    auto options = quick(2);
    options.without = {"row_noise"};
    const DiagnosisResult result = diagnose(context(), simulated({{"row_noise", {3.0}}}, kCaptureSeed + 300), options);
    EXPECT_EQ(result.verdict, Verdict::kUnknown);
    EXPECT_TRUE(result.residual_detected);
    const auto report = nlohmann::json::parse(report_json(result));
    EXPECT_EQ(report["cause"]["verdict"], "unknown");
    EXPECT_EQ(report["where"][0]["stage"], "sensor");
}

TEST(Diagnosis, AHypothesisJoinsTheRanking) {
    // Odd rows are brighter: in no catalogue.
    Hypothesis hypothesis;
    hypothesis.id = "odd_rows";
    hypothesis.stage = "sensor";
    hypothesis.point = HypothesisPoint::kIntensity;
    hypothesis.parameters = {{"gain", "1", 0.0, 1.0, 0.01, 0.1}};
    hypothesis.apply = [](const HypothesisFrame &frame) {
        for (std::size_t i = 0; i < frame.layout->pixel_count(); ++i)
            if (i / frame.layout->width % 2 == 1)
                frame.pixels[i] *= static_cast<float>(1.0 + frame.values[0]);
    };
    Capture capture = simulated({}, kCaptureSeed + 400);
    for (std::size_t s = 1; s < capture.codes.size(); ++s)
        for (std::size_t i = 0; i < capture.codes[s].size(); ++i)
            if (i / capture.layout.width % 2 == 1)
                capture.codes[s][i] =
                    static_cast<std::uint16_t>(std::min(1023.0, 63.2 + 1.05 * (capture.codes[s][i] - 63.2) + 0.5));
    auto options = quick(3);
    EXPECT_NE(diagnose(context(), capture, options).verdict, Verdict::kNone);
    options.hypotheses = {hypothesis};
    const DiagnosisResult result = diagnose(context(), capture, options);
    EXPECT_EQ(result.effects, std::vector<std::string>{"odd_rows"});
    ASSERT_EQ(result.parameters.size(), 1u);
    EXPECT_NEAR(result.parameters[0].value, 0.05, 0.01);
}

// From -0.2 to 0.2: half way it does nothing.
TEST(Diagnosis, AHypothesisThatDoesNothingHalfWayIsFoundOnEitherSide) {
    Hypothesis tilt;
    tilt.id = "tilt";
    tilt.stage = "optics";
    tilt.parameters = {{"slope", "1", -1.0, 1.0, -0.2, 0.2}};
    tilt.apply = [](const HypothesisFrame &frame) {
        for (std::uint32_t y = 0, at = 0; y < frame.layout->height; ++y)
            for (std::uint32_t x = 0; x < frame.layout->width; ++x, ++at)
                frame.pixels[at] *= static_cast<float>(1.0 + frame.values[0] * (double(x) / frame.layout->width - 0.5));
    };
    for (const double slope : {0.15, -0.15}) {
        auto options = quick(6);
        options.hypotheses = {tilt};
        const DiagnosisResult result =
            diagnose(context(), simulated({{"tilt", {slope}}}, kCaptureSeed + 420, {tilt}), options);
        ASSERT_EQ(result.effects, std::vector<std::string>{"tilt"}) << slope;
        EXPECT_NEAR(result.parameters[0].value, slope, 0.01);
    }
}

TEST(Diagnosis, CanBeCancelled) {
    auto options = quick(4);
    int calls = 0;
    options.progress = [&](const std::string &, double fraction) {
        EXPECT_GE(fraction, 0.0);
        EXPECT_LE(fraction, 1.0);
        return ++calls < 5;
    };
    try {
        diagnose(context(), simulated({}, kCaptureSeed + 500), options);
        FAIL() << "it went on";
    } catch (const Error &error) {
        EXPECT_EQ(error.status(), Status::kCancelled);
    }
    EXPECT_EQ(calls, 5);
}

nlohmann::json report_of(std::uint32_t frame_count) {
    CaptureLayout layout = small_layout();
    for (SequenceLayout &sequence : layout.sequences)
        sequence.frame_count = sequence.name == "flat" ? frame_count : 12;
    DiagnosisOptions options;
    options.null_replicates = 24;
    options.max_effects = 1;
    options.without = {};
    options.evidence = false;
    const DiagnosisResult result =
        diagnose(context(), simulated({{"vignetting", {0.4}}}, kCaptureSeed, {}, layout), options);
    EXPECT_NE(report_html(result).find("Statistic by statistic"), std::string::npos);
    return nlohmann::json::parse(report_json(result));
}

TEST(StatisticShrinkage, IsInTheReport) {
    const nlohmann::json report = report_of(12), &where = report["where"], &list = report["shrink"]["per_statistic"];
    ASSERT_GT(where.size(), 3u);
    EXPECT_GT(where[0]["distance_before"].get<double>(), 3.0);
    EXPECT_GT(where[0]["fraction"].get<double>(), 0.8);
    ASSERT_EQ(where[0]["ci95"].size(), 2u);
    EXPECT_LE(where[0]["ci95"][0].get<double>(), where[0]["fraction"].get<double>());
    EXPECT_GE(where[0]["ci95"][1].get<double>(), where[0]["fraction"].get<double>());
    EXPECT_FALSE(where[0].contains("no_interval"));
    std::size_t with = 0, without = 0;
    for (const nlohmann::json &entry : list) {
        EXPECT_TRUE(entry["distance_before"].is_number() && entry["distance_after"].is_number()) << entry;
        EXPECT_EQ(entry["fraction"].is_null(), entry["ci95"].is_null());
        EXPECT_EQ(entry["fraction"].is_null(), entry.contains("no_interval"));
        ++(entry["fraction"].is_null() ? without : with);
    }
    EXPECT_GT(with, where.size() / 2);
    EXPECT_GT(without, with) << "most statistics of this camera are right";
}

TEST(StatisticShrinkage, WithoutFramesToHoldOutThereIsNone) {
    for (const std::uint32_t frames : {1u, 3u}) {
        const nlohmann::json report = report_of(frames);
        std::size_t of_flat = 0;
        for (const nlohmann::json &entry : report["shrink"]["per_statistic"])
            if (entry["sequence"] == "flat") {
                ++of_flat;
                for (const char *member : {"distance_before", "distance_after", "fraction", "ci95"})
                    EXPECT_TRUE(entry[member].is_null()) << entry;
                EXPECT_NE(entry["no_interval"].get<std::string>().find("a sequence needs four"), std::string::npos);
            } else {
                EXPECT_TRUE(entry["distance_before"].is_number()) << entry;
            }
        EXPECT_GT(of_flat, 0u);
    }
}

TEST(StatisticShrinkage, WithoutAnEffectThereIsNone) {
    DiagnosisOptions options;
    options.null_replicates = 12;
    options.evidence = false;
    const nlohmann::json report =
        nlohmann::json::parse(report_json(diagnose(context(), simulated({}, kCaptureSeed + 3), options)));
    ASSERT_EQ(report["cause"]["verdict"], "none");
    for (const nlohmann::json &entry : report["shrink"]["per_statistic"]) {
        EXPECT_TRUE(entry["ci95"].is_null());
        EXPECT_EQ(entry["no_interval"], "no effect was added");
    }
}

} // namespace
