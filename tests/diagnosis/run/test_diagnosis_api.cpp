// The C and C++ interface of the diagnosis: defaults, refusals, callbacks, getters, the written report. What a verdict
// is worth is tested elsewhere; here the captures are small (64 x 48, 8 frames) and the causes are gross.
#include "test_support.hpp"

#include <cstdio>
#include <fstream>
#include <random>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace {

constexpr std::uint32_t kWidth = 64, kHeight = 48, kFrames = 8;

// Dark and flat of a camera with black level 64 and read noise 4; the flat has a ramp across its columns.
clspeckle::Capture make_capture(double ramp_dn) {
    auto desc = clspeckle::make<ClspCaptureDesc>();
    desc.width = kWidth;
    desc.height = kHeight;
    clspeckle::Capture capture(desc);
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 4.0);
    for (const bool flat : {false, true}) {
        std::vector<std::uint16_t> codes;
        for (std::uint32_t i = 0; i < kFrames * kHeight * kWidth; ++i) {
            const double across = 2.0 * (i % kWidth) / (kWidth - 1.0) - 1.0;
            const double level = 64.0 + (flat ? 300.0 + ramp_dn * across : 0.0);
            codes.push_back(static_cast<std::uint16_t>(std::clamp(std::round(level + noise(random)), 0.0, 1023.0)));
        }
        capture.add_sequence(flat ? "flat" : "dark", flat ? CLSP_SCENE_FLAT : CLSP_SCENE_DARK, false, codes);
    }
    return capture;
}

clspeckle::DiagnoseOptions quick_options() {
    clspeckle::DiagnoseOptions options;
    options.null_replicates = 12;
    options.max_effects = 1;
    return options;
}

ClspDiagnoseDesc quick_desc() {
    auto desc = clspeckle::make<ClspDiagnoseDesc>();
    desc.null_replicates = 12;
    desc.max_effects = 1;
    return desc;
}

// The camera's ramp as a hypothesis on the intensity.
struct RampCalls {
    std::uint32_t frames = 0, wrong = 0;
    std::int32_t answer = 0;
};

std::int32_t add_ramp(void *data, const ClspHypothesisFrame *frame) {
    auto &calls = *static_cast<RampCalls *>(data);
    ++calls.frames;
    const bool as_expected = frame->struct_size == sizeof(ClspHypothesisFrame) && frame->width == kWidth &&
                             frame->height == kHeight && frame->bits == 10 && frame->scene == CLSP_SCENE_FLAT &&
                             frame->sequence == 1 && std::string(frame->sequence_name) == "flat" && !frame->moving &&
                             frame->frame_index < kFrames && frame->parameter_count == 1 && frame->reserved == 0 &&
                             frame->f_number == 5.6 && frame->pixel_pitch_m == 2.9e-6 && frame->wavelength_m == 940e-9;
    calls.wrong += as_expected ? 0 : 1;
    for (std::uint32_t i = 0; i < kWidth * kHeight; ++i)
        frame->pixels[i] += static_cast<float>(frame->values[0] * (2.0 * (i % kWidth) / (kWidth - 1.0) - 1.0));
    return calls.answer;
}

constexpr const char *kRampSource =
    "float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {\n"
    "    return hypothesis_pixel(frame, x, y) + values.slope * (2.0f * x / (frame.width - 1) - 1.0f);\n"
    "}\n";

ClspHypothesis ramp_hypothesis(const ClspEffectParameter &parameter, RampCalls &calls) {
    auto hypothesis = clspeckle::make<ClspHypothesis>();
    hypothesis.id = "ramp";
    hypothesis.stage = "optics";
    hypothesis.parameters = &parameter;
    hypothesis.parameter_count = 1;
    hypothesis.apply = add_ramp;
    hypothesis.user_data = &calls;
    return hypothesis;
}

ClspEffectParameter slope() {
    ClspEffectParameter parameter{};
    std::strcpy(parameter.name, "slope");
    std::strcpy(parameter.unit, "1");
    parameter.maximum = 1.0;
    parameter.weak = 0.02;
    parameter.strong = 0.2;
    return parameter;
}

std::string file_text(const std::filesystem::path &path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

class Diagnosis : public test::DeviceTest {
  protected:
    clspeckle::Capture capture = make_capture(20.0); // 20 DN of 300: a slope of 0.0667
};

TEST(DiagnosisDefaults, AreDocumented) {
    const auto desc = clspeckle::make<ClspDiagnoseDesc>();
    EXPECT_EQ(desc.struct_size, sizeof desc);
    EXPECT_EQ(desc.null_replicates, 48u);
    EXPECT_EQ(desc.max_effects, 16u);
    EXPECT_EQ(desc.threads, 0u);
    EXPECT_EQ(desc.seed, 0u);
    EXPECT_EQ(desc.level, 0.02);
    EXPECT_EQ(desc.evidence, 1u);
    EXPECT_EQ(desc.window, CLSP_WINDOW_AUTO);
    EXPECT_EQ(desc.frames, CLSP_FRAMES_AUTO);
    EXPECT_EQ(desc.window_x + desc.window_y + desc.window_width + desc.window_height, 0u);
    EXPECT_EQ(desc.without_count + desc.hypothesis_count, 0u);
    EXPECT_EQ(desc.progress, nullptr);
    const auto hypothesis = clspeckle::make<ClspHypothesis>();
    EXPECT_EQ(hypothesis.point, CLSP_HYPOTHESIS_INTENSITY);
    EXPECT_EQ(hypothesis.apply, nullptr);
    ClspDiagnoseDesc small{};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspDiagnoseDescInit(&small, 8));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "NULL", clspDiagnoseDescInit(nullptr, sizeof small));
    ClspHypothesis half{};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspHypothesisInit(&half, 8));
    EXPECT_STREQ(clspStatusString(CLSP_ERROR_CANCELLED), "CLSP_ERROR_CANCELLED");
}

TEST_F(Diagnosis, RefusesBadNumbers) {
    ClspDiagnosis made = nullptr;
    const auto refuse = [&](const char *words, auto change) {
        ClspDiagnoseDesc desc = quick_desc();
        change(desc);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, words, clspDiagnose(context, capture, &desc, &made));
    };
    for (const double level : {0.0, 1e-7, 0.6, -1.0, test::nan_value, test::infinity})
        refuse("level", [&](ClspDiagnoseDesc &d) { d.level = level; });
    refuse("null_replicates is 11", [](ClspDiagnoseDesc &d) { d.null_replicates = 11; });
    refuse("max_effects is 0", [](ClspDiagnoseDesc &d) { d.max_effects = 0; });
    refuse("evidence is 2", [](ClspDiagnoseDesc &d) { d.evidence = 2; });
    refuse("reserved is 1", [](ClspDiagnoseDesc &d) { d.reserved = 1; });
    refuse("desc->window is 3", [](ClspDiagnoseDesc &d) { d.window = 3; });
    refuse("set it to CLSP_WINDOW_GIVEN", [](ClspDiagnoseDesc &d) { d.window_width = 16; });
    refuse("16 x 16", [](ClspDiagnoseDesc &d) { d.window = CLSP_WINDOW_GIVEN; });
    refuse("reaches to column", [](ClspDiagnoseDesc &d) {
        d.window = CLSP_WINDOW_GIVEN;
        d.window_x = 2;
        d.window_width = kWidth;
        d.window_height = kHeight;
    });
    refuse("threads is 2000", [](ClspDiagnoseDesc &d) { d.threads = 2000; });
    refuse("hypothesis_count is 65", [](ClspDiagnoseDesc &d) { d.hypothesis_count = 65; });
    refuse("hypotheses is NULL", [](ClspDiagnoseDesc &d) { d.hypothesis_count = 1; });
    refuse("without is NULL", [](ClspDiagnoseDesc &d) { d.without_count = 1; });
    const char *unknown[] = {"defokus"};
    refuse("defokus", [&](ClspDiagnoseDesc &d) {
        d.without = unknown;
        d.without_count = 1;
    });
    const char *missing[] = {nullptr};
    refuse("without[0] is NULL", [&](ClspDiagnoseDesc &d) {
        d.without = missing;
        d.without_count = 1;
    });
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspDiagnose(nullptr, capture, nullptr, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "capture", clspDiagnose(context, nullptr, nullptr, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "diagnosis is NULL",
                      clspDiagnose(context, capture, nullptr, nullptr));
    auto empty = clspeckle::make<ClspCaptureDesc>();
    empty.width = kWidth;
    empty.height = kHeight;
    const clspeckle::Capture nothing(empty);
    EXPECT_NE(clspDiagnose(context, nothing, nullptr, &made), CLSP_SUCCESS);
    EXPECT_EQ(made, nullptr);
}

TEST_F(Diagnosis, JudgesTheWindowThatIsGiven) {
    clspeckle::DiagnoseOptions options = quick_options();
    options.window = std::array<std::uint32_t, 4>{2, 4, kWidth - 4, kHeight - 4};
    options.frames = 4;
    const std::string report = clspeckle::diagnose(context, capture, options).report_json();
    EXPECT_NE(report.find("\"runs\""), std::string::npos); // of coverage.used
    EXPECT_NE(report.find("\"x\": 2,"), std::string::npos);
    options.window.reset();
    options.frames.reset();
    options.whole_image = true;
    EXPECT_EQ(clspeckle::diagnose(context, capture, options).report_json().find("\"runs\""), std::string::npos);
}

TEST_F(Diagnosis, RefusesBadHypotheses) {
    RampCalls calls;
    const auto refuse = [&](const char *words, auto change) {
        ClspEffectParameter parameter = slope();
        ClspHypothesis hypothesis = ramp_hypothesis(parameter, calls);
        change(hypothesis, parameter);
        const ClspHypothesis *list[] = {&hypothesis};
        ClspDiagnoseDesc desc = quick_desc();
        desc.hypotheses = list;
        desc.hypothesis_count = 1;
        ClspDiagnosis made = nullptr;
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, words, clspDiagnose(context, capture, &desc, &made));
        EXPECT_EQ(made, nullptr);
    };
    using H = ClspHypothesis;
    using P = ClspEffectParameter;
    refuse("id is NULL", [](H &h, P &) { h.id = nullptr; });
    refuse("letters", [](H &h, P &) { h.id = ""; });
    refuse("letters", [](H &h, P &) { h.id = "two words"; });
    refuse("letters", [](H &h, P &) { h.id = "a_name_that_is_longer_than_31_bytes"; });
    refuse("catalogue", [](H &h, P &) { h.id = "defocus"; });
    refuse("laser, doe", [](H &h, P &) { h.stage = "lens"; });
    refuse("stage", [](H &h, P &) { h.stage = nullptr; });
    refuse("CLSP_HYPOTHESIS_INTENSITY (1) or CLSP_HYPOTHESIS_CODES (2)", [](H &h, P &) { h.point = 3; });
    refuse("parameter_count", [](H &h, P &) { h.parameter_count = 0; });
    refuse("parameter_count", [](H &h, P &) { h.parameter_count = 5; });
    refuse("NULL", [](H &h, P &) { h.parameters = nullptr; });
    refuse("apply", [](H &h, P &) { h.apply = nullptr; });
    refuse("reserved", [](H &h, P &) { h.reserved = 1; });
    refuse("slope", [](H &, P &p) { p.weak = -1.0; });
    refuse("slope", [](H &, P &p) { p.maximum = test::nan_value; });
    refuse("name", [](H &, P &p) { p.name[0] = '\0'; });
    refuse("does not end", [](H &, P &p) { std::memset(p.unit, 'x', sizeof p.unit); });
    refuse("both given", [](H &h, P &) { h.opencl_source = kRampSource; });
    const auto from_source = [](H &h) {
        h.apply = nullptr;
        h.opencl_source = kRampSource;
    };
    refuse("without anything in it", [](H &h, P &) {
        h.apply = nullptr;
        h.opencl_source = " ";
    });
    refuse("letters, digits and '_'", [&](H &h, P &p) {
        from_source(h);
        std::strcpy(p.name, "a slope");
    });
    EXPECT_EQ(calls.frames, 0u);
    ClspEffectParameter parameter = slope();
    ClspHypothesis hypothesis = ramp_hypothesis(parameter, calls);
    from_source(hypothesis);
    hypothesis.opencl_source = "float hypothesis(void) {";
    const ClspHypothesis *list[] = {&hypothesis};
    ClspDiagnoseDesc desc = quick_desc();
    desc.hypotheses = list;
    desc.hypothesis_count = 1;
    ClspDiagnosis made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUILD, "the OpenCL source of the hypothesis \"ramp\" does not build",
                      clspDiagnose(context, capture, &desc, &made));
    EXPECT_EQ(made, nullptr);
}

// On the device, in as many workers as there are: the same as the function on the caller's thread, to the last digit of
// what single precision leaves the same.
TEST_F(Diagnosis, HypothesisAsOpenclSource) {
    clspeckle::Hypothesis ramp;
    ramp.id = "ramp";
    ramp.stage = "optics";
    ramp.parameters = {{"slope", "1", 0.0, 1.0, 0.02, 0.2}};
    ramp.opencl_source = kRampSource;
    clspeckle::DiagnoseOptions options = quick_options();
    options.hypotheses = {ramp};
    std::vector<ClspDiagnosisParameter> fitted;
    std::vector<double> p_values;
    for (const std::uint32_t threads : {1u, 4u}) {
        options.threads = threads;
        const auto found = clspeckle::diagnose(context, capture, options);
        EXPECT_EQ(found.effects(), std::vector<std::string>{"ramp"});
        ASSERT_EQ(found.parameters().size(), 1u);
        fitted.push_back(found.parameters().front());
        p_values.push_back(found.summary().residual_p_value);
    }
    EXPECT_NEAR(fitted[0].value, 20.0 / 300.0, 0.003);
    EXPECT_EQ(fitted[0].value, fitted[1].value);
    EXPECT_EQ(p_values[0], p_values[1]);
    // As a program has it that knows of no source: without the last member.
    RampCalls calls;
    const ClspEffectParameter parameter = slope();
    ClspHypothesis old{};
    ASSERT_CLSP_OK(clspHypothesisInit(&old, offsetof(ClspHypothesis, opencl_source)));
    const ClspHypothesis now = ramp_hypothesis(parameter, calls);
    std::memcpy(&old.point, &now.point, offsetof(ClspHypothesis, opencl_source) - offsetof(ClspHypothesis, point));
    old.opencl_source = kRampSource; // behind its end: not looked at
    const ClspHypothesis *list[] = {&old};
    ClspDiagnoseDesc desc = quick_desc();
    desc.hypotheses = list;
    desc.hypothesis_count = 1;
    ClspDiagnosis made = nullptr;
    ASSERT_CLSP_OK(clspDiagnose(context, capture, &desc, &made));
    EXPECT_CLSP_OK(clspDiagnosisRelease(made));
    EXPECT_GT(calls.frames, 0u);
    calls.frames = 0;
    options.hypotheses.front().opencl_source.clear();
    options.hypotheses.front().apply = [&](const ClspHypothesisFrame &frame) { add_ramp(&calls, &frame); };
    const auto by_function = clspeckle::diagnose(context, capture, options);
    EXPECT_NEAR(by_function.parameters().front().value, fitted[0].value, 1e-4);
    EXPECT_GT(calls.frames, 0u);
    // Both at once are too many.
    options.hypotheses.front().opencl_source = kRampSource;
    EXPECT_THROW(clspeckle::diagnose(context, capture, options), clspeckle::Error);
}

TEST_F(Diagnosis, ProgressIsToldAndCancels) {
    struct Told {
        std::vector<double> fractions;
        std::size_t most = 20;
        std::thread::id thread;
        bool words = true;
    } told;
    ClspDiagnoseDesc desc = quick_desc();
    desc.progress_data = &told;
    desc.progress = [](void *data, const char *what, double fraction) -> std::int32_t {
        auto &t = *static_cast<Told *>(data);
        t.fractions.push_back(fraction);
        t.thread = std::this_thread::get_id();
        t.words = t.words && what[0] != '\0';
        return t.fractions.size() < t.most ? 1 : 0;
    };
    ClspDiagnosis made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_CANCELLED, "cancelled", clspDiagnose(context, capture, &desc, &made));
    EXPECT_EQ(made, nullptr);
    EXPECT_EQ(told.fractions.size(), told.most);
    EXPECT_TRUE(std::is_sorted(told.fractions.begin(), told.fractions.end()));
    EXPECT_GE(told.fractions.front(), 0.0);
    EXPECT_LE(told.fractions.back(), 1.0);
    EXPECT_EQ(told.thread, std::this_thread::get_id());
}

TEST_F(Diagnosis, HypothesisIsRankedAndEverythingIsTold) {
    RampCalls calls;
    const ClspEffectParameter parameter = slope();
    const ClspHypothesis hypothesis = ramp_hypothesis(parameter, calls);
    const ClspHypothesis *list[] = {&hypothesis};
    ClspDiagnoseDesc desc = quick_desc();
    desc.hypotheses = list;
    desc.hypothesis_count = 1;
    desc.seed = 5;
    ClspDiagnosis made = nullptr;
    ASSERT_CLSP_OK(clspDiagnose(context, capture, &desc, &made));
    const auto diagnosis = clspeckle::Diagnosis::adopt(made);
    EXPECT_GT(calls.frames, 0u);
    EXPECT_EQ(calls.wrong, 0u);

    ClspDiagnosisSummary summary{};
    summary.struct_size = sizeof summary;
    ASSERT_CLSP_OK(clspDiagnosisGetSummary(made, &summary));
    EXPECT_EQ(summary.struct_size, sizeof summary);
    EXPECT_EQ(summary.detected, 1u);
    EXPECT_NE(summary.verdict, CLSP_VERDICT_NONE);
    EXPECT_EQ(summary.seed, 5u);
    EXPECT_EQ(summary.level, 0.02);
    EXPECT_LT(summary.p_value, 0.001);
    EXPECT_GE(summary.p_value, 1e-300) << "never 0";
    EXPECT_GE(summary.residual_p_value, 1e-300);
    EXPECT_GT(summary.distance, 10.0 * summary.null_95);
    EXPECT_GT(summary.fraction, 0.9) << "the hypothesis is the cause";
    EXPECT_LE(summary.fraction_95[0], summary.fraction_95[1]);
    EXPECT_LT(summary.distance_after, summary.distance_before);
    EXPECT_EQ(summary.held_out, 1u);
    EXPECT_EQ(summary.step_count, 1u);
    EXPECT_GT(summary.seconds, 0.0);
    EXPECT_NEAR(summary.black_level_dn, 64.0, 0.1);
    EXPECT_NEAR(summary.read_noise_dn, 4.0, 0.2);
    constexpr std::uint32_t kOldSummary = offsetof(ClspDiagnosisSummary, black_level_dn);
    ClspDiagnosisSummary known{};
    known.struct_size = kOldSummary;
    known.black_level_dn = -7.0;
    ASSERT_CLSP_OK(clspDiagnosisGetSummary(made, &known));
    EXPECT_EQ(known.seconds, summary.seconds);
    EXPECT_EQ(known.black_level_dn, -7.0) << "beyond what the caller has";

    ClspDiagnosisRanked ranked{};
    ranked.struct_size = sizeof ranked;
    ASSERT_GE(summary.ranked_count, 1u);
    ASSERT_CLSP_OK(clspDiagnosisGetRanked(made, 0, &ranked));
    EXPECT_STREQ(ranked.effect, "ramp");
    EXPECT_STREQ(ranked.stage, "optics");
    EXPECT_EQ(ranked.parameter_count, 1u);
    EXPECT_NEAR(ranked.values[0], 20.0 / 300.0, 0.01);
    EXPECT_GT(ranked.probability, 0.95);

    ClspDiagnosisParameter fitted{};
    fitted.struct_size = sizeof fitted;
    ASSERT_EQ(summary.parameter_count, 1u);
    ASSERT_CLSP_OK(clspDiagnosisGetParameter(made, 0, &fitted));
    EXPECT_STREQ(fitted.effect, "ramp");
    EXPECT_STREQ(fitted.name, "slope");
    EXPECT_STREQ(fitted.unit, "1");
    EXPECT_NEAR(fitted.value, 20.0 / 300.0, 0.003);
    EXPECT_LE(fitted.low, fitted.value);
    EXPECT_GE(fitted.high, fitted.value);

    ClspDiagnosisPlace place{};
    place.struct_size = sizeof place;
    ASSERT_GE(summary.place_count, 10u);
    ASSERT_CLSP_OK(clspDiagnosisGetPlace(made, 0, &place));
    EXPECT_STREQ(place.sequence, "flat");
    EXPECT_GT(std::abs(place.z), 50.0);
    EXPECT_LT(place.p_adjusted, 0.02);
    EXPECT_GE(place.p_adjusted, 1e-300);
    EXPECT_NE(place.real, place.sim);
    EXPECT_GT(place.distance_before, 20.0);
    EXPECT_LT(place.distance_after, 0.2 * place.distance_before);
    EXPECT_GT(place.fraction, 0.8);
    EXPECT_LE(place.fraction_95[0], place.fraction);
    EXPECT_GE(place.fraction_95[1], place.fraction);
    // A caller of the release before knows less of the struct.
    constexpr std::uint32_t kOldSize = offsetof(ClspDiagnosisPlace, distance_before);
    ClspDiagnosisPlace old{};
    old.struct_size = kOldSize;
    old.distance_before = -7.0;
    ASSERT_CLSP_OK(clspDiagnosisGetPlace(made, 0, &old));
    EXPECT_EQ(old.z_after, place.z_after);
    EXPECT_EQ(old.distance_before, -7.0) << "beyond what the caller has";
    const std::vector<ClspDiagnosisPlace> places = diagnosis.places();
    ASSERT_EQ(places.size(), summary.place_count);
    for (std::size_t i = 0; i < places.size(); ++i) {
        EXPECT_LT(std::strlen(places[i].statistic), sizeof places[i].statistic - 1) << "may be cut";
        EXPECT_LT(std::strlen(places[i].region), sizeof places[i].region - 1);
        EXPECT_LT(std::strlen(places[i].unit), sizeof places[i].unit - 1);
        if (i > 0) {
            EXPECT_LE(std::abs(places[i].z), std::abs(places[i - 1].z)) << "worst first";
        }
    }

    ClspDiagnosisStep step{};
    step.struct_size = sizeof step;
    ASSERT_CLSP_OK(clspDiagnosisGetStep(made, 0, &step));
    EXPECT_STREQ(step.effect, "ramp");
    EXPECT_EQ(step.fraction, summary.fraction);
    EXPECT_EQ(step.distance_after, summary.distance_after);

    ASSERT_EQ(summary.effect_count, 1u);
    std::uint64_t length = 0;
    ASSERT_CLSP_OK(clspDiagnosisGetEffect(made, 0, 0, nullptr, &length));
    EXPECT_EQ(length, 5u);
    char cut[3] = {'x', 'x', 'x'};
    ASSERT_CLSP_OK(clspDiagnosisGetEffect(made, 0, sizeof cut, cut, nullptr));
    EXPECT_STREQ(cut, "ra");
    EXPECT_EQ(diagnosis.effects(), std::vector<std::string>{"ramp"});
    EXPECT_EQ(diagnosis.equivalents().size(), summary.equivalent_count);
    EXPECT_EQ(diagnosis.notes().size(), summary.note_count);

    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index is 1", clspDiagnosisGetEffect(made, 1, 0, nullptr, &length));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index",
                      clspDiagnosisGetEquivalent(made, summary.equivalent_count, 0, nullptr, &length));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index",
                      clspDiagnosisGetNote(made, summary.note_count, 0, nullptr, &length));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index",
                      clspDiagnosisGetRanked(made, summary.ranked_count, &ranked));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index", clspDiagnosisGetParameter(made, 1, &fitted));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index", clspDiagnosisGetPlace(made, summary.place_count, &place));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "index", clspDiagnosisGetStep(made, 1, &step));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "text is NULL",
                      clspDiagnosisGetReportJson(made, 10, nullptr, nullptr));
    place.struct_size = 8;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "place", clspDiagnosisGetPlace(made, 0, &place));

    const std::string json = diagnosis.report_json();
    EXPECT_EQ(json.front(), '{');
    EXPECT_EQ(json.back(), '}');
    EXPECT_NE(json.find("\"clspeckle-gap-report\""), std::string::npos);
    const std::filesystem::path folder = std::filesystem::temp_directory_path() / "clspeckle_test_diagnosis";
    std::filesystem::remove_all(folder);
    std::filesystem::create_directory(folder);
    const std::string path = (folder / "report.json").string();
    for (int round = 0; round < 2; ++round) { // the second one replaces the first
        ASSERT_CLSP_OK(clspDiagnosisWriteReport(made, path.c_str()));
        EXPECT_EQ(file_text(path), json + "\n");
    }
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator()), 1);
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "report.json", clspDiagnosisWriteReport(made, (path + "/below").c_str()));
    const std::string page = (folder / "report.html").string();
    ASSERT_CLSP_OK(clspDiagnosisWriteHtml(made, page.c_str()));
    EXPECT_NE(file_text(page).find("ramp"), std::string::npos);
    EXPECT_NE(file_text(page).find("</html>"), std::string::npos);
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "no regular file", clspDiagnosisWriteHtml(made, folder.c_str()));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "path", clspDiagnosisWriteHtml(made, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "no regular file", clspDiagnosisWriteReport(made, folder.c_str()));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "path", clspDiagnosisWriteReport(made, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "path", clspDiagnosisWriteReport(made, ""));
    std::filesystem::remove_all(folder);

    ASSERT_CLSP_OK(clspDiagnosisRetain(made));
    ASSERT_CLSP_OK(clspDiagnosisRelease(made));
    EXPECT_CLSP_OK(clspDiagnosisGetSummary(made, &summary)) << "one reference is left";
    EXPECT_CLSP_OK(clspDiagnosisRelease(nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "diagnosis", clspDiagnosisGetSummary(nullptr, &summary));

    // A user's function that fails ends it, and is named with sequence and frame.
    calls.answer = 3;
    ClspDiagnosis none = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "\"ramp\" on sequence \"flat\", frame 0 failed: its function returned 3",
                      clspDiagnose(context, capture, &desc, &none));
    EXPECT_EQ(none, nullptr);
}

TEST_F(Diagnosis, NoGapIsSeenWhereThereIsNone) {
    const auto diagnosis = clspeckle::diagnose(context, make_capture(0.0), quick_options());
    const ClspDiagnosisSummary summary = diagnosis.summary();
    EXPECT_EQ(summary.verdict, CLSP_VERDICT_NONE);
    EXPECT_EQ(summary.detected, 0u);
    EXPECT_TRUE(diagnosis.effects().empty());
    EXPECT_TRUE(diagnosis.parameters().empty());
    EXPECT_TRUE(diagnosis.steps().empty());
    for (const ClspDiagnosisPlace &place : diagnosis.places())
        EXPECT_TRUE(std::isnan(place.distance_before) && std::isnan(place.distance_after) &&
                    std::isnan(place.fraction) && std::isnan(place.fraction_95[0]) && std::isnan(place.fraction_95[1]));
    EXPECT_TRUE(diagnosis.ranking().empty());
    // What the verdict does not reach is said.
    const std::string json = diagnosis.report_json();
    for (const char *words :
         {"\"coverage\"", "\"effects_not_visible\"", "\"defocus\"", "\"left_out\": []", "\"scales\""})
        EXPECT_NE(json.find(words), std::string::npos) << words;
    const std::vector<std::string> notes = diagnosis.notes();
    EXPECT_TRUE(std::any_of(notes.begin(), notes.end(), [](const std::string &note) {
        return note.find("these effects cannot show in this capture: ") == 0 &&
               note.find("defocus") != std::string::npos;
    }));
    // The same seed, the same report; threads do not matter.
    auto options = quick_options();
    options.threads = 1;
    EXPECT_EQ(clspeckle::diagnose(context, make_capture(0.0), options).report_json(), diagnosis.report_json());
    options.seed = 1;
    EXPECT_NE(clspeckle::diagnose(context, make_capture(0.0), options).report_json(), diagnosis.report_json());
}

TEST_F(Diagnosis, MeasuredNoiseHoldsWhateverTheDataSheetSays) {
    const clspeckle::Capture good = make_capture(0.0);
    for (const double stated : {0.0, 0.3, 40.0}) {
        auto desc = clspeckle::make<ClspCaptureDesc>();
        desc.width = kWidth;
        desc.height = kHeight;
        desc.read_noise_dn = stated;
        clspeckle::Capture stated_set(desc);
        stated_set.add_sequence("dark", CLSP_SCENE_DARK, false, good.codes(0));
        stated_set.add_sequence("flat", CLSP_SCENE_FLAT, false, good.codes(1));
        const auto summary = clspeckle::diagnose(context, stated_set, quick_options()).summary();
        EXPECT_EQ(summary.verdict, CLSP_VERDICT_NONE) << stated << " DN: a gap of " << summary.distance;
    }
}

TEST_F(Diagnosis, SequencesThatCannotBeJudgedAreLeftOut) {
    auto desc = clspeckle::make<ClspCaptureDesc>();
    desc.width = kWidth;
    desc.height = kHeight;
    clspeckle::Capture clipped(desc);
    clipped.add_sequence("dark", CLSP_SCENE_DARK, false, capture.codes(0));
    std::vector<std::uint16_t> codes = capture.codes(1);
    for (std::size_t i = 0; i < codes.size(); ++i)
        if (i % 4 == 0) // 25 % of the pixels: the level of the light is not known
            codes[i] = 1023;
    clipped.add_sequence("flat", CLSP_SCENE_FLAT, false, codes);
    const auto diagnosis = clspeckle::diagnose(context, clipped, quick_options());
    EXPECT_EQ(diagnosis.summary().verdict, CLSP_VERDICT_NONE) << "the ramp is in what was left out";
    EXPECT_NE(diagnosis.report_json().find("\"left_out\": [\n   \"flat\"\n  ]"), std::string::npos)
        << diagnosis.report_json();
    EXPECT_EQ(diagnosis.summary().judged, 0u);
    EXPECT_EQ(clspeckle::diagnose(context, make_capture(0.0), quick_options()).summary().judged, 1u);
    for (const ClspDiagnosisPlace &place : diagnosis.places())
        EXPECT_STREQ(place.sequence, "dark");

    clspeckle::Capture hidden(desc);
    hidden.add_sequence("dark", CLSP_SCENE_DARK, false, capture.codes(0));
    std::vector<std::uint8_t> mask(std::size_t{kWidth} * kHeight, 0);
    std::fill_n(mask.begin(), 63, std::uint8_t{1});
    auto masked = clspeckle::make<ClspCaptureSequence>();
    masked.name = "flat";
    masked.scene = CLSP_SCENE_FLAT;
    masked.frame_count = kFrames;
    const std::vector<std::uint16_t> flat = capture.codes(1);
    masked.codes = flat.data();
    masked.mask = mask.data();
    ASSERT_CLSP_OK(clspCaptureAddSequence(hidden, &masked));
    const std::vector<std::string> notes = clspeckle::diagnose(context, hidden, quick_options()).notes();
    EXPECT_NE(
        std::find(notes.begin(), notes.end(), "flat was left out: its mask leaves 63 pixels; at least 64 are needed"),
        notes.end());

    clspeckle::Capture nothing(desc);
    nothing.add_sequence("flat", CLSP_SCENE_FLAT, false, codes);
    ClspDiagnosis made = nullptr;
    const ClspDiagnoseDesc quick = quick_desc();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "flat was left out: 25 % of its pixels are at the top code",
                      clspDiagnose(context, nothing, &quick, &made));
    EXPECT_EQ(made, nullptr);

    // A camera that was off, or whose frames were lost: no bits of a converter are to be read from that.
    for (const int code : {0, 64}) {
        clspeckle::Capture black(desc);
        const std::vector<std::uint16_t> same(flat.size(), static_cast<std::uint16_t>(code));
        black.add_sequence("dark", CLSP_SCENE_DARK, false, same);
        black.add_sequence("flat", CLSP_SCENE_FLAT, false, same);
        EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_DATA, "dark was left out: all its codes are " + std::to_string(code),
                          clspDiagnose(context, black, &quick, &made));
    }

    // Beside light a dark of one code counts: a black level of 0 cuts its noise off, and levels go by it.
    clspeckle::Capture cut(desc);
    cut.add_sequence("dark", CLSP_SCENE_DARK, false, std::vector<std::uint16_t>(flat.size(), 0));
    cut.add_sequence("flat", CLSP_SCENE_FLAT, false, flat);
    const std::string report = clspeckle::diagnose(context, cut, quick_options()).report_json();
    EXPECT_NE(report.find("\"left_out\": []"), std::string::npos) << report;
}

TEST_F(Diagnosis, WhatFunctionsThrowLeavesDiagnose) {
    auto options = quick_options();
    options.progress = [](const std::string &, double) -> bool { throw std::out_of_range("mine"); };
    EXPECT_THROW(clspeckle::diagnose(context, capture, options), std::out_of_range);
    options.progress = [](const std::string &, double) { return false; };
    try {
        clspeckle::diagnose(context, capture, options);
        ADD_FAILURE() << "was not cancelled";
    } catch (const clspeckle::Error &error) {
        EXPECT_EQ(error.status(), CLSP_ERROR_CANCELLED);
    }
    options.progress = nullptr;
    clspeckle::Hypothesis hypothesis{"mine", "sensor", "", CLSP_HYPOTHESIS_INTENSITY, {{"a", "DN", 0, 9, 1, 3}},
                                     nullptr};
    hypothesis.apply = [](const ClspHypothesisFrame &) { throw std::length_error("too long"); };
    options.hypotheses = {hypothesis};
    EXPECT_THROW(clspeckle::diagnose(context, capture, options), std::length_error);
    options.hypotheses[0].apply = [](const ClspHypothesisFrame &frame) { frame.pixels[0] = NAN; };
    EXPECT_THROW(clspeckle::diagnose(context, capture, options), clspeckle::Error);
    options.hypotheses[0].parameters[0].unit = "a unit of many words";
    EXPECT_THROW(clspeckle::diagnose(context, capture, options), std::invalid_argument);
    options.hypotheses.clear();
    options.without = {"defokus"};
    EXPECT_THROW(clspeckle::diagnose(context, capture, options), clspeckle::Error);
}

} // namespace
