// Which part of a capture is judged, what is cut out of it, and codes that stay in their files.
#include "capture/judged_part.hpp"

#include "capture/capture_check.hpp"
#include "capture/capture_reader.hpp"
#include "capture/capture_writer.hpp"
#include "capture/stored_sequence.hpp"
#include "capture_support.hpp"
#include "runtime/error.hpp"
#include "simulator/sequence_model.hpp"

#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace clsp {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kBudget = 1'000'000;

CaptureLayout layout_of(std::uint32_t width, std::uint32_t height, const std::vector<std::uint32_t> &frames) {
    CaptureLayout layout = camera_layout(width, height);
    const std::pair<CaptureScene, bool> kinds[] = {{CaptureScene::kDark, false},
                                                   {CaptureScene::kFlat, false},
                                                   {CaptureScene::kBoard, true},
                                                   {CaptureScene::kDots, true}};
    for (std::size_t s = 0; s < frames.size(); ++s)
        add_sequence(layout, "s" + std::to_string(s), kinds[s % 4].first, kinds[s % 4].second, frames[s]);
    if (frames.size() >= 4)
        layout.dots = CaptureDots{2.0, {{10.0, 10.0}, {width / 2.0, height / 2.0}, {width / 2.0, height / 2.0 + 30.0}}};
    return layout;
}

std::uint64_t pixels_of(const JudgedPart &part) {
    std::uint64_t frames = 0;
    for (const JudgedPart::Sequence &sequence : part.sequences)
        frames += sequence.frames();
    return frames * part.window.width * part.window.height;
}

std::string refusal(const CaptureLayout &layout, const PartChoice &choice) {
    try {
        choose_part(layout, choice, kBudget);
    } catch (const Error &error) {
        return error.what();
    }
    return {};
}

PartChoice given(std::uint32_t x, std::uint32_t y, std::uint32_t width, std::uint32_t height) {
    PartChoice choice;
    choice.window = PixelWindow{x, y, width, height};
    return choice;
}

PartChoice some(std::uint32_t frames) {
    PartChoice choice;
    choice.frames = frames;
    return choice;
}

TEST(JudgedPart, SmallCapturesAreWhole) {
    const JudgedPart part = choose_part(layout_of(192, 160, {8, 8, 7}), {}, kBudget);
    EXPECT_TRUE(part.is_whole());
    EXPECT_EQ(part.sequences[2].frames(), 7u);
    ASSERT_EQ(part.sequences[2].runs.size(), 1u);
}

TEST(JudgedPart, LargeOnesAreAStripThroughTheAxis) {
    CaptureLayout layout = layout_of(1280, 800, {300, 300, 300});
    const JudgedPart part = choose_part(layout, {});
    EXPECT_EQ(part.window.width, 1280u);
    EXPECT_LE(pixels_of(part), kMostJudgedPixels);
    EXPECT_GE(pixels_of(part), kMostJudgedPixels / 2);
    EXPECT_EQ(part.window.y % 2, 0u);
    EXPECT_NEAR(part.window.y + 0.5 * (part.window.height - 1.0), 399.5, 1.0);
    for (const JudgedPart::Sequence &sequence : part.sequences)
        EXPECT_EQ(sequence.frames(), kEnoughFrames);
    layout.principal_point_px = {100.0, 20.0}; // a strip stays within the image
    EXPECT_EQ(choose_part(layout, {}).window.y, 0u);
    std::swap(layout.width, layout.height);
    EXPECT_EQ(choose_part(layout, {}).window.height, 1280u);
}

TEST(JudgedPart, FewFramesOfALargeImageKeepItWhole) {
    const JudgedPart part = choose_part(layout_of(640, 480, {2, 2, 200}), {}, 10'000'000);
    EXPECT_TRUE(part.has_whole_image());
    EXPECT_EQ(part.sequences[2].frames(), 28u); // 32 frames of 640 x 480 pixels are 9.8 million
}

TEST(JudgedPart, ManySequencesKeepToTheBudgetByFrames) {
    const CaptureLayout layout = layout_of(1280, 800, std::vector<std::uint32_t>(40, 100));
    const JudgedPart part = choose_part(layout, {});
    EXPECT_LE(pixels_of(part), kMostJudgedPixels);
    EXPECT_GE(part.sequences[0].frames(), 4u);
    EXPECT_GE(std::min(part.window.width, part.window.height), 64u);
}

// Neighbours in time stay neighbours, and what was in a half stays in it.
TEST(JudgedPart, FramesAreRunsInTheMiddleOfEachHalf) {
    for (const std::uint32_t frames : {40u, 41u, 300u})
        for (const std::uint32_t most : {4u, 10u, 13u, 39u}) {
            const JudgedPart part = choose_part(layout_of(64, 48, {frames}), some(most), kBudget);
            ASSERT_EQ(part.sequences[0].runs.size(), 2u);
            const auto &[first, second] = std::pair{part.sequences[0].runs[0], part.sequences[0].runs[1]};
            EXPECT_EQ(first.count + second.count, most);
            EXPECT_EQ(first.count, most / 2);
            EXPECT_LE(first.first + first.count, frames / 2);
            EXPECT_GE(second.first, frames / 2);
            EXPECT_LE(second.first + second.count, frames);
            EXPECT_NEAR(first.first, (frames / 2 - first.count) / 2.0, 1.0);
        }
    const JudgedPart three = choose_part(layout_of(64, 48, {41}), some(3), kBudget);
    ASSERT_EQ(three.sequences[0].runs.size(), 1u);
    EXPECT_EQ(three.sequences[0].runs[0].first, 19u);
    EXPECT_TRUE(choose_part(layout_of(64, 48, {41}), some(0), kBudget).is_whole());
}

TEST(JudgedPart, WhatTheUserSaysHolds) {
    const CaptureLayout layout = layout_of(1280, 800, {300, 300, 300});
    PartChoice whole;
    whole.whole_image = true;
    EXPECT_TRUE(choose_part(layout, whole).has_whole_image());
    EXPECT_EQ(choose_part(layout, whole).sequences[0].frames(), 4u); // as few as have halves
    whole.frames = 0;
    EXPECT_TRUE(choose_part(layout, whole).is_whole());
    const JudgedPart part = choose_part(layout, given(480, 300, 320, 200));
    EXPECT_EQ(part.window.x, 480u);
    EXPECT_EQ(part.window.height, 200u);
    EXPECT_EQ(part.sequences[0].frames(), 46u); // 3 x 46 frames of 320 x 200 pixels are 8.8 million
    PartChoice both = given(480, 300, 320, 200);
    both.frames = 100;
    EXPECT_EQ(choose_part(layout, both).sequences[0].frames(), 100u);
    EXPECT_LE(pixels_of(choose_part(layout, some(100))), kMostJudgedPixels);
    EXPECT_EQ(choose_part(layout, some(100)).sequences[0].frames(), 100u);
}

TEST(JudgedPart, WindowsThatDoNotFitAreRefused) {
    const CaptureLayout layout = layout_of(1280, 800, {300});
    EXPECT_NE(refusal(layout, given(1200, 0, 200, 100)).find("1400"), std::string::npos);
    EXPECT_NE(refusal(layout, given(0, 4294967294u, 200, 100)).find("1280 x 800"), std::string::npos);
    EXPECT_NE(refusal(layout, given(0, 0, 8, 100)).find("16 x 16"), std::string::npos);
    EXPECT_NE(refusal(layout, given(1, 0, 200, 100)).find("odd"), std::string::npos);
    CaptureLayout masked = layout;
    masked.sequences[0].mask.assign(masked.pixel_count(), 0);
    std::fill_n(masked.sequences[0].mask.begin() + 600 * 1280, 1280, std::uint8_t{1});
    EXPECT_NE(refusal(masked, given(0, 0, 200, 100)).find("mask"), std::string::npos);
    EXPECT_EQ(refusal(masked, given(0, 590, 200, 100)), "");
}

TEST(JudgedPart, AStripGoesWhereMasksLeaveSomething) {
    CaptureLayout layout = layout_of(1280, 800, {300, 300});
    layout.sequences[1].mask.assign(layout.pixel_count(), 0);
    std::fill_n(layout.sequences[1].mask.begin() + 560 * 1280, 240 * 1280, std::uint8_t{255});
    const JudgedPart part = choose_part(layout, {});
    EXPECT_GE(part.window.y + 0.1 * part.window.height, 560.0);
    EXPECT_LE(part.window.y, 580u); // and no farther from the axis than that takes
}

TEST(JudgedPart, WindowsTakeAxisDotsAndMaskAlong) {
    Capture capture;
    capture.layout = layout_of(100, 80, {6, 5, 5, 5});
    capture.layout.principal_point_px = {40.0, 30.0};
    for (const SequenceLayout &sequence : capture.layout.sequences) {
        capture.codes.emplace_back();
        for (std::uint32_t i = 0; i < sequence.frame_count * 8000; ++i)
            capture.codes.back().push_back(static_cast<std::uint16_t>(i % 8000 % 100 + 10 * (i / 8000)));
    }
    std::vector<std::uint8_t> &mask = capture.layout.sequences[1].mask;
    mask.assign(8000, 255);
    mask[22 * 100 + 33] = 0;
    PartChoice choice = given(32, 20, 50, 40);
    choice.frames = 4;
    CaptureLayout chosen = capture.layout;
    chosen.sequences.erase(chosen.sequences.begin());
    const JudgedPart part = choose_part(chosen, choice, kBudget);
    const Capture taken = take_part(capture, {1, 2, 3}, chosen.sequences, part);
    EXPECT_EQ(taken.layout.width, 50u);
    EXPECT_EQ(taken.layout.height, 40u);
    EXPECT_EQ(taken.layout.principal_point_px, (std::array<double, 2>{8.0, 10.0}));
    EXPECT_EQ(taken.layout.corner_radius_px(), capture.layout.corner_radius_px());
    ASSERT_EQ(taken.codes.size(), 3u);
    ASSERT_EQ(taken.codes[0].size(), 4u * 2000);
    // Column 32 of frames 0, 1, 2 or 3, and of the last but one or the last.
    EXPECT_EQ(taken.codes[0][0], 32 + 10 * part.sequences[0].runs[0].first);
    EXPECT_EQ(taken.codes[0][3 * 2000 + 51], 33 + 10 * (part.sequences[0].runs[1].first + 1));
    EXPECT_EQ(std::count(taken.layout.sequences[0].mask.begin(), taken.layout.sequences[0].mask.end(), 0), 1);
    EXPECT_EQ(taken.layout.sequences[0].mask[2 * 50 + 1], 0);
    // The dot at (10, 10) is 22 px from the window's edge, too far; that at (50, 70) 10 px.
    ASSERT_EQ(taken.layout.dots->positions_px.size(), 2u);
    EXPECT_EQ(taken.layout.dots->positions_px[0], (std::array<double, 2>{18.0, 20.0}));
}

// What effects of the lens do to a pixel is the same in a window: a (r / R)^2 with R of the image's corner.
TEST(JudgedPart, TheLensIsThatOfTheImage) {
    CaptureLayout image = layout_of(1280, 800, {4, 4, 4, 4});
    image.principal_point_px = {600.0, 420.0};
    Capture capture;
    capture.layout = image;
    for (const SequenceLayout &sequence : image.sequences)
        capture.codes.emplace_back(sequence.frame_count * image.pixel_count());
    const JudgedPart part = choose_part(image, given(200, 360, 800, 96));
    const CaptureLayout window = take_part(capture, {0, 1, 2, 3}, image.sequences, part).layout;
    const double far_x = 1279.0 - 600.0, far_y = 420.0; // the corner that is farthest from the axis
    const double in_x = 400.0, in_y = 60.0;             // of the window
    const double ratio = (in_x * in_x + in_y * in_y) / (far_x * far_x + far_y * far_y);
    const auto model = [](const CaptureLayout &layout, std::size_t sequence) {
        return sequence_model(layout, {}, sequence, {{"vignetting", {0.4}}, {"lens_distortion", {0.05}}});
    };
    EXPECT_NEAR(model(window, 1).corner_loss, 0.4 * ratio, 1e-12);
    EXPECT_EQ(model(image, 1).corner_loss, 0.4);
    EXPECT_NEAR(model(window, 3).model.lens.k1, 0.05 * ratio, 1e-12);
    EXPECT_EQ(model(window, 3).model.lens.principal_point_x_px, 400.0);
    EXPECT_EQ(model(window, 3).model.lens.principal_point_y_px, 60.0);
}

// A folder of the test's own.
class StoredCapture : public ::testing::Test {
  protected:
    fs::path folder = fs::path(::testing::TempDir()) / ("clspeckle_stored_" + std::to_string(::getpid()));
    ~StoredCapture() override {
        std::error_code ignored;
        fs::remove_all(folder, ignored);
    }

    Capture written(std::uint32_t width, std::uint32_t height, std::uint32_t frames) const {
        Capture capture;
        capture.layout = layout_of(width, height, {frames, frames, frames, frames});
        capture.layout.sequences[2].mask.assign(capture.layout.pixel_count(), 255);
        std::fill_n(capture.layout.sequences[2].mask.begin(), 3 * width, std::uint8_t{0});
        std::mt19937 random(5);
        for (std::size_t s = 0; s < 4; ++s) {
            capture.codes.emplace_back(frames * capture.layout.pixel_count());
            for (std::uint16_t &code : capture.codes.back())
                code = static_cast<std::uint16_t>(60 + random() % (s == 0 ? 9u : 200u));
        }
        write_capture(capture, folder.string());
        return capture;
    }
};

TEST_F(StoredCapture, SaysWhatOneInMemorySays) {
    const Capture written_one = written(40, 30, 12);
    const Capture stored = read_capture(folder.string(), {}, 0), memory = read_capture(folder.string());
    ASSERT_TRUE(stored.is_stored(0));
    EXPECT_TRUE(stored.codes[0].empty());
    EXPECT_FALSE(memory.is_stored(0));
    EXPECT_EQ(memory.codes, written_one.codes);
    EXPECT_EQ(capture_summary_json(stored), capture_summary_json(memory));
    PartChoice choice = given(4, 6, 20, 18);
    choice.frames = 6;
    const JudgedPart part = choose_part(stored.layout, choice);
    EXPECT_EQ(take_part(stored, {0, 1, 2, 3}, stored.layout.sequences, part).codes,
              take_part(memory, {0, 1, 2, 3}, stored.layout.sequences, part).codes);
    // And it can be written.
    fs::path again = folder;
    again += "_again";
    write_capture(stored, again.string());
    EXPECT_EQ(read_capture(again.string()).codes, memory.codes);
    fs::remove_all(again);
}

TEST_F(StoredCapture, ProgressRisesToOneAndMayStop) {
    written(40, 30, 6);
    for (const std::uint64_t in_memory : {std::uint64_t{0}, kMostBytesInMemory}) {
        double last = 0.0;
        read_capture(
            folder.string(),
            [&](double part) {
                EXPECT_GT(part, last);
                last = part;
            },
            in_memory);
        EXPECT_DOUBLE_EQ(last, 1.0);
        struct Stop {};
        EXPECT_THROW(read_capture(
                         folder.string(),
                         [](double part) {
                             if (part > 0.5)
                                 throw Stop();
                         },
                         in_memory),
                     Stop);
    }
}

TEST_F(StoredCapture, FilesThatChangeAreTold) {
    written(40, 30, 6);
    const Capture stored = read_capture(folder.string(), {}, 0);
    std::vector<std::uint16_t> room;
    frame_of(stored, 0, 3, room);
    const fs::path file = folder / "s1.npy";
    fs::resize_file(file, fs::file_size(file) - 100);
    try {
        frame_of(stored, 1, 3, room);
        ADD_FAILURE() << "nothing was thrown";
    } catch (const Error &error) {
        EXPECT_EQ(error.status(), Status::kIo);
        EXPECT_NE(std::string(error.what()).find("s1.npy"), std::string::npos) << error.what();
    }
}

// A code above the top one is an error when the set is opened, in the middle of a stream, too.
TEST_F(StoredCapture, BadCodesAreToldAtOnce) {
    written(40, 30, 6);
    {
        std::fstream file(folder / "s2.npy", std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(-2 * (40 * 30 + 40 * 29 - 7), std::ios::end); // frame 4, pixel (7, 1)
        file.write("\xff\x7f", 2);
    }
    for (const std::uint64_t in_memory : {std::uint64_t{0}, kMostBytesInMemory})
        try {
            read_capture(folder.string(), {}, in_memory);
            ADD_FAILURE() << "nothing was thrown";
        } catch (const Error &error) {
            EXPECT_EQ(error.status(), Status::kInvalidData);
            EXPECT_NE(std::string(error.what()).find("frame 4, pixel (7, 1): the code is 32767"), std::string::npos)
                << error.what();
        }
}

// Most memory that a piece of work takes beyond what there is, in MB; of a process of its own.
double peak_megabytes(const std::function<void()> &work) {
    int ends[2];
    if (::pipe(ends) != 0)
        return -1.0;
    const pid_t child = ::fork();
    if (child == 0) {
        const auto status = [](const std::string &key) {
            std::ifstream file("/proc/self/status");
            for (std::string line; std::getline(file, line);)
                if (line.rfind(key, 0) == 0)
                    return std::stod(line.substr(key.size()));
            return -1.0;
        };
        std::ofstream("/proc/self/clear_refs") << "5"; // the peak begins anew
        const double before = status("VmRSS:");
        work();
        const double megabytes = (status("VmHWM:") - before) / 1024.0;
        const ssize_t size = ::write(ends[1], &megabytes, sizeof megabytes);
        ::_exit(size == sizeof megabytes ? 0 : 1);
    }
    double megabytes = -1.0;
    ::close(ends[1]);
    if (child < 0 || ::read(ends[0], &megabytes, sizeof megabytes) != sizeof megabytes)
        megabytes = -1.0;
    ::close(ends[0]);
    ::waitpid(child, nullptr, 0);
    return megabytes;
}

// 64 MB of codes whose frames have 0.5 MB: sums of a pixel take 12 bytes and its ends 8, 5.2 MB; samples of the
// frames and their statistics the rest.
TEST_F(StoredCapture, TakesTheMemoryOfAFewFrames) {
    written(512, 512, 32);
    const double stored = peak_megabytes([&] {
        const Capture capture = read_capture(folder.string(), {}, 0);
        summarize_capture(capture);
        const JudgedPart part = choose_part(capture.layout, {}, kBudget);
        take_part(capture, {0, 1, 2, 3}, capture.layout.sequences, part);
    });
    const double memory = peak_megabytes([&] { read_capture(folder.string()); });
    EXPECT_GT(memory, 60.0);
    EXPECT_GT(stored, 0.0);
    EXPECT_LT(stored, 32.0);
}

} // namespace
} // namespace clsp
