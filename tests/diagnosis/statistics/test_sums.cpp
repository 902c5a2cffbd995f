// Sums over rows: the bits of sixteen plain sums side by side, whatever vectors this processor has, and right by
// float64.
#include "statistics/sums.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace {

using namespace clsp::statistics;

constexpr std::size_t kLongest = 200;

std::vector<float> draw(std::size_t count, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal(0.3f, 20.0f);
    std::vector<float> values(count);
    for (float &value : values)
        value = normal(random);
    return values;
}

// Of element(i) in lanes of float, what is left over in double; one after the other.
double plain(std::size_t count, const std::function<float(std::size_t)> &single,
             const std::function<double(std::size_t)> &twice) {
    volatile float lanes[16] = {}; // nothing may keep a product to add it unrounded
    std::size_t i = 0;
    for (; i + 16 <= count; i += 16)
        for (std::size_t k = 0; k < 16; ++k) {
            volatile const float value = single(i + k);
            lanes[k] = lanes[k] + value;
        }
    double total = 0.0, of_lanes = 0.0;
    for (; i < count; ++i)
        total += twice(i);
    for (const volatile float &lane : lanes)
        of_lanes += lane;
    return total + of_lanes;
}

TEST(Sums, HaveTheBitsOfPlainSums) {
    for (std::size_t count = 0; count <= kLongest; ++count)
        for (std::size_t offset = 0; offset < 3; ++offset) { // aligned to nothing
            const std::vector<float> all_a = draw(kLongest + 3, 1), all_b = draw(kLongest + 3, 2);
            const float *a = all_a.data() + offset, *b = all_b.data() + 2 - offset;
            EXPECT_EQ(sum(a, count), plain(count, [&](auto i) { return a[i]; }, [&](auto i) { return a[i]; }));
            EXPECT_EQ(dot(a, b, count),
                      plain(count, [&](auto i) { return a[i] * b[i]; }, [&](auto i) { return double(a[i]) * b[i]; }));
            EXPECT_EQ(lopsided(a, b, count),
                      plain(
                          count,
                          [&](auto i) {
                              volatile const float product = a[i] * b[i], difference = a[i] - b[i];
                              return product * difference;
                          },
                          [&](auto i) { return double(a[i]) * b[i] * (a[i] - b[i]); }));
            Powers powers;
            powers.add(a, count);
            const auto square = [&](auto i) { return a[i] * a[i]; };
            EXPECT_EQ(powers.sum, sum(a, count));
            EXPECT_EQ(powers.square, dot(a, a, count));
            EXPECT_EQ(powers.cube, plain(
                                       count,
                                       [&](auto i) {
                                           volatile const float squared = square(i);
                                           return squared * a[i];
                                       },
                                       [&](auto i) { return double(a[i]) * a[i] * a[i]; }));
            EXPECT_EQ(powers.fourth, plain(
                                         count,
                                         [&](auto i) {
                                             volatile const float squared = square(i);
                                             return squared * squared;
                                         },
                                         [&](auto i) {
                                             const double squared = double(a[i]) * a[i];
                                             return squared * squared;
                                         }));
        }
}

TEST(Sums, RowsAreWhatTheySay) {
    const std::vector<float> a = draw(kLongest, 3), b = draw(kLongest, 4);
    std::vector<std::uint16_t> codes(kLongest);
    for (std::size_t i = 0; i < kLongest; ++i)
        codes[i] = std::uint16_t(i * 327 % 65536);
    const CodeScale scale{64.25f, 1.03f, 17.5f};
    for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{37}, kLongest}) {
        std::vector<float> added = a, squares = a, product(kLongest), coded = a, rest(kLongest), once(a);
        add(added.data(), b.data(), count);
        add_squares(squares.data(), b.data(), count);
        multiply(product.data(), a.data(), b.data(), count);
        multiply(once.data(), once.data(), b.data(), count); // in place
        add_codes(coded.data(), codes.data(), scale, count);
        residual_codes(rest.data(), codes.data(), scale, b.data(), count);
        for (std::size_t i = 0; i < kLongest; ++i) {
            const bool in = i < count;
            volatile const float square = b[i] * b[i], lifted = float(codes[i]) - scale.black,
                                 scaled = scale.factor * lifted, code = scaled - scale.shift;
            EXPECT_EQ(added[i], in ? a[i] + b[i] : a[i]);
            EXPECT_EQ(squares[i], in ? a[i] + square : a[i]);
            EXPECT_EQ(product[i], in ? a[i] * b[i] : 0.0f);
            EXPECT_EQ(once[i], in ? a[i] * b[i] : a[i]);
            EXPECT_EQ(coded[i], in ? a[i] + code : a[i]);
            EXPECT_EQ(rest[i], in ? code - b[i] : 0.0f);
        }
    }
}

// Against float64: rows of 96 floats, relative to the sum of magnitudes.
TEST(Sums, LagsAreThoseOfPairsInside) {
    constexpr std::size_t kWidth = 96, kHeight = 11;
    const std::vector<float> a = draw(kWidth * kHeight, 5), b = draw(kWidth * kHeight, 6);
    for (int dy = -12; dy <= 12; ++dy)
        for (int dx : {-97, -96, -95, -17, -1, 0, 1, 5, 16, 95, 96}) {
            double expected = 0.0, magnitude = 1e-30;
            for (int y = 0; y < int(kHeight); ++y)
                for (int x = 0; x < int(kWidth); ++x)
                    if (x + dx >= 0 && x + dx < int(kWidth) && y + dy >= 0 && y + dy < int(kHeight)) {
                        const double term = double(a[std::size_t(y) * kWidth + std::size_t(x)]) *
                                            b[std::size_t(y + dy) * kWidth + std::size_t(x + dx)];
                        expected += term;
                        magnitude += std::abs(term);
                    }
            EXPECT_NEAR(lag_sum(a.data(), b.data(), kWidth, kHeight, {dx, dy}), expected, 1e-6 * magnitude) << dx << dy;
        }
}

} // namespace
