// Frames against frames: what changes in the middle of a sequence is told, with its frame; what only fluctuates is not.
#include "capture/frame_changes.hpp"
#include "capture_support.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace clsp {
namespace {

constexpr std::uint32_t kWidth = 40, kHeight = 30;
constexpr double kDark = 64.0, kNoise = 4.0, kLight = 150.0;

using Image = std::vector<double>; // light, 1 on average

// A capture of one sequence: light(t) for each frame, on a black level, with noise.
Capture capture_of(CaptureScene scene, bool moving, std::uint32_t frames, std::mt19937_64 &random,
                   const std::function<Image(std::uint32_t)> &light) {
    Capture capture;
    capture.layout = camera_layout(kWidth, kHeight);
    add_sequence(capture.layout, "it", scene, moving, frames);
    capture.codes.emplace_back();
    std::normal_distribution<double> noise(0.0, kNoise);
    for (std::uint32_t t = 0; t < frames; ++t)
        for (const double value : light(t))
            capture.codes[0].push_back(static_cast<std::uint16_t>(
                std::clamp(std::nearbyint(kDark + kLight * value + noise(random)), 0.0, 1023.0)));
    return capture;
}

Image even(double level = 1.0) {
    return Image(std::size_t{kWidth} * kHeight, level);
}

// Fully developed speckle, its pixels independent.
Image speckle(std::mt19937_64 &random, double mean = 1.0) {
    std::exponential_distribution<double> law(1.0 / mean);
    Image image = even();
    for (double &value : image)
        value = law(random);
    return image;
}

std::string said(const Capture &capture) {
    std::string text;
    for (const CaptureWarning &warning : frame_changes(capture.layout, 0, scan_sequence(capture, 0), kDark))
        text += (text.empty() ? "" : "; ") + warning.text;
    return text;
}

void expect_says(const Capture &capture, const std::vector<std::string> &parts) {
    const std::string text = said(capture);
    for (const std::string &part : parts)
        EXPECT_NE(text.find(part), std::string::npos) << '"' << text << "\" does not say \"" << part << '"';
}

// Sequences in which nothing changes: 300 of each kind and length, of which none is told. One in a hundred would be
// missed with a probability of 5 %.
TEST(FrameChanges, NothingIsSaidOfWhatFluctuates) {
    std::mt19937_64 random(38);
    std::normal_distribution<double> normal;
    for (const std::uint32_t frames : {4u, 5u, 8u, 16u, 40u}) {
        std::string alarms[5];
        for (int i = 0; i < 300; ++i) {
            alarms[0] += said(capture_of(CaptureScene::kDark, false, frames, random, [](auto) { return even(0.0); }));
            // A lamp that flickers by 3 %.
            alarms[1] += said(capture_of(CaptureScene::kFlat, false, frames, random, [&](auto) {
                              return even(1.0 + 0.03 * normal(random));
                          }));
            alarms[2] += said(capture_of(CaptureScene::kBoard, true, frames, random, [&](auto) {
                              return speckle(random);
                          }));
            // Resting, with a laser that flickers by 5 %.
            const Image still = speckle(random);
            alarms[3] += said(capture_of(CaptureScene::kBoard, false, frames, random, [&](auto) {
                              Image image = still;
                              const double factor = 1.0 + 0.05 * normal(random);
                              for (double &value : image)
                                  value *= factor;
                              return image;
                          }));
            // Boiling: fields that keep exp(-1 / 10) from frame to frame.
            std::vector<double> re(still.size()), im(still.size());
            for (std::size_t k = 0; k < re.size(); ++k) {
                re[k] = normal(random);
                im[k] = normal(random);
            }
            const double keep = std::exp(-0.1), draw = std::sqrt(1.0 - keep * keep);
            alarms[4] += said(capture_of(CaptureScene::kBoard, false, frames, random, [&](auto) {
                              Image image = even();
                              for (std::size_t k = 0; k < image.size(); ++k) {
                                  image[k] = 0.5 * (re[k] * re[k] + im[k] * im[k]);
                                  re[k] = keep * re[k] + draw * normal(random);
                                  im[k] = keep * im[k] + draw * normal(random);
                              }
                              return image;
                          }));
        }
        EXPECT_EQ("", alarms[0]) << "dark, " << frames;
        EXPECT_EQ("", alarms[1]) << "flicker of a lamp, " << frames;
        EXPECT_EQ("", alarms[2]) << "moving board, " << frames;
        EXPECT_EQ("", alarms[3]) << "flicker of a laser, " << frames;
        EXPECT_EQ("", alarms[4]) << "boiling, " << frames;
    }
}

// Wherever the step is, and in which scene: 40 draws each.
TEST(FrameChanges, StepsOfTheLevelAreToldWithTheirFrame) {
    std::mt19937_64 random(39);
    for (int i = 0; i < 40; ++i) {
        const auto frames = static_cast<std::uint32_t>(8 + random() % 30);
        const auto at = static_cast<std::uint32_t>(2 + random() % (frames - 3));
        const std::string where = "at frame " + std::to_string(at) + ":";
        const double factor = random() % 2 ? 0.5 : 1.4;
        const auto level = [&](std::uint32_t t) { return t < at ? 1.0 : factor; };
        expect_says(capture_of(CaptureScene::kFlat, false, frames, random, [&](auto t) { return even(level(t)); }),
                    {"the level steps", where});
        const Image still = speckle(random);
        expect_says(capture_of(CaptureScene::kBoard, false, frames, random, [&](auto t) {
                        Image image = still;
                        for (double &value : image)
                            value *= level(t);
                        return image;
                    }),
                    {"the level steps", where});
        expect_says(
            capture_of(CaptureScene::kBoard, true, frames, random, [&](auto t) { return speckle(random, level(t)); }),
            {"the level steps", where});
    }
}

TEST(FrameChanges, WeakStepsAndDriftsOfALampAreTold) {
    std::mt19937_64 random(40);
    std::normal_distribution<double> normal;
    // 2 % within a flicker of 0.4 %: t = 16 of 40 frames.
    expect_says(capture_of(CaptureScene::kFlat, false, 40, random,
                           [&](auto t) { return even((t < 17 ? 1.0 : 1.02) + 0.004 * normal(random)); }),
                {"the level steps", "at frame 17:"});
    expect_says(capture_of(CaptureScene::kFlat, false, 30, random, [&](auto t) { return even(1.0 - 0.002 * t); }),
                {"the level drifts", "in frames 0 to 6"});
    // As an exposure that settles.
    expect_says(capture_of(CaptureScene::kFlat, false, 16, random,
                           [&](auto t) { return even(1.0 - 0.4 * std::exp(-0.3 * t)); }),
                {"the level"});
}

// Lines from four frames on, exposures that settle from eight.
TEST(FrameChanges, DriftsOfFewFramesAreTold) {
    std::mt19937_64 random(46);
    // With 4 of noise in 1200 pixels the t of four frames is above its bound in 81 % of draws; 40 give fewer than 20
    // with a probability below 1e-5.
    int told = 0;
    for (int i = 0; i < 40; ++i)
        told += said(capture_of(CaptureScene::kFlat, false, 4, random, [](auto t) { return even(1.0 + 0.2 * t); }))
                    .find("the level drifts") != std::string::npos;
    EXPECT_GE(told, 20);
    for (const std::uint32_t frames : {5u, 6u, 8u, 10u, 12u})
        for (int i = 0; i < 10; ++i) {
            const double step = i % 2 ? 0.2 : -0.65 / frames;
            expect_says(
                capture_of(CaptureScene::kFlat, false, frames, random, [&](auto t) { return even(1.0 + step * t); }),
                {"the level drifts", "in frame"});
            const double times = 1.0 + 0.3 * i; // frames
            if (frames >= 8)
                expect_says(capture_of(CaptureScene::kFlat, false, frames, random,
                                       [&](auto t) { return even(2.0 - 1.2 * std::exp(-double(t) / times)); }),
                            {"the level"});
        }
}

// Flicker of independent frames, of any size and law: at 1e-5 for each sequence, 4800 give more than one alarm with a
// probability of 0.1 %.
TEST(FrameChanges, FlickerOfFewFramesIsNoDrift) {
    std::mt19937_64 random(47);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    int alarms = 0;
    for (const std::uint32_t frames : {4u, 5u, 8u, 12u})
        for (const double size : {0.01, 0.05, 0.2})
            for (int i = 0; i < 200; ++i) {
                CaptureLayout layout = camera_layout(2, 2);
                add_sequence(layout, "it", CaptureScene::kFlat, false, frames);
                for (const bool even_law : {false, true}) {
                    Capture capture;
                    capture.layout = layout;
                    capture.codes.emplace_back();
                    for (std::uint32_t t = 0; t < frames; ++t) {
                        const double factor = 1.0 + size * (even_law ? uniform(random) : normal(random));
                        const double code = kDark + 4.0 * kLight * factor;
                        for (int pixel = 0; pixel < 4; ++pixel)
                            capture.codes[0].push_back(static_cast<std::uint16_t>(
                                std::clamp(std::nearbyint(code + kNoise * normal(random)), 0.0, 1023.0)));
                    }
                    alarms += said(capture).find("drifts") != std::string::npos;
                }
            }
    EXPECT_LE(alarms, 1);
}

TEST(FrameChanges, FramesThatAreNotLikeTheOthersAreTold) {
    std::mt19937_64 random(41);
    expect_says(
        capture_of(CaptureScene::kBoard, true, 16, random, [&](auto t) { return speckle(random, t % 2 ? 0.01 : 1.0); }),
        {"8 of 16 frames (1, 3, 5, 7, 9, 11 and 2 more)", "have no light", "take codes[0::2]"});
    const Image still = speckle(random);
    expect_says(capture_of(CaptureScene::kBoard, false, 12, random, [&](auto t) { return t == 5 ? even(0.6) : still; }),
                {"1 of 12 frames (5)"});
    // Stray light on some dark frames.
    expect_says(capture_of(CaptureScene::kDark, false, 10, random, [&](auto t) { return even(t >= 6 ? 0.02 : 0.0); }),
                {"at frame 6:"});
}

TEST(FrameChanges, AnotherSceneIsTold) {
    std::mt19937_64 random(42);
    for (int i = 0; i < 20; ++i) {
        const auto frames = static_cast<std::uint32_t>(6 + random() % 30);
        const auto at = static_cast<std::uint32_t>(1 + random() % (frames - 2));
        Image first = speckle(random), second = speckle(random);
        // The same level: only the pattern tells.
        double levels[2] = {};
        for (std::size_t k = 0; k < first.size(); ++k) {
            levels[0] += first[k];
            levels[1] += second[k];
        }
        for (double &value : second)
            value *= levels[0] / levels[1];
        expect_says(
            capture_of(CaptureScene::kBoard, false, frames, random, [&](auto t) { return t < at ? first : second; }),
            {"changes at frame " + std::to_string(at) + ":"});
    }
    // Of a moving scene only its contrast: half of the light without speckle.
    expect_says(capture_of(CaptureScene::kBoard, true, 20, random, [&](auto t) {
                    Image image = speckle(random);
                    for (double &value : image)
                        value = t < 9 ? value : 0.5 + 0.5 * value;
                    return image;
                }),
                {"the contrast steps", "at frame 9"});
}

// Frames of a level of their own and a noise of their own, in each scene at rest.
Capture noisy_capture(CaptureScene scene, std::uint32_t frames, std::mt19937_64 &random,
                      const std::function<double(std::uint32_t)> &deviation) {
    std::normal_distribution<double> normal;
    const Image still = scene == CaptureScene::kDark   ? even(0.0)
                        : scene == CaptureScene::kFlat ? even()
                                                       : speckle(random);
    return capture_of(scene, false, frames, random, [&](auto t) {
        Image image = still;
        const double own = std::sqrt(std::max(0.0, std::pow(deviation(t), 2.0) - kNoise * kNoise));
        for (double &value : image)
            value += own / kLight * normal(random);
        return image;
    });
}

// Wherever the step is, up and down, in the dark, in even light and on a board at rest: 40 draws each.
TEST(FrameChanges, StepsOfTheNoiseAreToldWithTheirFrame) {
    std::mt19937_64 random(48);
    for (int i = 0; i < 40; ++i)
        for (const CaptureScene scene : {CaptureScene::kDark, CaptureScene::kFlat, CaptureScene::kBoard}) {
            const auto frames = static_cast<std::uint32_t>(8 + random() % 30);
            const auto at = static_cast<std::uint32_t>(2 + random() % (frames - 3));
            const double before = i % 2 ? 4.0 : 8.0, after = i % 2 ? 8.0 : 4.0;
            expect_says(noisy_capture(scene, frames, random, [&](auto t) { return t < at ? before : after; }),
                        {"the noise steps", "at frame " + std::to_string(at) + ":"});
        }
    // A tenth, of 40 frames: 1200 pixels tell the noise of a frame to 2 %, so that t is 15.
    expect_says(noisy_capture(CaptureScene::kDark, 40, random, [&](auto t) { return t < 20 ? 6.0 : 6.6; }),
                {"the noise steps", "at frame 20:"});
}

TEST(FrameChanges, NoiseThatDriftsOrAlternatesIsTold) {
    std::mt19937_64 random(49);
    // The text is followed by a deviation: of 1200 pixels of a frame, less their rows and columns, good to 2.3 %.
    // Pixels with four times the usual variance are left out, which one noisy frame makes of some.
    const auto number = [](const std::string &text, const char *before) {
        const std::size_t at = text.find(before);
        return at == std::string::npos ? 0.0 : std::stod(text.substr(at + std::string(before).size()));
    };
    for (const CaptureScene scene : {CaptureScene::kDark, CaptureScene::kFlat}) {
        expect_says(noisy_capture(scene, 20, random, [](auto t) { return 4.0 + 0.2 * t; }), {"the noise drifts"});
        const std::string half = said(noisy_capture(scene, 12, random, [](auto t) { return t % 2 ? 8.0 : 4.0; }));
        EXPECT_NEAR(number(half, "6 of 12 frames (1, 3, 5, 7, 9, 11) have a noise of "), 8.0, 0.6) << half;
        EXPECT_NEAR(number(half, "the others "), 4.0, 0.3) << half;
        const std::string one = said(noisy_capture(scene, 12, random, [](auto t) { return t == 5 ? 8.0 : 4.0; }));
        EXPECT_NEAR(number(one, "1 of 12 frames (5) have a noise of "), 7.5, 1.0) << one;
        EXPECT_NEAR(number(one, "the others "), 4.0, 0.3) << one;
    }
}

// A minority of frames of another scene lies farther from the mean than the others do, with the same noise.
TEST(FrameChanges, AnotherSceneIsNoOtherNoise) {
    std::mt19937_64 random(50);
    for (int i = 0; i < 20; ++i) {
        const Image first = speckle(random), second = speckle(random);
        const std::uint32_t at = 10 + i % 5;
        const std::string text = said(capture_of(CaptureScene::kBoard, false, 16, random, [&](auto t) {
            Image image = t < at ? first : second;
            double level = 0.0;
            for (const double value : image)
                level += value / double(image.size());
            for (double &value : image)
                value /= level;
            return image;
        }));
        EXPECT_EQ(text.find("noise"), std::string::npos) << text;
        EXPECT_NE(text.find("changes at frame " + std::to_string(at)), std::string::npos) << text;
    }
}

// A sensor with lag keeps something of the frame before, which a first frame has not.
TEST(FrameChanges, AFirstFrameWithoutOneBeforeItIsNoOther) {
    std::mt19937_64 random(44);
    for (int i = 0; i < 60; ++i) {
        Image last;
        EXPECT_EQ("", said(capture_of(CaptureScene::kBoard, true, 8 + 8 * (i % 5), random, [&](auto) {
                      const Image now = speckle(random);
                      Image seen = now;
                      for (std::size_t k = 0; k < last.size(); ++k)
                          seen[k] = 0.85 * now[k] + 0.15 * last[k];
                      last = now;
                      return seen;
                  })));
    }
}

// A grabber that hands out frames twice makes no other scene, however many it repeats.
TEST(FrameChanges, RepeatedFramesAreNoOtherScene) {
    std::mt19937_64 random(45);
    const Image still = speckle(random);
    Capture capture = capture_of(CaptureScene::kBoard, false, 20, random, [&](auto) { return still; });
    const std::size_t pixels = still.size();
    for (const std::uint32_t t : {1, 3, 4, 6, 7, 9, 10, 12, 13, 15, 16, 18, 19}) // of 20; most of the differences are 0
        std::copy_n(capture.codes[0].begin() + std::ptrdiff_t((t - 1) * pixels), pixels,
                    capture.codes[0].begin() + std::ptrdiff_t(t * pixels));
    EXPECT_EQ("", said(capture));
}

TEST(FrameChanges, MasksAndShortSequencesAreKept) {
    std::mt19937_64 random(43);
    const auto stepping = [&](std::uint32_t t) { return even(t < 2 ? 1.0 : 0.5); };
    EXPECT_EQ("", said(capture_of(CaptureScene::kFlat, false, 3, random, stepping)));
    Capture masked = capture_of(CaptureScene::kFlat, false, 12, random, [](std::uint32_t t) {
        Image image = even();
        if (t >= 6)
            image[7] = 6.0; // one pixel
        return image;
    });
    std::vector<std::uint8_t> &mask = masked.layout.sequences[0].mask;
    mask.assign(masked.layout.pixel_count(), 0);
    EXPECT_EQ("", said(masked)); // no pixel at all
    mask[7] = mask[8] = 1;
    expect_says(masked, {"at frame 6:"});
    std::fill(mask.begin(), mask.end(), std::uint8_t{1});
    mask[7] = 0;
    EXPECT_EQ("", said(masked));
}

} // namespace
} // namespace clsp
