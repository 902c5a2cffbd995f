// The statistics behind a verdict: tail probabilities, shrunk covariances, the gap test's level, candidates' strengths,
// levels that are calibrated.
#include "diagnosis/inference/attribution_support.hpp"
#include "effects/effects.hpp"
#include "inference/candidate.hpp"
#include "inference/covariance.hpp"
#include "inference/effect_model.hpp"
#include "inference/gap_test.hpp"
#include "inference/response.hpp"
#include "inference/thresholds.hpp"
#include "simulator/simulator.hpp"
#include "statistics/distributions.hpp"

#include <Eigen/Core>
#include <cmath>
#include <gtest/gtest.h>
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
            result(r, k) = (k < 6 ? std::sqrt(0.8) * common + std::sqrt(0.2) * normal(random) : normal(random)) *
                           (1.0 + static_cast<double>(k));
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
    // The mean of 2,000 chi-squared values has a standard deviation of 1 %; 200 replicates and the shrinkage leave up
    // to 10 %.
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
                EXPECT_NEAR(candidate.value(p, 1.0), parameter.strong, 1e-12 * std::abs(parameter.strong))
                    << candidate.id;
            }
            for (const double u : {-0.5, 0.3, 1.6}) {
                const double value = candidate.value(p, u);
                EXPECT_GE(value, parameter.minimum);
                EXPECT_LE(value, parameter.maximum);
                if (value > parameter.minimum && value < parameter.maximum && !candidate.is_choice(p)) {
                    EXPECT_NEAR(candidate.strength(p, value), candidate.snapped(p, u), 1e-9)
                        << candidate.id << ' ' << parameter.name;
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
    const Candidate &bits =
        *std::find_if(all.begin(), all.end(), [](const Candidate &c) { return c.id == "adc_bits"; });
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
    all.push_back(
        {"lopsided", "sensor", "", {{"slope", "1", -0.3, 1.0, 0.02, 0.2}, {"gain", "1", 0.5, 3.0, 1.0, 2.0}}});
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
    EXPECT_EQ(from_nothing, (std::vector<std::string>{"bayer_mismatch", "beam_skew", "correlated_read_noise",
                                                      "lens_distortion", "wavelength_shift"}));
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
    ASSERT_EQ(more.size(), all.size() + 11);
    const Candidate &other = more[all.size() + 1];
    EXPECT_EQ(other.id, "beam_skew");
    const Candidate &usual =
        *std::find_if(all.begin(), all.end(), [](const Candidate &c) { return c.id == "beam_skew"; });
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
    EXPECT_EQ(with_alternatives(candidates({}, {"beam_skew"})).size(), all.size() + 7);
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
        const auto fitted =
            fitted_parameters(model, Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Constant(1, 0.1), 24.0);
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
                 {{"ratio", "1", 1.0 / 15.5, 15.5, 1.0, 1.4}, true}, {{"ratio", "1", 0.2, 5.0, 1.0, 1.0}, false},
                 {{"ratio", "1", -2.0, -0.5, -0.9, -0.6}, false},    {{"ratio", "px", 0.2, 5.0, 1.2, 1.5}, false},
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
    EXPECT_EQ(error[1], -error[0]);                                                // near its floor
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

// Down there a step goes on only where something is left to see.
TEST(EffectModel, AStepEndsWhereNothingShows) {
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

// Two models that are the same, of 48 replicates each: by a covariance of its own, either leaves more or less of a
// capture by chance. By one of both, only what their means differ by is left of that: a third of the variance. Of 80
// captures, half is exceeded once in 15 draws, and equal variances come below half once in 1000.
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

// A statistic that is 0 in half of the replicates and once is not in the other half: by the covariance of the first,
// whose deviation is 0, that one would be a certainty, and no capture's distance could ever be larger.
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
TEST(Calibration, LevelAndNoiseBehindTheClippingAreCalibrated) {
    const std::vector<bool> all(small_layout().sequences.size(), true);
    for (const auto &[level, noise] : {std::pair(0.6, 9.35), std::pair(4.0, 9.35), std::pair(12.0, 6.0)}) {
        ReplicateRunner runner(context(), simulated({}, kCaptureSeed + 180, {}, small_layout(), level, noise), {}, 1);
        const CalibratedLevels levels = runner.calibrate({}, all, nullptr);
        EXPECT_NEAR(levels.black_level_dn, level, 8.0 * noise / 192.0);
        EXPECT_NEAR(levels.read_noise_dn, noise, 8.0 * noise / 192.0);
    }
}

// What changes over time on a board at rest is the surface here, by ten times what the camera's noise is, and that it
// is known to a quarter only must not matter: dark and flat tell the noise. A board that stood still would have it,
// whatever effects are known.
TEST(Calibration, SpeckleThatLivesTellsNoReadNoise) {
    CaptureLayout layout = small_layout();
    SequenceLayout resting = layout.sequences.back();
    resting.name = "board_static";
    resting.moving = false;
    layout.sequences.push_back(resting);
    const std::vector<bool> all(layout.sequences.size(), true);
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        const Capture capture =
            simulated({{"adc_bits", {6.0}}, {"surface_boiling", {16.0}}}, kCaptureSeed + 154 + seed, {}, layout);
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
// error of 0.02 DN. The level is found on one draw of the same size, which puts all of them 0.04 DN too high. The data
// sheet says 4.0.
TEST(Calibration, ReadNoiseShowsBetweenCoarseSteps) {
    const std::vector<bool> all(small_layout().sequences.size(), true);
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        const Capture capture = simulated({{"adc_bits", {6.0}}}, kCaptureSeed + 160 + seed);
        ReplicateRunner runner(context(), capture, {}, 1);
        EXPECT_NEAR(runner.calibrate({{"adc_bits", {6.0}}}, all, nullptr).read_noise_dn, 4.3, 0.1) << seed;
    }
}

// Dark and flat half way between two of 32 codes: there are no others, whatever the noise is, and how the two scatter
// must not say much: ten captures gave 3.90 to 4.55 DN, within the data sheet's deviation of 0.6 DN. Without its prior
// these three are 0.75 to 0.93 DN off.
TEST(Calibration, ReadNoiseThatDoesNotShowIsTheDataSheets) {
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

} // namespace
