// Tuning through the C API: a run writes a record, and an aperture follows it; bad input, cancelling, the log.
#include "test_support.hpp"

#include <cstdlib>
#include <fstream>

namespace {

namespace fs = std::filesystem;
struct Log {
    std::vector<std::pair<std::uint32_t, std::string>> lines;

    static void take(void *data, std::uint32_t level, const char *message) {
        static_cast<Log *>(data)->lines.emplace_back(level, message);
    }
    int count(std::uint32_t level, const std::string &words) const {
        int found = 0;
        for (const auto &[line_level, text] : lines)
            found += line_level == level && text.find(words) != std::string::npos;
        return found;
    }
};

class Tuning : public ::testing::Test {
  protected:
    void SetUp() override {
        fs::remove_all(folder);
        ::setenv("CLSPECKLE_TUNING", path.c_str(), 1);
        context = logged();
    }
    void TearDown() override {
        context = clspeckle::Context::adopt(nullptr);
        ::unsetenv("CLSPECKLE_TUNING");
        fs::remove_all(folder);
    }
    clspeckle::Context logged() {
        auto desc = clspeckle::make<ClspContextDesc>();
        desc.log = Log::take;
        desc.log_data = &log;
        return clspeckle::Context(desc);
    }
    ClspTuningDesc desc() {
        auto d = clspeckle::make<ClspTuningDesc>();
        d.frames = 3;
        d.sizes = &size;
        d.size_count = 1;
        return d;
    }
    static ClspApertureInfo aperture_info(const clspeckle::Context &of, std::uint32_t width, std::uint32_t height) {
        auto d = clspeckle::make<ClspApertureDesc>();
        d.width = width;
        d.height = height;
        d.relative_diameter = 0.5;
        return clspeckle::Aperture(of, d).info();
    }
    void replace(const std::string &from, const std::string &to) {
        std::string text = content();
        const std::size_t at = text.find(from);
        ASSERT_NE(std::string::npos, at) << from;
        text.replace(at, from.size(), to);
        std::ofstream(path) << text;
    }
    std::string content() const {
        std::ifstream file(path);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    const fs::path folder = fs::temp_directory_path() / "clspeckle_test_tuning";
    const std::string path = (folder / "tuning.json").string();
    ClspTuningSize size{48, 32};
    Log log;
    clspeckle::Context context{clspeckle::Context::adopt(nullptr)};
};

TEST_F(Tuning, StructsFollowTheRules) {
    test::check_init<ClspTuningDesc>("clspTuningDescInit", clspTuningDescInit);
    const auto defaults = clspeckle::make<ClspTuningDesc>();
    EXPECT_EQ(15u, defaults.frames);
    EXPECT_EQ(1u, defaults.keep);
    EXPECT_EQ(0.5, defaults.relative_diameter);
    ClspTuningDesc valid = desc();
    valid.keep = 0;
    test::check_struct_size<ClspTuningDesc>("clspTuningRun", valid, [&](ClspTuningDesc *d) {
        ClspTuning tuning = nullptr;
        const ClspStatus status = clspTuningRun(context, d, &tuning);
        if (tuning) {
            EXPECT_CLSP_OK(clspTuningRelease(tuning));
        }
        return status;
    });
    test::check_init<ClspContextDesc>("clspContextDescInit", clspContextDescInit);
}

// Whether the device's default is the engine for GPUs, as GPUs' is.
bool defaults_to_groups(const clspeckle::Context &context) {
    cl_device_type type = 0;
    clGetDeviceInfo(context.info().cl_device, CL_DEVICE_TYPE, sizeof type, &type, nullptr);
    return (type & CL_DEVICE_TYPE_GPU) != 0;
}

TEST_F(Tuning, ARunWritesARecordThatIsFollowed) {
    const clspeckle::Tuning tuning(context, desc());
    EXPECT_EQ(path, tuning.path());
    const std::string json = tuning.json();
    for (const char *words : {"\"clfft\"", "\"gpu\"", "\"median_ms\"", "\"width\": 48"})
        EXPECT_NE(std::string::npos, json.find(words)) << words << json;
    // Lanes are no candidate where groups are the default (GPUs).
    const bool has_lanes = json.find("\"cpu\"") != std::string::npos;
    EXPECT_NE(has_lanes, defaults_to_groups(context));
    EXPECT_EQ(json, content());

    // Whatever was the fastest, the record is followed where it says something else.
    const clspeckle::Context before = logged();
    const ClspApertureInfo info = aperture_info(before, 48, 32);
    EXPECT_EQ("the tuning record " + path + ", 48 x 32", info.fft_source);
    EXPECT_EQ(1, log.count(CLSP_LOG_INFO, " is used for a field grid of 48 x 32: the tuning record"));
    EXPECT_EQ(0, log.count(CLSP_LOG_WARNING, ""));
    const std::size_t from = content().find("\"chosen\""), to = content().find("\"reason\"", from);
    replace(content().substr(from, to - from), R"("chosen": {"engine": "clfft"}, )");
    EXPECT_STREQ(info.fft_engine, aperture_info(before, 48, 32).fft_engine); // read once
    const ClspApertureInfo changed = aperture_info(logged(), 48, 32);
    EXPECT_STREQ("clfft", changed.fft_engine);
    EXPECT_STREQ("clfft", changed.fft_backend);
    EXPECT_EQ("the tuning record " + path + ", 48 x 32", changed.fft_reason);
    EXPECT_EQ("clfft: the tuning record " + path + ", 48 x 32", clspeckle::Tuning::explain(logged(), 40, 40));
    EXPECT_EQ(path, clspeckle::Tuning::record_path(logged()));
}

TEST_F(Tuning, WhatAnEngineCannotDoGoesOnToTheNext) {
    const clspeckle::Tuning tuning(context, desc());
    const std::size_t from = content().find("\"chosen\""), to = content().find("[", from);
    // A shape that was measured, says the record, but that no device has.
    const std::string shape = R"({"engine": "gpu", "columns": {"lines": 64, "work_items": 4096})";
    replace(content().substr(from, to - from), "\"chosen\": " + shape + R"(}, "reason": "", "candidates": [)" + shape +
                                                   R"(, "median_ms": 1, "spread_ms": 0}], "others":)");
    const ClspApertureInfo info = aperture_info(logged(), 48, 32);
    EXPECT_EQ(std::string::npos, std::string(info.fft_source).find(path)) << info.fft_source;
    EXPECT_EQ(1,
              log.count(CLSP_LOG_INFO, "gpu, columns 64 x 4096 is not used for a field grid of 48 x 32 (the "
                                       "tuning record " +
                                           path + ", 48 x 32): lines of 32 points do not go in"));
    EXPECT_NE(64u, info.column_lines);
    EXPECT_EQ(defaults_to_groups(context), info.column_lines > 0);
}

TEST_F(Tuning, AWrongFileIsIgnoredWithOneWarningAndRenewed) {
    fs::create_directories(folder);
    std::ofstream(path) << "{\"format\": \"clspeckle-tuning\"";
    const clspeckle::Context made = logged();
    for (int i = 0; i < 3; ++i)
        EXPECT_EQ(std::string::npos, std::string(aperture_info(made, 48, 32).fft_source).find(path));
    EXPECT_EQ(1,
              log.count(CLSP_LOG_WARNING, "the tuning record " + path + " is ignored: the file: is not valid JSON"));
    EXPECT_EQ(1, log.count(CLSP_LOG_WARNING, ""));
    const clspeckle::Tuning tuning(made, desc());
    EXPECT_EQ(tuning.json(), content());
    EXPECT_EQ(1, log.count(CLSP_LOG_WARNING, "is replaced"));
    // But not in the place of somebody's own file.
    const std::string other = (folder / "notes.txt").string();
    std::ofstream(other) << "dear diary";
    ClspTuningDesc d = desc();
    d.path = other.c_str();
    ClspTuning handle = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "is no tuning record", clspTuningRun(made, &d, &handle));
    EXPECT_EQ(10u, fs::file_size(other));
}

TEST_F(Tuning, RecordsCanBeOff) {
    const clspeckle::Tuning tuning(context, desc());
    ::setenv("CLSPECKLE_TUNING", "off", 1);
    const clspeckle::Context made = logged();
    EXPECT_EQ(std::string::npos, std::string(aperture_info(made, 48, 32).fft_source).find("record"));
    EXPECT_EQ("", clspeckle::Tuning::record_path(made));
    ClspTuningDesc d = desc();
    ClspTuning handle = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "no place for the tuning record", clspTuningRun(made, &d, &handle));
    d.keep = 0;
    EXPECT_EQ("", clspeckle::Tuning(made, d).path());
}

TEST_F(Tuning, CancellingWritesNothing) {
    double last = 0.0;
    int calls = 0;
    EXPECT_THROW(clspeckle::Tuning(context, desc(),
                                   [&](const std::string &what, double fraction) {
                                       EXPECT_GE(fraction, last);
                                       EXPECT_NE(std::string::npos, what.find("48 x 32"));
                                       last = fraction;
                                       return ++calls < 5;
                                   }),
                 clspeckle::Error);
    EXPECT_EQ(5, calls);
    EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(Tuning, BadInput) {
    ClspTuning handle = nullptr;
    const auto refuse = [&](const char *words, auto change, ClspStatus status = CLSP_ERROR_INVALID_ARGUMENT) {
        ClspTuningDesc d = desc();
        change(d);
        EXPECT_CLSP_FAILS(status, words, clspTuningRun(context, &d, &handle));
        EXPECT_EQ(nullptr, handle);
    };
    refuse("frames is 0", [](ClspTuningDesc &d) { d.frames = 0; });
    refuse("frames is 10001", [](ClspTuningDesc &d) { d.frames = CLSP_MAX_TUNING_FRAMES + 1; });
    refuse("relative_diameter", [](ClspTuningDesc &d) { d.relative_diameter = test::nan_value; });
    refuse("relative_diameter is 1.5", [](ClspTuningDesc &d) { d.relative_diameter = 1.5; });
    refuse("keep", [](ClspTuningDesc &d) { d.keep = 2; });
    refuse("give both or neither", [](ClspTuningDesc &d) { d.size_count = 0; });
    refuse("give both or neither", [](ClspTuningDesc &d) { d.sizes = nullptr; });
    refuse("size_count is 65", [](ClspTuningDesc &d) { d.size_count = CLSP_MAX_TUNING_SIZES + 1; });
    refuse("path is empty", [](ClspTuningDesc &d) { d.path = ""; });
    refuse("keep is 0", [](ClspTuningDesc &d) {
        d.keep = 0;
        d.path = "x.json";
    });
    refuse("the image", [](ClspTuningDesc &d) {
        static const ClspTuningSize wrong{0, 4};
        d.sizes = &wrong;
    });
    refuse(
        "cannot be written", [](ClspTuningDesc &d) { d.path = "/dev/null/tuning.json"; }, CLSP_ERROR_IO);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "desc", clspTuningDescInit(nullptr, sizeof(ClspTuningDesc)));
    const ClspTuningDesc d = desc();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "tuning", clspTuningRun(context, &d, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspTuningRun(nullptr, &d, &handle));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "tuning", clspTuningGetJson(nullptr, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "tuning", clspTuningGetPath(nullptr, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "text", clspTuningExplain(context, 4, 4, 9, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "the image", clspTuningExplain(context, 4, 0, 0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "path", clspTuningGetRecordPath(context, 9, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "tuning", clspTuningRetain(nullptr));
    EXPECT_CLSP_OK(clspTuningRelease(nullptr));
}

TEST_F(Tuning, TextsAreCutToFit) {
    ClspTuningDesc d = desc();
    d.keep = 0;
    const clspeckle::Tuning tuning(context, d);
    std::uint64_t length = 0;
    char text[8];
    ASSERT_CLSP_OK(clspTuningGetJson(tuning, sizeof text, text, &length));
    EXPECT_EQ(tuning.json().size() + 1, length);
    EXPECT_EQ(tuning.json().substr(0, 7), text);
}

TEST(Log, TheEnvironmentMustNameALevel) {
    ::setenv("CLSPECKLE_LOG", "loud", 1);
    ClspContext made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CLSPECKLE_LOG is \"loud\"", clspContextCreate(nullptr, &made));
    ::unsetenv("CLSPECKLE_LOG");
}

TEST(Log, TheEnvironmentSaysWhatIsPrinted) {
    for (const char *level : {"off", "warning", "info"}) {
        ::setenv("CLSPECKLE_LOG", level, 1);
        testing::internal::CaptureStderr();
        auto d = clspeckle::make<ClspApertureDesc>();
        d.width = d.height = 16;
        d.relative_diameter = 0.5;
        clspeckle::Aperture(clspeckle::Context(), d);
        const bool printed = testing::internal::GetCapturedStderr().find("clspeckle: info: ") != std::string::npos;
        EXPECT_EQ(std::string(level) == "info", printed) << level;
    }
    ::unsetenv("CLSPECKLE_LOG");
}

} // namespace
