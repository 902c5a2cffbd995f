// The fewest lines of a laser against all of them: moments, and the law of the light that they make.
#include "stages/laser_lines.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace {

using clsp::LaserLine;

double moment(const std::vector<LaserLine> &lines, int power) {
    double sum = 0.0;
    for (const LaserLine &line : lines)
        sum += line.weight * std::pow(line.offset, power);
    return sum;
}

// Fields of lines k_i and k_j correlate by exp(-s^2 (k_i - k_j)^2 / 2) on a rough surface: E[I^2] - 1, and the third
// cumulant over 2, sum w_i w_j w_l r_ij r_jl r_li, of circular Gaussian light (Goodman, Speckle Phenomena, 3.3).
struct Law {
    double variance = 0.0, third = 0.0;
};
Law law_of(const std::vector<LaserLine> &lines, double s) {
    const auto r = [&](const LaserLine &a, const LaserLine &b) {
        const double turn = s * (a.offset - b.offset);
        return std::exp(-0.5 * turn * turn);
    };
    Law law;
    for (const LaserLine &a : lines)
        for (const LaserLine &b : lines) {
            law.variance += a.weight * b.weight * r(a, b) * r(a, b);
            for (const LaserLine &c : lines)
                law.third += a.weight * b.weight * c.weight * r(a, b) * r(b, c) * r(c, a);
        }
    return law;
}

TEST(LaserLines, AreThoseThatAreAskedForUntilFewerMayBe) {
    const std::vector<LaserLine> all = clsp::equal_lines(9);
    EXPECT_NEAR(moment(all, 0), 1.0, 1e-12);
    for (const double s : {0.0, 0.5, 100.0}) {
        const std::vector<LaserLine> same = clsp::fewest_lines(all, s, 0.0);
        ASSERT_EQ(same.size(), all.size());
        for (std::size_t i = 0; i < all.size(); ++i) {
            EXPECT_EQ(same[i].offset, all[i].offset);
            EXPECT_EQ(same[i].weight, all[i].weight);
        }
    }
    EXPECT_EQ(clsp::fewest_lines(all, 100.0, 1e-3).size(), all.size()); // no two of them share anything
    EXPECT_EQ(clsp::fewest_lines(all, 0.0, 1e-3).size(), 1u);           // all are the same
    EXPECT_EQ(clsp::fewest_lines(clsp::equal_lines(1), 1.0, 1e-3).size(), 1u);
    EXPECT_EQ(clsp::equal_lines(1).front().offset, 0.0);
}

TEST(LaserLines, FewerHaveTheMomentsOfAll) {
    const std::vector<LaserLine> all = clsp::equal_lines(9);
    std::size_t before = 1;
    for (const double s : {0.1, 0.25, 0.5, 0.8, 1.2, 1.6}) {
        const std::vector<LaserLine> few = clsp::fewest_lines(all, s, 1e-3);
        const int n = static_cast<int>(few.size());
        EXPECT_GE(few.size(), before) << s;
        EXPECT_LT(few.size(), all.size()) << s;
        before = few.size();
        for (int power = 0; power < 2 * n; ++power)
            EXPECT_NEAR(moment(few, power), moment(all, power), 1e-10 * std::pow(2.0, power)) << s << ' ' << power;
        for (const LaserLine &line : few) {
            EXPECT_GT(line.weight, 0.0);
            EXPECT_LT(std::abs(line.offset), 2.0);
        }
        if (n % 2 == 1) {
            EXPECT_EQ(few[static_cast<std::size_t>(n / 2)].offset, 0.0) << "the middle line needs no surface";
        }
    }
}

TEST(LaserLines, FewerMakeTheSameLight) {
    for (const std::uint32_t count : {2u, 5u, 9u, 32u, 63u}) {
        const std::vector<LaserLine> all = clsp::equal_lines(count);
        for (const double s : {0.05, 0.5, 1.2, 3.0})
            for (const double error : {1e-5, 1e-3, 0.1}) {
                const std::vector<LaserLine> few = clsp::fewest_lines(all, s, error);
                const Law law = law_of(few, s), wanted = law_of(all, s);
                EXPECT_NEAR(law.variance, wanted.variance, error * wanted.variance * (1.0 + 1e-9)) << count << ' ' << s;
                EXPECT_NEAR(law.third, wanted.third, 3.0 * error * wanted.third) << count << ' ' << s;
                EXPECT_NEAR(moment(few, 0), 1.0, 1e-12);
            }
    }
}

} // namespace
