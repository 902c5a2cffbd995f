// Quantities in a data sheet's units, of frames whose noise, patterns and dots are known: drawn here by the standard
// library, whose normal law has nothing to do with the simulator's. Seeds are fixed; tolerances are five standard
// errors, so that a right program fails once in 1.7 million checks, and what they would miss is said beside each.
#include "measure/datasheet_quantities.hpp"
#include "capture_support.hpp"
#include "statistics/quantities.hpp"

#include "runtime/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace {

constexpr std::uint32_t kWidth = 96, kHeight = 80, kFrames = 16;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;
constexpr double kBlack = 64.0, kRead = 4.0;

clsp::CaptureLayout layout(clsp::CaptureScene scene, bool moving, std::uint32_t frames = kFrames) {
    clsp::CaptureLayout result = clsp::camera_layout(kWidth, kHeight);
    clsp::add_sequence(result, "sequence", scene, moving, frames);
    return result;
}

std::uint16_t code_of(double signal) {
    return std::uint16_t(std::clamp(std::lround(signal), 0L, 1023L));
}

// The unit's, by name; fails if there is none.
double value(const std::vector<clsp::Quantity> &all, const std::string &name) {
    for (const clsp::Quantity &quantity : all)
        if (quantity.name == name)
            return quantity.value;
    ADD_FAILURE() << "no quantity " << name;
    return std::nan("");
}

std::vector<clsp::Quantity> quantities(const clsp::CaptureLayout &of, const std::vector<std::uint16_t> &codes) {
    return clsp::sequence_quantities(of, 0, codes.data(), std::uint32_t(codes.size() / kPixels), {kBlack, kRead}, 2);
}

struct Noise {
    double light = 0.0, gain = 0.0; // DN; DN per electron
    double pixel_offsets = 0.0, column_offsets = 0.0, pixel_gains = 0.0;
    double rows = 0.0, columns = 0.0, frames = 0.0; // new in each frame; DN, DN, part of the light
    double corner_loss = 0.0;
    double wave = 0.0, wave_x = 0.0, wave_y = 0.0; // DN, cycles per pixel
};

std::vector<std::uint16_t> even_frames(const Noise &noise, std::uint64_t seed, std::uint32_t frames = kFrames) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<double> offset(kPixels), gain(kPixels), column(kWidth);
    for (double &c : column)
        c = noise.column_offsets * normal(generator);
    for (std::size_t i = 0; i < kPixels; ++i) {
        const double x = double(i % kWidth) - 0.5 * (kWidth - 1), y = double(i / kWidth) - 0.5 * (kHeight - 1);
        const double corner = 0.25 * ((kWidth - 1.0) * (kWidth - 1.0) + (kHeight - 1.0) * (kHeight - 1.0));
        const double turns = noise.wave_x * double(i % kWidth) + noise.wave_y * double(i / kWidth);
        offset[i] = noise.pixel_offsets * normal(generator) + column[i % kWidth] +
                    noise.wave * std::sin(6.283185307179586 * turns + 0.7);
        gain[i] = (1.0 + noise.pixel_gains * normal(generator)) * (1.0 - noise.corner_loss * (x * x + y * y) / corner);
    }
    std::vector<std::uint16_t> codes;
    for (std::uint32_t t = 0; t < frames; ++t) {
        const double power = 1.0 + noise.frames * normal(generator);
        std::vector<double> columns(kWidth);
        for (double &c : columns)
            c = noise.columns * normal(generator);
        for (std::size_t y = 0; y < kHeight; ++y) {
            const double row = noise.rows * normal(generator);
            for (std::size_t x = 0; x < kWidth; ++x) {
                const std::size_t i = y * kWidth + x;
                const double light = noise.light * power * gain[i];
                const double deviation = std::sqrt(kRead * kRead + noise.gain * light);
                codes.push_back(code_of(kBlack + light + offset[i] + row + columns[x] + deviation * normal(generator)));
            }
        }
    }
    return codes;
}

// What rounding adds to a variance.
constexpr double kRounding = 1.0 / 12.0;

TEST(Quantities, NoiseInTheDark) {
    Noise noise;
    noise.pixel_offsets = 1.5;
    noise.column_offsets = 1.0;
    noise.rows = 0.8;
    noise.columns = 0.6;
    const auto all = quantities(layout(clsp::CaptureScene::kDark, false), even_frames(noise, 1));
    // Standard errors: of a deviation s from n values s / sqrt(2 n).
    EXPECT_NEAR(value(all, "temporal_noise"), std::sqrt(kRead * kRead + kRounding),
                5 * 4.0 / std::sqrt(2.0 * 15 * kPixels) + 0.01);
    EXPECT_NEAR(value(all, "row_noise"), 0.8, 5 * 0.9 / std::sqrt(2.0 * 15 * kHeight));
    EXPECT_NEAR(value(all, "column_noise"), 0.6, 5 * 0.75 / std::sqrt(2.0 * 15 * kWidth));
    // All fixed offsets together: 1.8 DN.
    EXPECT_NEAR(value(all, "fixed_pattern"), std::hypot(1.5, 1.0), 5 * 1.0 / std::sqrt(2.0 * kWidth));
    EXPECT_NEAR(value(all, "column_fixed_pattern"), 1.0, 5 * 1.0 / std::sqrt(2.0 * kWidth));
    EXPECT_LT(value(all, "row_fixed_pattern"), 0.3) << "offsets of rows that are new in each frame leave 0.2";
    EXPECT_NEAR(value(all, "dark_offset"), kBlack, 0.6) << "with the mean of 96 column offsets";
    EXPECT_EQ(value(all, "codes_missing"), 0.0);
    EXPECT_EQ(value(all, "codes_at_zero"), 0.0);
}

// Codes that are as wide as 1 + 0.2 cos(2 pi (n - widest) / period), made by levels that are summed up from the widths,
// under noise of 4 DN. Amplitude and widest code within 4 standard errors; even codes, few bits and a narrow law tell
// nothing.
TEST(Quantities, WidthsOfCodes) {
    for (const std::size_t period : {std::size_t{2}, std::size_t{4}}) {
        const double widest = period == 2 ? 1.0 : 2.6;
        std::vector<double> levels{-0.5};
        for (std::size_t n = 0; n < 1024; ++n)
            levels.push_back(levels.back() + 1.0 + 0.2 * std::cos(2.0 * M_PI * (double(n) - widest) / double(period)));
        std::mt19937_64 generator(40 + period);
        std::normal_distribution<double> normal(kBlack, kRead);
        std::vector<std::uint16_t> codes(kFrames * kPixels);
        for (std::uint16_t &code : codes)
            code =
                std::uint16_t(std::upper_bound(levels.begin(), levels.end(), normal(generator)) - levels.begin() - 1);
        const auto all = quantities(layout(clsp::CaptureScene::kDark, false), codes);
        EXPECT_EQ(value(all, "code_width_period"), double(period));
        EXPECT_NEAR(value(all, "code_width_wave"), 0.2, 4.0 * std::sqrt(2.0 / double(codes.size())));
        const double error = value(all, "widest_code_error");
        EXPECT_LT(error, 0.05);
        EXPECT_NEAR(value(all, "widest_code"), widest, period == 2 ? 0.0 : 4.0 * error);
    }
    const auto nothing = quantities(layout(clsp::CaptureScene::kDark, false), even_frames({}, 42));
    EXPECT_TRUE(std::isnan(value(nothing, "code_width_wave")));
    std::mt19937_64 generator(44);
    std::normal_distribution<double> normal(kBlack, 1.5); // exp(-2 pi^2 1.5^2 / 4^2) = 0.06 of a wave by itself
    std::vector<std::uint16_t> narrow(kFrames * kPixels);
    for (std::uint16_t &code : narrow)
        code = code_of(normal(generator));
    EXPECT_TRUE(std::isnan(value(quantities(layout(clsp::CaptureScene::kDark, false), narrow), "code_width_wave")));
    std::vector<std::uint16_t> few = even_frames({}, 43);
    for (std::uint16_t &code : few)
        code = std::uint16_t(code / 2 * 2);
    EXPECT_TRUE(std::isnan(value(quantities(layout(clsp::CaptureScene::kDark, false), few), "code_width_wave")));
}

// A wave at any frequency, beside column offsets: within 4 standard errors as the quantity itself has them, which are
// small.
TEST(Quantities, AWaveAndItsFrequencies) {
    const std::array<double, 2> waves[] = {
        {0.1713, 0.0649}, {0.3071, -0.2222}, {0.25, 0.5 - 3.0 / kHeight}, {0.0617, 0.0}};
    std::uint64_t seed = 20;
    for (const auto &[x, y] : waves) {
        Noise noise;
        noise.pixel_offsets = 0.5;
        noise.column_offsets = y == 0.0 ? 0.0 : 1.0;
        noise.wave = 1.5;
        noise.wave_x = x;
        noise.wave_y = y;
        const auto all = quantities(layout(clsp::CaptureScene::kDark, false), even_frames(noise, ++seed));
        const double error = value(all, "wave_frequency_error");
        EXPECT_LT(error, 5e-4);
        EXPECT_NEAR(value(all, "wave_frequency_x"), x, 4 * error);
        EXPECT_NEAR(value(all, "wave_frequency_y"), y, 4 * error);
        EXPECT_NEAR(value(all, "wave_amplitude"), 1.5, 0.1);
    }
    Noise lines;
    lines.column_offsets = 3.0;
    const auto all = quantities(layout(clsp::CaptureScene::kDark, false), even_frames(lines, 30));
    EXPECT_TRUE(std::isnan(value(all, "wave_amplitude"))) << "columns are no wave";
    const auto nothing = quantities(layout(clsp::CaptureScene::kDark, false), even_frames({}, 31));
    EXPECT_TRUE(std::isnan(value(nothing, "wave_frequency_x")));
}

TEST(Quantities, NothingIsSeenWhereNothingIs) {
    const auto all = quantities(layout(clsp::CaptureScene::kDark, false), even_frames({}, 2));
    for (const char *name : {"row_noise", "column_noise", "fixed_pattern", "row_fixed_pattern", "column_fixed_pattern",
                             "frame_mean_deviation"})
        EXPECT_LT(value(all, name), 0.25) << name << ", of a noise of 4 DN";
}

TEST(Quantities, Flat) {
    Noise noise;
    noise.light = 300.0;
    noise.gain = 0.25;
    noise.pixel_gains = 0.02;
    noise.frames = 0.03;
    noise.corner_loss = 0.3;
    const auto all = quantities(layout(clsp::CaptureScene::kFlat, false, 64), even_frames(noise, 3, 64));
    EXPECT_NEAR(value(all, "corner_loss"), 30.0, 0.3);
    EXPECT_NEAR(value(all, "frame_mean_deviation"), 3.0, 5 * 3.0 / std::sqrt(2.0 * 63));
    const double light = value(all, "mean_signal");
    EXPECT_NEAR(light, 300.0 * (1.0 - 0.3 / 3.0), 6.0); // the mean of r^2 over the image is 1/3
    EXPECT_NEAR(value(all, "fixed_pattern") / light, 0.02, 0.001) << "2 % of the pixel's own light, which falls off";
    EXPECT_NEAR(value(all, "temporal_noise"), std::sqrt(kRead * kRead + kRounding + 0.25 * light), 0.1);
}

TEST(Quantities, SpeckleWithoutGrain) {
    // Each pixel has a grain of its own: exponential law, and an autocorrelation that is a triangle of a pixel to each
    // side.
    std::mt19937_64 generator(4);
    std::exponential_distribution<double> exponential;
    std::normal_distribution<double> normal;
    std::vector<std::uint16_t> codes;
    for (std::size_t i = 0; i < kFrames * kPixels; ++i)
        codes.push_back(code_of(kBlack + 60.0 * exponential(generator) + kRead * normal(generator)));
    const auto all = quantities(layout(clsp::CaptureScene::kBoard, true), codes);
    // The contrast's standard error is 1 / sqrt(n), the skewness's about 13 / sqrt(n).
    const double n = kFrames * double(kPixels);
    EXPECT_NEAR(value(all, "contrast"), 1.0, 5 / std::sqrt(n) + 0.003);
    EXPECT_NEAR(value(all, "intensity_skewness"), 2.0, 5 * 13 / std::sqrt(n) + 0.02);
    EXPECT_NEAR(value(all, "grain_width_x"), 1.0, 0.1);
    EXPECT_NEAR(value(all, "grain_width_y"), 1.0, 0.1);
}

TEST(Quantities, GrainWidthIsThatOfABox) {
    // Boxes of 4 x 2 equal pixels at random places: the autocorrelation is a triangle of 4 and 2 pixels to each side.
    std::mt19937_64 generator(5);
    std::exponential_distribution<double> exponential;
    std::vector<std::uint16_t> codes(kFrames * kPixels);
    for (std::uint32_t t = 0; t < kFrames; ++t) {
        std::vector<double> grain(kPixels);
        for (double &g : grain)
            g = exponential(generator);
        const std::size_t x0 = generator() % 4, y0 = generator() % 2;
        for (std::size_t y = 0; y < kHeight; ++y)
            for (std::size_t x = 0; x < kWidth; ++x)
                codes[t * kPixels + y * kWidth + x] =
                    code_of(kBlack + 100.0 * grain[(y + y0) / 2 * kWidth + (x + x0) / 4]);
    }
    const auto of = layout(clsp::CaptureScene::kBoard, true);
    const auto all = clsp::sequence_quantities(of, 0, codes.data(), kFrames, {kBlack, 0.0}, 2);
    EXPECT_NEAR(value(all, "grain_width_x"), 4.0, 0.5);
    EXPECT_NEAR(value(all, "grain_width_y"), 2.0, 0.25);
}

TEST(Quantities, Dots) {
    clsp::CaptureLayout of = layout(clsp::CaptureScene::kDots, true);
    of.dots = clsp::CaptureDots{2.0, {}};
    std::vector<double> image(kPixels, 0.03 * 400.0); // light everywhere, 3 % of a dot's peak
    const double cx = 0.5 * (kWidth - 1), cy = 0.5 * (kHeight - 1);
    for (int y = 8; y < int(kHeight); y += 16)
        for (int x = 8; x < int(kWidth); x += 16) {
            of.dots->positions_px.push_back({double(x), double(y)});
            const double px = cx + 1.01 * (x - cx) + 0.4, py = cy + 1.01 * (y - cy) - 0.3; // 1 % larger and moved
            for (std::size_t i = 0; i < kPixels; ++i) {
                const double dx = double(i % kWidth) - px, dy = double(i / kWidth) - py;
                image[i] += 400.0 * std::exp(-0.5 * (dx * dx / (2.2 * 2.2) + dy * dy / (1.9 * 1.9)));
            }
        }
    std::mt19937_64 generator(6);
    std::normal_distribution<double> normal;
    std::vector<std::uint16_t> codes;
    for (std::uint32_t t = 0; t < kFrames; ++t)
        for (const double light : image)
            codes.push_back(code_of(kBlack + light + kRead * normal(generator)));
    const auto all = quantities(of, codes);
    EXPECT_NEAR(value(all, "dot_shift_x"), 0.4, 0.03);
    EXPECT_NEAR(value(all, "dot_shift_y"), -0.3, 0.03);
    EXPECT_NEAR(value(all, "dot_magnification"), 1.0, 0.1);
    EXPECT_NEAR(value(all, "dot_cubic_displacement"), 0.0, 0.1);
    EXPECT_NEAR(value(all, "dot_width_x"), 2.2, 0.05);
    EXPECT_NEAR(value(all, "dot_width_y"), 1.9, 0.05);
    // Over the mean of a core of one standard deviation of the description, about 0.8 of the peak.
    EXPECT_NEAR(value(all, "light_between_dots"), 3.0 / 0.8, 0.4);
    // Two dots lie 7.5 px from the axis: exp(-7.5^2 / (2 (2^2 + 2.2^2))) / 2 each.
    EXPECT_NEAR(value(all, "light_on_axis"), 4.0, 0.6);

    // All masked but discs around the dots: these are seen as before, but for the tails that the discs cut off.
    of.sequences[0].mask.assign(kPixels, 0);
    for (std::size_t i = 0; i < kPixels; ++i)
        for (const auto &dot : of.dots->positions_px)
            if (std::hypot(double(i % kWidth) - dot[0], double(i / kWidth) - dot[1]) < 6.0)
                of.sequences[0].mask[i] = 1;
    EXPECT_NEAR(value(quantities(of, codes), "dot_shift_x"), 0.4, 0.05);
    EXPECT_NEAR(value(quantities(of, codes), "dot_width_y"), 1.9, 0.2);
    of.sequences[0].mask.clear();

    // A dot on the axis of half the light: half of its peak under a window of its own width, over a core of 0.8.
    for (std::size_t i = 0; i < codes.size(); ++i) {
        const double dx = double(i % kWidth) - cx, dy = double(i % kPixels / kWidth) - cy;
        codes[i] = code_of(codes[i] + 200.0 * std::exp(-0.5 * (dx * dx + dy * dy) / 4.0));
    }
    EXPECT_NEAR(value(quantities(of, codes), "light_on_axis") - value(all, "light_on_axis"), 0.5 * 50.0 / 0.8, 2.0);
}

TEST(Quantities, RestingLightThatMoves) {
    // An image that shifts by a normal law of 0.2 px along x; power that flickers does not count as motion.
    std::mt19937_64 generator(7);
    std::normal_distribution<double> normal;
    const auto of = layout(clsp::CaptureScene::kBoard, false, 64);
    std::vector<double> phase(60);
    for (double &p : phase)
        p = 6.28 * double(generator() % 1000) / 1000.0;
    std::vector<std::uint16_t> codes;
    double square = 0.0;
    for (std::uint32_t t = 0; t < 64; ++t) {
        const double shift = 0.2 * normal(generator), power = 1.0 + 0.03 * normal(generator);
        square += shift * shift / 63.0;
        for (std::size_t i = 0; i < kPixels; ++i) {
            const double x = double(i % kWidth) - shift, y = double(i / kWidth);
            double light = 6.0;
            for (std::size_t k = 0; k < 12; ++k)
                light += std::cos(phase[k] + x * 0.9 * std::cos(phase[k + 12]) + y * 0.9 * std::sin(phase[k + 12]));
            codes.push_back(code_of(kBlack + power * 20.0 * std::max(0.0, light) + kRead * normal(generator)));
        }
    }
    const auto all = quantities(of, codes);
    EXPECT_NEAR(value(all, "image_shift_x"), std::sqrt(square), 0.05 * std::sqrt(square) + 0.02);
    EXPECT_LT(value(all, "image_shift_y"), 0.03);
    EXPECT_NEAR(value(all, "frame_mean_deviation"), 3.0, 5 * 3.0 / std::sqrt(2.0 * 63));
}

TEST(Quantities, MissingCodesAndClipping) {
    std::mt19937_64 generator(8);
    std::normal_distribution<double> normal;
    std::vector<std::uint16_t> codes;
    for (std::size_t i = 0; i < kFrames * kPixels; ++i)
        codes.push_back(std::uint16_t(4 * (code_of(kBlack + 30.0 + 20.0 * normal(generator)) / 4)));
    for (std::size_t i = 0; i < codes.size(); i += 50)
        codes[i] = 1023;
    for (std::size_t i = 1; i < codes.size(); i += 100)
        codes[i] = 0;
    const auto all = quantities(layout(clsp::CaptureScene::kFlat, false), codes);
    EXPECT_NEAR(value(all, "codes_at_maximum"), 2.0, 0.01);
    EXPECT_NEAR(value(all, "codes_at_zero"), 1.0, 0.02);
    EXPECT_NEAR(value(all, "codes_missing"), 75.0, 2.0) << "three of four codes; not those up to the clipped ones";
}

TEST(Quantities, WhatCannotBeToldIsNaN) {
    const std::vector<std::uint16_t> one(kPixels, 70);
    const auto flat = quantities(layout(clsp::CaptureScene::kFlat, false, 1), one);
    EXPECT_TRUE(std::isnan(value(flat, "fixed_pattern"))) << "of one frame, pattern and noise are one";
    const std::vector<std::uint16_t> black(kFrames * kPixels, std::uint16_t(kBlack));
    const auto board = quantities(layout(clsp::CaptureScene::kBoard, true), black);
    EXPECT_TRUE(std::isnan(value(board, "contrast")));
    EXPECT_TRUE(std::isnan(value(board, "grain_width_x")));
    EXPECT_THROW(clsp::sequence_quantities(layout(clsp::CaptureScene::kFlat, false), 0, nullptr, kFrames, {}, 1),
                 clsp::Error);
}

TEST(Quantities, ListDependsOnTheLayoutAlone) {
    for (const auto scene : {clsp::CaptureScene::kDark, clsp::CaptureScene::kFlat, clsp::CaptureScene::kBoard})
        for (const bool moving : {false, true}) {
            const auto of = layout(scene, moving);
            const auto first = quantities(of, std::vector<std::uint16_t>(kFrames * kPixels, 0));
            Noise noise;
            noise.light = 100.0;
            const auto second = quantities(of, even_frames(noise, 9));
            ASSERT_EQ(first.size(), second.size());
            for (std::size_t k = 0; k < first.size(); ++k) {
                EXPECT_EQ(first[k].name, second[k].name);
                EXPECT_EQ(first[k].unit, second[k].unit);
            }
        }
}

// Half of the rows and a third of the columns masked whole: what lines have is that of the others.
TEST(Quantities, MaskedLinesHaveNoSay) {
    auto of = layout(clsp::CaptureScene::kDark, false, 64);
    of.sequences[0].mask.assign(kPixels, 0);
    for (std::size_t i = 0; i < kPixels; ++i)
        of.sequences[0].mask[i] = i / kWidth < kHeight / 2 && i % kWidth % 3 != 0;
    Noise noise;
    noise.rows = 0.8;
    noise.columns = 0.6;
    const auto all = quantities(of, even_frames(noise, 12, 64));
    EXPECT_NEAR(value(all, "row_noise"), 0.8, 5 * 0.95 / std::sqrt(2.0 * 63 * kHeight / 2));
    EXPECT_NEAR(value(all, "column_noise"), 0.6, 5 * 0.87 / std::sqrt(2.0 * 63 * kWidth * 2 / 3));
    const auto quiet = quantities(of, even_frames({}, 13, 64));
    EXPECT_LT(value(quiet, "row_noise"), 0.15);
    EXPECT_LT(value(quiet, "column_noise"), 0.15);
}

TEST(Quantities, MaskedPixelsHaveNoSay) {
    auto of = layout(clsp::CaptureScene::kFlat, false);
    of.sequences[0].mask.assign(kPixels, 1);
    for (std::size_t i = 0; i < kPixels; i += 7)
        of.sequences[0].mask[i] = 0;
    Noise noise;
    noise.light = 200.0;
    std::vector<std::uint16_t> codes = even_frames(noise, 10);
    const auto first = quantities(of, codes);
    for (std::size_t i = 0; i < codes.size(); ++i)
        if (i % kPixels % 7 == 0)
            codes[i] = std::uint16_t(i * 31 % 1024);
    const auto second = quantities(of, codes);
    for (std::size_t k = 0; k < first.size(); ++k)
        EXPECT_TRUE(first[k].value == second[k].value || (std::isnan(first[k].value) && std::isnan(second[k].value)))
            << first[k].name << " " << first[k].value << " " << second[k].value;
}

clsp::TransferPoint point(double signal, double variance, double error = 0.1) {
    return {"flat", signal, variance, error};
}

TEST(PhotonTransfer, LineThroughPoints) {
    // Those beyond 70 % of the full signal of 959 DN have lost variance to clipping.
    const auto fit = clsp::fit_photon_transfer(
        {point(0, 16), point(100, 41), point(300, 91, 0.3), point(600, 166, 0.5), point(900, 40)}, 959.0);
    ASSERT_TRUE(fit.fitted);
    EXPECT_NEAR(fit.gain_dn_per_electron, 0.25, 1e-12);
    EXPECT_NEAR(fit.intercept_dn2, 16.0, 1e-10);
    EXPECT_EQ(fit.points.size(), 5u);
}

TEST(PhotonTransfer, ErrorsAreThoseOfRepeatedFits) {
    std::mt19937_64 generator(11);
    std::normal_distribution<double> normal;
    constexpr int kFits = 4000; // a deviation to 1.1 %: five of these are 5.6 %
    double gain = 0.0, gain_square = 0.0, intercept = 0.0, intercept_square = 0.0, gain_error = 0.0,
           intercept_error = 0.0;
    for (int k = 0; k < kFits; ++k) {
        std::vector<clsp::TransferPoint> points;
        for (const double signal : {0.0, 80.0, 200.0, 500.0}) {
            const double variance = 16.0 + 0.25 * signal, error = 0.01 * variance;
            points.push_back(point(signal, variance + error * normal(generator), error));
        }
        const auto fit = clsp::fit_photon_transfer(points, 959.0);
        gain += fit.gain_dn_per_electron / kFits;
        gain_square += fit.gain_dn_per_electron * fit.gain_dn_per_electron / kFits;
        intercept += fit.intercept_dn2 / kFits;
        intercept_square += fit.intercept_dn2 * fit.intercept_dn2 / kFits;
        gain_error = fit.gain_error;
        intercept_error = fit.intercept_error;
    }
    EXPECT_NEAR(gain, 0.25, 5 * gain_error / std::sqrt(double(kFits)));
    EXPECT_NEAR(std::sqrt(gain_square - gain * gain) / gain_error, 1.0, 0.06);
    EXPECT_NEAR(std::sqrt(intercept_square - intercept * intercept) / intercept_error, 1.0, 0.06);
}

TEST(PhotonTransfer, OneLevelIsNoLine) {
    EXPECT_FALSE(clsp::fit_photon_transfer({point(200, 66), point(202, 67)}, 959.0).fitted);
    EXPECT_FALSE(clsp::fit_photon_transfer({point(0, 16)}, 959.0).fitted);
    EXPECT_FALSE(clsp::fit_photon_transfer({}, 959.0).fitted);
    EXPECT_FALSE(clsp::fit_photon_transfer({point(0, 16), point(800, 200)}, 959.0).fitted)
        << "the other one is clipped";
}

} // namespace
