// The sums over pixels on the device: every statistic of every kind of sequence has the bits that the host's sums give.
#include "statistics/device_sums.hpp"

#include "capture_support.hpp"
#include "runtime/error.hpp"
#include "statistics/geometry.hpp"
#include "statistics/sequence_statistics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace {

using clsp::CaptureLayout;
using clsp::CaptureScene;
using clsp::SequenceStatistics;
using clsp::statistics::DeviceSums;

using Codes = std::vector<std::uint16_t>;

struct Kind {
    CaptureScene scene;
    bool moving;
    std::uint32_t width, height, frames, bits;
    bool masked;
};

CaptureLayout layout_of(const Kind &kind) {
    CaptureLayout layout = clsp::camera_layout(kind.width, kind.height);
    layout.bits = kind.bits;
    clsp::CaptureDots dots;
    dots.sigma_px = 2.1;
    for (double y = 9.2; y < kind.height - 2.0; y += 15.3)
        for (double x = 8.7; x < kind.width - 2.0; x += 14.9)
            dots.positions_px.push_back({x + std::sin(y), y + std::cos(2.0 * x)});
    layout.dots = dots;
    clsp::SequenceLayout &sequence = clsp::add_sequence(layout, "frames", kind.scene, kind.moving, kind.frames);
    if (kind.masked) {
        sequence.mask.assign(layout.pixel_count(), 1);
        for (std::size_t i = 0; i < sequence.mask.size(); ++i)
            if (i % kind.width < 5 || i / kind.width == 11 || i * 2654435761u % 23 == 0)
                sequence.mask[i] = 0;
    }
    return layout;
}

// Light with a structure that rests or moves, flickers, and clips here and there.
Codes codes_of(const Kind &kind, std::uint32_t seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::exponential_distribution<double> exponential;
    const std::size_t pixels = std::size_t{kind.width} * kind.height;
    const double top = std::exp2(kind.bits) - 1.0, light = kind.scene == CaptureScene::kDark ? 0.0 : 0.25 * top;
    std::vector<double> image(pixels);
    Codes codes;
    for (std::uint32_t t = 0; t < kind.frames; ++t) {
        if (t == 0 || kind.moving)
            for (double &value : image)
                value = kind.scene == CaptureScene::kFlat ? 1.0 : exponential(random);
        const double power = 1.0 + 0.05 * normal(random);
        for (std::size_t i = 0; i < pixels; ++i)
            codes.push_back(std::uint16_t(std::clamp(
                std::round(0.06 * top + light * power * image[i] + 0.004 * top * normal(random)), 0.0, top)));
    }
    return codes;
}

std::shared_ptr<clsp::Context> context() {
    static const std::shared_ptr<clsp::Context> shared = clsp::Context::create({});
    return shared;
}

class OfEveryKind : public testing::TestWithParam<CaptureScene> {};
INSTANTIATE_TEST_SUITE_P(Scenes, OfEveryKind,
                         testing::Values(CaptureScene::kDark, CaptureScene::kFlat, CaptureScene::kBoard,
                                         CaptureScene::kDots));

} // namespace

TEST_P(OfEveryKind, TheDeviceHasTheHostsBits) {
    DeviceSums device(context()); // one for all: its buffers grow
    std::uint32_t seed = 0;
    for (const bool moving : {false, true})
        for (const bool masked : {false, true})
            for (const auto &[width, height, frames, bits] : {std::array<std::uint32_t, 4>{96, 80, 10, 10},
                                                              {101, 67, 5, 8},
                                                              {51, 120, 2, 12},
                                                              {64, 64, 1, 10},
                                                              {67, 49, 3, 16},
                                                              {13, 12, 4, 10}}) {
                const Kind kind{GetParam(), moving, width, height, frames, bits, masked};
                const CaptureLayout layout = layout_of(kind);
                const Codes codes = codes_of(kind, ++seed);
                const SequenceStatistics statistics(layout, 0, frames);
                const clsp::Calibration calibration{0.06 * (std::exp2(bits) - 1.0), 3.0};
                ASSERT_TRUE(device.takes(clsp::statistics::Geometry(layout, 0, frames)));
                std::vector<double> host(statistics.list().size()), there = host;
                statistics.compute(codes.data(), calibration, host.data(), 2);
                statistics.compute(codes.data(), calibration, there.data(), 2, &device);
                for (std::size_t k = 0; k < host.size(); ++k)
                    EXPECT_EQ(host[k], there[k]) << statistics.list()[k].name << ' ' << statistics.list()[k].region
                                                 << ", " << width << " x " << height << ", " << frames << " frames"
                                                 << (moving ? ", moving" : "") << (masked ? ", masked" : "");
            }
}

TEST(DeviceSums, TinyImagesAreTheHosts) {
    const DeviceSums device(context());
    const Kind tiny{CaptureScene::kBoard, true, 11, 40, 4, 10, false},
        good{CaptureScene::kBoard, true, 64, 64, 4, 10, false};
    EXPECT_FALSE(device.takes(clsp::statistics::Geometry(layout_of(tiny), 0, 4)));
    EXPECT_TRUE(device.takes(clsp::statistics::Geometry(layout_of(good), 0, 4)));
    // More than any device's buffer: nothing is allocated for the question.
    clsp::statistics::Geometry huge(layout_of(good), 0, 4);
    huge.frames = std::size_t{1} << 40;
    EXPECT_FALSE(device.takes(huge));
    // What the device does not take, compute() measures on the host.
    const CaptureLayout layout = layout_of(tiny);
    const SequenceStatistics statistics(layout, 0, 4);
    const Codes codes = codes_of(tiny, 1);
    std::vector<double> host(statistics.list().size()), there = host;
    DeviceSums other(context());
    statistics.compute(codes.data(), {}, host.data(), 1);
    statistics.compute(codes.data(), {}, there.data(), 1, &other);
    EXPECT_EQ(host, there);
}

TEST(DeviceSums, LeavesToTheHostWhatItFailsAt) {
    const clsp::statistics::Geometry geometry(layout_of({CaptureScene::kBoard, true, 64, 64, 4, 10, false}), 0, 4);
    DeviceSums chosen(context(), true), forced(context());
    EXPECT_TRUE(chosen.takes(geometry));
    EXPECT_TRUE(chosen.gives_up("no memory"));
    EXPECT_FALSE(chosen.takes(geometry));
    EXPECT_FALSE(forced.gives_up("no memory"));
    EXPECT_TRUE(forced.takes(geometry));
}

TEST(DeviceSums, TheVariableChooses) {
    using namespace clsp::statistics;
    const auto with = [](const char *value) {
        setenv("CLSPECKLE_STATISTICS", value, 1);
        const StatisticsChoice choice = environment_statistics_choice();
        unsetenv("CLSPECKLE_STATISTICS");
        return choice;
    };
    EXPECT_EQ(with("device"), StatisticsChoice::kDevice);
    EXPECT_EQ(with("host"), StatisticsChoice::kHost);
    EXPECT_EQ(with("auto"), StatisticsChoice::kAuto);
    EXPECT_EQ(with(""), StatisticsChoice::kAuto);
    EXPECT_EQ(environment_statistics_choice(), StatisticsChoice::kAuto);
    try {
        with("gpu");
        FAIL();
    } catch (const clsp::Error &error) {
        unsetenv("CLSPECKLE_STATISTICS");
        EXPECT_EQ(error.status(), clsp::Status::kInvalidArgument);
        EXPECT_NE(std::string(error.what()).find("auto, host or device"), std::string::npos);
    }
    const bool is_gpu = (context()->device().getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_GPU) != 0;
    EXPECT_EQ(make_device_sums(context(), StatisticsChoice::kAuto) != nullptr, is_gpu);
    EXPECT_EQ(make_device_sums(context(), StatisticsChoice::kHost), nullptr);
    EXPECT_NE(make_device_sums(context(), StatisticsChoice::kDevice), nullptr);
}
