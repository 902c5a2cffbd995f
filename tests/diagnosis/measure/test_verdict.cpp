// What a diagnosis says of what it found: stages of unexplained gaps, effects that count as found, names,
// probabilities. Made-up numbers.
#include "inference/effect_model.hpp"
#include "measure/gap_stages.hpp"
#include "measure/verdict.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace clsp;

SequenceLayout sequence(const char *name, CaptureScene scene, bool moving = false) {
    SequenceLayout result;
    result.name = name;
    result.scene = scene;
    result.moving = moving;
    return result;
}

class Stages : public testing::Test {
  protected:
    Stages() {
        layout.sequences = {sequence("dark", CaptureScene::kDark),
                            sequence("flat", CaptureScene::kFlat),
                            sequence("board_static", CaptureScene::kBoard),
                            sequence("board_moving", CaptureScene::kBoard, true),
                            sequence("dots_static", CaptureScene::kDots),
                            sequence("dots_moving", CaptureScene::kDots, true)};
    }
    // Stage of a statistic of a sequence, where the sequences named have deviations and the others do not.
    std::string placed(const std::string &of, const std::string &stage,
                       const std::vector<std::pair<std::string, double>> &z) {
        std::vector<GapPlace> places;
        for (const SequenceLayout &s : layout.sequences) {
            GapPlace place;
            place.statistic.sequence = s.name;
            place.statistic.stage = s.name == of ? stage : "surface";
            for (const auto &[name, value] : z)
                if (name == s.name)
                    place.z = value;
            places.push_back(place);
        }
        place_stages(layout, places, {});
        for (const GapPlace &place : places)
            if (place.statistic.sequence == of)
                return place.statistic.stage;
        return {};
    }
    CaptureLayout layout;
};

TEST_F(Stages, NoLightReachesTheDark) {
    EXPECT_EQ(placed("dark", "motion", {{"dark", 9.0}, {"flat", -30.0}}), "sensor");
}

TEST_F(Stages, AFlatHasNeitherSpeckleNorDots) {
    EXPECT_EQ(placed("flat", "laser", {{"flat", -8.0}}), "sensor");
    EXPECT_EQ(placed("flat", "optics", {{"flat", 8.0}}), "optics");
}

TEST_F(Stages, WhatOnlyRestingOrMovingScenesShowIsMotion) {
    EXPECT_EQ(placed("board_static", "sensor", {{"board_static", 20.0}, {"dots_static", 9.0}}), "motion");
    EXPECT_EQ(placed("board_moving", "surface", {{"board_moving", 20.0}}), "motion");
    // A sensor that remembers shows in moving scenes alone, too.
    EXPECT_EQ(placed("board_moving", "sensor", {{"board_moving", 20.0}}), "sensor");
}

TEST_F(Stages, RestingScenesThatCouldNotShowItSayNothing) {
    const auto place = [](const char *sequence, double z, double deviation, const char *stage) {
        GapPlace result;
        result.statistic.sequence = sequence;
        result.statistic.name = "intensity_skewness";
        result.statistic.stage = stage;
        result.z = z;
        result.real = 1.0 + z * deviation;
        result.sim = 1.0;
        return result;
    };
    // Of one resting surface the skewness is known five times worse than of many: 8 deviations would be less than 2.
    std::vector<GapPlace> places = {place("board_moving", 8.0, 0.01, "laser"),
                                    place("board_static", 1.0, 0.05, "laser")};
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "laser");
    places = {place("board_moving", 8.0, 0.01, "laser"), place("board_static", 1.0, 0.012, "laser")};
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "motion");
    // Six times worse, 34 deviations would be less than 6, and 4 are no sign that they are not there.
    places = {place("board_moving", 34.0, 0.01, "laser"), place("board_static", 4.0, 0.06, "laser")};
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "laser");
    places[1].z = 1.0;
    places[1].real = 1.06;
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "motion");
    // One statistic that ought to be off at rest and is not, of two, is no majority.
    places.push_back(place("board_moving", 9.0, 0.01, "laser"));
    places.push_back(place("board_static", 1.0, 0.05, "laser"));
    places[2].statistic.name = places[3].statistic.name = "contrast";
    places[0].statistic.stage = "laser";
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "laser");
    // Frames are repeated where the scene moves, and nowhere else: it stood still.
    places = {place("board_moving", 900.0, 0.01, "sensor"), place("board_static", 0.5, 0.01, "sensor")};
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "sensor");
    places[0].statistic.name = places[1].statistic.name = "repeated_frames";
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "motion");
    // Light between dots that are wider is that of their tails; beside narrower ones (ghosts) it is the pattern's.
    for (const double width : {60.0, -60.0}) {
        places = {place("dots_moving", 200.0, 0.01, "doe"), place("dots_moving", width, 0.01, "optics"),
                  place("dots_static", 20.0, 0.01, "doe"), place("board_moving", 1.0, 0.01, "surface")};
        places[1].statistic.name = "dot_width_x";
        place_stages(layout, places, {});
        EXPECT_EQ(places[0].statistic.stage, width > 0.0 ? "optics" : "doe");
    }
    // A pattern falls on dots only: one cause for boards and dots is no pattern.
    places = {place("dots_moving", 80.0, 0.01, "doe"), place("board_moving", 70.0, 0.01, "optics"),
              place("board_static", 70.0, 0.01, "optics")};
    place_stages(layout, places, {});
    EXPECT_EQ(places[0].statistic.stage, "optics");
}

TEST_F(Stages, RestingLightThatChangesAsAWholeIsTheLasers) {
    const auto place = [](const char *sequence, const char *name, double z, double excess) {
        GapPlace result;
        result.statistic.sequence = sequence;
        result.statistic.name = name;
        result.statistic.stage = "motion";
        result.z = z;
        result.real = excess;
        return result;
    };
    const auto stage = [&](double rows, double columns, double mean, double flat, const char *scene) {
        std::vector<GapPlace> places = {
            place(scene, "row_noise", 50.0 * rows, rows), place(scene, "column_noise", 50.0 * columns, columns),
            place(scene, "frame_mean_fluctuation", mean, mean), place("board_moving", "contrast", 1.0, 0.02),
            place("flat", "row_noise", flat, 0.02)};
        place_stages(layout, places, {});
        return places[0].statistic.stage;
    };
    EXPECT_EQ(stage(4.0, 0.1, 20.0, 1.0, "board_static"), "laser") << "a rolling shutter";
    EXPECT_EQ(stage(0.0, 0.0, 40.0, 1.0, "board_static"), "laser") << "whole frames";
    EXPECT_EQ(stage(1.0, 0.9, 40.0, 1.0, "board_static"), "motion") << "speckle that changes: rows and columns alike";
    EXPECT_EQ(stage(0.0, 0.0, 1.0, 1.0, "board_static"), "motion");
    // The flat has other light: what changes there is read so.
    EXPECT_EQ(stage(4.0, 0.1, 20.0, 50.0, "board_static"), "sensor");
    // In moving scenes rows differ by their grain, too.
    EXPECT_EQ(stage(4.0, 0.1, 20.0, 1.0, "dots_moving"), "motion");
}

TEST_F(Stages, ACauseThatAKnownEffectImitatesLiesWhereThatDoes) {
    const auto stages = [&](const std::vector<std::pair<const char *, double>> &z, const std::string &alike) {
        std::vector<GapPlace> places;
        for (const auto &[sequence, deviation] : z) {
            GapPlace result;
            result.statistic.sequence = sequence;
            result.statistic.stage = "surface";
            result.z = deviation;
            places.push_back(result);
        }
        place_stages(layout, places, alike);
        return places.front().statistic.stage;
    };
    const std::vector<std::pair<const char *, double>> lit = {
        {"board_moving", 90.0}, {"board_static", 80.0}, {"dots_moving", 70.0}, {"dots_static", 60.0}};
    EXPECT_EQ(stages(lit, ""), "surface");
    EXPECT_EQ(stages(lit, "optics"), "optics");
    // What the sequences say is surer.
    EXPECT_EQ(stages({{"dark", 90.0}, {"board_moving", 80.0}}, "optics"), "sensor");
}

TEST_F(Stages, DotsOnASurfaceThatAgrees) {
    EXPECT_EQ(placed("dots_moving", "surface", {{"dots_moving", 20.0}, {"dots_static", -12.0}}), "doe");
    EXPECT_EQ(placed("dots_moving", "laser", {{"dots_moving", 20.0}, {"dots_static", -12.0}}), "laser");
}

TEST_F(Stages, WhereTheLightOfAPatternLies) {
    layout.sequences = {sequence("board_moving", CaptureScene::kBoard, true),
                        sequence("dots_moving", CaptureScene::kDots, true)};
    struct Deviation {
        const char *sequence, *statistic, *stage;
        double z;
    };
    const auto stages = [&](const std::vector<Deviation> &deviations, const std::string &alike) {
        std::vector<GapPlace> places;
        for (const Deviation &d : deviations) {
            GapPlace place;
            place.statistic.sequence = d.sequence;
            place.statistic.name = d.statistic;
            place.statistic.stage = d.stage;
            place.z = d.z;
            places.push_back(place);
        }
        place_stages(layout, places, alike);
        std::vector<std::string> result;
        for (const GapPlace &place : places)
            result.push_back(place.statistic.stage);
        return result;
    };
    using Names = std::vector<std::string>;
    // Less contrast alone is like depolarization; with light between the dots it comes through the lens.
    const Deviation contrast{"board_moving", "contrast", "surface", -90.0},
        between{"dots_moving", "light_between_dots", "doe", 40.0},
        little{"dots_moving", "light_between_dots", "doe", 9.0};
    EXPECT_EQ(stages({contrast, {"dots_moving", "contrast", "surface", -70.0}}, "laser"), (Names{"laser", "laser"}));
    EXPECT_EQ(stages({contrast, between}, "laser"), (Names{"optics", "optics"}));
    // Faint copies of the dots, too: the image is there twice. What lies on the axis alone is the pattern's.
    const Deviation copies{"dots_moving", "peak_point_reflections", "optics", 15.0},
        axis{"dots_moving", "peak_on_axis", "doe", 15.0};
    EXPECT_EQ(stages({contrast, copies}, "laser"), (Names{"optics", "optics"}));
    EXPECT_EQ(stages({contrast, axis}, "laser"), (Names{"laser", "laser"}));
    EXPECT_EQ(stages({contrast, {"dots_moving", "peak_point_reflections", "optics", 9.0}}, "laser"),
              (Names{"laser", "laser"}));
    EXPECT_EQ(stages({contrast, little}, "laser"), (Names{"laser", "laser"}));
    EXPECT_EQ(stages({contrast, {"dots_moving", "light_between_dots", "doe", -40.0}}, "laser"),
              (Names{"laser", "laser"}));
    // Dots without light have no width; dots that are spread lack light, too, but it lies beside them.
    const Deviation empty{"dots_moving", "core_below_10_percent", "doe", 90.0},
        width{"dots_moving", "dot_width", "optics", 95.0};
    EXPECT_EQ(stages({width, empty}, ""), (Names{"doe", "doe"}));
    EXPECT_EQ(stages({width, empty, between}, ""), (Names{"optics", "optics", "optics"}));
    EXPECT_EQ(stages({width, {"dots_moving", "core_below_10_percent", "doe", 9.0}}, ""), (Names{"optics", "optics"}));
}

TEST_F(Stages, SmallDeviationsBesideLargeOnesRuleNothingOut) {
    // 6 deviations in the dark are a hundredth of what the boards show.
    const std::vector<std::pair<std::string, double>> z = {{"dark", 6.0},
                                                           {"board_static", 900.0},
                                                           {"board_moving", 900.0},
                                                           {"dots_static", 900.0},
                                                           {"dots_moving", 900.0}};
    EXPECT_EQ(placed("board_moving", "optics", z), "optics");
    EXPECT_EQ(placed("board_moving", "optics", {{"dark", 4.0}, {"board_moving", 7.0}, {"board_static", 7.0}}),
              "optics");
}

TEST_F(Stages, WhatWasNotRecordedRulesNothingOut) {
    layout.sequences = {sequence("board_static", CaptureScene::kBoard)};
    EXPECT_EQ(placed("board_static", "surface", {{"board_static", 20.0}}), "surface");
}

TEST(Explained, ByTheStatisticsThatAnEffectMoves) {
    const Eigen::VectorXd moved = (Eigen::VectorXd(4) << 50.0, -6.0, 3.0, 0.0).finished();
    EXPECT_TRUE(explained(moved, (Eigen::VectorXd(4) << 1.0, -1.5, 40.0, 90.0).finished()));
    EXPECT_FALSE(explained(moved, (Eigen::VectorXd(4) << 1.0, -2.5, 0.0, 0.0).finished()));
    EXPECT_FALSE(explained(Eigen::VectorXd::Constant(4, 3.9), Eigen::VectorXd::Zero(4))); // it moves nothing
}

RankedEffect ranked(const char *effect, double gain) {
    RankedEffect result;
    result.effect = effect;
    result.gain = gain;
    return result;
}

SearchStep step(std::vector<RankedEffect> ranking) {
    SearchStep result;
    weigh(ranking);
    result.added = ranking.front().effect;
    result.ranking = std::move(ranking);
    return result;
}

TEST(Weigh, LikelihoodRatiosByHalf) {
    std::vector<RankedEffect> ranking = {ranked("glare", 90.0), ranked("defocus", 100.0)};
    weigh(ranking);
    EXPECT_EQ(ranking[0].effect, "defocus");
    EXPECT_NEAR(ranking[0].probability + ranking[1].probability, 1.0, 1e-12);
    // A quarter of the difference of -2 log likelihood, where a half would be the likelihood's own.
    EXPECT_NEAR(ranking[1].probability / ranking[0].probability, std::exp(-10.0 / 4.0), 1e-12);
}

TEST(Names, CertainStepsAreNamed) {
    DiagnosisResult result;
    result.probability = 1.0;
    name_effects({step({ranked("defocus", 400.0), ranked("glare", 300.0)}), step({ranked("dsnu", 50.0)})}, {}, result);
    EXPECT_EQ(result.verdict, Verdict::kNamed);
    EXPECT_EQ(result.effects, (std::vector<std::string>{"defocus", "dsnu"}));
    EXPECT_TRUE(result.equivalent.empty());
    EXPECT_GT(result.probability, 0.99);
}

TEST(Names, EqualRivalsAreEquivalent) {
    DiagnosisResult result;
    result.probability = 1.0;
    name_effects({step({ranked("linewidth", 100.0), ranked("depolarization", 99.0), ranked("glare", 40.0)})}, {},
                 result);
    EXPECT_EQ(result.verdict, Verdict::kAmbiguous);
    EXPECT_EQ(result.equivalent, (std::vector<std::string>{"linewidth", "depolarization"}));
    EXPECT_LT(result.probability, 0.6);
}

TEST(Moved, BySignificantDeviationsAlone) {
    Eigen::VectorXd moved(3);
    moved << 1.0, -9.0, 3.9;
    EXPECT_EQ(most_moved(moved, {false, true, true}), 9.0);
    EXPECT_EQ(most_moved(moved, {true, false, true}), 0.0);
    EXPECT_EQ(most_moved(moved, {false, false, false}), 0.0);
}

TEST(Slight, WhatIsFarWeakerThanTheCatalogueHasItIsNotNamed) {
    const std::vector<Candidate> all = candidates({}, {});
    const auto step = [](const char *effect) {
        SearchStep result;
        result.added = effect;
        result.ranking = {RankedEffect{effect, {}, 100.0, 1.0, 0.0, true}};
        return result;
    };
    const std::vector<SearchStep> steps = {step("glare"), step("ambient_light"), step("gamma"),
                                           step("pixel_integration"), step("beam_skew")};
    const std::vector<FittedParameter> parameters = {
        {"glare", "fraction", 0.025, 0.02, 0.03},     {"glare", "scale_px", 9.0, 8.0, 10.0},
        {"ambient_light", "level_dn", 5.9, 5.0, 7.0}, {"gamma", "gamma", 0.985, 0.98, 0.99},
        {"pixel_integration", "fill_factor", 0.6, 0.5, 0.7}, {"beam_skew", "skew", -0.8, -0.9, -0.7}};
    const std::vector<bool> slight = slight_effects(steps, parameters, all);
    EXPECT_EQ(slight, (std::vector<bool>{true, false, true, false, false}));
    DiagnosisResult result;
    name_effects(steps, slight, result);
    EXPECT_EQ(result.verdict, Verdict::kNamed);
    EXPECT_EQ(result.effects, (std::vector<std::string>{"ambient_light", "pixel_integration", "beam_skew"}));
    // On their own, weak effects are what there is.
    EXPECT_EQ(slight_effects({step("glare"), step("gamma")}, parameters, all), (std::vector<bool>{false, false}));
}

// What no scene shows, beside effects that scenes do show, is a model's chance: one of its many statistics moved a
// little.
TEST(Slight, WhatNoSceneShowsIsNotNamed) {
    std::vector<SearchStep> steps(3);
    steps[0].added = "prnu";
    steps[1].added = "nonlinearity";
    steps[2].added = "defocus";
    std::vector<RungResult> rungs(3);
    rungs[1].effects = {"prnu"};
    rungs[2].effects = {"prnu", "defocus"};
    EXPECT_EQ(shows_nowhere(steps, rungs), (std::vector<bool>{false, true, false}));
    // Where none stands out, all together are what there is.
    EXPECT_EQ(shows_nowhere(steps, {RungResult{}}), (std::vector<bool>{false, false, false}));
    EXPECT_EQ(shows_nowhere(steps, {}), (std::vector<bool>{false, false, false}));
}

TEST(Slight, InItsOwnDirection) {
    const std::vector<Candidate> all = candidates({}, {});
    const struct {
        const char *effect, *name;
        double value;
        bool slight;
    } cases[] = {{"gamma", "gamma", 1.2, false},  {"gamma", "gamma", 1.02, true},  {"gamma", "gamma", 0.8, false},
                 {"gamma", "gamma", 0.985, true}, {"defocus", "waves", 0.8, false}, {"defocus", "waves", 0.1, true},
                 {"wavelength_shift", "delta_nm", -6.0, false}, {"wavelength_shift", "delta_nm", -0.5, true},
                 {"aperture_mismatch", "f_number_ratio", 0.7, false},
                 {"aperture_mismatch", "f_number_ratio", 0.98, true},
                 {"aperture_mismatch", "f_number_ratio", 1.3, false}};
    for (const auto &c : cases) {
        std::vector<SearchStep> steps(2);
        steps[0].added = "row_noise";
        steps[1].added = c.effect;
        const std::vector<FittedParameter> parameters = {{"row_noise", "sigma_dn", 3.0, 2.9, 3.1},
                                                         {c.effect, c.name, c.value, c.value, c.value}};
        EXPECT_EQ(slight_effects(steps, parameters, all), (std::vector<bool>{false, c.slight}))
            << c.effect << ' ' << c.value;
    }
}

TEST(Reading, LagThatRemembersOrDoesNot) {
    CaptureLayout layout;
    layout.sequences.resize(2);
    layout.sequences[0].name = "board_static";
    layout.sequences[1].name = "board_moving";
    layout.sequences[1].moving = true;
    layout.sequences[0].frame_count = layout.sequences[1].frame_count = 40;
    std::vector<StatisticInfo> list(4);
    list[0].name = "temporal_correlation_1";
    list[1].name = "temporal_correlation_2";
    list[2].name = list[3].name = "contrast";
    list[0].sequence = list[1].sequence = list[2].sequence = "board_moving";
    list[3].sequence = "board_static";
    const Eigen::VectorXd change = (Eigen::VectorXd(4) << 0.0, 0.0, -0.2, -0.2).finished();
    const Eigen::MatrixXd jacobian = Eigen::MatrixXd::Ones(4, 2);
    const Eigen::VectorXd tolerance = reading_tolerance(list, layout, {{"defocus", {1.0}}, {"image_lag", {0.1}}},
                                                        {{0, 0, 0.5}, {1, 0, 0.5}}, change, jacobian);
    // The light of the frame before alone: f (1 - f) / (1 - 2 f + 2 f^2), not f.
    EXPECT_GT(tolerance[0], 0.1 * 0.9 / 0.82 - 0.1);
    EXPECT_NEAR(tolerance[0], 0.01, 1e-15);
    EXPECT_NEAR(tolerance[1], 0.01, 1e-15);
    // One of 40 frames had a frame before it, or had not.
    EXPECT_NEAR(tolerance[2], 0.2 / 40, 1e-15);
    EXPECT_EQ(tolerance[3], 0.0);
    EXPECT_EQ(reading_tolerance(list, layout, {{"defocus", {1.0}}}, {{0, 0, 0.5}}, change, jacobian).norm(), 0.0);
}

TEST(Reading, DistortionOfTheLensOrOfTheProjector) {
    CaptureLayout layout;
    layout.sequences.resize(1);
    layout.sequences[0].name = "dots_moving";
    std::vector<StatisticInfo> list(3);
    list[0].name = "dot_cubic_displacement";
    list[1].name = "dot_width";
    list[2].name = "contrast";
    for (StatisticInfo &one : list)
        one.sequence = "dots_moving";
    // Of a scale in pixels and its room, then of k1 from 0.01 to 0.05.
    const Eigen::MatrixXd jacobian =
        (Eigen::MatrixXd(3, 3) << 9.0, 9.0, 0.3, 9.0, 9.0, -0.2, 9.0, 9.0, 0.0).finished();
    // A form of an effect (which of the mosaic's diagonals) is a value without a column.
    const EffectSettings effects = {
        {"glare", {0.1, 6.0}}, {"bayer_mismatch", {0.03, 1.0}}, {"lens_distortion", {-0.03}}};
    Eigen::MatrixXd of_all(3, 4);
    of_all << jacobian.leftCols(2), Eigen::VectorXd::Constant(3, 7.0), jacobian.rightCols(1);
    const Eigen::VectorXd tolerance = reading_tolerance(
        list, layout, effects, {{0, 0, 0.5}, {0, 1, 0.5}, {1, 0, 0.5}, {2, 0, 0.5}}, Eigen::VectorXd::Ones(3), of_all);
    EXPECT_EQ(tolerance[0], 0.0); // both move the dots
    EXPECT_NEAR(tolerance[1], 0.2 * 0.03 / 0.04, 1e-12);
    EXPECT_EQ(tolerance[2], 0.0);
}

TEST(Reading, PhotonsByPoissonsLawOrAGaussianOne) {
    CaptureLayout layout;
    layout.sequences.resize(1);
    layout.sequences[0].name = "flat";
    std::vector<StatisticInfo> list(2);
    list[0].name = "noise_skewness";
    list[1].name = "temporal_variance";
    list[0].sequence = list[1].sequence = "flat";
    const Eigen::VectorXd change = (Eigen::VectorXd(2) << -0.03, 1.2).finished();
    const Eigen::MatrixXd jacobian = Eigen::MatrixXd::Ones(2, 1);
    const Eigen::VectorXd tolerance =
        reading_tolerance(list, layout, {{"shot_noise", {0.3}}}, {{0, 0, 0.5}}, change, jacobian);
    EXPECT_NEAR(tolerance[0], 0.03, 1e-15);
    EXPECT_EQ(tolerance[1], 0.0); // both laws have the variance
    EXPECT_EQ(reading_tolerance(list, layout, {{"row_noise", {2.0}}}, {{0, 0, 0.5}}, change, jacobian).norm(), 0.0);
}

} // namespace
