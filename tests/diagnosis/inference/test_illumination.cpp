// Lamp and laser whose light is not even, told from what the lens does. Captures are made here, by formula.
#include "inference/illumination.hpp"
#include "capture_support.hpp"
#include "simulator/host_noise.hpp"
#include "simulator/simulator.hpp"
#include "diagnosis/inference/attribution_support.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace clsp;

constexpr std::uint32_t kWidth = 128, kHeight = 96, kFrames = 8;
constexpr double kBlack = 64.0, kSignal = 400.0;
using Field = std::function<double(double x, double y)>; // of 1 on the axis; x, y: 1 in the corner

const auto kEven = [](double, double) { return 1.0; };
const auto kVignetting = [](double x, double y) { return 1.0 - 0.2 * (x * x + y * y); };
const auto kSlope = [](double x, double y) { return 1.0 + 0.1 * x - 0.05 * y; };

CaptureLayout layout_of(const std::vector<CaptureScene> &scenes) {
    CaptureLayout layout = camera_layout(kWidth, kHeight);
    for (const CaptureScene scene : scenes)
        add_sequence(layout, scene_name(scene), scene, is_laser(scene), kFrames);
    return layout;
}

// Boards have an exponential law in each pixel and frame, the flat the noise alone; columns: deviation of their gains.
Capture capture_of(const std::vector<CaptureScene> &scenes, const Field &lamp, const Field &laser, std::uint64_t seed,
                   double columns = 0.0) {
    Capture capture;
    capture.layout = layout_of(scenes);
    const double corner = std::hypot(0.5 * (kWidth - 1), 0.5 * (kHeight - 1));
    std::vector<double> gain(kWidth, 1.0);
    HostNoise gains(seed, 99, 0, HostStream::kProbe);
    for (double &one : gain)
        one += columns * gains.normal();
    for (std::size_t s = 0; s < scenes.size(); ++s) {
        std::vector<std::uint16_t> codes;
        for (std::uint32_t t = 0; t < kFrames; ++t) {
            HostNoise noise(seed, s, t, HostStream::kProbe);
            for (std::uint32_t y = 0; y < kHeight; ++y)
                for (std::uint32_t x = 0; x < kWidth; ++x) {
                    const double u = (x - 0.5 * (kWidth - 1)) / corner, v = (y - 0.5 * (kHeight - 1)) / corner;
                    double light = 0.0;
                    if (scenes[s] == CaptureScene::kFlat)
                        light = kSignal * lamp(u, v);
                    else if (is_laser(scenes[s]))
                        light = -0.4 * kSignal * laser(u, v) * std::log(noise.uniform());
                    const double code = std::nearbyint(kBlack + gain[x] * light + 4.0 * noise.normal());
                    codes.push_back(static_cast<std::uint16_t>(std::clamp(code, 0.0, 1023.0)));
                }
        }
        capture.codes.push_back(std::move(codes));
    }
    return capture;
}

const std::vector<CaptureScene> kAll = {CaptureScene::kDark, CaptureScene::kFlat, CaptureScene::kBoard};

const LabLight &light_of(const LabLights &found, const std::string &name) {
    for (const LabLight &light : found.lights)
        if (light.name == name)
            return light;
    throw std::runtime_error("no light is called " + name);
}
bool is_uneven(const LabLights &found, const std::string &name) {
    return !light_of(found, name).light.coefficients.empty();
}

// 400 lights at a size of 1e-4: more than one alarm comes once in 1250 runs of other seeds. Columns' gains of 1 % move
// blocks of the flat by more than their own scatter.
TEST(Illumination, EvenLightIsEven) {
    for (const double columns : {0.0, 0.01}) {
        int uneven = 0;
        for (std::uint64_t seed = 1; seed <= 100; ++seed) {
            const LabLights found = measure_lab_lights(capture_of(kAll, kEven, kEven, seed, columns));
            uneven += is_uneven(found, "lamp") + is_uneven(found, "laser");
            EXPECT_FALSE(found.lens_or_light);
        }
        EXPECT_LE(uneven, 1) << columns;
    }
}

TEST(Illumination, TheLensHasWhatBothLightsShare) {
    const LabLights found = measure_lab_lights(capture_of(kAll, kVignetting, kVignetting, 1));
    EXPECT_NEAR(found.shared_corner_loss, 0.2, 0.005);
    EXPECT_FALSE(is_uneven(found, "lamp"));
    EXPECT_FALSE(is_uneven(found, "laser"));
}

// The strip that is judged of a large image: radii are those of the image, and of a board the curvature along the strip
// tells the fall-off, since its speckle hides that across.
TEST(Illumination, AStripTellsTheImagesFallOff) {
    constexpr std::uint32_t kImageWidth = 1280, kImageHeight = 800, kFirst = 360, kRows = 80;
    Capture capture;
    capture.layout = layout_of({CaptureScene::kFlat, CaptureScene::kBoard});
    CaptureLayout &layout = capture.layout;
    layout.width = kImageWidth;
    layout.height = kRows;
    layout.window = ImageWindow{0, kFirst, kImageWidth, kImageHeight};
    layout.principal_point_px = {0.5 * (kImageWidth - 1), 0.5 * (kImageHeight - 1) - kFirst};
    const auto [axis_x, axis_y] = layout.principal_point_px;
    const double corner = std::hypot(0.5 * (kImageWidth - 1), 0.5 * (kImageHeight - 1));
    const auto lamp = [&](double u) { return 1.0 + 0.05 * u; };
    for (std::size_t s = 0; s < 2; ++s) {
        capture.codes.emplace_back();
        for (std::uint32_t t = 0; t < kFrames; ++t) {
            HostNoise noise(4, s, t, HostStream::kProbe);
            for (std::uint32_t y = 0; y < kRows; ++y)
                for (std::uint32_t x = 0; x < kImageWidth; ++x) {
                    const double u = (x - axis_x) / corner, v = (y - axis_y) / corner;
                    const double light = kVignetting(u, v) * (s == 0 ? kSignal * lamp(u)
                                                                     : -0.4 * kSignal * std::log(noise.uniform()));
                    const double code = std::nearbyint(kBlack + light + 4.0 * noise.normal());
                    capture.codes.back().push_back(static_cast<std::uint16_t>(std::clamp(code, 0.0, 1023.0)));
                }
        }
    }
    const LabLights both = measure_lab_lights(capture);
    EXPECT_NEAR(both.shared_corner_loss, 0.2, 0.01);
    ASSERT_TRUE(is_uneven(both, "lamp"));
    EXPECT_FALSE(is_uneven(both, "laser"));
    const SmoothLight &found = light_of(both, "lamp").light;
    for (const double x : {20.0, 400.0, 900.0, 1260.0})
        EXPECT_NEAR(found.at(x, 40.0) / found.at(axis_x, 40.0), lamp((x - axis_x) / corner), 0.004) << x;
    Capture board = capture;
    board.layout.sequences.erase(board.layout.sequences.begin());
    board.codes.erase(board.codes.begin());
    EXPECT_NEAR(measure_lab_lights(board).shared_corner_loss, 0.2, 0.03);
}

TEST(Illumination, ASlopeIsTheLights) {
    const LabLights found = measure_lab_lights(capture_of(
        kAll, [](double x, double y) { return kSlope(x, y) * kVignetting(x, y); }, kVignetting, 2));
    EXPECT_NEAR(found.shared_corner_loss, 0.2, 0.01);
    const LabLight &lamp = light_of(found, "lamp");
    ASSERT_TRUE(is_uneven(found, "lamp"));
    EXPECT_FALSE(is_uneven(found, "laser"));
    EXPECT_NEAR(lamp.slope[0], 0.1, 4.0 * lamp.slope_error[0] + 0.001);
    EXPECT_NEAR(lamp.slope[1], -0.05, 4.0 * lamp.slope_error[1] + 0.001);
    for (const double x : {0.0, 40.0, 127.0})
        for (const double y : {0.0, 95.0}) {
            const double corner = std::hypot(63.5, 47.5);
            EXPECT_NEAR(lamp.light.at(x, y), kSlope((x - 63.5) / corner, (y - 47.5) / corner), 0.006);
        }
}

// Lamp and laser hardly rise to one side alike: the camera does it.
TEST(Illumination, ASlopeOfBothIsNoLights) {
    const LabLights found = measure_lab_lights(capture_of(kAll, kSlope, kSlope, 7));
    EXPECT_NEAR(found.shared_slope[0], 0.1, 0.01);
    EXPECT_NEAR(found.shared_slope[1], -0.05, 0.01);
    EXPECT_FALSE(is_uneven(found, "lamp"));
    EXPECT_FALSE(is_uneven(found, "laser"));
}

// A beam of its own centre, and a lens with the lamp.
TEST(Illumination, WhatTheLensHasNotIsTheBeams) {
    const Field beam = [](double x, double y) { return std::exp(-0.4 * ((x - 0.2) * (x - 0.2) + y * y)); };
    const LabLights found = measure_lab_lights(capture_of(kAll, kEven, beam, 3));
    EXPECT_LT(found.shared_corner_loss, 0.005);
    ASSERT_TRUE(is_uneven(found, "laser"));
    EXPECT_FALSE(is_uneven(found, "lamp"));
    const LabLight &laser = light_of(found, "laser");
    EXPECT_NEAR(laser.light.at(127.0, 95.0), beam(0.8, 0.6) / beam(0.0, 0.0), 0.04);
}

// A lamp and a beam that are both brightest near the axis look like a lens's fall-off; that they are uneven is seen.
TEST(Illumination, WhatBothLightsLoseMayBeTheirs) {
    const Field lamp = [](double x, double y) { return 1.0 - 0.06 * ((x - 0.4) * (x - 0.4) + y * y); };
    const Field beam = [](double x, double y) { return std::exp(-0.3 * (x * x + (y - 0.1) * (y - 0.1))); };
    const auto with_lens = [](const Field &light) {
        return [light](double x, double y) { return light(x, y) * kVignetting(x, y); };
    };
    const LabLights uneven = measure_lab_lights(capture_of(kAll, with_lens(lamp), with_lens(beam), 8)),
                    even = measure_lab_lights(capture_of(kAll, kVignetting, kVignetting, 8));
    EXPECT_GT(uneven.shared_corner_loss, 0.23);
    const LabLight &of_lamp = light_of(uneven, "lamp");
    EXPECT_NEAR(uneven.shared_corner_loss_error, std::hypot(of_lamp.slope[0], of_lamp.slope[1]), 1e-12);
    EXPECT_LT(uneven.shared_corner_loss - 0.2, 2.0 * uneven.shared_corner_loss_error);
    EXPECT_LT(even.shared_corner_loss_error, 0.005);
}

// Without a lens's fall-off, what they share is as little as what they may: it is in both lights, and none is left.
TEST(Illumination, LittleThatBothLightsLoseIsTheirs) {
    const Field lamp = [](double x, double y) { return 1.0 - 0.09 * x - 0.015 * (x * x + y * y); };
    const Field beam = [](double x, double y) { return std::exp(-0.1 * ((x - 0.35) * (x - 0.35) + y * y)); };
    const LabLights found = measure_lab_lights(capture_of(kAll, lamp, beam, 8));
    EXPECT_EQ(found.shared_corner_loss, 0.0);
    EXPECT_GT(found.shared_corner_loss_error, 0.05);
    for (const auto &[name, field] : {std::pair{"lamp", lamp}, std::pair{"laser", beam}}) {
        const LabLight &light = light_of(found, name);
        EXPECT_NEAR(light.light.at(127.0, 95.0), field(0.8, 0.6) / field(0.0, 0.0), 0.04) << name;
    }
}

TEST(Illumination, OneLightAloneTellsNoLensFromALamp) {
    const LabLights found = measure_lab_lights(
        capture_of({CaptureScene::kDark, CaptureScene::kFlat}, kVignetting, kEven, 4));
    EXPECT_TRUE(found.lens_or_light);
    EXPECT_NEAR(found.shared_corner_loss, 0.2, 0.005);
    EXPECT_FALSE(is_uneven(found, "lamp"));
    EXPECT_TRUE(measure_lab_lights(capture_of({CaptureScene::kDark}, kEven, kEven, 5)).lights.empty());
}

// Errors of 200 slopes: 3 standard deviations about 95 % are 4.6 %, so that less than 90 % is no chance.
TEST(Illumination, ErrorsHoldTheSlope) {
    int held = 0, all = 0;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
        const LabLight lamp = light_of(measure_lab_lights(capture_of(kAll, kSlope, kEven, seed)), "lamp");
        for (std::size_t k = 0; k < 2; ++k, ++all)
            held += std::abs(lamp.slope[k] - (k ? -0.05 : 0.1)) <= 1.96 * lamp.slope_error[k];
    }
    EXPECT_GE(held, 0.9 * all);
}

TEST(Illumination, AMaskedCornerIsLeftOut) {
    Capture capture = capture_of(kAll, kEven, kEven, 6);
    for (SequenceLayout &sequence : capture.layout.sequences) {
        sequence.mask.assign(capture.layout.pixel_count(), 1);
        for (std::uint32_t y = 0; y < 32; ++y)
            for (std::uint32_t x = 0; x < 32; ++x)
                sequence.mask[std::size_t{y} * kWidth + x] = 0;
    }
    for (std::size_t i = 0; i < capture.codes[1].size(); ++i)
        if (i % kWidth < 32 && i / kWidth % kHeight < 32)
            capture.codes[1][i] = 0;
    EXPECT_FALSE(is_uneven(measure_lab_lights(capture), "lamp"));
}

// 300 flats at a size of 1e-4: an alarm comes once in 33 runs of other seeds, two once in 2,000.
TEST(Illumination, ALampThatDrifts) {
    int drifting = 0;
    for (std::uint64_t seed = 1; seed <= 300; ++seed)
        drifting += int(measure_lab_lights(capture_of({CaptureScene::kDark, CaptureScene::kFlat}, kEven, kEven, seed))
                            .drifts.size());
    EXPECT_LE(drifting, 1);
    Capture capture = capture_of(kAll, kEven, kEven, 400);
    const std::size_t pixels = capture.layout.pixel_count();
    for (std::size_t i = 0; i < capture.codes[1].size(); ++i) // frames get brighter by 0.5 DN each
        capture.codes[1][i] = std::uint16_t(capture.codes[1][i] + (i % 2 ? i / pixels : 0));
    const LabLights found = measure_lab_lights(capture);
    ASSERT_EQ(found.drifts.size(), 1u);
    EXPECT_EQ(found.drifts[0].sequence, "flat");
    EXPECT_NEAR(found.drifts[0].deviation, 0.5 * std::sqrt(6.0) / kSignal, 0.1e-3);
    EXPECT_NEAR(found.drifts[0].frame_light[7] - found.drifts[0].frame_light[0], 3.5 / kSignal, 0.5e-3);
}

// Two flats, each of half the image: none of the blocks is in both.
TEST(Illumination, MasksThatShareNoBlock) {
    Capture capture = capture_of({CaptureScene::kDark, CaptureScene::kFlat, CaptureScene::kFlat}, kSlope, kEven, 8);
    capture.layout.sequences[2].name = "flat_right";
    for (std::size_t s = 1; s < 3; ++s)
        for (std::size_t i = 0; i < capture.layout.pixel_count(); ++i)
            capture.layout.sequences[s].mask.push_back((i % kWidth < kWidth / 2) == (s == 1));
    const LabLights found = measure_lab_lights(capture);
    ASSERT_TRUE(is_uneven(found, "lamp"));
    EXPECT_NEAR(light_of(found, "lamp").slope[0], 0.1, 0.02);
    // Nor do the dark frames know any block of the flat.
    capture.layout.sequences[0].mask = capture.layout.sequences[1].mask;
    capture.layout.sequences.pop_back();
    capture.codes.pop_back();
    for (std::uint8_t &used : capture.layout.sequences[1].mask)
        used = used ? 0 : 1;
    EXPECT_TRUE(measure_lab_lights(capture).lights.empty());
}

// The simulator's frames have the light that a sequence's layout says; their mean stays.
TEST(Illumination, TheSimulatorHasIt) {
    CaptureLayout layout = layout_of(kAll);
    const double corner = std::hypot(63.5, 47.5);
    layout.sequences[1].illumination = {{63.5, 47.5}, corner, {0.3, -0.2, -0.1, 0.0, 0.05}};
    layout.sequences[2].illumination = layout.sequences[1].illumination;
    Simulator simulator(attribution_test::context(), layout);
    for (const std::size_t sequence : {std::size_t{1}, std::size_t{2}}) {
        const double mean = simulator.mean_intensity(sequence, {}, 7, kFrames);
        std::vector<std::uint16_t> codes(kFrames * layout.pixel_count());
        SimulationLevels levels;
        levels.gain_dn = 100.0 / mean;
        levels.black_level_dn = kBlack;
        levels.read_noise_dn = 2.0;
        simulator.codes(sequence, {}, levels, 7, kFrames, codes.data());
        double sum = 0.0, left = 0.0, right = 0.0;
        for (std::size_t i = 0; i < codes.size(); ++i) {
            const std::size_t x = i % kWidth;
            sum += codes[i] - kBlack;
            (x < kWidth / 2 ? left : right) += codes[i] - kBlack;
        }
        EXPECT_NEAR(sum / double(codes.size()), 100.0, 0.5) << sequence;
        double expected_left = 0.0, expected_right = 0.0;
        for (std::uint32_t y = 0; y < kHeight; ++y)
            for (std::uint32_t x = 0; x < kWidth; ++x)
                (x < kWidth / 2 ? expected_left : expected_right) += layout.sequences[1].illumination.at(x, y);
        EXPECT_NEAR(right / left, expected_right / expected_left, sequence == 1 ? 0.002 : 0.05) << sequence;
    }
}

} // namespace
