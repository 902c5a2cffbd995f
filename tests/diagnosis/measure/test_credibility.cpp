// The area validation metric against its integral; acceptance against known answers and by simulation.
#include "measure/acceptance.hpp"
#include "measure/credibility.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <random>

namespace {

using namespace clsp;

// The area between a normal distribution function and the step at `real`, by the trapezoidal rule.
double integrated(double real, double mean, double deviation) {
    const double low = std::min(real, mean - 10.0 * deviation), high = std::max(real, mean + 10.0 * deviation);
    const int steps = 400000;
    double sum = 0.0;
    for (int i = 0; i < steps; ++i) {
        const double x = low + (high - low) * (i + 0.5) / steps;
        const double simulated = 0.5 * std::erfc((mean - x) / (deviation * std::sqrt(2.0)));
        sum += std::abs(simulated - (x >= real ? 1.0 : 0.0));
    }
    return sum * (high - low) / steps;
}

TEST(AreaMetric, IsTheAreaBetweenTheDistributions) {
    for (const double mean : {-3.0, 0.0, 0.4, 2.0, 30.0})
        for (const double deviation : {0.1, 1.0, 5.0}) {
            const AreaMetric metric = area_metric(0.5, mean, deviation);
            EXPECT_NEAR(metric.area, integrated(0.5, mean, deviation), 1e-3 * metric.area);
            EXPECT_DOUBLE_EQ(metric.bias, std::abs(mean - 0.5));
            EXPECT_DOUBLE_EQ(metric.bias + metric.scatter, metric.area);
        }
}

TEST(AreaMetric, WithoutScatterIsTheBias) {
    const AreaMetric metric = area_metric(2.0, 5.0, 0.0);
    EXPECT_EQ(metric.area, 3.0);
    EXPECT_EQ(metric.scatter, 0.0);
}

TEST(Credibility, LeavesOutWhatIsNotTold) {
    const double none = std::numeric_limits<double>::quiet_NaN();
    DatasheetQuantities measured;
    measured.quantities = {{"flat", "temporal_noise", "DN", {{5.0, none}, {4.0, 0.1}, {4.9, 0.1}}},
                           {"board", "contrast", "1", {{none, none}, {1.0, 0.1}, {0.9, 0.1}}},
                           {"", "system_gain", "DN/electron", {{0.3, none}, {none, none}, {0.3, 0.01}}}};
    const std::vector<CredibilityRow> rows = credibility(measured);
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows[0].quantity, "temporal_noise");
    ASSERT_EQ(rows[0].versions.size(), 2u);
    EXPECT_NEAR(rows[0].versions[0].area, 1.0, 1e-9);
    EXPECT_LT(rows[0].versions[1].area, 0.15);
    EXPECT_TRUE(credibility({}).empty());
}

TEST(Acceptance, GoesByTheWholeInterval) {
    // Student's 2.3646 of 7 degrees, times 0.1 sqrt(1 + 1/8).
    const double reach = 2.3646 * 0.1 * std::sqrt(1.125);
    const JudgedDifference judged = judge_difference(5.0, 5.5, 0.1, 8.0, 1.0);
    EXPECT_NEAR(judged.difference, 0.5, 1e-12);
    EXPECT_NEAR(judged.interval_95[0], 0.5 - reach, 1e-4);
    EXPECT_NEAR(judged.interval_95[1], 0.5 + reach, 1e-4);
    const auto answer = [](double mean, double deviation, double tolerance) {
        return judge_difference(5.0, mean, deviation, 8.0, tolerance).acceptance;
    };
    EXPECT_EQ(answer(5.5, 0.1, 0.76), Acceptance::kAccepted);
    EXPECT_EQ(answer(5.5, 0.1, 0.74), Acceptance::kUndecided);
    EXPECT_EQ(answer(5.5, 0.1, 0.26), Acceptance::kUndecided);
    EXPECT_EQ(answer(5.5, 0.1, 0.24), Acceptance::kNotAccepted);
    EXPECT_EQ(answer(4.5, 0.1, 0.24), Acceptance::kNotAccepted) << "either side";
    EXPECT_EQ(answer(5.0, 0.1, 0.0), Acceptance::kUndecided);
    EXPECT_EQ(answer(5.0, 0.0, 0.0), Acceptance::kAccepted) << "exactly alike";
    const double none = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(answer(none, 0.1, 9.0), Acceptance::kUndecided);
    EXPECT_EQ(judge_difference(5.0, 5.0, none, 1.0, 9.0).acceptance, Acceptance::kUndecided) << "one says no scatter";
}

TEST(Acceptance, IntervalsHoldTheDifference) {
    // Eight simulated captures and a camera of the same scatter, 20,000 times: 0.95 to 0.005, three standard errors.
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    int held = 0;
    constexpr int kDraws = 20000;
    constexpr double kDifference = 0.7;
    for (int draw = 0; draw < kDraws; ++draw) {
        double sum = 0.0, squares = 0.0;
        for (int i = 0; i < 8; ++i) {
            const double value = kDifference + normal(random);
            sum += value;
            squares += value * value;
        }
        const double mean = sum / 8.0, deviation = std::sqrt((squares - 8.0 * mean * mean) / 7.0);
        const auto interval = judge_difference(normal(random), mean, deviation, 8.0, 1.0).interval_95;
        held += interval[0] <= kDifference && kDifference <= interval[1];
    }
    EXPECT_NEAR(double(held) / kDraws, 0.95, 0.005);
}

TEST(Acceptance, TheLongerKeyCounts) {
    const std::vector<Measurable> there = {{false, "dark", "temporal_noise", "", "DN", 4.0, 0},
                                           {false, "flat", "temporal_noise", "", "DN", 10.0, 1},
                                           {true, "flat", "temporal_noise", "all", "log", 1.0, 0}};
    Tolerances tolerances{"t.json", {{false, "flat/temporal_noise", 5.0, "%"}, {false, "temporal_noise", 0.2, "DN"}}};
    for (int order = 0; order < 2; ++order) {
        const std::vector<AcceptanceRow> rows = acceptance_rows(tolerances, there);
        ASSERT_EQ(rows.size(), 2u);
        for (const AcceptanceRow &row : rows)
            EXPECT_DOUBLE_EQ(row.tolerance, row.of.sequence == "flat" ? 0.5 : 0.2);
        std::swap(tolerances.entries[0], tolerances.entries[1]);
    }
}

} // namespace
