// Two capture sets compared: pairing, levels, effects on finished frames, verdicts. Frames of 64 x 48 pixels; the sets
// come from the library's own simulator, with other random numbers than those of the comparison.
#include "run/compare.hpp"
#include "simulator/finished_frames.hpp"
#include "inference/levels.hpp"
#include "capture/pairing.hpp"
#include "simulator/sample_filters.hpp"
#include "effects/effects.hpp"
#include "diagnosis/simulator/gap_simulator_support.hpp"
#include "report/report_html.hpp"
#include "report/report_json.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>

namespace {

using namespace clsp;
using namespace clsp::gap_simulator_test;

class ComparisonTest : public GapSimulator {
  protected:
    // A set of the baseline camera with effects. sequences: numbers of Sequence.
    static Capture make(const std::vector<EffectSetting> &effects, std::uint64_t seed, std::uint32_t frames = 12,
                        const std::vector<std::size_t> &sequences = {kDark, kFlat, kBoardMoving},
                        const SimulationLevels &levels = kLevels) {
        CaptureLayout layout = small_layout();
        const std::vector<SequenceLayout> all = layout.sequences;
        layout.sequences.clear();
        for (const std::size_t s : sequences) {
            layout.sequences.push_back(all[s]);
            layout.sequences.back().frame_count = frames;
            layout.sequences.back().f_number = layout.f_number; // as a file's
        }
        Simulator simulator(context, layout);
        return simulate_capture(simulator, effects, std::vector<SimulationLevels>(sequences.size(), levels), seed);
    }
    static DiagnosisOptions quick() {
        DiagnosisOptions options;
        options.null_replicates = 24;
        options.max_effects = 2;
        options.evidence = false;
        options.seed = 1;
        return options;
    }
    static DiagnosisResult compared(const Capture &real, const Capture &sim) {
        return compare(context, real, sim, quick());
    }
};

// Fixed layouts without light: frames of the right number, all black.
Capture black_set(const std::vector<SequenceLayout> &sequences) {
    Capture capture;
    capture.layout = small_layout();
    capture.layout.sequences = sequences;
    for (const SequenceLayout &s : sequences)
        capture.codes.emplace_back(s.frame_count * capture.layout.pixel_count(), std::uint16_t{64});
    return capture;
}

SequenceLayout sequence(const char *name, CaptureScene scene, bool moving = false, std::uint32_t frames = 4,
                        double f_number = small_layout().f_number) {
    SequenceLayout result;
    result.name = name;
    result.scene = scene;
    result.moving = moving;
    result.frame_count = frames;
    result.f_number = f_number;
    return result;
}

TEST(Pairing, ByNameThenBySceneAndMotion) {
    const Capture real =
        black_set({sequence("dark", CaptureScene::kDark), sequence("wall", CaptureScene::kBoard, false, 6, 8.0),
                   sequence("wall_open", CaptureScene::kBoard, false, 6, 4.0), sequence("led", CaptureScene::kFlat),
                   sequence("hand", CaptureScene::kBoard, true)});
    const Capture sim = black_set(
        {sequence("hand", CaptureScene::kBoard, false, 5, 4.0), sequence("b", CaptureScene::kBoard, false, 9, 8.0),
         sequence("dark", CaptureScene::kDark, false, 3), sequence("extra", CaptureScene::kDots, true)});
    const PairedCaptures paired = pair_captures(real, sim);
    ASSERT_EQ(paired.pairs.size(), 3u);
    EXPECT_EQ(paired.pairs[0].sim, "dark");
    // Of two boards at rest each gets the one of its f-number; the name "hand" does not pair a moving scene with one at
    // rest.
    EXPECT_EQ(paired.pairs[1].real, "wall");
    EXPECT_EQ(paired.pairs[1].sim, "b");
    EXPECT_EQ(paired.pairs[2].sim, "hand");
    EXPECT_EQ(paired.real_alone, (std::vector<std::string>{"led", "hand"}));
    EXPECT_EQ(paired.sim_alone, (std::vector<std::string>{"extra"}));
    // As many frames of both.
    EXPECT_EQ(paired.pairs[0].frames, 3u);
    EXPECT_EQ(paired.pairs[1].frames, 6u);
    EXPECT_EQ(paired.real.codes[0].size(), 3u * 64 * 48);
    EXPECT_EQ(paired.sim.codes[2].size(), 5u * 64 * 48);
    EXPECT_EQ(paired.sim.layout.sequences[2].frame_count, 5u);
}

TEST(Pairing, MasksAreJoined) {
    Capture real = black_set({sequence("dark", CaptureScene::kDark)}), sim = real;
    real.layout.sequences[0].mask.assign(64 * 48, 255);
    real.layout.sequences[0].mask[3] = 0;
    sim.layout.sequences[0].mask.assign(64 * 48, 255);
    sim.layout.sequences[0].mask[5] = 0;
    const auto mask = pair_captures(real, sim).real.layout.sequences[0].mask;
    EXPECT_EQ(std::count(mask.begin(), mask.end(), 0), 2);
    EXPECT_EQ(mask[3] + mask[5], 0);
}

class Refusals : public GapSimulator {};

TEST_F(Refusals, SayWhatIsWrong) {
    const Capture real = black_set({sequence("dark", CaptureScene::kDark)});
    Capture small = real, coarse = real;
    small.layout.height = 24;
    coarse.layout.bits = 12;
    EXPECT_TRUE(contains(message_of([&] { pair_captures(real, small); }, Status::kInvalidArgument),
                         "64 x 48 pixels, those of the simulated set 64 x 24"));
    EXPECT_TRUE(contains(message_of([&] { pair_captures(real, coarse); }, Status::kInvalidArgument),
                         "10 bits in the real set and 12"));
    const Capture other = black_set({sequence("flat", CaptureScene::kFlat)});
    EXPECT_TRUE(contains(message_of([&] { pair_captures(real, other); }, Status::kInvalidArgument),
                         "no sequence of the real set has a partner"));
    DiagnosisOptions options;
    options.hypotheses.resize(1);
    EXPECT_TRUE(contains(message_of([&] { compare(context, real, real, options); }, Status::kInvalidArgument),
                         "no hypotheses"));
    options.hypotheses.clear();
    Capture white = real;
    std::fill(white.codes[0].begin(), white.codes[0].end(), std::uint16_t{1023});
    EXPECT_TRUE(contains(message_of([&] { compare(context, white, real, options); }, Status::kInvalidData),
                         "dark of the real set: 100 % of its pixels are at the top code"));
    EXPECT_TRUE(contains(message_of([&] { compare(context, real, white, options); }, Status::kInvalidData),
                         "dark of the simulated set: 100 %"));
    // Pixels that a mask takes out of it do not count.
    Capture hidden = real;
    auto &mask = hidden.layout.sequences[0].mask;
    mask.assign(hidden.layout.pixel_count(), 255);
    std::fill(mask.begin(), mask.begin() + 64 * 24, std::uint8_t{0});
    for (std::size_t i = 0; i < hidden.codes[0].size(); ++i)
        hidden.codes[0][i] = mask[i % mask.size()] == 0 ? 1023 : static_cast<std::uint16_t>(60 + i % 9);
    Capture shown = hidden;
    shown.layout.sequences[0].mask.clear();
    EXPECT_NO_THROW(compare(context, hidden, hidden, options));
    EXPECT_TRUE(contains(message_of([&] { compare(context, shown, shown, options); }, Status::kInvalidData),
                         "dark of the real set: 50 % of its pixels are at the top code"));
    options.without = {"defokus"};
    EXPECT_TRUE(
        contains(message_of([&] { compare(context, real, real, options); }, Status::kInvalidArgument), "defokus"));
}

TEST(SampleFilters, PixelAreaHasTheSpectrumOfABox) {
    // Of a band-limited picture a pixel of width w passes sin(pi w f) / (pi w f); the sum over the samples of its
    // kernel shows it.
    const PointSpread spread = pixel_area_spread(0.8);
    for (const double f : {0.0, 0.1, 0.25, 0.4}) {
        double sum = 0.0, flat = 0.0;
        for (int d = -400; d <= 400; ++d) {
            sum += spread(d, 0.0) * std::cos(2.0 * 3.14159265358979 * f * d);
            flat += spread(d, 0.0);
        }
        const double x = 3.14159265358979 * 0.8 * f, expected = f == 0.0 ? 1.0 : std::sin(x) / x;
        EXPECT_NEAR(sum / flat, expected, 2e-3) << f;
    }
}

TEST(SampleFilters, ShiftMovesWaves) {
    // A wave of 8 px moved by (0.3, -0.7) px; the window of 4 px is good to some thousandths of it, inside the image.
    const std::uint32_t width = 64, height = 48;
    const auto wave = [](double x, double y) {
        return float(100.0 + 50.0 * std::sin(0.785398 * x) * std::cos(0.785398 * y));
    };
    std::vector<float> image(width * height);
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            image[y * width + x] = wave(x, y);
    const std::vector<float> moved = shifted(image, width, height, 0.3, -0.7);
    for (std::uint32_t y = 8; y < height - 8; ++y)
        for (std::uint32_t x = 8; x < width - 8; ++x)
            ASSERT_NEAR(moved[y * width + x], wave(x - 0.3, y + 0.7), 0.5);
    EXPECT_EQ(shifted(image, width, height, 0.0, 0.0), image);
}

TEST_F(ComparisonTest, BrighterFramesAreDimmedAndKeepTheirReadNoise) {
    const Capture real = make({}, 3, 8, {kDark, kFlat});
    const Capture sim = make({}, 9, 8, {kDark, kFlat}, {160.0, 64.0, 4.0});
    PairedCaptures paired = pair_captures(real, sim);
    const ReadNoiseComparison noise = level_captures(paired, camera_levels(real), camera_levels(sim), false, 0);
    EXPECT_EQ(noise.added_dn, 0.0);
    EXPECT_FALSE(noise.excess);
    // 8 frames of 3072 pixels: the noise is known to 1 / sqrt(2 x 7 x 3072) = 0.5 %.
    EXPECT_NEAR(noise.real.read_noise_dn, 4.0, 0.08);
    EXPECT_NEAR(noise.real.noise_error, 0.0048, 0.0003);
    EXPECT_NEAR(paired.pairs[1].real_signal_dn, 100.0, 0.5);
    EXPECT_NEAR(paired.pairs[1].sim_signal_dn, 160.0, 0.5);
    EXPECT_EQ(paired.pairs[1].real_scale, 1.0);
    EXPECT_NEAR(paired.pairs[1].sim_scale, 0.625, 0.005);
    EXPECT_EQ(paired.real.codes[1], real.codes[1]);
    EXPECT_NEAR(mean(paired.sim.codes[1]), mean(real.codes[1]), 0.15);
    EXPECT_NEAR(std::sqrt(variance(paired.sim.codes[1])), std::sqrt(variance(real.codes[1])), 0.08);
    EXPECT_EQ(paired.sim.codes[0], sim.codes[0]);
}

TEST_F(ComparisonTest, ReadNoiseIsAddedNeverTakenAway) {
    const Capture quiet = make({}, 3, 8, {kDark, kFlat}, {100.0, 64.0, 2.0}), loud = make({}, 4, 8, {kDark, kFlat});
    PairedCaptures up = pair_captures(loud, quiet);
    const ReadNoiseComparison added = level_captures(up, camera_levels(loud), camera_levels(quiet), false, 0);
    EXPECT_NEAR(added.added_dn, std::sqrt(16.0 - 4.0), 0.1);
    EXPECT_FALSE(added.excess);
    EXPECT_NEAR(camera_levels(up.sim).read_noise_dn, 4.0, 0.08);
    PairedCaptures down = pair_captures(quiet, loud);
    const ReadNoiseComparison more = level_captures(down, camera_levels(quiet), camera_levels(loud), false, 0);
    EXPECT_EQ(more.added_dn, 0.0);
    EXPECT_TRUE(more.excess);
    EXPECT_LT(more.p_value, 1e-12);
    EXPECT_EQ(down.sim.codes[0], loud.codes[0]);
}

TEST_F(ComparisonTest, AlteredFramesHaveWhatTheirEffectSays) {
    const std::uint32_t frames = 16;
    Capture capture = make({}, 5, frames, {kDark, kFlat, kBoardStatic, kBoardMoving});
    FinishedFrames finished(context, capture);
    const std::size_t pixels = capture.layout.pixel_count();
    const auto altered = [&](std::size_t s, const char *id, std::vector<double> values) {
        return finished.codes(s, {{id, std::move(values)}}, 9);
    };
    // Without any effect there is rounding noise alone: a triangular law of variance 1/6 and rounding, 1/4 in all.
    const Codes untouched = finished.codes(0, {}, 9);
    double square = 0.0;
    for (std::size_t i = 0; i < untouched.size(); ++i)
        square += std::pow(double(untouched[i]) - capture.codes[0][i], 2);
    EXPECT_NEAR(square / double(untouched.size()), 0.25, 0.01);
    EXPECT_EQ(finished.codes(0, {}, 9), untouched);

    // Row noise of 3 DN: variance of row means over frames (768 of them: 5 %), beside that of 64 pixels of noise 4.
    const Codes rows = altered(0, "row_noise", {3.0});
    double row_square = 0.0;
    for (std::size_t r = 0; r < rows.size() / 64; ++r) {
        double sum = 0.0;
        for (std::size_t x = 0; x < 64; ++x)
            sum += rows[r * 64 + x] - 64.0;
        row_square += (sum / 64.0) * (sum / 64.0);
    }
    EXPECT_NEAR(row_square / double(rows.size() / 64), 9.0 + 16.4 / 64.0, 1.6);

    // Shot noise of 0.5 DN per electron at 100 DN: 50 DN^2 more in time; the mean is kept.
    const auto time_variance = [&](const Codes &codes) {
        double total = 0.0;
        for (std::size_t i = 0; i < pixels; ++i) {
            double sum = 0.0, squares = 0.0;
            for (std::uint32_t t = 0; t < frames; ++t) {
                sum += codes[t * pixels + i];
                squares += double(codes[t * pixels + i]) * codes[t * pixels + i];
            }
            total += (squares - sum * sum / frames) / (frames - 1.0);
        }
        return total / double(pixels);
    };
    // 46,000 degrees of freedom: 0.7 %.
    const double before = time_variance(capture.codes[1]);
    const Codes shot = altered(1, "shot_noise", {0.5});
    EXPECT_NEAR(time_variance(shot) - before, 50.0 + 0.25, 2.0);
    EXPECT_NEAR(mean(shot), mean(capture.codes[1]), 0.3);

    // Fall-off of 0.4: the corner's share of the mean, 0.6 / (1 - 0.4 <r^2>) with <r^2> = 1/3; the noise stays.
    const Codes dim = altered(1, "vignetting", {0.4});
    EXPECT_NEAR(mean(dim), mean(capture.codes[1]), 0.3);
    EXPECT_NEAR(time_variance(dim), before + 0.25, 0.5);
    double corner = 0.0;
    for (std::uint32_t t = 0; t < frames; ++t)
        for (const std::size_t i :
             {std::size_t{0}, std::size_t{1}, std::size_t{63}, std::size_t{64}, pixels - 1, pixels - 2})
            corner += dim[t * pixels + i] / (6.0 * frames);
    EXPECT_NEAR((corner - 64.0) / 100.0, 0.6 / (1.0 - 0.4 / 3.0),
                0.03); // 96 codes of noise 4: 0.4 DN, and the four not quite in the corner

    // Crosstalk of a resting scene spreads the light and leaves the noise white.
    const Codes blurred = altered(2, "crosstalk", {0.2});
    const auto neighbour_noise = [&](const Codes &codes) {
        double sum = 0.0, count = 0.0;
        for (std::uint32_t t = 0; t + 1 < frames; t += 2)
            for (std::size_t i = 0; i + 1 < pixels; ++i)
                if (i % 64 != 63) {
                    const double a = double(codes[t * pixels + i]) - codes[(t + 1) * pixels + i],
                                 b = double(codes[t * pixels + i + 1]) - codes[(t + 1) * pixels + i + 1];
                    sum += a * b;
                    ++count;
                }
        return sum / count;
    };
    EXPECT_NEAR(neighbour_noise(blurred), 0.0, 0.8); // 24,000 products of variance 32^2: 0.2
    EXPECT_NEAR(time_variance(blurred), time_variance(capture.codes[2]) + 0.25, 0.5);
    EXPECT_LT(variance(blurred), 0.95 * variance(capture.codes[2]));

    // Unpolarized light of a moving board: contrast 1 / sqrt(2). 16 frames of some 300 grains: 3 %.
    const auto contrast = [&](const Codes &codes) { return std::sqrt(variance(codes) - 16.0) / (mean(codes) - 64.0); };
    EXPECT_NEAR(contrast(altered(3, "depolarization", {0.0})) / contrast(capture.codes[3]), std::sqrt(0.5), 0.03);
    // Sequences that an effect does not reach stay what rounding makes of them.
    EXPECT_EQ(altered(0, "vignetting", {0.4}), untouched);
}

TEST_F(ComparisonTest, EveryEffectIsACandidateOrRefusedWithAReason) {
    Capture capture = make({}, 5, 4, {kDark, kFlat, kBoardStatic, kBoardMoving, kDotsStatic, kDotsMoving});
    FinishedFrames finished(context, capture);
    std::size_t candidates = 0;
    for (const Effect &effect : effect_catalogue()) {
        if (!finished_frames_refusal(effect.id, capture.layout).empty()) {
            for (std::size_t s = 0; s < kSequenceCount; ++s)
                EXPECT_FALSE(finished.concerns(effect.id, s)) << effect.id;
            continue;
        }
        ++candidates;
        bool changes = false;
        for (std::size_t s = 0; s < kSequenceCount; ++s) {
            std::vector<double> values;
            for (const EffectParameter &p : effect.parameters)
                values.push_back(p.strong);
            const bool differs = finished.codes(s, {{effect.id, values}}, 2) != finished.codes(s, {}, 2);
            EXPECT_TRUE(!differs || finished.concerns(effect.id, s)) << effect.id << " " << s;
            changes = changes || differs;
        }
        EXPECT_TRUE(changes) << effect.id;
    }
    EXPECT_GE(candidates, 20u);
    capture.layout.degree_of_polarization = 0.5;
    EXPECT_TRUE(contains(finished_frames_refusal("depolarization", capture.layout), "polarized in part"));
}

// Six pairs of sets of one camera: with a level of 0.02 each, two or more alarms have a probability of 0.6 %. Their
// light differs by up to 20 %.
TEST_F(ComparisonTest, EqualCamerasAreNotToldApart) {
    unsigned alarms = 0;
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
        const Capture real = make({}, 100 + 2 * seed),
                      sim = make({}, 101 + 2 * seed, 12 + unsigned(seed), {kDark, kFlat, kBoardMoving},
                                 {100.0 + 4.0 * double(seed), 66.0, 4.0});
        alarms += compared(real, sim).detected;
    }
    EXPECT_LE(alarms, 1u);
}

struct Missing {
    const char *effect;
    double value, low, high;
};

class MissingEffect : public ComparisonTest, public ::testing::WithParamInterface<Missing> {};

// What the simulator lacks is named first, with its strength.
TEST_P(MissingEffect, IsNamedWithItsStrength) {
    const Missing &m = GetParam();
    const Capture real = make({{m.effect, {m.value}}}, 11), sim = make({}, 12);
    const DiagnosisResult result = compared(real, sim);
    ASSERT_TRUE(result.detected);
    ASSERT_FALSE(result.ranking.empty());
    EXPECT_EQ(result.ranking.front().effect, m.effect);
    EXPECT_EQ(result.found.front().effect, m.effect);
    EXPECT_GT(result.found.front().values.front(), m.low);
    EXPECT_LT(result.found.front().values.front(), m.high);
    EXPECT_LT(result.steps.front().distance_after, 0.5 * result.distance_before);
    const auto of_effect = std::find_if(result.parameters.begin(), result.parameters.end(),
                                        [&](const FittedParameter &p) { return p.effect == m.effect; });
    ASSERT_NE(of_effect, result.parameters.end());
    EXPECT_LE(of_effect->low, of_effect->value);
    EXPECT_GE(of_effect->high, of_effect->value);
    for (const RankedEffect &ranked : result.ranking)
        EXPECT_TRUE(finished_frames_refusal(ranked.effect, real.layout).empty());
}
INSTANTIATE_TEST_SUITE_P(Effects, MissingEffect,
                         ::testing::Values(Missing{"vignetting", 0.35, 0.28, 0.42}, Missing{"row_noise", 3.0, 2.4, 3.6},
                                           Missing{"shot_noise", 0.4, 0.3, 0.5}, Missing{"crosstalk", 0.2, 0.15, 0.25}),
                         [](const auto &tested) { return std::string(tested.param.effect); });

// The catalogue's strengths are below 1. Read noise that is in the frames is bent along, so that something is left.
TEST_F(ComparisonTest, ResponsesBendEitherWay) {
    const Capture sim = make({}, 12);
    for (const double gamma : {0.8, 1.25}) {
        const DiagnosisResult result = compared(make({{"gamma", {gamma}}}, 11), sim);
        ASSERT_FALSE(result.found.empty()) << gamma;
        EXPECT_EQ(result.found.front().effect, "gamma");
        EXPECT_NEAR(result.found.front().values.front(), gamma, 0.06);
    }
}

// Another lattice of the same kind is no gap, and the error of the dots' centres is that of each set's own dots.
TEST_F(ComparisonTest, DotsAreMeasuredWhereEachSetHasThem) {
    const auto dots_set = [&](double shift_px, const std::vector<EffectSetting> &effects, std::uint64_t seed) {
        CaptureLayout layout = small_layout();
        std::vector<SequenceLayout> sequences;
        for (const SequenceLayout &s : layout.sequences)
            if (s.scene == CaptureScene::kDark || (s.scene == CaptureScene::kDots && s.moving)) {
                sequences.push_back(s);
                sequences.back().frame_count = 12;
            }
        layout.sequences = sequences;
        for (SequenceLayout &one : layout.sequences)
            one.f_number = layout.f_number;
        // No two dots move alike.
        for (std::size_t i = 0; i < layout.dots->positions_px.size(); ++i) {
            layout.dots->positions_px[i][0] += shift_px * std::sin(2.1 * double(i));
            layout.dots->positions_px[i][1] += shift_px * std::cos(1.3 * double(i));
        }
        Simulator simulator(context, layout);
        return simulate_capture(simulator, effects, std::vector<SimulationLevels>(sequences.size(), {400.0, 64.0, 4.0}),
                                seed);
    };
    const Capture real = dots_set(0.0, {}, 21), sim = dots_set(1.5, {}, 22);
    ASSERT_EQ(real.layout.sequences.size(), 2u);
    const DiagnosisResult same = compared(real, sim);
    EXPECT_FALSE(same.detected) << same.p_value << " " << same.places[0].statistic.name << " " << same.places[0].z;
    const auto told = [](const DiagnosisResult &result, const char *words) {
        return std::any_of(result.notes.begin(), result.notes.end(),
                           [&](const std::string &note) { return contains(note, words); });
    };
    EXPECT_TRUE(told(same, "px apart"));
    EXPECT_TRUE(told(same, "each set's dots are measured where its own description has them"));
    ASSERT_TRUE(same.downstream.valid);
    EXPECT_NEAR(same.downstream.before, same.downstream.real, 0.15 * same.downstream.real);
    EXPECT_EQ(same.downstream.after, same.downstream.before);
    // What a set says of its dots is not what its frames have: that is a gap, and centres are off by it.
    Capture wrong = sim;
    wrong.layout.dots = real.layout.dots;
    const DiagnosisResult gap = compared(real, wrong);
    EXPECT_TRUE(gap.detected);
    ASSERT_TRUE(gap.downstream.valid);
    EXPECT_GT(gap.downstream.before, 1.2 * same.downstream.before);
    const auto report = nlohmann::json::parse(report_json(gap));
    EXPECT_GT(report["shrink"]["downstream"]["depth_error_mm"]["before"].get<double>(), 0.0);
    EXPECT_FALSE(contains(report_html(gap), "The capture holds no frames of dots"));
    EXPECT_TRUE(contains(report_html(compared(make({}, 1), make({}, 2))), "No dots were compared"));
}

TEST_F(ComparisonTest, TheReportHasWhatWasCompared) {
    const Capture real = make({{"vignetting", {0.35}}}, 11, 8, {kDark, kFlat}),
                  sim = make({}, 12, 10, {kDark, kFlat, kBoardStatic}, {100.0, 64.0, 6.0});
    DiagnosisOptions options = quick();
    options.evidence = true;
    options.max_effects = 1;
    std::vector<double> told;
    options.progress = [&](const std::string &what, double fraction) {
        EXPECT_FALSE(what.empty());
        told.push_back(fraction);
        return true;
    };
    const DiagnosisResult result = compare(context, real, sim, options);
    EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
    const auto report = nlohmann::json::parse(report_json(result));
    EXPECT_EQ(report["compare"]["pairs"].size(), 2u);
    EXPECT_EQ(report["compare"]["pairs"][1]["frames"], 8u);
    EXPECT_EQ(report["compare"]["sim_alone"][0], "board_static");
    EXPECT_TRUE(report["compare"]["read_noise"]["sim_has_more"].get<bool>());
    // No wave stands out, so that periodic_offset is no candidate.
    EXPECT_EQ(report["compare"]["cannot_be_applied"].size() + result.candidates.size() + 1, effect_catalogue().size());
    // Noise that cannot be taken away is a gap that no effect explains.
    EXPECT_EQ(report["cause"]["verdict"], "unknown");
    bool noise_told = false;
    for (const auto &place : report["where"])
        noise_told = noise_told || (place["statistic"] == "read_noise" && place["sequence"] == "dark");
    EXPECT_TRUE(noise_told);
    const std::string page = report_html(result);
    for (const char *words : {"What was compared", "cannot be put on finished frames", "vignetting", "id=\"evidence\""})
        EXPECT_NE(page.find(words), std::string::npos) << words;
    // The same seed, the same report.
    EXPECT_EQ(report_json(compare(context, real, sim, options)), report_json(result));
    options.progress = [](const std::string &, double) { return false; };
    EXPECT_TRUE(contains(message_of([&] { compare(context, real, sim, options); }, Status::kCancelled), "cancelled"));
}

} // namespace
