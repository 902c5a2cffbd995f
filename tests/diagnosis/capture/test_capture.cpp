// Capture sets through the C and C++ interfaces: what is read, written and refused, and with which words.
#include <clspeckle/clspeckle.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <unistd.h>
#include <vector>

namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kWidth = 24, kHeight = 16;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<std::uint16_t> noise(std::uint32_t frames, double mean, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(mean, 4.0);
    std::vector<std::uint16_t> codes(frames * kPixels);
    for (std::uint16_t &code : codes)
        code = static_cast<std::uint16_t>(std::lround(std::min(1023.0, std::max(0.0, normal(random)))));
    return codes;
}

ClspCaptureDesc camera() {
    auto desc = clspeckle::make<ClspCaptureDesc>();
    desc.width = kWidth;
    desc.height = kHeight;
    return desc;
}

clspeckle::Capture small_capture() {
    clspeckle::Capture capture(camera());
    capture.set_dots(2.2, {4.0, 5.0, 15.5, 9.25});
    capture.add_sequence("dark", CLSP_SCENE_DARK, false, noise(3, 64, 1));
    capture.add_sequence("board_moving", CLSP_SCENE_BOARD, true, noise(2, 200, 2), 12.5, 4.0);
    capture.add_sequence("dots_static", CLSP_SCENE_DOTS, false, noise(2, 150, 3));
    return capture;
}

// What a call is refused with: its status, and words that its message must have.
void expect_refused(ClspStatus status, ClspStatus expected, const std::vector<std::string> &words) {
    EXPECT_EQ(status, expected) << clspStatusString(status);
    auto info = clspeckle::make<ClspErrorInfo>();
    ASSERT_EQ(clspGetLastError(&info), CLSP_SUCCESS);
    for (const std::string &word : words)
        EXPECT_NE(std::string(info.message).find(word), std::string::npos)
            << '"' << word << "\" is not in: " << info.message;
}

class CaptureFolder : public ::testing::Test {
  protected:
    void SetUp() override {
        root_ = fs::temp_directory_path() / ("clspeckle-capture-" + std::to_string(::getpid()));
        fs::remove_all(root_);
        fs::create_directory(root_);
    }
    void TearDown() override { fs::remove_all(root_); }
    std::string path(const std::string &name) const { return (root_ / name).string(); }

    std::string text(const std::string &file) const {
        std::ifstream stream(path(file));
        return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    }
    void put(const std::string &file, const std::string &content) const {
        fs::create_directories(fs::path(path(file)).parent_path());
        std::ofstream(path(file), std::ios::binary) << content;
    }
    // A fresh written set "set", with one change in its capture.json.
    void written_with(const std::string &from, const std::string &to) const {
        small_capture().write(path("set"), true);
        std::string json = text("set/capture.json");
        const std::size_t at = json.find(from);
        ASSERT_NE(at, std::string::npos) << from << " is not in " << json;
        put("set/capture.json", json.replace(at, from.size(), to));
    }
    void expect_open_refused(ClspStatus expected, const std::vector<std::string> &words) const {
        ClspCapture capture = nullptr;
        expect_refused(clspCaptureOpen(path("set").c_str(), &capture), expected, words);
        EXPECT_EQ(capture, nullptr);
    }
    fs::path root_;
};

TEST(Capture, DefaultsAreThoseOfTheSensorAndAperture) {
    ClspCaptureDesc desc;
    ASSERT_EQ(clspCaptureDescInit(&desc, sizeof desc), CLSP_SUCCESS);
    const auto sensor = clspeckle::make<ClspSensorDesc>();
    const auto aperture = clspeckle::make<ClspApertureDesc>();
    EXPECT_EQ(desc.bits, sensor.bits);
    EXPECT_EQ(desc.black_level_dn, sensor.black_level_dn);
    EXPECT_EQ(desc.read_noise_dn, sensor.read_noise_dn);
    EXPECT_EQ(desc.pixel_pitch_m, aperture.pixel_pitch_m);
    EXPECT_EQ(desc.f_number, aperture.f_number);
    EXPECT_EQ(desc.wavelength_m, aperture.wavelength_m);
    EXPECT_EQ(desc.degree_of_polarization, 1.0);
    ClspCaptureSequence sequence;
    ASSERT_EQ(clspCaptureSequenceInit(&sequence, sizeof sequence), CLSP_SUCCESS);
    EXPECT_EQ(sequence.codes, nullptr);
    EXPECT_EQ(clspCaptureDescInit(nullptr, sizeof desc), CLSP_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(clspCaptureSequenceInit(&sequence, 4), CLSP_ERROR_INVALID_STRUCT_SIZE);
}

TEST(Capture, GivesBackWhatItWasGiven) {
    const ClspCaptureDesc desc = camera();
    ClspCapture capture = nullptr;
    ASSERT_EQ(clspCaptureCreate(&desc, &capture), CLSP_SUCCESS);
    const double positions[] = {4.0, 5.0, 15.5, 9.25};
    ASSERT_EQ(clspCaptureSetDots(capture, 2.2, 2, positions), CLSP_SUCCESS);
    const std::vector<std::uint16_t> codes = noise(3, 300, 7);
    std::vector<std::uint8_t> mask(kPixels, 1);
    mask[5] = 0;
    auto sequence = clspeckle::make<ClspCaptureSequence>();
    sequence.name = "dots_moving";
    sequence.scene = CLSP_SCENE_DOTS;
    sequence.moving = 1;
    sequence.frame_count = 3;
    sequence.codes = codes.data();
    sequence.mask = mask.data();
    sequence.exposure_ms = 4.5;
    ASSERT_EQ(clspCaptureAddSequence(capture, &sequence), CLSP_SUCCESS);
    ASSERT_EQ(clspCaptureValidate(capture), CLSP_SUCCESS);

    std::uint32_t count = 0;
    ASSERT_EQ(clspCaptureGetSequenceCount(capture, &count), CLSP_SUCCESS);
    EXPECT_EQ(count, 1u);
    auto info = clspeckle::make<ClspCaptureSequenceInfo>();
    ASSERT_EQ(clspCaptureGetSequence(capture, 0, &info), CLSP_SUCCESS);
    EXPECT_STREQ(info.name, "dots_moving");
    EXPECT_EQ(info.scene, CLSP_SCENE_DOTS);
    EXPECT_EQ(info.moving, 1u);
    EXPECT_EQ(info.frame_count, 3u);
    EXPECT_EQ(info.has_mask, 1u);
    EXPECT_EQ(info.f_number, 5.6);
    EXPECT_EQ(info.exposure_ms, 4.5);
    std::vector<std::uint16_t> out(codes.size());
    ASSERT_EQ(clspCaptureGetCodes(capture, 0, out.size(), out.data()), CLSP_SUCCESS);
    EXPECT_EQ(out, codes);
    std::vector<std::uint8_t> mask_out(kPixels);
    ASSERT_EQ(clspCaptureGetMask(capture, 0, mask_out.size(), mask_out.data()), CLSP_SUCCESS);
    EXPECT_EQ(mask_out, mask);
    double sigma = 0.0, dots[4] = {};
    std::uint64_t dot_count = 0;
    ASSERT_EQ(clspCaptureGetDots(capture, &sigma, 2, dots, &dot_count), CLSP_SUCCESS);
    EXPECT_EQ(sigma, 2.2);
    EXPECT_EQ(dot_count, 2u);
    EXPECT_EQ(dots[3], 9.25);
    auto back = clspeckle::make<ClspCaptureDesc>();
    ASSERT_EQ(clspCaptureGetDesc(capture, &back), CLSP_SUCCESS);
    EXPECT_EQ(back.principal_point_x_px, (kWidth - 1) / 2.0);

    // Bad questions.
    expect_refused(clspCaptureGetSequence(capture, 1, &info), CLSP_ERROR_INVALID_ARGUMENT,
                   {"index is 1", "1 sequences"});
    expect_refused(clspCaptureGetCodes(capture, 0, 10, out.data()), CLSP_ERROR_BUFFER_TOO_SMALL, {"10", "1152"});
    expect_refused(clspCaptureGetCodes(capture, 0, out.size(), nullptr), CLSP_ERROR_INVALID_ARGUMENT,
                   {"codes is NULL"});
    expect_refused(clspCaptureGetMask(capture, 0, 1, mask_out.data()), CLSP_ERROR_BUFFER_TOO_SMALL, {"384"});
    expect_refused(clspCaptureGetDots(capture, nullptr, 1, dots, nullptr), CLSP_ERROR_BUFFER_TOO_SMALL, {"2 dots"});

    ASSERT_EQ(clspCaptureRetain(capture), CLSP_SUCCESS);
    ASSERT_EQ(clspCaptureRelease(capture), CLSP_SUCCESS);
    ASSERT_EQ(clspCaptureRelease(capture), CLSP_SUCCESS);
    expect_refused(clspCaptureValidate(capture), CLSP_ERROR_INVALID_HANDLE, {"capture is not a live handle"});
    EXPECT_EQ(clspCaptureRelease(nullptr), CLSP_SUCCESS);
}

TEST(Capture, RefusesACameraThatCannotBe) {
    struct Case {
        std::function<void(ClspCaptureDesc &)> change;
        std::vector<std::string> words;
    };
    const std::vector<Case> cases = {
        {[](ClspCaptureDesc &d) { d.width = 0; }, {"/camera/width", "is 0", "8 to 16384"}},
        {[](ClspCaptureDesc &d) { d.height = 20000; }, {"/camera/height", "20000"}},
        {[](ClspCaptureDesc &d) { d.bits = 17; }, {"/camera/bits", "8 to 16"}},
        {[](ClspCaptureDesc &d) { d.pixel_pitch_m = 2.9; }, {"/camera/pixel_pitch_um"}},
        {[](ClspCaptureDesc &d) { d.f_number = -5.6; }, {"/camera/f_number", "-5.6"}},
        {[](ClspCaptureDesc &d) { d.wavelength_m = 940; }, {"/laser/wavelength_nm", "nm"}},
        {[](ClspCaptureDesc &d) { d.degree_of_polarization = 1.5; }, {"/laser/degree_of_polarization", "0 to 1"}},
        {[](ClspCaptureDesc &d) { d.black_level_dn = kNan; }, {"/camera/black_level_dn", "nan"}},
        {[](ClspCaptureDesc &d) { d.black_level_dn = 1023; }, {"/camera/black_level_dn", "1023"}},
        {[](ClspCaptureDesc &d) { d.read_noise_dn = -1; }, {"/camera/read_noise_dn"}},
        {[](ClspCaptureDesc &d) { d.read_noise_dn = INFINITY; }, {"/camera/read_noise_dn", "inf"}},
        {[](ClspCaptureDesc &d) { d.field = 5; },
         {"desc->field is 5", "CLSP_FIELD_CIRCULAR_GAUSSIAN (0) or CLSP_FIELD_UNIT_PHASOR (1)"}},
        {[](ClspCaptureDesc &d) { d.principal_point_x_px = 3; }, {"principal_point_given is 0"}},
    };
    for (const Case &c : cases) {
        ClspCaptureDesc desc = camera();
        c.change(desc);
        ClspCapture capture = nullptr;
        expect_refused(clspCaptureCreate(&desc, &capture), CLSP_ERROR_INVALID_ARGUMENT, c.words);
        EXPECT_EQ(capture, nullptr);
    }
    const ClspCaptureDesc desc = camera();
    expect_refused(clspCaptureCreate(&desc, nullptr), CLSP_ERROR_INVALID_ARGUMENT, {"capture is NULL"});
}

TEST(Capture, RefusesSequencesThatCannotBeAndStaysAsItWas) {
    const clspeckle::Capture capture = small_capture();
    std::vector<std::uint16_t> codes = noise(2, 300, 7);
    const std::vector<std::uint8_t> nothing(kPixels, 0);
    struct Case {
        std::function<void(ClspCaptureSequence &)> change;
        std::vector<std::string> words;
    };
    const std::vector<Case> cases = {
        {[](ClspCaptureSequence &s) { s.name = nullptr; }, {"sequence->name is NULL"}},
        {[](ClspCaptureSequence &s) { s.codes = nullptr; }, {"sequence->codes is NULL"}},
        {[](ClspCaptureSequence &s) { s.name = ""; }, {"/sequences/3/name", "letters"}},
        {[](ClspCaptureSequence &s) { s.name = "../dark"; }, {"/sequences/3/name", "../dark"}},
        {[](ClspCaptureSequence &s) { s.name = "a b"; }, {"/sequences/3/name"}},
        {[](ClspCaptureSequence &s) { s.name = "dark"; }, {"\"dark\"", "sequence 0"}},
        {[](ClspCaptureSequence &s) { s.name = "DARK"; }, {"\"DARK\"", "capital letters"}},
        {[](ClspCaptureSequence &s) { s.scene = 4; },
         {"sequence->scene is 4", "CLSP_SCENE_BOARD (2) or CLSP_SCENE_DOTS (3)"}},
        {[](ClspCaptureSequence &s) { s.moving = 2; }, {"moving", "0 or 1"}},
        {[](ClspCaptureSequence &s) { s.frame_count = 0; }, {"/sequences/3/frame_count", "1 to 65535"}},
        {[](ClspCaptureSequence &s) { s.f_number = kNan; }, {"/sequences/3/f_number"}},
        {[](ClspCaptureSequence &s) { s.exposure_ms = -1; }, {"/sequences/3/exposure_ms"}},
        {[&](ClspCaptureSequence &s) { s.mask = nothing.data(); }, {"/sequences/3/mask", "0 everywhere"}},
    };
    for (const Case &c : cases) {
        auto sequence = clspeckle::make<ClspCaptureSequence>();
        sequence.name = "flat";
        sequence.scene = CLSP_SCENE_FLAT;
        sequence.frame_count = 2;
        sequence.codes = codes.data();
        c.change(sequence);
        expect_refused(clspCaptureAddSequence(capture, &sequence), CLSP_ERROR_INVALID_ARGUMENT, c.words);
        EXPECT_EQ(capture.sequence_count(), 3u);
    }
    codes[kPixels + 2 * kWidth + 5] = 1024; // frame 1, pixel (5, 2)
    try {
        capture.add_sequence("flat", CLSP_SCENE_FLAT, false, codes);
        FAIL() << "codes above the top code pass";
    } catch (const clspeckle::Error &error) {
        EXPECT_EQ(error.status(), CLSP_ERROR_INVALID_DATA);
        EXPECT_NE(error.message().find("frame 1, pixel (5, 2): the code is 1024"), std::string::npos)
            << error.message();
        EXPECT_NE(error.message().find("Set bits to 11"), std::string::npos) << error.message();
    }
    EXPECT_EQ(capture.sequence_count(), 3u);
    EXPECT_THROW(capture.add_sequence("flat", CLSP_SCENE_FLAT, false, {}), std::invalid_argument);
}

TEST(Capture, RefusesDotsThatCannotBe) {
    const clspeckle::Capture capture(camera());
    const double inside[] = {3, 3}, outside[] = {300, 3, -20, -9}, bad[] = {3, kNan};
    expect_refused(clspCaptureSetDots(capture, 0.0, 1, inside), CLSP_ERROR_INVALID_ARGUMENT,
                   {"/dots/sigma_px", "is 0"});
    expect_refused(clspCaptureSetDots(capture, kNan, 1, inside), CLSP_ERROR_INVALID_ARGUMENT, {"/dots/sigma_px"});
    expect_refused(clspCaptureSetDots(capture, 2.0, 2, outside), CLSP_ERROR_INVALID_ARGUMENT,
                   {"all of them outside", "24 x 16"});
    expect_refused(clspCaptureSetDots(capture, 2.0, 1, bad), CLSP_ERROR_INVALID_ARGUMENT,
                   {"/dots/positions_px/0", "nan"});
    expect_refused(clspCaptureSetDots(capture, 2.0, 1, nullptr), CLSP_ERROR_INVALID_ARGUMENT, {"positions_px is NULL"});
    expect_refused(clspCaptureSetDots(capture, 2.0, CLSP_MAX_DOTS + 1ull, inside), CLSP_ERROR_INVALID_ARGUMENT,
                   {"1000000"});
    EXPECT_EQ(clspCaptureSetDots(capture, 2.0, 1, inside), CLSP_SUCCESS);
    EXPECT_EQ(clspCaptureSetDots(capture, 0.0, 0, nullptr), CLSP_SUCCESS);
    EXPECT_TRUE(capture.dots().empty());
    expect_refused(clspCaptureValidate(capture), CLSP_ERROR_INVALID_ARGUMENT, {"/sequences", "empty"});
    capture.add_sequence("dots_static", CLSP_SCENE_DOTS, false, noise(2, 150, 3));
    expect_refused(clspCaptureValidate(capture), CLSP_ERROR_INVALID_ARGUMENT, {"/sequences/0/scene", "\"dots\""});
}

TEST_F(CaptureFolder, ReadingTellsHowFarItIsAndStops) {
    small_capture().write(path("set"));
    ClspCapture capture = nullptr;
    ASSERT_EQ(clspCaptureOpenWithProgress(path("set").c_str(), nullptr, nullptr, &capture), CLSP_SUCCESS);
    clspCaptureRelease(capture);
    capture = nullptr;
    double last = 0.0;
    const auto told = clspeckle::Capture::open(path("set"), [&](const std::string &what, double fraction) {
        EXPECT_EQ(what, "reading");
        EXPECT_GT(fraction, last);
        last = fraction;
        return true;
    });
    EXPECT_EQ(told.sequence_count(), small_capture().sequence_count());
    EXPECT_DOUBLE_EQ(last, 1.0);
    const ClspProgressFunction no = [](void *, const char *, double) -> std::int32_t { return 0; };
    expect_refused(clspCaptureOpenWithProgress(path("set").c_str(), no, nullptr, &capture), CLSP_ERROR_CANCELLED,
                   {"cancelled"});
    EXPECT_EQ(capture, nullptr);
    struct Thrown {};
    EXPECT_THROW(clspeckle::Capture::open(path("set"), [](const std::string &, double) -> bool { throw Thrown(); }),
                 Thrown);
}

TEST_F(CaptureFolder, WritesWhatItReads) {
    const clspeckle::Capture written = small_capture();
    ASSERT_EQ(clspCaptureWrite(written, path("set").c_str(), 0), CLSP_SUCCESS);
    const clspeckle::Capture read = clspeckle::Capture::open(path("set"));
    ASSERT_EQ(read.sequence_count(), written.sequence_count());
    for (std::uint32_t i = 0; i < read.sequence_count(); ++i) {
        EXPECT_STREQ(read.sequence(i).name, written.sequence(i).name);
        EXPECT_EQ(read.sequence(i).scene, written.sequence(i).scene);
        EXPECT_EQ(read.sequence(i).moving, written.sequence(i).moving);
        EXPECT_EQ(read.sequence(i).f_number, written.sequence(i).f_number);
        EXPECT_EQ(read.sequence(i).exposure_ms, written.sequence(i).exposure_ms);
        EXPECT_EQ(read.codes(i), written.codes(i));
    }
    EXPECT_EQ(read.dots(), written.dots());
    EXPECT_DOUBLE_EQ(read.desc().pixel_pitch_m, written.desc().pixel_pitch_m);
    EXPECT_DOUBLE_EQ(read.desc().wavelength_m, written.desc().wavelength_m);
    EXPECT_EQ(read.mask(0), std::vector<std::uint8_t>(kPixels, 255));
    // The second time it is byte for byte the same.
    read.write(path("again"));
    EXPECT_EQ(text("set/capture.json"), text("again/capture.json"));
    EXPECT_EQ(text("set/dark.npy"), text("again/dark.npy"));
    EXPECT_EQ(clspeckle::Capture::open(path("set/capture.json")).sequence_count(), 3u);
}

TEST_F(CaptureFolder, OverwritesOnlyWrittenSets) {
    const clspeckle::Capture capture = small_capture();
    capture.write(path("set"));
    expect_refused(clspCaptureWrite(capture, path("set").c_str(), 0), CLSP_ERROR_INVALID_ARGUMENT, {"exists"});
    EXPECT_EQ(clspCaptureWrite(capture, path("set/").c_str(), 1), CLSP_SUCCESS);
    put("set/raw.png", "the only copy");
    expect_refused(clspCaptureWrite(capture, path("set").c_str(), 1), CLSP_ERROR_INVALID_ARGUMENT, {"raw.png"});
    EXPECT_EQ(text("set/raw.png"), "the only copy");
    expect_refused(clspCaptureWrite(capture, path("set/raw.png").c_str(), 1), CLSP_ERROR_INVALID_ARGUMENT,
                   {"no folder"});
    expect_refused(clspCaptureWrite(capture, nullptr, 0), CLSP_ERROR_INVALID_ARGUMENT, {"path is NULL"});
    expect_refused(clspCaptureWrite(capture, "", 0), CLSP_ERROR_INVALID_ARGUMENT, {"empty"});
    expect_refused(clspCaptureWrite(capture, path("set/raw.png/deeper").c_str(), 0), CLSP_ERROR_IO,
                   {"cannot be written"});
    for (const fs::directory_entry &entry : fs::directory_iterator(root_))
        EXPECT_EQ(entry.path().filename(), "set") << "something was left behind";
}

TEST_F(CaptureFolder, RefusesDescriptionsThatCannotBe) {
    struct Case {
        const char *from, *to;
        std::vector<std::string> words;
    };
    const std::vector<Case> cases = {
        {"\"clspeckle-capture\"", "\"other\"", {"capture.json: /format", "clspeckle-capture"}},
        {"\"version\": 1", "\"version\": 2", {"/version is 2", "version 1"}},
        {"\"version\": 1", "\"version\": 1.5", {"/version is 1.5"}},
        {"\"width\": 24", "\"width\": \"24\"", {"/camera/width is \"24\""}},
        {"\"width\": 24", "\"width\": -24", {"/camera/width is -24"}},
        {"\"bits\": 10", "\"bits\": 20", {"/camera/bits is 20"}},
        {"\"read_noise_dn\": 4.0", "\"read_noise_dn\": -4.0", {"/camera/read_noise_dn is -4"}},
        {"\"read_noise_dn\": 4.0", "\"read_noise_dn\": null", {"/camera/read_noise_dn is null"}},
        {"\"read_noise_dn\": 4.0", "\"read_noise_dn\": NaN", {"not valid JSON", "neither NaN nor Infinity"}},
        {"\"read_noise_dn\": 4.0", "\"read_noise_dn\": 1e999", {"not valid JSON"}},
        {"\"read_noise_dn\": 4.0", "\"bits\": 10", {"\"camera.bits\" is given twice"}},
        {",\n  \"read_noise_dn\": 4.0", "", {"/camera/read_noise_dn is missing"}},
        {"\"wavelength_nm\": 940.0", "\"wavelength_nm\": 0", {"/laser/wavelength_nm is 0"}},
        {"\"sigma_px\": 2.2", "\"sigma_px\": -2.2", {"/dots/sigma_px is -2.2"}},
        {"15.5,", "\"15\",", {"/dots/positions_px/1/0 is \"15\""}},
        {"\"dots\": {", "\"spots\": {", {"/sequences/2/scene", "there is no \"dots\""}},
        {"\"scene\": \"dark\"", "\"scene\": \"night\"", {"/sequences/0/scene", "\"dark\" or \"flat\""}},
        {"\"motion\": \"moving\"", "\"motion\": \"fast\"", {"/sequences/1/motion", "\"static\" or \"moving\""}},
        {"\"name\": \"dark\"", "\"name\": \"dots_static\"", {"/sequences/2/name", "sequence 0"}},
        {"\"name\": \"dark\"", "\"name\": \"a/b\"", {"/sequences/0/name", "a/b"}},
        {"\"file\": \"dark.npy\"", "\"file\": \"/etc/passwd\"", {"/sequences/0/file", "within the folder"}},
        {"\"file\": \"dark.npy\"", "\"file\": \"x/../../dark.npy\"", {"/sequences/0/file", "within the folder"}},
        {"\"file\": \"dark.npy\"", "\"file\": \".[.]/dark.npy\"", {"/sequences/0/file", "within the folder"}},
        {"\"file\": \"dark.npy\"", "\"file\": \"x/\\\\.\\\\./y\"", {"/sequences/0/file", "within the folder"}},
        {"\"file\": \"dark.npy\"", "\"file\": \"..:R\"", {"/sequences/0/file", "within the folder"}},
        {"\"file\": \"dark.npy\"", "\"file\": 3", {"/sequences/0/file is 3"}},
        {"\"exposure_ms\": 12.5", "\"exposure_ms\": 0", {"/sequences/1/exposure_ms is 0"}},
        {"\"f_number\": 4.0", "\"f_number\": -1", {"/sequences/1/f_number is -1"}},
        {"\"format\"", "\"format", {"not valid JSON", "line 2", "correct it there, at ...", "double quotes"}},
        {",\n  \"read_noise_dn\": 4.0",
         "\n  \"read_noise_dn\": 4.0",
         {"not valid JSON: parse error at line 11", "\"black_level_dn\": 64.0 \"read_noise_dn\"", "a comma"}},
        {"\"bits\": 10", "\"bits\": 0x0a", {"not valid JSON", "at ... ", "\"bits\": 0x"}},
        {"\"laser\"",
         "\"lazer\"",
         {"/laser is missing", "\"wavelength_nm\": 940.0", "\"board_moving\" shows its light"}},
        {"\"camera\"", "\"kamera\"", {"/camera is missing", "\"pixel_pitch_um\": 2.9"}},
        {"\"sequences\"", "\"sequence\"", {"/sequences is missing", "\"file\": \"dark.npy\""}},
    };
    for (const Case &c : cases) {
        SCOPED_TRACE(c.to);
        written_with(c.from, c.to);
        expect_open_refused(CLSP_ERROR_INVALID_ARGUMENT, c.words);
    }
    // Cut off within, and in another encoding, whose bytes no message repeats.
    small_capture().write(path("set"), true);
    const std::string json = text("set/capture.json");
    put("set/capture.json", json.substr(0, json.size() / 2));
    expect_open_refused(CLSP_ERROR_INVALID_ARGUMENT, {"capture.json: is not valid JSON", "copy it again"});
    put("set/capture.json", json.substr(0, json.find("clspeckle-capture") + 4));
    expect_open_refused(CLSP_ERROR_INVALID_ARGUMENT, {"capture.json: is not valid JSON", "ends before it is complete"});
    put("set/capture.json", "{\"name\": \"Pr\xfc"
                            "fstand\"}"); // Latin-1
    expect_open_refused(CLSP_ERROR_INVALID_ARGUMENT, {"capture.json: is not valid JSON", "save it in that encoding"});
    std::string wide = "\xff\xfe";
    for (const char c : json)
        wide += {c, '\0'};
    put("set/capture.json", wide);
    expect_open_refused(CLSP_ERROR_INVALID_ARGUMENT, {"capture.json: is not valid JSON", "save it in that encoding"});
    auto info = clspeckle::make<ClspErrorInfo>();
    ASSERT_EQ(clspGetLastError(&info), CLSP_SUCCESS);
    EXPECT_EQ(std::string(info.message).find('\xff'), std::string::npos) << info.message;
}

TEST_F(CaptureFolder, RefusesArraysThatCannotBe) {
    const auto refuse = [&](const std::string &file, const std::string &content, ClspStatus status,
                            const std::vector<std::string> &words) {
        SCOPED_TRACE(words.front());
        small_capture().write(path("set"), true);
        put("set/" + file, content);
        expect_open_refused(status, words);
    };
    const auto npy = [](const std::string &descr, const std::string &shape, std::size_t bytes, char fill = 1) {
        std::string header = "{'descr': '" + descr + "', 'fortran_order': False, 'shape': " + shape + ", }";
        header.append(118 - header.size() - 1, ' ');
        header += '\n';
        return std::string("\x93NUMPY\x01\0", 8) + static_cast<char>(118) + '\0' + header + std::string(bytes, fill);
    };
    refuse("dark.npy", "no array", CLSP_ERROR_IO, {"dark.npy", "not a PNG, TIFF"});
    refuse("dark.npy", npy("<u2", "(3, 16, 24)", 100), CLSP_ERROR_IO, {"dark.npy", "truncated"});
    refuse("dark.npy", npy("<f4", "(3, 16, 24)", 4 * 3 * kPixels), CLSP_ERROR_INVALID_DATA,
           {"dark.npy", "float32", "uint16"});
    refuse("dark.npy", npy("<i2", "(3, 16, 24)", 2 * 3 * kPixels), CLSP_ERROR_INVALID_DATA, {"int16", "uint16"});
    refuse("dark.npy", npy("|u1", "(3, 16, 24)", 3 * kPixels), CLSP_ERROR_INVALID_DATA, {"uint8", "10 bits"});
    refuse("dark.npy", npy("<u2", "(3, 24, 16)", 2 * 3 * kPixels), CLSP_ERROR_INVALID_DATA,
           {"16 x 24", "24 x 16", "exchanged"});
    refuse("dark.npy", npy("<u2", "(16, 24, 3)", 2 * 3 * kPixels), CLSP_ERROR_INVALID_DATA,
           {"3 channels", "one number for each pixel", "dark.npy:R"});
    const std::string field = "capture.json: /sequences/0/file names it", expected = "(frames, height, width), uint16";
    refuse("dark.npy", npy("<u2", "(0, 16, 24)", 0), CLSP_ERROR_IO,
           {"dark.npy: holds an empty array (0 x 16 x 24)", "at least one frame", field, expected});
    refuse("dark.npy", npy("|O", "(3, 16, 24)", 100), CLSP_ERROR_IO,
           {"dark.npy: its numbers are of type '|O', Python objects", "numpy.stack(frames)", field, expected});
    refuse("dark.npy", npy("<u2", "(3, sixteen)", 100), CLSP_ERROR_IO,
           {"dark.npy: is damaged: 'shape'", "write or copy it again", field, expected});
    refuse("dark.npy", npy("<u2", "(3, 16, 24)", 2 * 3 * kPixels).replace(10, 1, "("), CLSP_ERROR_IO,
           {"dark.npy: is damaged: its header is not a dictionary", field, "take the sequence out"});
    // Masks.
    const auto refuse_mask = [&](const std::string &content, ClspStatus status, std::vector<std::string> words) {
        SCOPED_TRACE(words.front());
        written_with("\"file\": \"dark.npy\"", "\"file\": \"dark.npy\", \"mask\": \"mask.npy\"");
        put("set/mask.npy", content);
        words.insert(words.end(), {"capture.json: /sequences/0/mask names it", "24 x 16 pixels (width x height)",
                                   "take \"mask\" out"});
        expect_open_refused(status, words);
    };
    refuse_mask(npy("|u1", "(8, 8)", 64), CLSP_ERROR_INVALID_DATA, {"mask.npy: the mask has 8 x 8 pixels"});
    refuse_mask(npy("|u1", "(24, 16)", kPixels), CLSP_ERROR_INVALID_DATA, {"the two sides are exchanged"});
    refuse_mask(npy("<u2", "(16, 24)", 2 * kPixels), CLSP_ERROR_INVALID_DATA, {"one image of uint16"});
    refuse_mask("no image", CLSP_ERROR_IO, {"mask.npy", "not a PNG"});
    refuse("dark.npy", npy("<u2", "(900000, 16, 24)", 100), CLSP_ERROR_IO, {"dark.npy", "truncated"});
    refuse("dark.npy", npy("<u2", "(3, 16, 24)", 2 * 3 * kPixels, 9), CLSP_ERROR_INVALID_DATA,
           {"dark.npy: frame 0, pixel (0, 0): the code is 2313", "/camera/bits is 10", "1023", "12"});
    // Zero-size frames in a folder, missing files, folders.
    small_capture().write(path("set"), true);
    fs::remove(path("set/dark.npy"));
    expect_open_refused(CLSP_ERROR_IO, {"/sequences/0/file", "\"dark.npy\"", "does not exist"});
    written_with("\"file\": \"dark.npy\"", "\"file\": \"dark_*.png\"");
    expect_open_refused(CLSP_ERROR_IO, {"/sequences/0/file", "matches no file"});
    written_with("\"file\": \"dark.npy\"", "\"file\": \"*.npy\"");
    expect_open_refused(CLSP_ERROR_INVALID_DATA, {".npy array among the frames"});
    written_with("\"file\": \"dark.npy\"", "\"file\": \"frames\"");
    fs::create_directory(path("set/frames"));
    expect_open_refused(CLSP_ERROR_IO, {"frames", "no PNG, TIFF, PNM"});
    fs::remove_all(path("set"));
    expect_open_refused(CLSP_ERROR_IO, {"does not exist", "capture.json"});
    fs::create_directory(path("set"));
    expect_open_refused(CLSP_ERROR_IO, {"holds no capture.json"});
    ClspCapture capture = nullptr;
    expect_refused(clspCaptureOpen(nullptr, &capture), CLSP_ERROR_INVALID_ARGUMENT, {"path is NULL"});
    expect_refused(clspCaptureOpen(path("set").c_str(), nullptr), CLSP_ERROR_INVALID_ARGUMENT, {"capture is NULL"});
    expect_refused(clspCaptureOpenWithProgress(path("set").c_str(), nullptr, nullptr, nullptr),
                   CLSP_ERROR_INVALID_ARGUMENT, {"capture is NULL"});
}

TEST(Capture, SummaryIsCutToFitAndWarnsOfWhatIsOdd) {
    clspeckle::Capture capture(camera());
    capture.set_dots(2.0, {3, 3, 99, 3});
    std::vector<std::uint16_t> frame = noise(1, 300, 5), copies;
    for (int i = 0; i < 3; ++i)
        copies.insert(copies.end(), frame.begin(), frame.end());
    capture.add_sequence("dark", CLSP_SCENE_DARK, false, noise(4, 64, 1));
    capture.add_sequence("copies", CLSP_SCENE_FLAT, false, copies);
    capture.add_sequence("saturated", CLSP_SCENE_FLAT, false, noise(2, 5000, 1));
    capture.add_sequence("unlit", CLSP_SCENE_FLAT, false, noise(8, 64, 3));
    capture.add_sequence("single", CLSP_SCENE_BOARD, false, frame);
    std::vector<std::uint16_t> repeated = noise(3, 300, 6);
    std::copy_n(repeated.begin(), kPixels, repeated.begin() + 2 * kPixels);
    capture.add_sequence("repeated", CLSP_SCENE_BOARD, true, repeated);
    // Multiples of 8, which nothing else is; "moving", which lamp light does not show.
    std::vector<std::uint16_t> coarse = noise(16, 300, 8);
    for (std::uint16_t &code : coarse)
        code = static_cast<std::uint16_t>(code / 8 * 8);
    capture.add_sequence("coarse", CLSP_SCENE_FLAT, true, coarse);
    const std::string json = capture.summary_json();
    for (const char *words :
         {"1 of 2 dots lie so far outside", "all 3 frames are the same", "the sequence is saturated",
          "hardly any light", "one frame only", "frame 2 is frame 0 again", "all codes are multiples of 8",
          "even lamp light shows no motion"})
        EXPECT_NE(json.find(words), std::string::npos) << words << " is not in " << json;
    std::uint64_t length = 0;
    ASSERT_EQ(clspCaptureGetSummaryJson(capture, 0, nullptr, &length), CLSP_SUCCESS);
    EXPECT_EQ(length, json.size() + 1);
    char start[9] = {};
    ASSERT_EQ(clspCaptureGetSummaryJson(capture, sizeof start, start, nullptr), CLSP_SUCCESS);
    EXPECT_EQ(std::string(start), json.substr(0, 8));
    expect_refused(clspCaptureGetSummaryJson(capture, 5, nullptr, nullptr), CLSP_ERROR_INVALID_ARGUMENT,
                   {"text is NULL"});
}

TEST(Capture, Emva1288NumbersAreJsonAndXml) {
    clspeckle::Capture capture(camera());
    ClspCapture none = capture;
    expect_refused(clspCaptureGetEmva1288Json(none, 0, nullptr, nullptr), CLSP_ERROR_INVALID_ARGUMENT, {"sequence"});
    expect_refused(clspCaptureGetEmva1288Xml(none, 0, nullptr, nullptr), CLSP_ERROR_INVALID_ARGUMENT, {"sequence"});
    capture.add_sequence("dark", CLSP_SCENE_DARK, false, noise(6, 64, 3));
    capture.add_sequence("flat", CLSP_SCENE_FLAT, false, noise(6, 400, 9)); // of the same noise
    const std::string json = capture.emva1288_json(), xml = capture.emva1288_xml();
    EXPECT_NE(json.find("\"gain_method\": \"none\""), std::string::npos) << json;
    EXPECT_NE(json.find("the flats' variance does not grow with their mean"), std::string::npos) << json;
    EXPECT_NE(json.find("\"system_gain\""), std::string::npos);
    EXPECT_NE(xml.find("<K>\n      <section>sensitivity</section>"), std::string::npos) << xml;
    std::uint64_t length = 0;
    ASSERT_EQ(clspCaptureGetEmva1288Json(capture, 0, nullptr, &length), CLSP_SUCCESS);
    EXPECT_EQ(length, json.size() + 1);
    char start[10] = {};
    ASSERT_EQ(clspCaptureGetEmva1288Xml(capture, sizeof start, start, &length), CLSP_SUCCESS);
    EXPECT_EQ(std::string(start), "<results>");
    EXPECT_EQ(length, xml.size() + 1);
}

} // namespace
