// The simulator of captures: what is the same for the same seed, what differs, hypotheses, and bad input.
#include "diagnosis/simulator/gap_simulator_support.hpp"

#include "effects/effects.hpp"
#include "simulator/sequence_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

namespace clsp::gap_simulator_test {
namespace {

std::vector<EffectSetting> strong(const Effect &effect) {
    EffectSetting setting{effect.id, {}};
    for (const EffectParameter &parameter : effect.parameters)
        setting.values.push_back(parameter.strong);
    return {setting};
}

TEST_F(GapSimulator, TheSameSeedGivesTheSameCodesAndAnotherOneOthers) {
    Simulator simulator(context, small_layout()), other(context, small_layout());
    for (std::size_t s = 0; s < kSequenceCount; ++s) {
        const Codes first = draw(simulator, s);
        EXPECT_EQ(first, draw(simulator, s)) << kNames[s];
        EXPECT_EQ(first, draw(other, s)) << kNames[s];
        EXPECT_NE(first, draw(simulator, s, {}, kLevels, 8)) << kNames[s];
    }
}

TEST_F(GapSimulator, FramesMoveOrRestAsTheSequenceSays) {
    Simulator simulator(context, small_layout());
    const std::size_t pixels = simulator.layout().pixel_count();
    for (const std::size_t s : {kBoardStatic, kDotsStatic, kFlat, kDark}) {
        const Codes codes = draw(simulator, s, {}, kQuiet);
        EXPECT_TRUE(std::equal(codes.begin(), codes.begin() + pixels, codes.begin() + pixels)) << kNames[s];
    }
    for (const std::size_t s : {kBoardMoving, kDotsMoving}) {
        const Codes codes = draw(simulator, s, {}, kQuiet);
        EXPECT_FALSE(std::equal(codes.begin(), codes.begin() + pixels, codes.begin() + pixels)) << kNames[s];
    }
    // Speckle and noise are each sequence's own.
    CaptureLayout twice = small_layout();
    twice.sequences[kFlat] = twice.sequences[kDark];
    twice.sequences[kBoardMoving] = twice.sequences[kBoardStatic];
    Simulator same(context, twice);
    EXPECT_NE(draw(same, kDark), draw(same, kFlat));
    EXPECT_NE(draw(same, kBoardStatic, {}, kQuiet), draw(same, kBoardMoving, {}, kQuiet));
}

// Two samples of a pixel that integrates have its ideal light, a staircase that widens dots; where the middle one of
// three is a point it does not.
TEST(SequenceModel, SamplesFollowThePupilAndDotsKeepTheirWidth) {
    CaptureLayout layout = small_layout();
    const double pitch_over_wavelength = layout.pixel_pitch_m / layout.wavelength_m, sigma_px = layout.dots->sigma_px;
    const auto model = [&](double diameter, const std::vector<EffectSetting> &effects) {
        layout.sequences[kDotsMoving].f_number = pitch_over_wavelength / diameter;
        return sequence_model(layout, {}, kDotsMoving, effects).model;
    };
    const std::vector<EffectSetting> integrates = {{"pixel_integration", {1.0}}};
    for (const double diameter : {0.3, 0.59, 0.61, 0.99, 1.1, 1.54}) {
        const PipelineModel points = model(diameter, {}), areas = model(diameter, integrates);
        EXPECT_EQ(points.aperture.oversampling, diameter <= 1.0 ? 1u : 3u) << diameter;
        EXPECT_EQ(points.dots->sigma_px, sigma_px) << diameter;
        EXPECT_EQ(areas.aperture.oversampling, diameter <= 0.6   ? 1u
                                               : diameter <= 1.0 ? 2u
                                               : diameter <= 1.5 ? 3u
                                                                 : 5u)
            << diameter;
        EXPECT_EQ(areas.phase.oversampling, areas.aperture.oversampling);
        const double widening = areas.aperture.oversampling == 2 ? 1.0 / 16.0 : 0.0;
        EXPECT_NEAR(areas.dots->sigma_px, std::sqrt(sigma_px * sigma_px - widening), 1e-12) << diameter;
    }
}

TEST_F(GapSimulator, MoreFramesBeginWithTheSameOnes) {
    Simulator simulator(context, small_layout());
    const std::vector<std::vector<EffectSetting>> lists = {
        {}, {{"surface_boiling", {6.0}}}, {{"airflow", {0.8, 6.0}}}, {{"vibration", {0.3}}}, {{"image_lag", {0.15}}}};
    for (const auto &effects : lists)
        for (std::size_t s = 0; s < kSequenceCount; ++s) {
            const Codes few = draw(simulator, s, effects, kLevels, 3, 2),
                        more = draw(simulator, s, effects, kLevels, 3, 5);
            EXPECT_TRUE(std::equal(few.begin(), few.end(), more.begin())) << kNames[s];
        }
}

TEST_F(GapSimulator, WhatIsKeptChangesNothing) {
    Simulator keeps(context, small_layout()), forgets(context, small_layout());
    forgets.set_cache_bytes(0);
    Simulator tight(context, small_layout());
    tight.set_cache_bytes(2 * 4 * sizeof(float) * tight.layout().pixel_count()); // two moving sequences of four frames
    for (int round = 0; round < 2; ++round)
        for (std::uint64_t seed = 0; seed < 3; ++seed)
            for (std::size_t s = 0; s < kSequenceCount; ++s) {
                const Codes codes = draw(keeps, s, {{"defocus", {1.0}}}, kLevels, seed);
                EXPECT_EQ(codes, draw(forgets, s, {{"defocus", {1.0}}}, kLevels, seed)) << kNames[s];
                EXPECT_EQ(codes, draw(tight, s, {{"defocus", {1.0}}}, kLevels, seed)) << kNames[s];
            }
}

TEST_F(GapSimulator, HundredsOfCallsHoldNoMoreMemory) {
    Simulator simulator(context, small_layout());
    simulator.set_cache_bytes(1 << 20);
    const auto some = [&](std::uint64_t seed) {
        Codes codes(simulator.layout().pixel_count());
        simulator.codes(kBoardStatic, {{"defocus", {0.5 + 1e-3 * double(seed % 64)}}, {"prnu", {0.01}}}, kLevels, seed,
                        1, codes.data());
        simulator.codes(kDotsStatic, {{"glare", {0.1, 6.0}}}, kLevels, seed, 1, codes.data());
    };
    for (std::uint64_t seed = 0; seed < 100; ++seed)
        some(seed);
    const std::uint64_t bytes = context->memory_use().allocated_bytes;
    const std::uint32_t count = context->memory_use().allocation_count;
    for (std::uint64_t seed = 100; seed < 500; ++seed)
        some(seed);
    EXPECT_EQ(context->memory_use().allocated_bytes, bytes);
    EXPECT_EQ(context->memory_use().allocation_count, count);
}

// Exact where it says no. Where it says yes the codes change, but for effects that need another effect beside them on a
// uniform image.
TEST_F(GapSimulator, EffectsShowWhereTheyConcernASequenceAndNowhereElse) {
    Simulator simulator(context, small_layout());
    // Full well and the converter's steps are to be met.
    const SimulationLevels bright{400.0, 64.0, 4.0};
    std::vector<Codes> baseline;
    for (std::size_t s = 0; s < kSequenceCount; ++s)
        baseline.push_back(draw(simulator, s, {}, bright));
    // The light is the same all over, or in every frame: another effect must make it differ.
    const auto companion = [](const std::string &id, std::size_t s) -> EffectSetting {
        if (id == "crosstalk" && s == kFlat)
            return {"vignetting", {0.9}};
        if (id == "image_lag" && s != kBoardMoving && s != kDotsMoving)
            return {"shot_noise", {0.5}};
        return {};
    };
    for (const Effect &effect : effect_catalogue())
        for (std::size_t s = 0; s < kSequenceCount; ++s) {
            const Codes codes = draw(simulator, s, strong(effect), bright);
            if (!simulator.concerns(effect.id, s)) {
                EXPECT_EQ(codes, baseline[s]) << effect.id << " on " << kNames[s];
            } else if (const EffectSetting beside = companion(effect.id, s); beside.id.empty()) {
                EXPECT_NE(codes, baseline[s]) << effect.id << " on " << kNames[s];
            } else {
                std::vector<EffectSetting> both = strong(effect);
                both.push_back(beside);
                EXPECT_EQ(codes, baseline[s]) << effect.id << " on " << kNames[s];
                EXPECT_NE(draw(simulator, s, both, bright), draw(simulator, s, {beside}, bright))
                    << effect.id << " on " << kNames[s];
            }
        }
}

TEST_F(GapSimulator, TheTableOfConcerns) {
    Simulator simulator(context, small_layout());
    const auto reached = [&](const std::string &id) {
        std::set<std::size_t> sequences;
        for (std::size_t s = 0; s < kSequenceCount; ++s)
            if (simulator.concerns(id, s))
                sequences.insert(s);
        return sequences;
    };
    const std::set<std::size_t> all{kDark, kFlat, kBoardStatic, kBoardMoving, kDotsStatic, kDotsMoving};
    const std::set<std::size_t> lit{kFlat, kBoardStatic, kBoardMoving, kDotsStatic, kDotsMoving};
    const std::set<std::size_t> laser{kBoardStatic, kBoardMoving, kDotsStatic, kDotsMoving};
    const std::set<std::size_t> dots{kDotsStatic, kDotsMoving}, still{kBoardStatic, kDotsStatic},
        moving{kBoardMoving, kDotsMoving};
    const std::vector<std::pair<const char *, std::set<std::size_t>>> table = {{"linewidth", laser},
                                                                               {"power_flicker", laser},
                                                                               {"wavelength_shift", dots},
                                                                               {"beam_skew", dots},
                                                                               {"beam_flat_top", dots},
                                                                               {"zero_order", dots},
                                                                               {"ghost_dots", dots},
                                                                               {"scatter_background", dots},
                                                                               {"depolarization", laser},
                                                                               {"low_roughness", laser},
                                                                               {"subsurface_scattering", dots},
                                                                               {"motion_decorrelation", moving},
                                                                               {"surface_boiling", still},
                                                                               {"airflow", still},
                                                                               {"vibration", still},
                                                                               {"defocus", laser},
                                                                               {"vignetting", lit},
                                                                               {"aperture_mismatch", laser},
                                                                               {"pupil_obstruction", laser},
                                                                               {"glare", laser},
                                                                               {"ambient_light", lit},
                                                                               {"lens_distortion", dots},
                                                                               {"pixel_integration", laser},
                                                                               {"crosstalk", lit},
                                                                               {"shot_noise", lit},
                                                                               {"prnu", lit},
                                                                               {"dsnu", all},
                                                                               {"column_fpn", all},
                                                                               {"hot_pixels", all},
                                                                               {"row_noise", all},
                                                                               {"gamma", lit},
                                                                               {"full_well", lit},
                                                                               {"adc_bits", all},
                                                                               {"bayer_mismatch", lit},
                                                                               {"image_lag", lit}};
    for (const auto &[id, sequences] : table)
        EXPECT_EQ(reached(id), sequences) << id;

    CaptureLayout phasors = small_layout();
    phasors.field = FieldKind::kUnitPhasor;
    Simulator other(context, phasors);
    EXPECT_FALSE(other.concerns("surface_boiling", kBoardStatic));
    EXPECT_FALSE(other.concerns("motion_decorrelation", kBoardMoving));
    EXPECT_EQ(draw(other, kBoardStatic, {{"surface_boiling", {6.0}}}), draw(other, kBoardStatic));
}

TEST_F(GapSimulator, AnEffectLeavesTheRestAsItWas) {
    Simulator simulator(context, small_layout());
    const std::size_t pixels = simulator.layout().pixel_count();
    // Pixel offsets: the same in each sequence, on top of what there was.
    const SimulationLevels fine{40.0, 400.0, 0.0};
    std::vector<double> offset(pixels, 0.0);
    for (std::size_t s = 0; s < kSequenceCount; ++s) {
        const Codes before = draw(simulator, s, {}, fine), after = draw(simulator, s, {{"dsnu", {5.0}}}, fine);
        for (std::size_t i = 0; i < before.size(); ++i) {
            const double difference = double(after[i]) - before[i];
            if (s == 0 && i < pixels)
                offset[i] = difference;
            EXPECT_LE(std::abs(difference - offset[i % pixels]), 1.0) << kNames[s];
        }
    }
    // A second effect on top of one: noise and speckle stay, so the difference is the same as without the first.
    const Codes a = draw(simulator, kBoardMoving, {{"defocus", {1.0}}}, fine),
                b = draw(simulator, kBoardMoving, {{"defocus", {1.0}}, {"row_noise", {4.0}}}, fine),
                c = draw(simulator, kDark, {}, fine);
    const std::uint32_t width = simulator.layout().width;
    for (std::size_t row = 0; row < a.size() / width; ++row)
        for (std::size_t x = 1; x < width; ++x) {
            const std::size_t i = row * width + x;
            EXPECT_LE(std::abs((double(b[i]) - a[i]) - (double(b[row * width]) - a[row * width])), 1.0);
        }
    EXPECT_EQ(c, Codes(c.size(), 400));
}

TEST_F(GapSimulator, ACaptureHasAllSequencesAndIsWhatTheyAreOneByOne) {
    Simulator simulator(context, small_layout());
    const std::vector<SimulationLevels> levels(kSequenceCount, kLevels);
    const Capture capture = simulate_capture(simulator, {{"prnu", {0.03}}}, levels, 11);
    ASSERT_EQ(capture.codes.size(), kSequenceCount);
    for (std::size_t s = 0; s < kSequenceCount; ++s)
        EXPECT_EQ(capture.codes[s], draw(simulator, s, {{"prnu", {0.03}}}, kLevels, 11)) << kNames[s];
    EXPECT_TRUE(contains(message_of([&] { simulate_capture(simulator, {}, {kLevels}, 0); }, Status::kInvalidArgument),
                         "levels for 1 sequences, the layout has 6"));
}

// Hypotheses.

Hypothesis make_hypothesis(const std::string &id, HypothesisPoint point,
                           std::function<void(const HypothesisFrame &)> apply) {
    Hypothesis hypothesis;
    hypothesis.id = id;
    hypothesis.stage = "optics";
    hypothesis.summary = "for the test";
    hypothesis.point = point;
    hypothesis.parameters = {{"strength", "DN", -10.0, 10.0, 1.0, 5.0}};
    hypothesis.apply = std::move(apply);
    return hypothesis;
}

TEST_F(GapSimulator, HypothesesThatDoNothingChangeNothing) {
    const auto nothing = [](const HypothesisFrame &) {};
    Simulator plain(context, small_layout());
    Simulator simulator(context, small_layout(),
                        {make_hypothesis("a", HypothesisPoint::kIrradiance, nothing),
                         make_hypothesis("b", HypothesisPoint::kIntensity, nothing),
                         make_hypothesis("c", HypothesisPoint::kCodes, nothing)});
    for (std::size_t s = 0; s < kSequenceCount; ++s)
        EXPECT_EQ(draw(plain, s, {{"vignetting", {0.3}}}),
                  draw(simulator, s, {{"a", {1.0}}, {"vignetting", {0.3}}, {"b", {1.0}}, {"c", {1.0}}}))
            << kNames[s];
}

TEST_F(GapSimulator, HypothesesActAtTheirPoint) {
    std::vector<std::size_t> sequences;
    std::vector<std::uint32_t> frames;
    const auto halve_left = [](const HypothesisFrame &frame) {
        for (std::uint32_t y = 0; y < frame.layout->height; ++y)
            for (std::uint32_t x = 0; x < frame.layout->width / 2; ++x)
                frame.pixels[std::size_t{y} * frame.layout->width + x] *= 0.5f;
    };
    const auto add = [&](const HypothesisFrame &frame) {
        sequences.push_back(frame.sequence);
        frames.push_back(frame.frame_index);
        EXPECT_EQ(frame.seed, 7u);
        for (std::size_t i = 0; i < frame.layout->pixel_count(); ++i)
            frame.pixels[i] += static_cast<float>(frame.values[0]);
    };
    Simulator simulator(context, small_layout(),
                        {make_hypothesis("half", HypothesisPoint::kIrradiance, halve_left),
                         make_hypothesis("veil", HypothesisPoint::kIntensity, add),
                         make_hypothesis("offset", HypothesisPoint::kCodes, add)});
    const std::uint32_t width = simulator.layout().width;
    // Irradiance on flat: half the light on the left.
    const Codes half = draw(simulator, kFlat, {{"half", {1.0}}}, kQuiet);
    for (std::size_t i = 0; i < half.size(); ++i)
        EXPECT_EQ(half[i], i % width < width / 2 ? 114 : 164);
    // On a board: |sqrt(I0 / 2) z|^2 before the pupil, so the mean halves away from the border.
    EXPECT_NEAR(simulator.mean_intensity(kBoardMoving, {{"half", {1.0}}}, 7, 8),
                0.75 * simulator.mean_intensity(kBoardMoving, {}, 7, 8), 0.02);
    EXPECT_TRUE(sequences.empty());
    // Intensity: in units of the mean.
    const Codes before = draw(simulator, kBoardMoving, {}, kQuiet),
                veiled = draw(simulator, kBoardMoving, {{"veil", {2.0}}}, kQuiet);
    EXPECT_EQ(sequences, std::vector<std::size_t>(4, kBoardMoving));
    EXPECT_EQ(frames, (std::vector<std::uint32_t>{0, 1, 2, 3}));
    for (std::size_t i = 0; i < before.size(); ++i)
        EXPECT_EQ(veiled[i], std::min(before[i] + 200, 1023));
    // Codes: rounded and clipped after the call. In the order given: (code + 1.4 + 1.4) rounds once per hypothesis.
    const Codes offset = draw(simulator, kDark, {{"offset", {1.4}}}, kQuiet);
    EXPECT_EQ(offset, Codes(offset.size(), 65));
    const Codes below = draw(simulator, kDark, {{"offset", {-10.0}}}, {0.0, 3.0, 0.0});
    EXPECT_EQ(below, Codes(below.size(), 0));
    // No light, no hypothesis about it.
    EXPECT_EQ(draw(simulator, kDark, {{"veil", {5.0}}, {"half", {1.0}}}), draw(simulator, kDark));
    EXPECT_FALSE(simulator.concerns("veil", kDark));
    EXPECT_TRUE(simulator.concerns("offset", kDark));
    // It counts in the mean.
    EXPECT_NEAR(simulator.mean_intensity(kFlat, {{"veil", {2.0}}}, 7, 2), 3.0, 1e-5);
}

// Six lists of effects at random, in any order: those that a sequence takes notice of give its frames.
TEST_F(GapSimulator, WhatConcernsASequenceGivesItsFrames) {
    const auto spot = [](const HypothesisFrame &frame) {
        frame.pixels[24 * std::size_t{frame.layout->width} + 50] = 5.0f;
    };
    Simulator simulator(context, small_layout(), {make_hypothesis("spot", HypothesisPoint::kIrradiance, spot)});
    std::mt19937 random(5);
    std::size_t taken = 0, left = 0;
    for (int list = 0; list < 6; ++list) {
        std::vector<EffectSetting> effects;
        for (const Effect &effect : effect_catalogue())
            if (random() % 3 == 0)
                effects.push_back(strong(effect).front());
        if (list % 3 == 0)
            effects.push_back({"spot", {1.0}});
        std::shuffle(effects.begin(), effects.end(), random);
        for (std::size_t s = 0; s < kSequenceCount; ++s) {
            const std::vector<EffectSetting> concerning = simulator.concerning(effects, s);
            taken += concerning.size();
            left += effects.size() - concerning.size();
            EXPECT_EQ(draw(simulator, s, effects), draw(simulator, s, concerning))
                << "list " << list << " on " << kNames[s];
            std::vector<EffectSetting> others = effects;
            std::reverse(others.begin(), others.end());
            EXPECT_EQ(simulator.concerning(others, s), concerning);
        }
    }
    EXPECT_GT(taken, 50u);
    EXPECT_GT(left, 50u);
    // Light that a hypothesis shaped is spread and displaced on a board, too.
    EXPECT_EQ(simulator.concerning({{"lens_distortion", {0.1}}}, kBoardMoving).size(), 0u);
    EXPECT_EQ(simulator.concerning({{"lens_distortion", {0.1}}, {"spot", {1.0}}}, kBoardMoving).size(), 2u);
}

TEST_F(GapSimulator, AShapedIrradianceMakesGlareAndDistortionShowOnFlat) {
    const auto spot = [](const HypothesisFrame &frame) {
        for (std::size_t i = 0; i < frame.layout->pixel_count(); ++i)
            frame.pixels[i] = 0.0f;
        frame.pixels[24 * std::size_t{frame.layout->width} + 50] = 5.0f;
    };
    Simulator simulator(context, small_layout(), {make_hypothesis("spot", HypothesisPoint::kIrradiance, spot)});
    const Codes sharp = draw(simulator, kFlat, {{"spot", {1.0}}}, kQuiet);
    EXPECT_NE(sharp, draw(simulator, kFlat, {{"spot", {1.0}}, {"glare", {0.5, 2.0}}}, kQuiet));
    EXPECT_NE(sharp, draw(simulator, kFlat, {{"spot", {1.0}}, {"lens_distortion", {0.1}}}, kQuiet));
}

TEST_F(GapSimulator, HypothesesThatFailAreNamed) {
    const auto throws = [](const HypothesisFrame &) { throw std::runtime_error("the moon is full"); };
    const auto odd = [](const HypothesisFrame &) { throw 3; };
    const auto nan = [](const HypothesisFrame &frame) { frame.pixels[65] = std::nanf(""); };
    const auto negative = [](const HypothesisFrame &frame) { frame.pixels[0] = -1.0f; };
    Simulator simulator(context, small_layout(),
                        {make_hypothesis("throws", HypothesisPoint::kCodes, throws),
                         make_hypothesis("odd", HypothesisPoint::kIntensity, odd),
                         make_hypothesis("nan", HypothesisPoint::kIntensity, nan),
                         make_hypothesis("negative", HypothesisPoint::kIrradiance, negative)});
    const auto error = [&](const char *id) {
        return message_of([&] { draw(simulator, kBoardStatic, {{id, {1.0}}}); }, Status::kInvalidData);
    };
    EXPECT_TRUE(contains(error("throws"), "\"throws\" on sequence \"board_static\", frame 0 failed: the moon is full"));
    EXPECT_TRUE(contains(error("odd"), "\"odd\" on sequence \"board_static\", frame 0 failed with an exception"));
    EXPECT_TRUE(contains(error("nan"), "made the pixel x = 1, y = 1"));
    EXPECT_TRUE(contains(error("negative"), "irradiance is never negative"));
    // What failed is not kept.
    EXPECT_TRUE(contains(error("negative"), "irradiance is never negative"));
    EXPECT_EQ(draw(simulator, kBoardStatic).size(), 4 * simulator.layout().pixel_count());
}

TEST_F(GapSimulator, HypothesesThatCannotBeUsedAreRefused) {
    const auto nothing = [](const HypothesisFrame &) {};
    const auto error = [&](const Hypothesis &h, const Hypothesis *second = nullptr) {
        std::vector<Hypothesis> list{h};
        if (second)
            list.push_back(*second);
        return message_of([&] { Simulator(context, small_layout(), list); }, Status::kInvalidArgument);
    };
    const Hypothesis good = make_hypothesis("good", HypothesisPoint::kCodes, nothing);
    EXPECT_TRUE(contains(error(good, &good), "two hypotheses have the id \"good\""));
    EXPECT_TRUE(contains(error(make_hypothesis("defocus", HypothesisPoint::kCodes, nothing)),
                         "id of an effect of the catalogue"));
    EXPECT_TRUE(contains(error(make_hypothesis("", HypothesisPoint::kCodes, nothing)), "empty id"));
    EXPECT_TRUE(contains(error(make_hypothesis("x", HypothesisPoint::kCodes, {})), "neither a function"));
    EXPECT_TRUE(
        contains(error(make_hypothesis("x", static_cast<HypothesisPoint>(3), nothing)), "it must be 0 (irradiance)"));
    Hypothesis range = good;
    range.parameters[0].strong = 11.0;
    EXPECT_TRUE(contains(error(range), "weak and strong within minimum and maximum"));
    range.parameters[0].strong = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(contains(error(range), "all finite"));
    Simulator simulator(context, small_layout(), {good});
    EXPECT_TRUE(contains(message_of(
                             [&] {
                                 draw(simulator, kDark, {{"good", {11.0}}});
                             },
                             Status::kInvalidArgument),
                         "it must be -10 to 10"));
    EXPECT_TRUE(contains(message_of(
                             [&] {
                                 draw(simulator, kDark, {{"good", {}}});
                             },
                             Status::kInvalidArgument),
                         "got 0 values"));
}

TEST_F(GapSimulator, BadInputIsRefused) {
    Simulator simulator(context, small_layout());
    Codes codes(simulator.layout().pixel_count());
    const auto call = [&](std::size_t sequence, const std::vector<EffectSetting> &effects,
                          const SimulationLevels &levels, std::uint32_t frames, std::uint16_t *to) {
        return message_of([&] { simulator.codes(sequence, effects, levels, 0, frames, to); }, Status::kInvalidArgument);
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(contains(call(6, {}, kLevels, 1, codes.data()), "no sequence 6"));
    EXPECT_TRUE(contains(call(0, {}, kLevels, 0, codes.data()), "frame_count is 0"));
    EXPECT_TRUE(contains(call(0, {}, kLevels, 1, nullptr), "codes is NULL"));
    EXPECT_TRUE(contains(call(1, {}, {nan, 64.0, 4.0}, 1, codes.data()), "gain_dn is nan"));
    EXPECT_TRUE(contains(call(1, {}, {-1.0, 64.0, 4.0}, 1, codes.data()), "gain_dn is -1"));
    EXPECT_TRUE(contains(call(1, {}, {1.0, nan, 4.0}, 1, codes.data()), "black_level_dn is nan"));
    EXPECT_TRUE(contains(call(1, {}, {1.0, 64.0, -4.0}, 1, codes.data()), "read_noise_dn is -4"));
    EXPECT_TRUE(contains(call(1, {{"ambient_light", {6.0}}}, {0.0, 64.0, 4.0}, 1, codes.data()),
                         "gain_dn of sequence \"flat\" is 0"));
    EXPECT_TRUE(contains(call(0, {{"defocuss", {1.0}}}, kLevels, 1, codes.data()), "there is no effect \"defocuss\""));
    EXPECT_TRUE(contains(call(0, {{"defocus", {1.0}}, {"defocus", {1.1}}}, kLevels, 1, codes.data()), "given twice"));
    // Also where the effect does not reach.
    EXPECT_TRUE(contains(call(0, {{"defocus", {1e9}}}, kLevels, 1, codes.data()), "waves of the effect defocus"));
    EXPECT_TRUE(contains(call(0, {{"defocus", {nan}}}, kLevels, 1, codes.data()), "waves of the effect defocus"));
    EXPECT_TRUE(contains(call(0, {{"defocus", {1.0, 2.0}}}, kLevels, 1, codes.data()), "has 1 parameter"));
    EXPECT_TRUE(contains(message_of([&] { simulator.concerns("nothing", 0); }, Status::kInvalidArgument),
                         "there is no effect"));
    EXPECT_TRUE(
        contains(message_of([&] { simulator.concerns("defocus", 6); }, Status::kInvalidArgument), "no sequence 6"));
    EXPECT_TRUE(contains(message_of([&] { simulator.mean_intensity(kFlat, {}, 0, 0); }, Status::kInvalidArgument),
                         "frame_count is 0"));
}

TEST_F(GapSimulator, BadLayoutsAreRefused) {
    const auto error = [&](const std::function<void(CaptureLayout &)> &spoil) {
        CaptureLayout layout = small_layout();
        spoil(layout);
        return message_of([&] { Simulator(context, layout); }, Status::kInvalidArgument);
    };
    EXPECT_TRUE(contains(error([](CaptureLayout &l) { l.width = 0; }), "frame"));
    EXPECT_TRUE(contains(error([](CaptureLayout &l) { l.bits = 17; }), "bits are 17"));
    EXPECT_TRUE(contains(error([](CaptureLayout &l) { l.wavelength_m = 0.0; }), "wavelength_m is 0"));
    EXPECT_TRUE(
        contains(error([](CaptureLayout &l) { l.degree_of_polarization = 1.5; }), "degree_of_polarization is 1.5"));
    EXPECT_TRUE(contains(error([](CaptureLayout &l) { l.sequences.clear(); }), "no sequences"));
    EXPECT_TRUE(
        contains(error([](CaptureLayout &l) { l.dots.reset(); }), "sequence \"dots_static\": its scene is dots"));
    EXPECT_TRUE(contains(error([](CaptureLayout &l) { l.f_number = 0.0; }), "sequence \"flat\": f_number is 0"));
    EXPECT_TRUE(contains(error([](CaptureLayout &l) { l.sequences[1].mask.resize(5); }), "its mask has 5 pixels"));
    EXPECT_TRUE(
        contains(message_of([] { Simulator(nullptr, small_layout()); }, Status::kInvalidArgument), "context is NULL"));
    CaptureLayout masked = small_layout();
    masked.sequences[kFlat].mask.assign(masked.pixel_count(), 0);
    Simulator simulator(context, masked);
    EXPECT_TRUE(contains(message_of([&] { simulator.mean_intensity(kFlat, {}, 0, 1); }, Status::kInvalidData),
                         "leaves no pixel"));
}

} // namespace
} // namespace clsp::gap_simulator_test
