// The shrinkage of single statistics: how often its intervals hold the true part, and what has none.
#include "inference/shrinkage.hpp"

#include "diagnosis/inference/attribution_support.hpp"
#include "inference/model_fit.hpp"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numeric>
#include <random>

namespace {

using namespace clsp;
using namespace clsp::attribution_test;

// Two halves of Gaussian differences, alike by `alike`; what scatters before is there after, too, and some of the fit's
// own beside it.
struct Law {
    double alike = 0.0, mean_before = 0.0, mean_after = 0.0, fit = 0.5;
};

HeldOutDifferences draw(const Law &law, Eigen::Index count, double part, std::mt19937_64 &random) {
    std::normal_distribution<double> normal;
    HeldOutDifferences result{Eigen::MatrixXd(count, 2), Eigen::MatrixXd(count, 2)};
    for (Eigen::Index k = 0; k < count; ++k) {
        const double common = normal(random);
        for (Eigen::Index half = 0; half < 2; ++half) {
            const double noise = std::sqrt(law.alike) * common + std::sqrt(1.0 - law.alike) * normal(random);
            result.before(k, half) = part * law.mean_before + noise;
            result.after(k, half) = part * law.mean_after + noise + law.fit * normal(random);
        }
    }
    return result;
}

TEST(StatisticShrinkage, IntervalsHoldTheTruePart) {
    // 200 captures of 10 statistics with replicates of their own: 95 % of 2000 have a standard deviation of 0.5 %.
    // Seed 1.
    std::mt19937_64 random(1);
    constexpr Eigen::Index kStatistics = 10;
    constexpr int kCaptures = 200;
    for (const int replicate_count : {12, 24})
        for (const double alike : {0.0, 0.5, 1.0})
            for (const double left : {0.0, 0.3, 1.0, 1.4, -0.5}) {
                const Law law{alike, 8.0, 8.0 * left, 0.5};
                int held = 0, with_part = 0;
                double width = 0.0;
                for (int i = 0; i < kCaptures; ++i) {
                    std::vector<HeldOutDifferences> replicates;
                    for (int r = 0; r < replicate_count; ++r)
                        replicates.push_back(draw(law, kStatistics, 0.0, random));
                    const auto shrunk =
                        statistic_shrinkages(draw(law, kStatistics, 1.0, random), replicates,
                                             Eigen::VectorXd::Ones(kStatistics), Eigen::VectorXd::Zero(kStatistics));
                    for (const StatisticShrinkage &s : shrunk) {
                        EXPECT_TRUE(s.held_out);
                        if (!s.beyond_chance)
                            continue;
                        ++with_part;
                        const double truth = 1.0 - std::abs(left);
                        held += s.fraction_95[0] <= truth && truth <= s.fraction_95[1];
                        width += s.fraction_95[1] - s.fraction_95[0];
                        EXPECT_LE(s.fraction_95[0], s.fraction);
                        EXPECT_GE(s.fraction_95[1], s.fraction);
                        EXPECT_LE(s.fraction_95[1], 1.0);
                    }
                }
                EXPECT_GT(with_part, 1900) << "8 deviations are beyond chance";
                EXPECT_GT(held, 0.935 * with_part)
                    << replicate_count << " replicates, alike " << alike << ", left " << left;
                EXPECT_LT(width / with_part, 1.2) << "says something: alike " << alike << ", left " << left;
            }
}

TEST(StatisticShrinkage, NoPartOfWhatIsChance) {
    std::mt19937_64 random(2);
    const Law law{0.3, 0.0, 0.0, 0.5};
    std::vector<HeldOutDifferences> replicates;
    for (int r = 0; r < 24; ++r)
        replicates.push_back(draw(law, 2000, 0.0, random));
    const auto shrunk = statistic_shrinkages(draw(law, 2000, 1.0, random), replicates, Eigen::VectorXd::Ones(2000),
                                             Eigen::VectorXd::Zero(2000));
    const auto some =
        std::count_if(shrunk.begin(), shrunk.end(), [](const StatisticShrinkage &s) { return s.beyond_chance; });
    EXPECT_LT(some, 100) << "5 % at most";
    EXPECT_GT(some, 10);
    for (const StatisticShrinkage &s : shrunk)
        EXPECT_TRUE(std::isfinite(s.before) && std::isfinite(s.after) && std::isfinite(s.fraction_95[0]));
}

TEST(StatisticShrinkage, WhatNeverScattersHasAFloor) {
    HeldOutDifferences same{Eigen::MatrixXd::Zero(1, 2), Eigen::MatrixXd::Zero(1, 2)}, near = same, far = same;
    near.before.setConstant(0.2);
    far.before.setConstant(5.0);
    const std::vector<HeldOutDifferences> replicates(12, same);
    const Eigen::VectorXd floor = Eigen::VectorXd::Constant(1, 0.25);
    EXPECT_FALSE(statistic_shrinkages(near, replicates, floor, floor)[0].beyond_chance);
    const StatisticShrinkage s = statistic_shrinkages(far, replicates, floor, floor)[0];
    ASSERT_TRUE(s.beyond_chance);
    EXPECT_EQ(s.fraction, 1.0);
    EXPECT_EQ(s.fraction_95[1], 1.0);
    EXPECT_GT(s.fraction_95[0], 0.8);
}

// A camera with two effects; the model has one of them, unfitted, so that what it leaves is known from many simulated
// captures.
TEST(StatisticShrinkage, IntervalsHoldOnSimulatedCaptures) {
    const EffectSettings one{{"shot_noise", {0.3}}};
    const EffectSettings both{{"shot_noise", {0.3}}, {"vignetting", {0.1}}};
    const Capture capture = simulated(both, kCaptureSeed);
    ReplicateRunner runner(context(), capture, {}, 2);
    const std::vector<bool> all(capture.codes.size(), true);
    const auto drawn = [&](const EffectSettings &effects, std::uint64_t seed, std::size_t count) {
        Replicates result{effects, runner.calibrate(effects, all, nullptr), {}};
        std::vector<std::uint64_t> seeds(count);
        std::iota(seeds.begin(), seeds.end(), seed);
        result.draws = runner.replicates(effects, result.levels, seeds, {});
        return result;
    };
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(runner.count()));
    const Eigen::MatrixXd no_directions(none.size(), 0);
    const auto fitted = [&](const EffectSettings &effects, std::uint64_t seed, std::size_t count) {
        FittedModel result;
        result.effects = effects;
        result.model = GapModel(runner, drawn(effects, seed, count), 0.02, no_directions, none);
        result.jacobian = no_directions;
        return result;
    };
    const FittedModel baseline = fitted({}, 1, 48), model = fitted(one, 1000, 24);
    const FittedModel many_of_baseline = fitted({}, 10000, 300), many_of_model = fitted(one, 20000, 300);
    const GapModel truth(runner, drawn(both, 30000, 300), 0.02, no_directions, none);
    const Eigen::VectorXd before = truth.full().mean() - many_of_baseline.model.full().mean();
    const Eigen::VectorXd after = truth.full().mean() - many_of_model.model.full().mean();
    int held = 0, counted = 0;
    for (const FoldStatistics &real : drawn(both, 40000, 40).draws) {
        HeldOutDifferences difference{Eigen::MatrixXd(none.size(), 2), Eigen::MatrixXd(none.size(), 2)};
        difference.before << real.first - baseline.model.first_mean(), real.second - baseline.model.second_mean();
        difference.after << real.first - model.model.first_mean(), real.second - model.model.second_mean();
        std::vector<HeldOutDifferences> replicates;
        for (const FoldStatistics &draw : model.model.replicates().draws) {
            HeldOutDifferences one_draw = difference;
            one_draw.before << draw.first - baseline.model.first_mean(), draw.second - baseline.model.second_mean();
            one_draw.after << draw.first - model.model.first_mean(), draw.second - model.model.second_mean();
            replicates.push_back(one_draw);
        }
        const auto shrunk = statistic_shrinkages(difference, replicates, model.model.fold().deviation(),
                                                 least_deviations(runner.list(), model.model.replicates().draws));
        for (Eigen::Index k = 0; k < none.size(); ++k) {
            // The truth must be known better than an interval knows it.
            const StatisticShrinkage &s = shrunk[static_cast<std::size_t>(k)];
            if (!s.beyond_chance || std::abs(before[k]) < 4.0 * truth.fold().deviation()[k])
                continue;
            ++counted;
            const double part = 1.0 - std::abs(after[k] / before[k]);
            held += s.fraction_95[0] <= part && part <= s.fraction_95[1];
        }
    }
    EXPECT_GT(counted, 200);
    // The replicates' own mean is one draw for all captures, so that captures are not quite independent.
    EXPECT_GT(held, 0.92 * counted) << "of " << counted;
}

} // namespace
