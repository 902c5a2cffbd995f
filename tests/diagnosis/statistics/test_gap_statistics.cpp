// Statistics of a capture's sequences: always finite, the same for any number of threads, blind to masked pixels, and
// each of them moved by what it is named after.
#include "capture_support.hpp"
#include "runtime/error.hpp"
#include "statistics/sequence_level.hpp"
#include "statistics/sequence_statistics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace {

using clsp::Calibration;
using clsp::CaptureLayout;
using clsp::CaptureScene;
using clsp::SequenceStatistics;

using Codes = std::vector<std::uint16_t>;
using Values = std::map<std::string, double>;

constexpr std::uint32_t kWidth = 96, kHeight = 80, kFrames = 10;
constexpr double kBlack = 64.0, kRead = 4.0, kSigma = 2.2;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

CaptureLayout make_layout(CaptureScene scene, bool moving, std::uint32_t frames = kFrames) {
    CaptureLayout layout = clsp::camera_layout(kWidth, kHeight);
    clsp::CaptureDots dots;
    dots.sigma_px = kSigma;
    for (int j = 0; j < 5; ++j)
        for (int i = 0; i < 6; ++i) // a lattice with a little unrest, so that mirrored dots do not fall on dots
            dots.positions_px.push_back({9.3 + 15.1 * i + 1.3 * std::sin(3.0 * i + 5.0 * j),
                                         8.8 + 15.2 * j + 1.3 * std::cos(4.0 * i + 2.0 * j)});
    layout.dots = dots;
    clsp::add_sequence(layout, "frames", scene, moving, frames);
    return layout;
}

// Signal of an image without noise, DN above the black level.
std::vector<double> ideal(const CaptureLayout &layout, double shift_x = 0.0, double width = kSigma) {
    const CaptureScene scene = layout.sequences[0].scene;
    std::vector<double> image(kPixels, scene == CaptureScene::kDark   ? 0.0
                                       : scene == CaptureScene::kFlat ? 390.0
                                                                      : 130.0);
    if (scene != CaptureScene::kDots)
        return image;
    for (std::size_t i = 0; i < kPixels; ++i) {
        image[i] = 0.0;
        for (const auto &dot : layout.dots->positions_px) {
            const double dx = double(i % kWidth) - dot[0] - shift_x, dy = double(i / kWidth) - dot[1];
            image[i] += 300.0 * std::exp(-0.5 * (dx * dx + dy * dy) / (width * width));
        }
    }
    return image;
}

// Speckle of a board: the moduli of smoothed complex normal numbers. What its exact law is does not matter here.
std::vector<double> make_speckle(std::mt19937 &random) {
    std::normal_distribution<double> normal;
    std::vector<double> field(2 * kPixels), smooth(kPixels);
    for (double &value : field)
        value = normal(random);
    for (std::size_t i = 0; i < kPixels; ++i) {
        double re = 0.0, im = 0.0;
        for (std::size_t k : {std::size_t{0}, std::size_t{1}, std::size_t{kWidth}, std::size_t{kWidth} + 1}) {
            re += field[2 * ((i + k) % kPixels)];
            im += field[2 * ((i + k) % kPixels) + 1];
        }
        smooth[i] = (re * re + im * im) / 8.0;
    }
    return smooth;
}

Codes make_codes(const CaptureLayout &layout, std::uint32_t seed) {
    const clsp::SequenceLayout &sequence = layout.sequences[0];
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, kRead);
    const std::vector<double> image = ideal(layout);
    const bool is_laser = sequence.scene == CaptureScene::kBoard || sequence.scene == CaptureScene::kDots;
    std::vector<double> speckle(kPixels, 1.0);
    Codes codes;
    for (std::uint32_t t = 0; t < sequence.frame_count; ++t) {
        if (is_laser && (t == 0 || sequence.moving))
            speckle = make_speckle(random);
        for (std::size_t i = 0; i < kPixels; ++i)
            codes.push_back(
                std::uint16_t(std::clamp(std::round(image[i] * speckle[i] + kBlack + noise(random)), 0.0, 1023.0)));
    }
    return codes;
}

std::vector<double> compute(const CaptureLayout &layout, const Codes &codes, unsigned threads = 1,
                            Calibration calibration = {kBlack, kRead}) {
    const SequenceStatistics statistics(layout, 0, layout.sequences[0].frame_count);
    std::vector<double> values(statistics.list().size(), NAN);
    statistics.compute(codes.data(), calibration, values.data(), threads);
    return values;
}

Values named(const CaptureLayout &layout, const Codes &codes) {
    const SequenceStatistics statistics(layout, 0, layout.sequences[0].frame_count);
    const std::vector<double> values = compute(layout, codes);
    Values result;
    for (std::size_t k = 0; k < values.size(); ++k)
        result[statistics.list()[k].name +
               (statistics.list()[k].region == "all" ? "" : "/" + statistics.list()[k].region)] = values[k];
    return result;
}

struct Scene {
    CaptureScene scene;
    bool moving;
};
constexpr Scene kScenes[] = {{CaptureScene::kDark, false}, {CaptureScene::kFlat, false}, {CaptureScene::kBoard, false},
                             {CaptureScene::kBoard, true}, {CaptureScene::kDots, false}, {CaptureScene::kDots, true}};

std::vector<std::uint8_t> striped_mask() {
    std::vector<std::uint8_t> mask(kPixels, 1);
    for (std::size_t i = 0; i < kPixels; ++i)
        if ((i % kWidth >= 20 && i % kWidth < 33) || i / kWidth == 7 || (i * 2654435761u) % 17 == 0)
            mask[i] = 0;
    return mask;
}

} // namespace

TEST(GapStatistics, FiniteWhateverTheFrames) {
    for (const Scene &scene : kScenes)
        for (const std::uint32_t frames : {1u, 2u, 3u, 10u})
            for (const bool masked : {false, true}) {
                CaptureLayout layout = make_layout(scene.scene, scene.moving, frames);
                if (masked)
                    layout.sequences[0].mask = striped_mask();
                std::vector<Codes> sets;
                for (const int code : {0, 64, 1023})
                    sets.emplace_back(frames * kPixels, std::uint16_t(code));
                Codes alternating(frames * kPixels), single(frames * kPixels, 64);
                for (std::size_t i = 0; i < alternating.size(); ++i)
                    alternating[i] = (i / kPixels) % 2 ? 1023 : 0;
                single[kPixels / 2 + 5] = 1023;
                sets.push_back(alternating);
                sets.push_back(single);
                for (const Codes &codes : sets)
                    for (const Calibration &calibration :
                         {Calibration{kBlack, kRead}, Calibration{0.0, 0.0}, Calibration{2000.0, 50.0}})
                        for (const double value : compute(layout, codes, 1, calibration))
                            ASSERT_TRUE(std::isfinite(value));
            }
}

TEST(GapStatistics, NamesAreUniqueAndStagesKnown) {
    const std::set<std::string> stages{"laser", "doe", "surface", "motion", "optics", "sensor"};
    for (const Scene &scene : kScenes)
        for (const std::uint32_t frames : {1u, 2u, 20u}) {
            const SequenceStatistics statistics(make_layout(scene.scene, scene.moving, frames), 0, frames);
            EXPECT_GT(statistics.list().size(), 10u);
            std::set<std::string> seen;
            for (const clsp::StatisticInfo &info : statistics.list()) {
                EXPECT_TRUE(stages.count(info.stage)) << info.stage;
                EXPECT_EQ(info.sequence, "frames");
                EXPECT_FALSE(info.unit.empty());
                EXPECT_TRUE(seen.insert(info.name + "/" + info.region).second) << info.name << " " << info.region;
            }
        }
}

TEST(GapStatistics, AnyNumberOfThreadsGivesTheSameBits) {
    for (const Scene &scene : kScenes) {
        const CaptureLayout layout = make_layout(scene.scene, scene.moving);
        const Codes codes = make_codes(layout, 5);
        const std::vector<double> one = compute(layout, codes, 1);
        EXPECT_EQ(one, compute(layout, codes, 2));
        EXPECT_EQ(one, compute(layout, codes, 7));
        EXPECT_EQ(one, compute(layout, codes, 0));
    }
}

TEST(GapStatistics, MaskedPixelsDoNotMatterBeyondTheirAbsence) {
    for (const Scene &scene : kScenes) {
        CaptureLayout layout = make_layout(scene.scene, scene.moving);
        layout.sequences[0].mask = striped_mask();
        Codes codes = make_codes(layout, 6);
        const std::vector<double> before = compute(layout, codes);
        for (std::size_t i = 0; i < codes.size(); ++i)
            if (!layout.sequences[0].mask[i % kPixels])
                codes[i] = std::uint16_t((i * 7919) % 1024);
        EXPECT_EQ(before, compute(layout, codes));
        const clsp::SequenceLevel level = clsp::sequence_level(layout, 0, codes.data(), kFrames);
        layout.sequences[0].mask.clear();
        EXPECT_NE(level.mean_dn, clsp::sequence_level(layout, 0, codes.data(), kFrames).mean_dn);
        EXPECT_NE(before, compute(layout, codes));
    }
}

TEST(GapStatistics, AMaskOfOnesIsNoMask) {
    CaptureLayout layout = make_layout(CaptureScene::kBoard, true);
    const Codes codes = make_codes(layout, 7);
    const std::vector<double> before = compute(layout, codes);
    layout.sequences[0].mask.assign(kPixels, 255);
    EXPECT_EQ(before, compute(layout, codes));
}

// Each test below compares frames with and without an effect. The frames without it have the same noise, so that the
// difference is the effect's; the margins are several times the scatter between seeds.
TEST(GapStatistics, SensorEffectsMoveTheirStatistics) {
    const CaptureLayout layout = make_layout(CaptureScene::kDark, false);
    const Codes clean = make_codes(layout, 8);
    const Values before = named(layout, clean);
    EXPECT_NEAR(before.at("row_noise"), 0.0, 0.2);
    EXPECT_NEAR(before.at("repeated_frames"), 0.0, 0.01);
    EXPECT_NEAR(before.at("codes_multiple_of_4"), 0.0, 0.01);

    Codes rows = clean, columns = clean, repeated = clean, lattice = clean, hot = clean, mosaic = clean, steps = clean,
          slope = clean;
    std::mt19937 random(9);
    std::normal_distribution<double> normal(0.0, 2.0);
    std::vector<int> column_offset(kWidth);
    for (int &offset : column_offset)
        offset = int(std::lround(normal(random)));
    int row_offset = 0;
    for (std::size_t i = 0; i < clean.size(); ++i) {
        const std::size_t x = i % kWidth, y = i / kWidth % kHeight;
        if (x == 0)
            row_offset = int(std::lround(normal(random)));
        rows[i] = std::uint16_t(clean[i] + row_offset);
        columns[i] = std::uint16_t(clean[i] + column_offset[x]);
        lattice[i] = std::uint16_t((clean[i] + 2) / 4 * 4);
        hot[i] = std::uint16_t(clean[i] + (i % kPixels % 1000 == 3 ? 120 : 0));
        mosaic[i] = std::uint16_t(clean[i] + (y % 2 == 0 && x % 2 == 1 ? 3 : 0));
        steps[i] = std::uint16_t(clean[i] + (x / 8 + y / 8) % 2 * 4);
        slope[i] = std::uint16_t(clean[i] + (8 * x + kWidth / 2) / kWidth);
    }
    std::copy_n(clean.begin() + 3 * kPixels, kPixels, repeated.begin() + 5 * kPixels);
    EXPECT_GT(named(layout, rows).at("row_noise"), 2.5); // log(1 + 96 * 4 / 16) = 3.2
    EXPECT_GT(named(layout, columns).at("fixed_pattern_columns"), 2.0);
    EXPECT_LT(named(layout, columns).at("row_noise"), 0.2);
    EXPECT_GT(named(layout, repeated).at("repeated_frames"), 1.0);
    EXPECT_GT(named(layout, lattice).at("codes_multiple_of_4"), 0.7);
    EXPECT_LT(named(layout, lattice).at("codes_multiple_of_4_plus_1"), -0.2);
    EXPECT_GT(named(layout, lattice).at("histogram_roughness"), before.at("histogram_roughness") + 3.0);
    EXPECT_NEAR(named(layout, hot).at("hot_pixels_12_sigma"), std::sqrt(8.0 + 0.375), 0.6); // 7680 pixels: 8 of them
    EXPECT_NEAR(before.at("hot_pixels_12_sigma"), std::sqrt(0.375), 0.2);
    EXPECT_NEAR(named(layout, hot).at("hot_pixels_48_sigma"), std::sqrt(8.0 + 0.375), 0.6);
    for (const char *const law : {"fixed_pattern", "fixed_pattern_skewness", "fixed_pattern_kurtosis"}) // is the bulk's
        EXPECT_NEAR(named(layout, hot).at(law), before.at(law), 0.05) << law;
    EXPECT_NEAR(named(layout, mosaic).at("mosaic_rows"), 1.5, 0.1); // one site in four is 3 DN brighter
    EXPECT_NEAR(named(layout, mosaic).at("mosaic_checker"), -1.5, 0.1);
    EXPECT_GT(named(layout, steps).at("block_edges_8"), before.at("block_edges_8") + 0.1);
    EXPECT_GT(named(layout, slope).at("gradient_x"), before.at("gradient_x") + 4.0);
}

// One grain that clips is no mosaic of a pattern at rest, however bright it is; columns that differ by 6 % are.
TEST(GapStatistics, OneGrainIsNoMosaic) {
    const CaptureLayout board = make_layout(CaptureScene::kBoard, false);
    const Codes speckle = make_codes(board, 11);
    Codes grain = speckle, columns = speckle;
    for (std::size_t i = 0; i < speckle.size(); ++i) {
        if (i % kPixels == 20 * kWidth + 31)
            grain[i] = 1023;
        const double gain = i % kWidth % 2 ? 1.06 : 1.0;
        columns[i] = std::uint16_t(std::min(1023l, std::lround(kBlack + (speckle[i] - kBlack) * gain)));
    }
    for (const char *name : {"mosaic_rows", "mosaic_columns", "mosaic_checker"}) {
        EXPECT_LT(std::abs(named(board, speckle).at(name)), 5.0) << name;
        EXPECT_NEAR(named(board, grain).at(name), named(board, speckle).at(name), 2.0)
            << name; // its four windows' most
    }
    EXPECT_LT(named(board, columns).at("mosaic_columns"), named(board, speckle).at("mosaic_columns") - 3.0);
    EXPECT_NEAR(named(board, columns).at("mosaic_rows"), named(board, speckle).at("mosaic_rows"), 1.0);
}

TEST(GapStatistics, LightEffectsMoveTheirStatistics) {
    const CaptureLayout flat = make_layout(CaptureScene::kFlat, false),
                        board = make_layout(CaptureScene::kBoard, false);
    const Codes even = make_codes(flat, 10), speckle = make_codes(board, 11);
    const Values flat_before = named(flat, even), board_before = named(board, speckle);
    EXPECT_NEAR(flat_before.at("temporal_variance"), 0.0, 0.05);
    EXPECT_NEAR(board_before.at("contrast"), 0.0, 0.1);
    EXPECT_NEAR(board_before.at("speckle_correlation_x6"), 0.0, 0.1);
    EXPECT_NEAR(board_before.at("temporal_variance/1_to_2.5_mean"), 0.0, 0.1);

    std::mt19937 random(12);
    std::normal_distribution<double> normal;
    Codes shot = even, falloff = even, flicker = speckle, ambient = speckle, clipped = speckle, vibration = speckle;
    double factor = 1.0;
    for (std::size_t i = 0; i < even.size(); ++i) {
        const double x = double(i % kWidth) - 47.5, y = double(i / kWidth % kHeight) - 39.5,
                     squared = (x * x + y * y) / (47.5 * 47.5 + 39.5 * 39.5);
        shot[i] = std::uint16_t(std::lround(even[i] + 10.0 * normal(random)));
        falloff[i] = std::uint16_t(std::lround(kBlack + (even[i] - kBlack) * (1.0 - 0.2 * squared)));
        if (i % kPixels == 0)
            factor = 1.0 + 0.05 * normal(random);
        flicker[i] = std::uint16_t(std::clamp(std::lround(kBlack + (speckle[i] - kBlack) * factor), 0l, 1023l));
        ambient[i] = std::uint16_t(std::min(speckle[i] + 40, 1023));
        clipped[i] = std::min<std::uint16_t>(speckle[i], 300);
        if (i % kWidth + 1 < kWidth && i / kPixels % 2)
            vibration[i] = std::uint16_t(std::lround(0.8 * speckle[i] + 0.2 * speckle[i + 1]));
    }
    EXPECT_NEAR(named(flat, shot).at("temporal_variance"), std::log((16.0 + 100.0) / 16.0), 0.1);
    EXPECT_NEAR(named(flat, falloff).at("radial_falloff"), -0.2 / (1.0 - 0.2 / 3.0), 0.02);
    EXPECT_GT(named(board, flicker).at("frame_mean_fluctuation"), board_before.at("frame_mean_fluctuation") + 2.0);
    EXPECT_LT(named(board, flicker).at("temporal_variance/1_to_2.5_mean"), 0.4); // it is not taken for a living surface
    EXPECT_LT(named(board, ambient).at("contrast"), std::log(130.0 / 170.0) + 0.15);
    EXPECT_LT(named(board, clipped).at("share_above_50_percent"), 1e-6);
    EXPECT_GT(board_before.at("share_above_50_percent"), 0.05);
    EXPECT_GT(named(board, vibration).at("image_shift_x"), board_before.at("image_shift_x") + 2.0);
    EXPECT_LT(named(board, vibration).at("image_shift_y"), named(board, vibration).at("image_shift_x") - 1.0);
}

Codes flickering(const CaptureLayout &layout, double sigma) {
    Codes codes = make_codes(layout, 11);
    std::mt19937 random(13);
    std::normal_distribution<double> normal;
    double factor = 1.0;
    for (std::size_t i = 0; i < codes.size(); ++i) {
        if (i % kPixels == 0)
            factor = 1.0 + sigma * normal(random);
        codes[i] = std::uint16_t(std::lround(kBlack + (std::min<int>(codes[i], 700) - kBlack) * factor));
    }
    return codes;
}

// Under a laser that flickers, the pixels of a few bright grains that clip stay at the top code: no noise of theirs. A
// coarse converter's top code is below 2^bits - 1.
TEST(GapStatistics, GrainsThatClipDoNotFlicker) {
    const CaptureLayout layout = make_layout(CaptureScene::kBoard, false);
    for (const int step : {1, 4, 16}) {
        Codes below = flickering(layout, 0.05);
        for (std::uint16_t &code : below)
            code = std::uint16_t((code + step / 2) / step * step);
        Codes clipped = below;
        for (std::size_t i = 0; i < clipped.size(); ++i)
            if (const std::size_t x = i % kWidth, y = i / kWidth % kHeight; x >= 40 && x < 43 && y >= 31 && y < 34)
                clipped[i] = std::uint16_t(1024 - step);
        ASSERT_LT(*std::max_element(below.begin(), below.end()), 1024 - step);
        const Values before = named(layout, below), after = named(layout, clipped);
        for (const char *name : {"noise_kurtosis", "noise_skewness", "repeated_frames", "temporal_correlation_1"})
            EXPECT_NEAR(after.at(name), before.at(name), 0.02) << name << " in steps of " << step;
        EXPECT_NEAR(after.at("temporal_variance/above_2.5_mean"), before.at("temporal_variance/above_2.5_mean"), 0.1)
            << step;
    }
}

// A frame that is white says nothing of the noise; the others do.
TEST(GapStatistics, AWhiteFrameLeavesTheOthersNoise) {
    const CaptureLayout layout = make_layout(CaptureScene::kBoard, false);
    const Codes good = flickering(layout, 0.0);
    Codes white = good;
    std::fill_n(white.begin() + std::ptrdiff_t(3 * kPixels), kPixels, std::uint16_t{1023});
    const Values before = named(layout, good), after = named(layout, white);
    EXPECT_GT(after.at("frame_mean_fluctuation"), before.at("frame_mean_fluctuation") + 3.0);
    // The nine are scaled to the mean of all ten, and vary about their own.
    const double signal = std::accumulate(good.begin(), good.end(), 0.0) / double(good.size()) - kBlack,
                 scale = 0.9 + 0.1 * (1023.0 - kBlack) / signal;
    EXPECT_NEAR(after.at("temporal_variance/1_to_2.5_mean"),
                before.at("temporal_variance/1_to_2.5_mean") + 2.0 * std::log(scale) + std::log(8.0 / 9.0), 0.02);
    EXPECT_NEAR(after.at("noise_skewness"), before.at("noise_skewness"), 0.1);
    EXPECT_NEAR(after.at("speckle_correlation_x1"), before.at("speckle_correlation_x1"), 0.02);
}

// A level that cuts the light moves through half of the range, 4 DN at a time: the root of the share above goes along,
// and never by more than an eighth of the way at once. A sharp step would have it go at once.
TEST(GapStatistics, LightThatIsCutIsFollowed) {
    const CaptureLayout layout = make_layout(CaptureScene::kBoard, 8, true);
    const Codes speckle = make_codes(layout, 1);
    std::vector<double> roots;
    for (int level = 440; level <= 600; level += 4) {
        Codes clipped = speckle;
        for (std::uint16_t &code : clipped)
            code = std::min<std::uint16_t>(code, std::uint16_t(level));
        roots.push_back(named(layout, clipped).at("share_above_50_percent"));
    }
    const double all = roots.back() - roots.front();
    EXPECT_LT(roots.front(), 1e-6);
    EXPECT_GT(all, 0.1);
    for (std::size_t i = 1; i < roots.size(); ++i) {
        EXPECT_GE(roots[i], roots[i - 1]);
        EXPECT_LT(roots[i] - roots[i - 1], all / 8.0) << i;
    }
}

// Dots without speckle and noise: the shape is known.
TEST(GapStatistics, DotsAreMeasuredWhereTheyAre) {
    const CaptureLayout layout = make_layout(CaptureScene::kDots, true, 2);
    const auto render = [&](double shift, double width, double background) {
        const std::vector<double> image = ideal(layout, shift, width);
        Codes codes(2 * kPixels);
        for (std::size_t i = 0; i < codes.size(); ++i)
            codes[i] = std::uint16_t(std::lround(kBlack + background + image[i % kPixels]));
        return named(layout, codes);
    };
    const Values centred = render(0.0, kSigma, 0.0), shifted = render(0.4, kSigma, 0.0),
                 wide = render(0.0, 1.2 * kSigma, 0.0);
    EXPECT_NEAR(centred.at("dot_shift_x"), 0.0, 0.02);
    EXPECT_NEAR(shifted.at("dot_shift_x"), 0.4, 0.02);
    EXPECT_NEAR(shifted.at("dot_shift_y"), 0.0, 0.02);
    EXPECT_NEAR(centred.at("dot_cubic_displacement"), 0.0, 0.1);
    // Under a window of twice its width a Gaussian dot looks 1 / sqrt(1 + 1/4) as wide; the radius of the moments cuts
    // a little more.
    EXPECT_NEAR(centred.at("dot_width_x"), kSigma / std::sqrt(1.25), 0.1);
    EXPECT_NEAR(centred.at("dot_width_x"), centred.at("dot_width_y"), 0.03);
    EXPECT_GT(wide.at("dot_width_x"), centred.at("dot_width_x") + 0.15);
    EXPECT_NEAR(centred.at("dot_skewness_x"), 0.0, 0.03);
    EXPECT_NEAR(centred.at("dot_profile/ring_1.0_to_1.5"),
                (std::exp(-0.5) - std::exp(-1.125)) / 0.625 / (2.0 * (1.0 - std::exp(-0.5))) * 1.0, 0.05);
    const Values lit = render(0.0, kSigma, 20.0);
    EXPECT_GT(lit.at("light_between_dots"), centred.at("light_between_dots") + 0.2);
    EXPECT_NEAR(lit.at("dot_width_x"), centred.at("dot_width_x"), 0.02);

    // Stretched by 1 % from the centre of the image: linear displacement, no cubic one.
    Codes codes(2 * kPixels);
    for (std::size_t i = 0; i < codes.size(); ++i) {
        double light = 0.0;
        for (const auto &dot : layout.dots->positions_px) {
            const double dx = double(i % kWidth) - (47.5 + 1.01 * (dot[0] - 47.5)),
                         dy = double(i % kPixels / kWidth) - (39.5 + 1.01 * (dot[1] - 39.5));
            light += 300.0 * std::exp(-0.5 * (dx * dx + dy * dy) / (kSigma * kSigma));
        }
        codes[i] = std::uint16_t(std::lround(kBlack + light));
    }
    const Values stretched = named(layout, codes);
    EXPECT_NEAR(stretched.at("dot_radial_displacement"), 0.75 * 0.01 * std::hypot(47.5, 39.5), 0.05);
    EXPECT_NEAR(stretched.at("dot_turn"), 0.0, 0.02);
}

// Spots with a moat around them, deeper and deeper: less light than between the dots, so that second moments vanish and
// become negative.
TEST(GapStatistics, MomentsOfWhatIsNoDotAreBounded) {
    const CaptureLayout layout = make_layout(CaptureScene::kDots, false, 2);
    bool spots = false, none = false;
    for (std::uint32_t seed = 0; seed < 40; ++seed) {
        const double moat = 8.0 * seed;
        std::vector<double> image(kPixels, 100.0);
        for (std::size_t i = 0; i < kPixels; ++i)
            for (const auto &dot : layout.dots->positions_px) {
                const double r = std::hypot(double(i % kWidth) - dot[0], double(i / kWidth) - dot[1]);
                image[i] += 800.0 * std::exp(-0.5 * r * r) - moat * std::exp(-0.5 * (r - 4.0) * (r - 4.0));
            }
        std::mt19937 random(seed);
        std::normal_distribution<double> noise(0.0, 10.0);
        Codes codes;
        for (std::size_t i = 0; i < 2 * kPixels; ++i)
            codes.push_back(std::uint16_t(std::max(0.0, std::round(kBlack + image[i % kPixels] + noise(random)))));
        const Values values = named(layout, codes);
        for (const char *name : {"dot_skewness_x", "dot_skewness_y", "dot_kurtosis"})
            EXPECT_LE(std::abs(values.at(name)), 10.0) << name << ", seed " << seed;
        EXPECT_LE(std::abs(values.at("dot_covariance_xy")), 1.0) << "seed " << seed;
        for (const char *name : {"dot_width_x", "dot_width_y"}) { // 0 where a core's moat takes all of its light
            EXPECT_TRUE(values.at(name) == 0.0 || values.at(name) >= std::sqrt(1.0 / 12.0) * (1 - 1e-9)) << name;
            EXPECT_LE(values.at(name), 2.0 * kSigma + 1e-9) << "as wide as the window at most, seed " << seed;
        }
        // Where no spot is seen, none has a place or a shape.
        const bool is_none = values.at("dot_width_x") == 2.0 * kSigma;
        for (const char *name : {"dot_shift_x", "dot_turn", "dot_skewness_y", "dot_kurtosis", "dot_flux_spread"})
            EXPECT_TRUE(!is_none || values.at(name) == 0.0) << name << ", seed " << seed;
        (is_none ? none : spots) = true;
    }
    EXPECT_TRUE(spots && none) << "the test tests nothing";
}

// Dots that vanish and become holes: the profile and the spokes are told relative to a core that would go through zero
// on the way.
TEST(GapStatistics, ProfilesOfWhatIsNoDotAreBounded) {
    const CaptureLayout layout = make_layout(CaptureScene::kDots, false, 2);
    double least = 1e9;
    int times_least = 0;
    for (int step = -8; step <= 8; ++step) {
        std::vector<double> image(kPixels, 100.0);
        for (std::size_t i = 0; i < kPixels; ++i)
            for (const auto &dot : layout.dots->positions_px) {
                const double r = std::hypot(double(i % kWidth) - dot[0], double(i / kWidth) - dot[1]);
                image[i] += step * std::exp(-0.5 * r * r) + 8.0 * std::exp(-0.5 * (r - 3.0) * (r - 3.0));
            }
        std::mt19937 random(std::uint32_t(step + 8));
        std::normal_distribution<double> noise(0.0, 2.0);
        Codes codes;
        for (std::size_t i = 0; i < 2 * kPixels; ++i)
            codes.push_back(std::uint16_t(std::max(0.0, std::round(kBlack + image[i % kPixels] + noise(random)))));
        for (const auto &[name, value] : named(layout, codes)) {
            if (name.rfind("dot_profile/", 0) == 0 || name.rfind("dot_angular", 0) == 0) {
                EXPECT_LE(std::abs(value), 10.0) << name << ", core of " << step << " DN";
            }
            if (name == "dot_peak")
                least = std::min(least, value), times_least += value == least;
        }
    }
    EXPECT_GE(times_least, 4) << "cores of no light reach one bound, else the test tests nothing";
}

// The residuals of two frames are each other's negative: a skewness or a correlation over time that is the same in all
// captures, but for rounding, would be a gap whenever rounding goes another way. 8 captures of each scene: a statistic
// stays the same or varies by more than rounding.
TEST(GapStatistics, NoneIsRoundingAlone) {
    for (const Scene &scene : kScenes)
        for (const std::uint32_t frames : {1u, 2u, 3u, 4u}) {
            const CaptureLayout layout = make_layout(scene.scene, scene.moving, frames);
            std::map<std::string, std::pair<double, double>> ranges;
            for (std::uint32_t seed = 0; seed < 8; ++seed)
                for (const auto &[name, value] : named(layout, make_codes(layout, 500 + seed))) {
                    const auto range = ranges.try_emplace(name, value, value).first;
                    range->second.first = std::min(range->second.first, value);
                    range->second.second = std::max(range->second.second, value);
                }
            for (const auto &[name, range] : ranges) {
                const double width = range.second - range.first;
                EXPECT_TRUE(width == 0.0 || width > 1e-6) << name << " of " << frames << " frames varies by " << width;
            }
        }
}

// Squares over few frames have the law of a chi-square of few degrees of freedom. 300 captures: the skewness of a
// Gaussian law would be 0 to 0.14; that of the cube root is 0.5 at most, of the logarithm or the square of two to four
// frames 0.8 to 2.
TEST(GapStatistics, SquaresOverFewFramesAreNearlyGaussian) {
    constexpr int kCaptures = 300;
    for (const std::uint32_t frames : {2u, 3u, 4u}) {
        const CaptureLayout layout = make_layout(CaptureScene::kBoard, false, frames);
        std::map<std::string, std::array<double, 3>> powers;
        std::size_t squares = 0;
        for (std::uint32_t seed = 0; seed < kCaptures; ++seed)
            for (const auto &[name, value] : named(layout, make_codes(layout, 1000 + seed)))
                for (std::size_t k = 0; k < 3; ++k)
                    powers[name][k] += std::pow(value, double(k + 1)) / kCaptures;
        for (const auto &[name, power] : powers) {
            if (name.rfind("image_", 0) != 0 && name != "frame_mean_fluctuation" && name != "repeated_frames")
                continue;
            ++squares;
            const double mean = power[0], variance = power[1] - mean * mean;
            const double cube = power[2] - 3.0 * mean * power[1] + 2.0 * mean * mean * mean;
            EXPECT_NEAR(cube / std::pow(variance, 1.5), 0.0, 0.7) << name << " of " << frames << " frames";
        }
        EXPECT_EQ(squares, frames > 2 ? 6u : 5u);
    }
}

// By chance a wave's score is a standard normal number, also where columns have offsets of any size: of 300 dark
// captures the mean is within 4 standard errors and 0.1 of 0, and the share above 1.645 is 5 %: more than 28 of 300 in
// 1 of 1,000 tests. A wave of twice the amplitude has a higher score, and less than twice, as its surrounding is known
// by few frequencies.
TEST(GapStatistics, AWaveIsToldByItsNormalScore) {
    constexpr std::uint32_t kCaptures = 300;
    const CaptureLayout layout = make_layout(CaptureScene::kDark, false, 2);
    const auto score = [&](std::uint32_t seed, double columns, double wave) {
        std::mt19937 random(seed);
        std::normal_distribution<double> normal;
        std::vector<double> offset(kWidth);
        for (double &one : offset)
            one = columns * normal(random);
        Codes codes;
        for (std::uint32_t t = 0; t < 2; ++t)
            for (std::size_t i = 0; i < kPixels; ++i) {
                const double x = double(i % kWidth), y = double(i / kWidth);
                const double turns = 0.1927 * x + 0.3141 * y;
                codes.push_back(std::uint16_t(std::round(kBlack + offset[i % kWidth] + kRead * normal(random) +
                                                         wave * std::sin(2.0 * M_PI * turns))));
            }
        return named(layout, codes).at("fixed_pattern_wave");
    };
    for (const double columns : {0.0, 3.0}) {
        double sum = 0.0, square = 0.0;
        std::uint32_t above = 0;
        for (std::uint32_t seed = 0; seed < kCaptures; ++seed) {
            const double value = score(2000 + seed, columns, 0.0);
            sum += value / kCaptures;
            square += value * value / kCaptures;
            above += value > 1.645 ? 1 : 0;
        }
        EXPECT_NEAR(sum, 0.0, 0.1 + 4.0 / std::sqrt(double(kCaptures))) << columns;
        EXPECT_NEAR(std::sqrt(square - sum * sum), 1.0, 0.2) << columns;
        EXPECT_LE(above, 28u) << columns;
        const double weak = score(3000, columns, 1.0), strong = score(3000, columns, 2.0);
        EXPECT_GT(weak, 8.0) << columns;
        EXPECT_NEAR(strong / weak, 1.6, 0.2) << columns;
    }
}

// 10 frames of 96 x 80: the standard error of the noise is 4 / sqrt(2 * 69120) = 0.011 DN; the margin is four of them.
// Rounding adds 1/12.
TEST(GapStatistics, LevelIsRobust) {
    const CaptureLayout layout = make_layout(CaptureScene::kDark, false);
    Codes codes = make_codes(layout, 13);
    const double expected = std::sqrt(kRead * kRead + 1.0 / 12.0);
    EXPECT_NEAR(clsp::sequence_level(layout, 0, codes.data(), kFrames).temporal_noise_dn, expected, 0.045);
    EXPECT_NEAR(clsp::sequence_level(layout, 0, codes.data(), kFrames).mean_dn, kBlack, 0.06);
    EXPECT_EQ(clsp::sequence_level(layout, 0, codes.data(), 1).temporal_noise_dn, 0.0);
    for (std::size_t i = 0; i < codes.size(); ++i) {
        const std::size_t frame = i / kPixels, y = i / kWidth % kHeight;
        codes[i] = std::uint16_t(codes[i] + (y * 7 + frame * 3) % 11 + 5 * frame); // rows and frames go their own ways
        if (i % kPixels % 640 == 9)
            codes[i] = std::uint16_t(codes[i] + (frame % 2 ? 600 : 0)); // one pixel in 640 jumps
    }
    EXPECT_NEAR(clsp::sequence_level(layout, 0, codes.data(), kFrames).temporal_noise_dn, expected, 0.06);
}

TEST(GapStatistics, RefusesWhatItCannotMeasure) {
    const auto message = [](const CaptureLayout &layout, std::size_t sequence, std::uint32_t frames) -> std::string {
        try {
            const SequenceStatistics statistics(layout, sequence, frames);
        } catch (const clsp::Error &error) {
            EXPECT_EQ(error.status(), clsp::Status::kInvalidArgument);
            return error.what();
        }
        return "";
    };
    const CaptureLayout good = make_layout(CaptureScene::kDots, false);
    EXPECT_EQ(message(good, 0, 3), "");
    EXPECT_NE(message(good, 1, 3).find("sequence 1"), std::string::npos);
    EXPECT_NE(message(good, 0, 0).find("no frames"), std::string::npos);
    CaptureLayout bad = good;
    bad.dots.reset();
    EXPECT_NE(message(bad, 0, 3).find("dots"), std::string::npos);
    bad = good;
    bad.sequences[0].mask.assign(kPixels - 1, 1);
    EXPECT_NE(message(bad, 0, 3).find("mask"), std::string::npos);
    bad.sequences[0].mask.assign(kPixels, 0);
    EXPECT_NE(message(bad, 0, 3).find("mask"), std::string::npos);
    bad = good;
    bad.bits = 17;
    EXPECT_NE(message(bad, 0, 3).find("bits"), std::string::npos);
    bad = good;
    bad.width = 4;
    EXPECT_NE(message(bad, 0, 3).find("8 x 8"), std::string::npos);
    bad = good;
    bad.sequences.clear();
    EXPECT_NE(message(bad, 0, 3).find("no sequences"), std::string::npos);

    const Codes codes = make_codes(good, 14);
    const SequenceStatistics statistics(good, 0, kFrames);
    std::vector<double> values(statistics.list().size());
    EXPECT_THROW(statistics.compute(nullptr, {kBlack, kRead}, values.data(), 1), clsp::Error);
    EXPECT_THROW(statistics.compute(codes.data(), {kBlack, kRead}, nullptr, 1), clsp::Error);
    EXPECT_THROW(statistics.compute(codes.data(), {NAN, kRead}, values.data(), 1), clsp::Error);
    EXPECT_THROW(statistics.compute(codes.data(), {kBlack, -1.0}, values.data(), 1), clsp::Error);
    EXPECT_THROW(clsp::sequence_level(good, 0, nullptr, kFrames), clsp::Error);
}
