// A small camera with all kinds of sequences, and moments of what the simulator draws of it.
#pragma once

#include "capture_support.hpp"
#include "runtime/error.hpp"
#include "simulator/simulator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace clsp::gap_simulator_test {

enum Sequence : std::size_t { kDark, kFlat, kBoardStatic, kBoardMoving, kDotsStatic, kDotsMoving, kSequenceCount };
inline const char *const kNames[kSequenceCount] = {"dark",         "flat",        "board_static",
                                                   "board_moving", "dots_static", "dots_moving"};

// 64 x 48 pixels at f/5.6: D = 0.551 cycles per pixel. 12 dots.
inline CaptureLayout small_layout() {
    CaptureLayout layout = camera_layout(64, 48);
    CaptureDots dots;
    dots.sigma_px = 2.2;
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 4; ++x)
            dots.positions_px.push_back({8.3 + 15.7 * x, 8.6 + 15.1 * y});
    layout.dots = dots;
    const CaptureScene scenes[] = {CaptureScene::kDark,  CaptureScene::kFlat, CaptureScene::kBoard,
                                   CaptureScene::kBoard, CaptureScene::kDots, CaptureScene::kDots};
    for (std::size_t i = 0; i < kSequenceCount; ++i)
        add_sequence(layout, kNames[i], scenes[i], i == kBoardMoving || i == kDotsMoving, 4).f_number = 0.0; // camera's
    return layout;
}

using Codes = std::vector<std::uint16_t>;

inline double mean(const Codes &codes) {
    double sum = 0.0;
    for (const std::uint16_t code : codes)
        sum += code;
    return sum / double(codes.size());
}

inline double variance(const Codes &codes) {
    const double m = mean(codes);
    double sum = 0.0;
    for (const std::uint16_t code : codes)
        sum += (code - m) * (code - m);
    return sum / double(codes.size());
}

class GapSimulator : public ::testing::Test {
  protected:
    // One context for all tests, gone before main() ends: drivers do not like to be used later.
    static inline std::shared_ptr<Context> context;
    static void SetUpTestSuite() { context = Context::create({}); }
    static void TearDownTestSuite() { context.reset(); }

    static constexpr SimulationLevels kLevels{100.0, 64.0, 4.0};
    // No noise but rounding.
    static constexpr SimulationLevels kQuiet{100.0, 64.0, 0.0};

    static Codes draw(Simulator &simulator, std::size_t sequence, const std::vector<EffectSetting> &effects = {},
                      const SimulationLevels &levels = kLevels, std::uint64_t seed = 7, std::uint32_t frames = 4) {
        Codes codes(frames * simulator.layout().pixel_count());
        simulator.codes(sequence, effects, levels, seed, frames, codes.data());
        return codes;
    }

    // The message of the error that `call` throws.
    static std::string message_of(const std::function<void()> &call, Status status) {
        try {
            call();
        } catch (const Error &error) {
            EXPECT_EQ(static_cast<int>(error.status()), static_cast<int>(status)) << error.what();
            return error.what();
        }
        ADD_FAILURE() << "nothing was thrown";
        return {};
    }
};

inline ::testing::AssertionResult contains(const std::string &text, const std::string &part) {
    if (text.find(part) != std::string::npos)
        return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << '"' << text << "\" does not say \"" << part << '"';
}

} // namespace clsp::gap_simulator_test
