// The statistics behind a verdict: tail probabilities, shrunk covariances, the gap test's level, candidates' strengths, and verdicts on
// captures of the simulator itself. Verdicts against an independent generator are the withheld check's (validation/gap_check).
#include "diagnosis/inference/attribution_support.hpp"
#include "effects/effects.hpp"
#include "inference/candidate.hpp"
#include "inference/covariance.hpp"
#include "inference/response.hpp"
#include "inference/thresholds.hpp"
#include "report/advice.hpp"
#include "report/report_json.hpp"
#include "run/diagnose.hpp"
#include "runtime/error.hpp"
#include "simulator/simulator.hpp"
#include "statistics/distributions.hpp"

#include <Eigen/Core>
#include <cmath>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>
#include <set>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

TEST(Distributions, AgreeWithTables) {
    // Student's t, 10 degrees of freedom: 2.228 at 5 % two-sided; 30: 2.750 at 1 %.
    EXPECT_NEAR(student_two_sided(2.228, 10.0), 0.05, 1e-4);
    EXPECT_NEAR(student_two_sided_quantile(0.01, 30.0), 2.750, 1e-3);
    EXPECT_DOUBLE_EQ(student_two_sided(0.0, 5.0), 1.0);
    EXPECT_LT(student_two_sided(1e6, 40.0), 1e-100);
    EXPECT_GE(student_two_sided(1e300, 40.0), 0.0);
    // Chi squared of 10 degrees of freedom is a gamma law of mean 10 and variance 20: 18.307 at 5 %.
    EXPECT_NEAR(gamma_upper(18.307, 10.0, 20.0), 0.05, 1e-4);
    EXPECT_EQ(gamma_upper(0.0, 1.0, 1.0), 1.0);
    // A gamma law of mean 100 and variance 100 has the skewness 0.2.
    EXPECT_NEAR(gamma_upper(140.0, 100.0, 100.0), 0.5 * std::erfc(without_skewness(4.0, 0.2) / std::sqrt(2.0)), 2e-5);
    EXPECT_DOUBLE_EQ(without_skewness(-4.0, 0.2), -4.0);
    EXPECT_DOUBLE_EQ(without_skewness(-4.0, -0.2), -without_skewness(4.0, 0.2));
    EXPECT_DOUBLE_EQ(without_skewness(4.0, 0.0), 4.0);
}

// Gaussian replicates of two blocks, correlated within the first by 0.8.
Eigen::MatrixXd gaussian(Eigen::Index rows, unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    Eigen::MatrixXd result(rows, 12);
    for (Eigen::Index r = 0; r < rows; ++r) {
        const double common = normal(random);
        for (Eigen::Index k = 0; k < 12; ++k)
            result(r, k) = (k < 6 ? std::sqrt(0.8) * common + std::sqrt(0.2) * normal(random) : normal(random)) * (1.0 + static_cast<double>(k));
    }
    return result;
}

TEST(Covariance, WhitensWhatItHasNotSeen) {
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(12);
    const Covariance covariance(gaussian(200, 1), {0, 6, 12}, none, none);
    const Eigen::MatrixXd fresh = gaussian(2000, 2);
    double sum = 0.0;
    for (Eigen::Index r = 0; r < fresh.rows(); ++r)
        sum += covariance.whiten(fresh.row(r).transpose()).squaredNorm() / 12.0;
    // The mean of 2,000 chi-squared values has a standard deviation of 1 %; 200 replicates and the shrinkage leave up to 10 %.
    EXPECT_NEAR(sum / 2000.0, 1.0, 0.12);
}

// 48 replicates know the skewness of a Gaussian law to 0.35, and two of three times are not certain of any.
TEST(Covariance, SkewnessIsCertain) {
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal;
    std::exponential_distribution<double> exponential;
    const Eigen::MatrixXd none = Eigen::MatrixXd::NullaryExpr(48, 300, [&] { return normal(random); });
    const Eigen::MatrixXd two = Eigen::MatrixXd::NullaryExpr(48, 300, [&] { return -exponential(random); });
    const Eigen::VectorXd certain = certain_skewness(none);
    EXPECT_NEAR(static_cast<double>((certain.array() == 0.0).count()) / 300.0, 0.7, 0.1);
    EXPECT_LT(std::sqrt(certain.squaredNorm() / 300.0), 0.25);
    EXPECT_NEAR(certain_skewness(two).mean(), -1.5, 0.3);
    EXPECT_EQ(certain_skewness(Eigen::MatrixXd::Constant(48, 1, 3.0))[0], 0.0);
}

TEST(Covariance, ToleranceIsAddedToTheSpread) {
    const Eigen::MatrixXd replicates = gaussian(100, 3);
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(12), tolerance = Eigen::VectorXd::Constant(12, 30.0);
    const Covariance plain(replicates, {0, 6, 12}, none, none), wide(replicates, {0, 6, 12}, none, tolerance);
    for (Eigen::Index k = 0; k < 12; ++k)
        EXPECT_NEAR(wide.deviation()[k], std::hypot(plain.deviation()[k], 30.0), 1e-9);
    EXPECT_EQ(plain.tolerance_square(0), 0.0);
    EXPECT_GT(wide.tolerance_square(0) + wide.tolerance_square(1), 6.0);
}

TEST(Covariance, ConstantStatisticsKeepTheirFloor) {
    Eigen::MatrixXd replicates = gaussian(20, 4);
    replicates.col(7).setConstant(3.0);
    Eigen::VectorXd least = Eigen::VectorXd::Constant(12, 0.25);
    const Covariance covariance(replicates, {0, 6, 12}, least, Eigen::VectorXd::Zero(12));
    EXPECT_DOUBLE_EQ(covariance.deviation()[7], 0.25);
    EXPECT_TRUE(covariance.whiten(Eigen::VectorXd::Ones(12)).allFinite());
}

TEST(Candidates, StrengthsRunFromWeakToStrong) {
    const std::vector<Candidate> all = candidates({}, {});
    EXPECT_EQ(all.size(), effect_catalogue().size());
    for (const Candidate &candidate : all) {
        for (std::size_t p = 0; p < candidate.parameters.size(); ++p) {
            const HypothesisParameter &parameter = candidate.parameters[p];
            if (parameter.weak != parameter.strong) {
                EXPECT_NEAR(candidate.value(p, 0.0), parameter.weak, 1e-12 * std::abs(parameter.weak)) << candidate.id;
                EXPECT_NEAR(candidate.value(p, 1.0), parameter.strong, 1e-12 * std::abs(parameter.strong)) << candidate.id;
            }
            for (const double u : {-0.5, 0.3, 1.6}) {
                const double value = candidate.value(p, u);
                EXPECT_GE(value, parameter.minimum);
                EXPECT_LE(value, parameter.maximum);
                if (value > parameter.minimum && value < parameter.maximum && !candidate.is_choice(p)) {
                    EXPECT_NEAR(candidate.strength(p, value), candidate.snapped(p, u), 1e-9) << candidate.id << ' ' << parameter.name;
                }
            }
        }
    }
    EXPECT_EQ(candidates({}, {"defocus", "gamma"}).size(), all.size() - 2);
    try {
        candidates({}, {"defokus"});
        FAIL() << "an unknown id was taken";
    } catch (const Error &error) {
        EXPECT_NE(std::string(error.what()).find("defokus"), std::string::npos);
    }
}

TEST(Candidates, RangesInDnGoWithTheCamera) {
    const std::vector<Candidate> catalogue = candidates({}, {});
    const auto of = [](const std::vector<Candidate> &all, const std::string &id) {
        return *std::find_if(all.begin(), all.end(), [&](const Candidate &c) { return c.id == id; });
    };
    CaptureLayout camera;
    camera.bits = 10;
    camera.read_noise_dn = 4.0;
    std::vector<Candidate> same = catalogue;
    scale_to_camera(same, camera, 5.0);
    for (std::size_t i = 0; i < catalogue.size(); ++i)
        for (std::size_t p = 0; p < catalogue[i].parameters.size(); ++p) {
            EXPECT_EQ(same[i].parameters[p].weak, catalogue[i].parameters[p].weak) << catalogue[i].id;
            EXPECT_EQ(same[i].parameters[p].strong, catalogue[i].parameters[p].strong) << catalogue[i].id;
        }
    camera.bits = 8;
    camera.read_noise_dn = 0.5;
    Hypothesis own;
    own.id = "own";
    own.parameters = {{"level_dn", "DN", 0.0, 1000.0, 100.0, 500.0}};
    std::vector<Candidate> coarse = candidates({own}, {});
    scale_to_camera(coarse, camera, 0.9);
    EXPECT_DOUBLE_EQ(of(coarse, "full_well").parameters[0].weak, 650.0 * 255.0 / 1023.0);
    EXPECT_DOUBLE_EQ(of(coarse, "full_well").parameters[0].strong, 380.0 * 255.0 / 1023.0);
    EXPECT_DOUBLE_EQ(of(coarse, "shot_noise").parameters[0].weak, 0.08 * 255.0 / 1023.0);
    EXPECT_DOUBLE_EQ(of(coarse, "row_noise").parameters[0].strong, 4.0 / 8.0);
    EXPECT_EQ(of(coarse, "adc_bits").parameters[0].weak, 6.0);
    EXPECT_EQ(of(coarse, "adc_bits").parameters[0].strong, 4.0);
    EXPECT_EQ(of(coarse, "adc_bits").parameters[0].maximum, 8.0);
    EXPECT_EQ(of(coarse, "defocus").parameters[0].weak, of(catalogue, "defocus").parameters[0].weak);
    EXPECT_EQ(of(coarse, "own").parameters[0].weak, 100.0);
    // A data sheet that is far off: what the dark frames show; without them a code's own rounding.
    camera.read_noise_dn = 0.0;
    std::vector<Candidate> measured = catalogue, silent = catalogue;
    scale_to_camera(measured, camera, 3.0);
    EXPECT_DOUBLE_EQ(of(measured, "row_noise").parameters[0].strong, 3.0);
    scale_to_camera(silent, camera, 0.0);
    EXPECT_NEAR(of(silent, "row_noise").parameters[0].strong, 1.0 / std::sqrt(12.0), 1e-12);
}

TEST(Candidates, WholeNumbersStayWhole) {
    const std::vector<Candidate> all = candidates({}, {});
    const Candidate &bits = *std::find_if(all.begin(), all.end(), [](const Candidate &c) { return c.id == "adc_bits"; });
    EXPECT_EQ(bits.value(0, 0.2), 8.0); // 7.6
    EXPECT_EQ(bits.value(0, 0.3), 7.0); // 7.4
    EXPECT_NEAR(bits.snapped(0, 0.3), 0.5, 1e-12);
    for (const double u : {-0.5, 0.0, 0.2, 0.5, 1.0, 1.5})
        EXPECT_EQ(std::abs(bits.value(0, u + bits.difference(0, u)) - bits.value(0, u)), 1.0) << u;
    const Candidate &gamma = *std::find_if(all.begin(), all.end(), [](const Candidate &c) { return c.id == "gamma"; });
    EXPECT_EQ(gamma.snapped(0, 0.3), 0.3);
    EXPECT_GT(gamma.difference(0, 0.3), 0.0);
    EXPECT_LT(gamma.difference(0, 1.2), 0.0);
}

// A strength beyond what its value may be is no strength: differences from there would be of nothing.
TEST(Candidates, StrengthsEndWhereValuesDo) {
    std::vector<Candidate> all = candidates({}, {});
    // Less room on the other side; a count that falls to none.
    all.push_back({"lopsided", "sensor", "", {{"slope", "1", -0.3, 1.0, 0.02, 0.2}, {"gain", "1", 0.5, 3.0, 1.0, 2.0}}});
    all.push_back({"frames_kept", "sensor", "", {{"count", "1", 0.0, 16.0, 8.0, 1.0, true}}});
    for (const Candidate &candidate : all)
        for (const double sign : {1.0, -1.0})
            for (std::size_t p = 0; p < candidate.parameters.size(); ++p)
                for (double u = kStrengths.weakest; u <= kStrengths.strongest; u += 0.1) {
                    if ((sign < 0.0 && !candidate.has_direction()) || candidate.is_choice(p))
                        continue;
                    const double held = candidate.snapped(p, u, sign), value = candidate.value(p, u, sign);
                    EXPECT_NEAR(candidate.value(p, held, sign), value, 1e-12 * std::abs(value)) << candidate.id;
                    EXPECT_NEAR(candidate.snapped(p, held, sign), held, 1e-9) << candidate.id;
                    EffectModel model;
                    model.add(candidate, sign, u);
                    const double from = model.strengths[p].strength, before = model.settings()[0].values[p];
                    EXPECT_GE(before, candidate.parameters[p].minimum) << candidate.id;
                    EXPECT_LE(before, candidate.parameters[p].maximum) << candidate.id;
                    if (candidate.has_direction() && u > 0.0) {
                        const bool turned = p == 0 && sign < 0.0;
                        if (candidate.is_ratio(p)) {
                            EXPECT_EQ(before < 1.0, (candidate.parameters[p].weak < 1.0) != turned)
                                << candidate.id << " at " << u;
                        } else {
                            EXPECT_EQ(before < 0.0, turned) << candidate.id << " at " << u;
                        }
                    }
                    const double moved = move_one(model, static_cast<Eigen::Index>(p));
                    const double after = model.settings()[0].values[p];
                    EXPECT_NEAR(model.strengths[p].strength, from + moved, 1e-12) << candidate.id;
                    EXPECT_NE(after, before) << candidate.id << " at " << u;
                    EXPECT_NEAR(candidate.strength(p, after, sign) - candidate.strength(p, before, sign), moved, 1e-9)
                        << candidate.id << " at " << u;
                    if (candidate.parameters[p].whole) {
                        EXPECT_EQ(1.0, std::abs(after - before)) << candidate.id << " at " << u;
                    }
                }
}

TEST(Candidates, WhatGoesBothWays) {
    std::vector<std::string> from_nothing, from_one;
    std::vector<Candidate> all = candidates({}, {});
    all.push_back({"my_ratio", "sensor", "", {{"ratio", "1", 0.3, 1.0 / 0.3, 1.2, 1.5}}});
    all.push_back({"not_around_one", "sensor", "", {{"ratio", "1", 0.2, 5.0, 0.8, 1.5}}});
    all.push_back({"part", "sensor", "", {{"part", "1", 0.1, 1.0, 0.8, 0.5}}});
    for (const Candidate &candidate : all)
        if (candidate.has_direction())
            (candidate.is_ratio(0) ? from_one : from_nothing).push_back(candidate.id);
    std::sort(from_nothing.begin(), from_nothing.end());
    EXPECT_EQ(from_nothing, (std::vector<std::string>{"bayer_mismatch", "beam_skew", "lens_distortion", "wavelength_shift"}));
    EXPECT_EQ(from_one, (std::vector<std::string>{"aperture_mismatch", "gamma", "my_ratio"}));
    const Candidate &ratio = all[all.size() - 3];
    EXPECT_DOUBLE_EQ(ratio.value(0, 1.0, -1.0), 1.0 / 1.5);
    EXPECT_NEAR(ratio.strength(0, 1.0 / 1.5, -1.0), 1.0, 1e-12);
    EXPECT_EQ(ratio.sign_of(1.1), 1.0);
    EXPECT_EQ(ratio.sign_of(0.9), -1.0);
}

TEST(Candidates, AFitMayBeginElsewhere) {
    std::vector<Candidate> all = candidates({}, {});
    const std::vector<Candidate> more = with_alternatives(all);
    ASSERT_EQ(more.size(), all.size() + 9);
    const Candidate &other = more[all.size() + 1];
    EXPECT_EQ(other.id, "beam_skew");
    const Candidate &usual = *std::find_if(all.begin(), all.end(), [](const Candidate &c) { return c.id == "beam_skew"; });
    EXPECT_EQ(usual.usual(1, 1.0), 0.0);
    EXPECT_NEAR(other.usual(1, 1.0), 1.5708, 1e-4);
    // What has a range on both sides of 0 has room on both sides of where the catalogue leaves it.
    for (const Candidate *candidate : {&usual, &other}) {
        const double at = candidate->usual(1, 1.0);
        EXPECT_EQ(candidate->value(1, 0.0), at);
        EXPECT_NEAR(candidate->value(1, 1.0), at + 1.5708, 1e-4);
        EXPECT_NEAR(candidate->value(1, -0.8), at - 0.8 * 1.5708, 1e-4);
        EXPECT_NEAR(candidate->strength(1, at - 0.3), -0.3 / 1.5708, 1e-4);
    }
    // One effect, wherever it begins: it is in a model once.
    EffectModel model;
    model.add(usual, 1.0, 0.5);
    EXPECT_TRUE(model.has(other));
    EXPECT_EQ(with_alternatives(candidates({}, {"beam_skew"})).size(), all.size() + 5);
}

// Which form an effect has is no strength: each form is a candidate, and the fitted parameters say which it was.
TEST(Candidates, FormsAreChosenNotFitted) {
    const std::vector<Candidate> all = with_alternatives(candidates({}, {}));
    std::vector<double> forms;
    for (const Candidate &candidate : all) {
        if (candidate.id != "ghost_dots")
            continue;
        EXPECT_FALSE(candidate.is_choice(0));
        ASSERT_TRUE(candidate.is_choice(1));
        EffectModel model;
        model.add(candidate, 1.0, 0.5);
        ASSERT_EQ(model.strengths.size(), 1u);
        const std::vector<double> values = model.settings().front().values;
        ASSERT_EQ(values.size(), 2u);
        EXPECT_NEAR(values[0], 0.1225, 1e-3); // half way from 0.06 to 0.25, in equal ratios
        forms.push_back(values[1]);
        const auto fitted = fitted_parameters(model, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Constant(1, 0.1), 24.0);
        ASSERT_EQ(fitted.size(), 2u);
        EXPECT_EQ(fitted[1].name, "lattice_direction");
        EXPECT_EQ(fitted[1].value, values[1]);
        EXPECT_EQ(fitted[1].low, values[1]);
        EXPECT_EQ(fitted[1].high, values[1]);
    }
    EXPECT_EQ(forms, (std::vector<double>{0.0, 1.0, 2.0}));
    // Whole numbers that the catalogue varies are fitted; so is the first parameter of what it does not vary.
    for (const Candidate &candidate : candidates({}, {}))
        if (candidate.id == "adc_bits" || candidate.id == "pixel_integration") {
            EXPECT_TRUE(candidate.is_varied(0)) << candidate.id;
            EXPECT_FALSE(candidate.is_choice(0)) << candidate.id;
        }
}

TEST(Candidates, RangesAroundOne) {
    const struct {
        HypothesisParameter parameter;
        bool both_ways;
    } cases[] = {{{"ratio", "1", 0.3333, 3.0, 1.2, 1.5}, true}, // as decimals have it
                 {{"ratio", "1", 0.2, 5.0, 1.5, 1.5}, true},    // of one strength
                 {{"ratio", "1", 0.2, 5.0, 1.0, 0.7}, true},    // from what does nothing
                 {{"ratio", "1", 1.0 / 15.5, 15.5, 1.0, 1.4}, true},
                 {{"ratio", "1", 0.2, 5.0, 1.0, 1.0}, false},
                 {{"ratio", "1", -2.0, -0.5, -0.9, -0.6}, false},
                 {{"ratio", "px", 0.2, 5.0, 1.2, 1.5}, false},
                 {{"ratio", "1", 0.25, 5.0, 1.2, 1.5}, false}};
    for (const auto &c : cases) {
        const HypothesisParameter &p = c.parameter;
        const Candidate candidate{"mine", "sensor", "", {p}};
        EXPECT_EQ(candidate.has_direction(), c.both_ways) << p.minimum << ' ' << p.weak << ' ' << p.strong;
        if (!c.both_ways)
            continue;
        for (double u = -0.8; u < 20.0; u += 0.1) {
            const double value = candidate.value(0, u, -1.0);
            EXPECT_GE(value, p.minimum);
            EXPECT_LE(value, p.maximum);
        }
        EffectModel model;
        model.add(candidate, -1.0, 0.5);
        const double value = model.settings()[0].values[0], middle = 0.5 * (p.weak + p.strong);
        EXPECT_NEAR(value, 1.0 / middle, 1e-12) << p.minimum << ' ' << p.weak << ' ' << p.strong;
    }
}

TEST(Candidates, ACountMayBeNone) {
    Candidate candidate{"frames_lost", "sensor", "", {{"count", "1", 0.0, 16.0, 1.0, 8.0, true}}};
    EXPECT_EQ(candidate.value(0, -0.8), 0.0);
    EXPECT_TRUE(std::isfinite(candidate.snapped(0, -0.8)));
    EXPECT_EQ(candidate.value(0, candidate.snapped(0, -0.8)), 0.0);
}

TEST(SimulatorError, OfLogarithms) {
    const std::vector<StatisticInfo> list(3, [] {
        StatisticInfo info;
        info.unit = "log";
        return info;
    }());
    const Eigen::VectorXd error = simulator_error(list, Eigen::Vector3d(3.0, -3.0, 0.001));
    EXPECT_NEAR(error[0], kModelError.of_effects * (1.0 - std::exp(-3.0)), 1e-12); // of what was added
    EXPECT_EQ(error[1], -error[0]);                                     // near its floor
    EXPECT_NEAR(error[2], 0.001 * kModelError.of_effects, 1e-3 * 0.001 * kModelError.of_effects);
}

TEST(Response, ParabolasAreReproduced) {
    Response response;
    for (const double u : {0.0, 0.5, 1.0})
        response.add(u, {Eigen::VectorXd::Constant(3, 1.0 + 2.0 * u + 3.0 * u * u), {}, {}});
    for (const double u : {-0.4, 0.2, 0.7, 1.5})
        EXPECT_NEAR(response.at(u)[1], 1.0 + 2.0 * u + 3.0 * u * u, 1e-12);
    EXPECT_NEAR(response.distance(0.4), 0.1, 1e-12);
}

TEST(Response, FadesByThePowerLawOfItsWeakest) {
    Response response(kStrengths.faintest);
    // Of the square of a value five times as large a strength further on, of its root, against it, and of none.
    const auto law = [](double u) {
        return Eigen::Vector4d(2.0 * std::pow(25.0, u), std::pow(5.0, 0.5 * u), -std::pow(5.0, u), 0.0);
    };
    for (const double u : {0.0, 0.5, 1.0})
        response.add(u, {law(u), {}, {}});
    for (const double u : {-2.7, -1.0, -0.2})
        for (int i = 0; i < 4; ++i)
            EXPECT_NEAR(response.at(u)[i], law(u)[i], 1e-12) << u;
    EXPECT_EQ(response.at(0.5), law(0.5));
    // Also where others lie between, some near each other; one that is off is left out of the law below.
    response.add(-1.6, {law(-1.6), {}, {}});
    response.add(-1.55, {1.02 * law(-1.55), {}, {}});
    for (const double u : {-2.7, -1.6, -0.8, -0.1, 0.0})
        for (int i = 0; i < 4; ++i)
            EXPECT_NEAR(response.at(u)[i], law(u)[i], 0.02 * std::abs(law(u)[i])) << u;
    // What turns goes straight in between, and stays below.
    Response turning(kStrengths.faintest);
    for (const double u : {-1.0, 0.0})
        turning.add(u, {Eigen::VectorXd::Constant(1, u < 0.0 ? -0.5 : 1.5), {}, {}});
    EXPECT_NEAR(turning.at(-0.5)[0], 0.5, 1e-12);
    EXPECT_EQ(turning.at(-2.0)[0], -0.5);
}

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
    // 18 of 400 such captures give an alarm (24 replicates know the tails less well than the usual 48, by which 3 % of 500 did): three
    // or more of eight do by chance once in 200.
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
        const DiagnosisResult result = diagnose(context(), simulated({{c.id, {c.value}}}, kCaptureSeed + 100), quick(1));
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

// A response that bends upwards, a lens that opens wider than it says: the catalogue's ranges lie on the other side of 1. Whether
// a residual is seen in so small a capture is the null's matter.
TEST(Diagnosis, NamesARatioOnTheOtherSideOfOne) {
    const struct {
        const char *id;
        double value;
    } cases[] = {{"gamma", 1.2}, {"aperture_mismatch", 0.8}, {"aperture_mismatch", 0.7}};
    for (const auto &c : cases) {
        const DiagnosisResult result = diagnose(context(), simulated({{c.id, {c.value}}}, kCaptureSeed + 170), quick(1));
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

// Few small frames, two of which stand still, and a gap that is large: what two captures of common random numbers say of a change is no
// measure of it: a fit that went by two stopped at 0.65, and a significant gap remained. Of 20 such captures two keep a residual; of the ten here
// more than two would by chance once in fourteen draws (seeds are fixed: none does). They lie between 0.618 and 0.646,
// and half of their intervals miss 0.62: the bound below only holds them apart from worse, it does not show that they are unbiased.
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
        const DiagnosisResult result =
            diagnose(context(), simulated({{"aperture_mismatch", {0.62}}}, kCaptureSeed + 180 + i, {}, layout), quick(i));
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

// Hot pixels scatter in each channel of a mosaic alike: by the covariance of a camera with the mosaic they weigh more than
// before, so that either effect alone seemed to make the gap wider, and neither was named.
TEST(Diagnosis, LargeGapsAreExplainedPartByPart) {
    const EffectSettings both = {{"bayer_mismatch", {0.036}}, {"hot_pixels", {0.009, 150.0}}};
    CaptureLayout layout = larger_layout();
    int right = 0;
    for (std::uint64_t i = 0; i < 3; ++i) {
        const DiagnosisResult result = diagnose(context(), simulated(both, kCaptureSeed + 1360 + i, {}, layout), quick(i));
        right += result.verdict == Verdict::kNamed &&
                 std::set<std::string>(result.effects.begin(), result.effects.end()) ==
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

// Down there a step goes on only where something is left to see.
TEST(Diagnosis, AStepEndsWhereNothingShows) {
    const std::vector<Candidate> all = candidates({}, {});
    const auto find = [&](const char *id) {
        return std::find_if(all.begin(), all.end(), [&](const Candidate &c) { return c.id == id; });
    };
    EffectModel model;
    model.add(*find("row_noise"), 1.0, kStrengths.weakest);
    model.add(*find("row_fpn"), 1.0, kStrengths.weakest);
    model.add(*find("column_fpn"), 1.0, 0.0);
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(4, 3);
    columns(0, 0) = 1.01 * kStrengths.least_slope;
    columns(1, 1) = 0.99 * kStrengths.least_slope;
    Eigen::VectorXd step = Eigen::VectorXd::Constant(3, -0.3);
    EXPECT_EQ(stop_where_nothing_shows(model.strengths, columns, step), std::vector<Eigen::Index>{1});
    EXPECT_EQ(step, Eigen::Vector3d(-0.3, 0.0, -0.3));
    for (int i = 0; i < 30; ++i)
        move_strengths(model, Eigen::VectorXd::Constant(3, -0.3));
    EXPECT_EQ(model.strengths.front().strength, kStrengths.faintest);
    // What is no ratio turns below its range.
    EXPECT_EQ(find("gamma")->weakest(0), kStrengths.weakest);
    EXPECT_EQ(find("pixel_integration")->weakest(0), kStrengths.weakest);
    EXPECT_EQ(find("surface_boiling")->weakest(0), kStrengths.faintest);
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

// Two models that are the same, of 48 replicates each: by a covariance of its own, either leaves more or less of a capture
// by chance. By one of both, only what their means differ by is left of that: a third of the variance. Of 80 captures, half
// is exceeded once in 15 draws, and equal variances come below half once in 1000.
TEST(GapModel, OneCovarianceOfTwoModelsHasLessChance) {
    const ReplicateRunner runner(context(), simulated({}, kCaptureSeed), {}, 1);
    const auto count = static_cast<Eigen::Index>(runner.count());
    std::mt19937 engine(12);
    std::normal_distribution<double> normal;
    const auto draws = [&](int how_many) {
        std::vector<FoldStatistics> result;
        for (int i = 0; i < how_many; ++i) {
            const Eigen::MatrixXd random = Eigen::MatrixXd::NullaryExpr(2, count, [&] { return normal(engine); });
            result.push_back({random.row(0), random.row(1)});
        }
        return result;
    };
    const auto model = [&] {
        Replicates replicates;
        replicates.draws = draws(48);
        return GapModel(runner, replicates, 0.02, Eigen::MatrixXd(count, 0), Eigen::VectorXd::Zero(count));
    };
    double by_own = 0.0, by_common = 0.0;
    for (int i = 0; i < 80; ++i) {
        const GapModel first = model(), second = model();
        const Covariance common = common_covariance(runner, first, second);
        const Eigen::VectorXd capture = draws(1).front().mean();
        const auto square = [&](const Covariance &covariance, const GapModel &of) {
            return covariance.whiten(capture - of.full().mean()).squaredNorm();
        };
        by_own += std::pow(square(first.full(), first) - square(second.full(), second), 2.0);
        by_common += std::pow(square(common, first) - square(common, second), 2.0);
        EXPECT_NEAR(square(common, first) / static_cast<double>(count), 1.0, 0.4);
    }
    EXPECT_LT(by_common, 0.5 * by_own) << by_common << " and " << by_own;
}

// A statistic that is 0 in half of the replicates and once is not in the other half: by the covariance of the first, whose deviation is 0,
// that one would be a certainty, and no capture's distance could ever be larger.
TEST(GapModel, WhatIsRareIsNoCertainty) {
    const ReplicateRunner runner(context(), simulated({}, kCaptureSeed), {}, 1);
    const auto count = static_cast<Eigen::Index>(runner.count());
    std::mt19937 engine(11);
    std::normal_distribution<double> normal;
    const Eigen::MatrixXd random = Eigen::MatrixXd::NullaryExpr(96, count, [&] { return normal(engine); });
    Replicates replicates;
    for (Eigen::Index r = 0; r < 48; ++r)
        replicates.draws.push_back({random.row(2 * r), random.row(2 * r + 1)});
    for (FoldStatistics &draw : replicates.draws)
        draw.first[5] = draw.second[5] = 0.0;
    replicates.draws[40].first[5] = 0.01;
    const GapModel model(runner, replicates, 0.02, Eigen::MatrixXd(count, 0), Eigen::VectorXd::Zero(count));
    FoldStatistics capture = replicates.draws[3];
    EXPECT_LT(model.test(capture).null_95, 1.0);
    EXPECT_FALSE(model.test(capture).detected);
    capture.first.array() += 2.0; // a deviation each, once in the mean of both
    EXPECT_GT(model.test(capture).distance, 0.5);
    EXPECT_TRUE(model.test(capture).detected);
}

// Captures of two, three and four frames without a gap: 200 of each, by five models of 48 others. Logarithms of squares
// over so few frames gave alarms on 8 % of them at the level of 0.02; 3 % is what 48 replicates know of tails. Their
// error is that of 600: 0.7 %.
TEST(GapModel, FewFramesAreNoGap) {
    constexpr std::size_t kModels = 5, kReplicates = 48, kCaptures = 200;
    int alarms = 0, tests = 0;
    for (const std::uint32_t frames : {2u, 3u, 4u}) {
        CaptureLayout layout = small_layout();
        layout.width = 96;
        layout.height = 80;
        layout.principal_point_px = {47.5, 39.5};
        layout.dots = CaptureDots{2.2, {}};
        for (int y = 12; y < 80; y += 14)
            for (int x = 12; x < 96; x += 14)
                layout.dots->positions_px.push_back({x + 0.3, y - 0.2});
        const auto add = [&](const char *name, CaptureScene scene, bool moving) {
            layout.sequences.push_back(layout.sequences.back());
            layout.sequences.back().name = name;
            layout.sequences.back().scene = scene;
            layout.sequences.back().moving = moving;
        };
        add("board_static", CaptureScene::kBoard, false);
        add("dots_static", CaptureScene::kDots, false);
        add("dots_moving", CaptureScene::kDots, true);
        layout.f_number = 5.6;
        for (SequenceLayout &sequence : layout.sequences) {
            sequence.frame_count = frames;
            sequence.f_number = 5.6;
        }
        ReplicateRunner runner(context(), simulated({}, kCaptureSeed + 300, {}, layout), {}, 2);
        const CalibratedLevels levels = runner.calibrate({}, std::vector<bool>(layout.sequences.size(), true), nullptr);
        std::vector<std::uint64_t> seeds(kModels * kReplicates + kCaptures);
        std::iota(seeds.begin(), seeds.end(), kCaptureSeed + 1000 * frames); // surfaces of their own
        const std::vector<FoldStatistics> draws = runner.replicates({}, levels, seeds, {});
        const auto count = static_cast<Eigen::Index>(runner.count());
        for (std::size_t m = 0; m < kModels; ++m) {
            const auto begin = draws.begin() + static_cast<std::ptrdiff_t>(kCaptures + m * kReplicates);
            const Replicates replicates{{}, levels, {begin, begin + kReplicates}};
            const GapModel model(runner, replicates, 0.02, Eigen::MatrixXd(count, 0), Eigen::VectorXd::Zero(count));
            for (std::size_t i = 0; i < kCaptures; ++i, ++tests)
                alarms += model.test(draws[i]).detected;
        }
    }
    EXPECT_LE(alarms, 0.05 * tests);
    RecordProperty("alarms", alarms);
}

// Half of the dark codes, a third and a fiftieth are cut off at 0. Of 36,864 codes a level behind that is uncertain by
// 1.5 to 2 times the 1/192 of the noise that it is without clipping; four times that is allowed.
TEST(Diagnosis, LevelAndNoiseBehindTheClippingAreCalibrated) {
    const std::vector<bool> all(small_layout().sequences.size(), true);
    for (const auto &[level, noise] : {std::pair(0.6, 9.35), std::pair(4.0, 9.35), std::pair(12.0, 6.0)}) {
        ReplicateRunner runner(context(), simulated({}, kCaptureSeed + 180, {}, small_layout(), level, noise), {}, 1);
        const CalibratedLevels levels = runner.calibrate({}, all, nullptr);
        EXPECT_NEAR(levels.black_level_dn, level, 8.0 * noise / 192.0);
        EXPECT_NEAR(levels.read_noise_dn, noise, 8.0 * noise / 192.0);
    }
}

// Steps of 16 DN at a read noise of 4.3 DN: dark and even frames have two codes, and their mean goes up in stairs with the level. They say
// nothing of the noise, which the data sheet has 7 % too low: speckle at rest does.
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

// What changes over time on a board at rest is the surface here, by ten times what the camera's noise is, and that it is known to a
// quarter only must not matter: dark and flat tell the noise. A board that stood still would have it, whatever effects are known.
TEST(Diagnosis, SpeckleThatLivesTellsNoReadNoise) {
    CaptureLayout layout = small_layout();
    SequenceLayout resting = layout.sequences.back();
    resting.name = "board_static";
    resting.moving = false;
    layout.sequences.push_back(resting);
    const std::vector<bool> all(layout.sequences.size(), true);
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        const Capture capture = simulated({{"adc_bits", {6.0}}, {"surface_boiling", {16.0}}}, kCaptureSeed + 154 + seed, {}, layout);
        ReplicateRunner runner(context(), capture, {}, 1);
        for (const double correlation_frames : {12.0, 20.0})
            EXPECT_NEAR(runner.calibrate({{"adc_bits", {6.0}}, {"surface_boiling", {correlation_frames}}}, all, nullptr)
                            .read_noise_dn,
                        4.3, 0.15)
                << seed << " " << correlation_frames;
    }
}

// Without speckle at rest. A black level of 63.2 DN is 8 DN, 1.9 deviations of the noise of 4.3 DN, from the next
// codes. Of 36,864 dark codes 2,300 are those, 2 %, and their number goes as the noise's 4.5th power, which makes an
// error of 0.02 DN. The level is found on one draw of the same size, which puts all of them 0.04 DN too high. The data sheet says 4.0.
TEST(Diagnosis, ReadNoiseShowsBetweenCoarseSteps) {
    const std::vector<bool> all(small_layout().sequences.size(), true);
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        const Capture capture = simulated({{"adc_bits", {6.0}}}, kCaptureSeed + 160 + seed);
        ReplicateRunner runner(context(), capture, {}, 1);
        EXPECT_NEAR(runner.calibrate({{"adc_bits", {6.0}}}, all, nullptr).read_noise_dn, 4.3, 0.1) << seed;
    }
}

// Dark and flat half way between two of 32 codes: there are no others, whatever the noise is, and how the two scatter must not say much: ten
// captures gave 3.90 to 4.55 DN, within the data sheet's deviation of 0.6 DN. Without its prior these three are 0.75 to 0.93 DN off.
TEST(Diagnosis, ReadNoiseThatDoesNotShowIsTheDataSheets) {
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        Capture capture = simulated({{"adc_bits", {5.0}}}, kCaptureSeed + 170 + seed);
        Simulator simulator(context(), capture.layout, {});
        for (std::size_t s = 0; s < 2; ++s) {
            const SimulationLevels levels{s == 0 ? 0.0 : 320.0, 80.0, 4.3};
            simulator.codes(s, {{"adc_bits", {5.0}}}, levels, kCaptureSeed + 170 + seed, 12, capture.codes[s].data());
        }
        ReplicateRunner runner(context(), capture, {}, 1);
        const std::vector<bool> all(capture.layout.sequences.size(), true);
        EXPECT_NEAR(runner.calibrate({{"adc_bits", {5.0}}}, all, nullptr).read_noise_dn, 4.0, 0.6) << seed;
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
    const Capture capture =
        simulated({{"bayer_mismatch", {0.05, 1.0}}, {"image_lag", {0.12}}}, kCaptureSeed + 250);
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
                capture.codes[s][i] = static_cast<std::uint16_t>(std::min(1023.0, 63.2 + 1.05 * (capture.codes[s][i] - 63.2) + 0.5));
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
        const DiagnosisResult result = diagnose(context(), simulated({{"tilt", {slope}}}, kCaptureSeed + 420, {tilt}), options);
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

} // namespace
