// The area validation metric against its integral.
#include "measure/credibility.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>

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

} // namespace
