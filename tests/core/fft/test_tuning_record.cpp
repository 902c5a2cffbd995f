// Tuning records: what is read and what is refused, which sizes are followed, what a measurement decides. Needs no
// device.
#include "runtime/error.hpp"
#include "fft/plan/tuning_record.hpp"
#include "tuning/tuning.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <functional>

namespace {

using clsp::EngineKind;
using clsp::EngineChoice;
using clsp::EngineSpec;
using clsp::WorkGroup;
using clsp::TunedCandidate;
using clsp::TuningFile;
using Json = nlohmann::json;

const clsp::TunedDevice kDevice{"Some GPU", "Vendor", "Platform", "1.2.3", 64};
const EngineSpec kClfft{EngineKind::kClfft, {}, {}}, kCpu{EngineKind::kCpu, {}, {}},
    kGpu{EngineKind::kGpu, {}, {}}, kShaped{EngineKind::kGpu, WorkGroup{8, 64}, WorkGroup{2, 32}};

clsp::TunedSize size_of(std::uint32_t width, std::uint32_t height, const EngineSpec &chosen) {
    clsp::TunedSize size;
    size.width = width;
    size.height = height;
    size.frames = 15;
    size.relative_diameter = 0.5;
    size.date = "2026-11-22";
    size.version = "0.1.0";
    size.chosen = chosen;
    size.reason = "the fastest";
    size.candidates = {{kClfft, 3.0, 0.1, ""}, {kGpu, 0.0, 0.0, "no room"}};
    if (!(chosen == kClfft))
        size.candidates.push_back({chosen, 1.0, 0.1, ""});
    return size;
}

TuningFile file_of(std::vector<clsp::TunedSize> sizes, const clsp::TunedDevice &device = kDevice) {
    return {{{device, std::move(sizes)}}};
}

Json sample() {
    return Json::parse(clsp::tuning_json(file_of({size_of(512, 512, kShaped)})));
}

// What a file of that text is refused with; "" if it is taken.
std::string refusal(const std::string &text) {
    try {
        clsp::parse_tuning(text);
        return {};
    } catch (const clsp::Error &error) {
        EXPECT_EQ(clsp::Status::kInvalidData, error.status());
        return error.what();
    }
}

TEST(TuningRecord, ComesBackAsItWasWritten) {
    const TuningFile file = file_of({size_of(512, 512, kShaped), size_of(640, 480, kClfft)});
    const TuningFile back = clsp::parse_tuning(clsp::tuning_json(file));
    ASSERT_EQ(1u, back.records.size());
    EXPECT_TRUE(back.records[0].device == kDevice);
    ASSERT_EQ(2u, back.records[0].sizes.size());
    const clsp::TunedSize &size = back.records[0].sizes[0];
    EXPECT_TRUE(size.chosen == kShaped);
    EXPECT_EQ(512u, size.width);
    EXPECT_EQ("no room", size.candidates[1].refusal);
    EXPECT_EQ(3.0, size.candidates[0].median_ms);
    EXPECT_EQ(clsp::tuning_json(file), clsp::tuning_json(back));
}

TEST(TuningRecord, RefusesWhatIsNotWhole) {
    const std::string whole = sample().dump();
    EXPECT_EQ("", refusal(whole));
    for (std::size_t length = 0; length < whole.size(); ++length)
        EXPECT_NE("", refusal(whole.substr(0, length))) << length;
    EXPECT_NE("", refusal(whole + "}"));
    EXPECT_NE("", refusal(std::string(whole.size(), '\0')));
    EXPECT_NE("", refusal("\x89PNG\r\n"));
}

TEST(TuningRecord, RefusesWhatIsWrong) {
    struct Wrong {
        const char *words;
        std::function<void(Json &)> change;
    };
    const auto size = [](Json &json) -> Json & { return json["records"][0]["sizes"][0]; };
    const Wrong wrongs[] = {
        {"\"format\" is not", [](Json &j) { j["format"] = "something"; }},
        {"\"format\" is not", [](Json &j) { j = Json::array(); }},
        {"format version 2, this release reads 1", [](Json &j) { j["format_version"] = 2; }},
        {"format_version", [](Json &j) { j["format_version"] = "1"; }},
        {"has no \"records\"", [](Json &j) { j.erase("records"); }},
        {"records is no list", [](Json &j) { j["records"] = 7; }},
        {"records[0] is no object", [](Json &j) { j["records"][0] = 7; }},
        {"device.name is empty", [](Json &j) { j["records"][0]["device"]["name"] = ""; }},
        {"device.name is no text", [](Json &j) { j["records"][0]["device"]["name"] = std::string(5000, 'x'); }},
        {"compute_units is 0", [](Json &j) { j["records"][0]["device"]["compute_units"] = 0; }},
        {"width is -512", [&](Json &j) { size(j)["width"] = -512; }},
        {"width is 512.5", [&](Json &j) { size(j)["width"] = 512.5; }},
        {"height is 4000000000", [&](Json &j) { size(j)["height"] = 4000000000u; }},
        {"frames is 0", [&](Json &j) { size(j)["frames"] = 0; }},
        {"relative_diameter is 0", [&](Json &j) { size(j)["relative_diameter"] = 0; }},
        {"median_ms is -1", [&](Json &j) { size(j)["candidates"][0]["median_ms"] = -1; }},
        {"median_ms is 0", [&](Json &j) { size(j)["candidates"][0]["median_ms"] = 0; }},
        {"median_ms is 1e+30", [&](Json &j) { size(j)["candidates"][0]["median_ms"] = 1e30; }},
        // How the writer of a NaN has it.
        {"median_ms is null", [&](Json &j) { size(j)["candidates"][0]["median_ms"] = std::nan(""); }},
        {"spread_ms is \"small\"", [&](Json &j) { size(j)["candidates"][0]["spread_ms"] = "small"; }},
        {"engine is \"vkfft\"", [&](Json &j) { size(j)["candidates"][0]["engine"] = "vkfft"; }},
        {"lines is 0", [&](Json &j) { size(j)["chosen"]["columns"]["lines"] = 0; }},
        {"work_items is 100000", [&](Json &j) { size(j)["chosen"]["rows"]["work_items"] = 100000; }},
        {"no candidate that was measured", [&](Json &j) { size(j)["chosen"]["columns"]["lines"] = 4; }},
        // One that was left out.
        {"no candidate that was measured",
         [&](Json &j) {
             size(j)["chosen"] = {{"engine", "gpu"}};
         }},
        {"only gpu has",
         [&](Json &j) {
             size(j)["candidates"][0]["rows"] = {{"lines", 1}, {"work_items", 2}};
         }},
        {"candidates is no list", [&](Json &j) { size(j)["candidates"] = Json::object(); }},
    };
    for (const Wrong &wrong : wrongs) {
        Json json = sample();
        wrong.change(json);
        const std::string message = refusal(json.dump());
        EXPECT_NE(std::string::npos, message.find(wrong.words)) << wrong.words << " / " << message;
        EXPECT_LT(message.size(), 300u);
    }
    // Numbers that JSON does not have, and one that overflows.
    std::string text = sample().dump();
    for (const char *number : {"NaN", "Infinity", "1e999", "0x10"}) {
        std::string with = text;
        with.replace(with.find("3.0"), 3, number);
        EXPECT_NE("", refusal(with)) << number;
    }
}

TEST(TuningRecord, FilesAreThereOrNotOrNoFiles) {
    namespace fs = std::filesystem;
    const fs::path folder = fs::temp_directory_path() / "clspeckle_test_tuning_record";
    fs::remove_all(folder);
    const std::string path = (folder / "deep" / "tuning.json").string();
    EXPECT_TRUE(clsp::load_tuning(path).records.empty());
    clsp::check_tuning_place(path);
    EXPECT_TRUE(fs::is_empty(folder / "deep"));
    clsp::save_tuning(path, file_of({size_of(512, 512, kCpu)}));
    EXPECT_EQ(1u, clsp::load_tuning(path).records.size());
    EXPECT_THROW(clsp::load_tuning(folder.string()), clsp::Error);
    EXPECT_THROW(clsp::check_tuning_place(folder.string()), clsp::Error);
    EXPECT_THROW(clsp::save_tuning(path + "/below", {}), clsp::Error);
    std::ofstream(path, std::ios::app) << "{";
    EXPECT_THROW(clsp::load_tuning(path), clsp::Error);
    fs::remove_all(folder);
}

TEST(TuningRecord, NewMeasurementsTakeThePlaceOfOldOnes) {
    TuningFile file = file_of({size_of(512, 512, kCpu), size_of(64, 64, kCpu)});
    clsp::TunedDevice other = kDevice;
    other.driver_version = "1.2.4";
    file.merge({other, {size_of(512, 512, kClfft)}});
    file.merge({kDevice, {size_of(512, 512, kShaped), size_of(256, 256, kClfft)}});
    ASSERT_EQ(2u, file.records.size());
    const auto &sizes = file.records[0].sizes;
    ASSERT_EQ(3u, sizes.size());
    EXPECT_EQ(64u, sizes[0].width); // by area
    EXPECT_EQ(256u, sizes[1].width);
    EXPECT_TRUE(sizes[2].chosen == kShaped);
    EXPECT_TRUE(file.records[1].sizes[0].chosen == kClfft);
}

std::vector<EngineChoice> choices(const TuningFile &file, std::uint32_t width, std::uint32_t height,
                                  bool any_driver = false, const clsp::TunedDevice &device = kDevice) {
    return clsp::tuned_choices(file, device, any_driver, width, height, "record");
}

TEST(TuningRecord, TheSizeItselfComesBeforeTheNearestArea) {
    const TuningFile file =
        file_of({size_of(256, 1024, kCpu), size_of(512, 512, kShaped), size_of(2048, 2048, kClfft)});
    const auto same = choices(file, 512, 512);
    ASSERT_EQ(3u, same.size());
    EXPECT_TRUE(same[0].spec == kShaped);
    EXPECT_EQ("record, 512 x 512", same[0].source);
    EXPECT_TRUE(same[1].spec == kCpu);
    EXPECT_TRUE(same[2].spec == kClfft);
    EXPECT_TRUE(choices(file, 1920, 1080)[0].spec == kClfft);
    EXPECT_TRUE(choices(file, 1024, 256)[0].spec == kCpu); // the area of two: the first of them
}

TEST(TuningRecord, WorkItemsAreOnlyTakenForLinesOfTheirLength) {
    const TuningFile file = file_of({size_of(512, 512, kShaped)});
    const EngineSpec wider = choices(file, 640, 512)[0].spec, higher = choices(file, 512, 480)[0].spec;
    EXPECT_TRUE((wider == EngineSpec{EngineKind::kGpu, WorkGroup{8, 64}, WorkGroup{2, 0}}));
    EXPECT_TRUE((higher == EngineSpec{EngineKind::kGpu, WorkGroup{8, 0}, WorkGroup{2, 32}}));
}

TEST(TuningRecord, TheUsersAreOfTheDriverShippedOnesOfTheName) {
    const TuningFile file = file_of({size_of(512, 512, kCpu)});
    EXPECT_EQ(1u, choices(file, 512, 512).size());
    for (const auto change :
         {+[](clsp::TunedDevice &d) { d.driver_version = "2"; }, +[](clsp::TunedDevice &d) { d.compute_units = 32; },
          +[](clsp::TunedDevice &d) { d.vendor = "V"; }, +[](clsp::TunedDevice &d) { d.platform = "P"; }}) {
        clsp::TunedDevice device = kDevice;
        change(device);
        EXPECT_TRUE(choices(file, 512, 512, false, device).empty());
        EXPECT_EQ(1u, choices(file, 512, 512, true, device).size());
    }
    clsp::TunedDevice other = kDevice;
    other.name = "Another GPU";
    EXPECT_TRUE(choices(file, 512, 512, true, other).empty());
}

TEST(TuningRecord, ShippedOnesCanBeRead) {
    ASSERT_GT(clsp::kShippedTuningCount, 0u);
    for (std::size_t i = 0; i < clsp::kShippedTuningCount; ++i) {
        const TuningFile file = clsp::parse_tuning(clsp::kShippedTunings[i].text);
        ASSERT_FALSE(file.records.empty()) << clsp::kShippedTunings[i].name;
        for (const clsp::TuningRecord &record : file.records)
            EXPECT_FALSE(record.sizes.empty()) << clsp::kShippedTunings[i].name;
    }
}

TEST(TuningChoice, MediansAndSpreads) {
    const clsp::Times odd = clsp::times_of({5.0, 1.0, 3.0}), even = clsp::times_of({4.0, 1.0, 2.0, 100.0});
    EXPECT_EQ(3.0, odd.median);
    EXPECT_DOUBLE_EQ(1.4826 * 2.0, odd.spread);
    EXPECT_EQ(3.0, even.median);
    EXPECT_DOUBLE_EQ(1.4826 * 1.5, even.spread); // an outlier hardly counts
}

std::size_t chosen(const std::vector<TunedCandidate> &candidates, std::string *reason = nullptr) {
    std::string why;
    const std::size_t result = clsp::choose_candidate(candidates, 16, why);
    if (reason)
        *reason = why;
    return result;
}

TEST(TuningChoice, TheFastestUnlessTheDefaultIsAsFast) {
    std::string reason;
    EXPECT_EQ(1u, chosen({{kClfft, 3.0, 0.01, ""}, {kShaped, 1.0, 0.01, ""}}, &reason));
    EXPECT_EQ("the fastest", reason);
    EXPECT_EQ(0u, chosen({{kClfft, 1.0, 0.01, ""}, {kShaped, 3.0, 0.01, ""}}));
    // 1 % is nothing, 3 % of quiet medians is something.
    EXPECT_EQ(0u, chosen({{kClfft, 1.0, 0.001, ""}, {kShaped, 0.99, 0.001, ""}}, &reason));
    EXPECT_EQ("gpu, columns 8 x 64, rows 2 x 32 is faster by 1.0 %, which is within the noise", reason);
    EXPECT_EQ(1u, chosen({{kClfft, 1.0, 0.001, ""}, {kShaped, 0.97, 0.001, ""}}));
    // 2 x 1.2533 x hypot(0.2, 0.2) / 4 = 0.177
    EXPECT_EQ(0u, chosen({{kClfft, 1.0, 0.2, ""}, {kShaped, 0.83, 0.2, ""}}));
    EXPECT_EQ(1u, chosen({{kClfft, 1.0, 0.2, ""}, {kShaped, 0.81, 0.2, ""}}));
    // Within the noise of the fastest, the preferred of those that are not slower.
    EXPECT_EQ(1u, chosen({{kClfft, 2.0, 0.001, ""}, {kGpu, 1.01, 0.001, ""}, {kShaped, 1.0, 0.001, ""}}));
}

TEST(TuningChoice, WhatDoesNotCountIsNotTaken) {
    EXPECT_EQ(0u, chosen({{kClfft, 3.0, 0.01, ""}, {kShaped, 1.0, 0.01, "its picture differs"}}));
    EXPECT_EQ(1u, chosen({{kClfft, 0.0, 0.0, "no plan"}, {kShaped, 9.0, 0.01, ""}}));
    EXPECT_THROW(chosen({{kClfft, 0.0, 0.0, "no plan"}}), clsp::Error);
    EXPECT_THROW(chosen({}), clsp::Error);
}

} // namespace
