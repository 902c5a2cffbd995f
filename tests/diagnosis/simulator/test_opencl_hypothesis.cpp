// Hypotheses as OpenCL source: against the same effect as a function of the host, what a source sees, its random
// numbers, and source that cannot be used.
#include "diagnosis/simulator/gap_simulator_support.hpp"

#include "simulator/source_includes.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

namespace clsp::gap_simulator_test {
namespace {

constexpr double kPi = 3.14159265358979323846;

Hypothesis from_source(const std::string &id, HypothesisPoint point, const std::string &source) {
    Hypothesis hypothesis;
    hypothesis.id = id;
    hypothesis.stage = "optics";
    hypothesis.point = point;
    hypothesis.parameters = {{"part", "1", 0.0, 1.0, 0.1, 0.5}, {"offset", "DN", -10.0, 1000.0, 1.0, 5.0}};
    hypothesis.opencl_source = source;
    return hypothesis;
}

std::string returning(const std::string &expression) {
    return "float hypothesis(hypothesis_frame frame, hypothesis_values values, uint x, uint y) {\n    return " +
           expression + ";\n}\n";
}

using OpenclHypothesis = GapSimulator;

TEST_F(OpenclHypothesis, DoesWhatTheSameFunctionOfTheHostDoes) {
    const std::string source =
        returning("x < 20u ? values.part * hypothesis_pixel(frame, (int)x - 3, (int)y + 2) + values.offset\n"
                  "                   : frame.pixels[y * frame.width + x]");
    const auto function = [](const HypothesisFrame &frame) {
        const std::size_t width = frame.layout->width, height = frame.layout->height;
        const std::vector<float> before(frame.pixels, frame.pixels + width * height);
        for (std::size_t y = 0; y < height; ++y)
            for (std::size_t x = 0; x < 20; ++x) {
                const std::size_t from_x = x < 3 ? 0 : x - 3, from_y = std::min(y + 2, height - 1);
                // Two roundings, as in kernels, where products and sums are not contracted.
                const float product = static_cast<float>(frame.values[0]) * before[from_y * width + from_x];
                frame.pixels[y * width + x] = product + static_cast<float>(frame.values[1]);
            }
    };
    for (const auto point : {HypothesisPoint::kIrradiance, HypothesisPoint::kIntensity, HypothesisPoint::kCodes}) {
        Hypothesis on_device = from_source("h", point, source), on_host = on_device;
        on_host.opencl_source.clear();
        on_host.apply = function;
        Simulator device(context, small_layout(), {on_device}), host(context, small_layout(), {on_host}),
            plain(context, small_layout());
        const std::vector<EffectSetting> effects = {{"h", {0.3, 2.25}}, {"vignetting", {0.3}}};
        for (std::size_t s = 0; s < kSequenceCount; ++s) {
            const Codes codes = draw(device, s, effects);
            EXPECT_EQ(codes, draw(host, s, effects)) << kNames[s];
            EXPECT_EQ(device.concerns("h", s), host.concerns("h", s)) << kNames[s];
            EXPECT_EQ(codes == draw(plain, s, {effects[1]}), !device.concerns("h", s)) << kNames[s];
        }
        EXPECT_EQ(device.mean_intensity(kBoardMoving, effects, 7, 4), host.mean_intensity(kBoardMoving, effects, 7, 4));
    }
}

TEST_F(OpenclHypothesis, SeesItsFrame) {
    CaptureLayout layout = small_layout();
    layout.sequences[kBoardMoving].f_number = 8.0;
    const std::uint64_t seed = (std::uint64_t{321} << 32) + 654;
    struct Seen {
        const char *expression;
        std::uint16_t expected;
    };
    for (const Seen &seen : {Seen{"frame.width", 64},
                             {"frame.height", 48},
                             {"frame.bits", 10},
                             {"frame.sequence", 3},
                             {"frame.scene == CLSP_SCENE_BOARD ? 7 : 0", 7},
                             {"frame.moving", 1},
                             {"(float)(frame.seed >> 32)", 321},
                             {"(float)(frame.seed & 0xffffffffUL)", 654},
                             {"frame.f_number", 8},
                             {"frame.pixel_pitch_m * 1e8f", 290},
                             {"frame.wavelength_m * 1e9f", 940},
                             {"values.part * 100", 25},
                             {"values.offset", 600}}) {
        Simulator simulator(context, layout,
                            {from_source("seen", HypothesisPoint::kCodes, returning(seen.expression))});
        const Codes codes = draw(simulator, kBoardMoving, {{"seen", {0.25, 600.0}}}, kLevels, seed);
        EXPECT_EQ(std::count(codes.begin(), codes.end(), seen.expected), std::ptrdiff_t(codes.size()))
            << seen.expression << " is " << codes.front();
    }
    Simulator simulator(context, layout,
                        {from_source("place", HypothesisPoint::kCodes, returning("100u * frame.frame_index + x + y"))});
    const Codes codes = draw(simulator, kDark, {{"place", {0.0, 0.0}}});
    for (std::size_t i = 0; i < codes.size(); ++i)
        ASSERT_EQ(codes[i], 100 * (i / (64 * 48)) + i % 64 + i / 64 % 48) << i;
}

// Codes of a 64 x 48 camera that must be expected(x, y, frame), rounded: single precision may fall on the other side.
template <typename Expected> void expect_codes(const Codes &codes, Expected expected) {
    for (std::uint32_t i = 0; i < codes.size(); ++i)
        ASSERT_NEAR(codes[i], std::clamp(expected(i % 64, i / 64 % 48, i / (64 * 48)), 0.0, 1023.0), 0.501) << i;
}

// Against Philox and Box-Muller on the host.
TEST_F(OpenclHypothesis, HasRandomNumbersOfItsOwn) {
    const auto drawn = [&](const std::string &expression, std::size_t sequence, const char *id = "noise") {
        // Which others are there makes no difference.
        Simulator simulator(context, small_layout(),
                            {from_source("first", HypothesisPoint::kCodes, returning("0.0f")),
                             from_source(id, HypothesisPoint::kCodes, returning("512.0f + 100.0f * " + expression))});
        return draw(simulator, sequence, {{id, {0.0, 0.0}}}, kLevels, (std::uint64_t{5} << 32) + 7);
    };
    std::uint32_t number = 0x811c9dc5u; // FNV-1a of "noise", folded
    for (const char c : {'n', 'o', 'i', 's', 'e'})
        number = (number ^ static_cast<std::uint32_t>(c)) * 0x01000193u;
    number = (number >> 16 ^ number) & 0xffffu;
    const auto expected = [&](std::uint32_t x, std::uint32_t row, std::uint32_t frame, std::uint32_t stream) {
        const std::uint32_t y = row | number << 16;
        const auto words = host_block((std::uint64_t{5} << 32) + 7, {x, y, frame, stream});
        const double radius = std::sqrt(-2.0 * std::log((words[0] + 0.5) * 0x1p-32));
        return 512.0 + 100.0 * radius * std::cos(2.0 * kPi * words[1] * 0x1p-32);
    };
    const std::uint32_t moving = kBoardMoving;
    const Codes codes = drawn("hypothesis_normal(frame, x, y, 3)", kBoardMoving);
    expect_codes(codes, [&](auto x, auto y, auto f) { return expected(x, y, f, 0x63u | moving << 16); });
    expect_codes(drawn("hypothesis_fixed_normal(frame, x, y, 1)", kBoardMoving),
                 [&](auto x, auto y, auto) { return expected(x, y, 0, 0x71u); });
    expect_codes(drawn("hypothesis_normal(frame, 0, y, 3)", kBoardMoving),
                 [&](auto, auto y, auto f) { return expected(0, y, f, 0x63u | moving << 16); });
    EXPECT_NE(codes, drawn("hypothesis_normal(frame, x, y, 3)", kDark));
    EXPECT_NE(codes, drawn("hypothesis_normal(frame, x, y, 2)", kBoardMoving));
    EXPECT_NE(codes, drawn("hypothesis_normal(frame, x, y, 3)", kBoardMoving, "noises"));
    EXPECT_EQ(drawn("hypothesis_fixed_normal(frame, x, y, 1)", kBoardMoving),
              drawn("hypothesis_fixed_normal(frame, x, y, 1)", kFlat));
}

TEST_F(OpenclHypothesis, MayBeWrittenAsUsual) {
    const Codes plain = [&] {
        Simulator simulator(context, small_layout(),
                            {from_source("h", HypothesisPoint::kCodes, returning("300.0f + x * values.part"))});
        return draw(simulator, kDark, {{"h", {0.5, 0.0}}});
    }();
    EXPECT_EQ(plain[10], 305);
    for (const std::string &source :
         {// Macros of the source are its own, whatever the library's kernel calls its things.
          "#define width frame.width\n#define number 3\n#define changed 4\n#define seed 5\n#define get_global_id(i) "
          "0\n" +
              returning("300.0f + x * values.part + 0 * (width + number + changed + seed)"),
          "\xef\xbb\xbf" + returning("300.0f + x * values.part"), // a byte order mark
          std::string("constant float base = 300.0f;\r\nfloat helper(float a) { return base + a; }\r\n"
                      "float hypothesis(hypothesis_frame f, hypothesis_values v, uint column, uint row) {\r\n"
                      "    return helper(column * v.part);\r\n}\r\n// no line end")}) {
        Simulator simulator(context, small_layout(), {from_source("h", HypothesisPoint::kCodes, source)});
        EXPECT_EQ(plain, draw(simulator, kDark, {{"h", {0.5, 0.0}}})) << source;
    }
}

TEST_F(OpenclHypothesis, SourceThatCannotBeUsedIsRefused) {
    const auto refused = [&](const Hypothesis &hypothesis, Status status) {
        return message_of([&] { Simulator(context, small_layout(), {hypothesis}); }, status);
    };
    const Hypothesis good = from_source("good", HypothesisPoint::kCodes, returning("values.part"));
    Hypothesis bad = good;
    bad.apply = [](const HypothesisFrame &) {};
    EXPECT_TRUE(contains(refused(bad, Status::kInvalidArgument), "a function and OpenCL source; give one of them"));
    bad = good;
    bad.opencl_source = " \n\t";
    EXPECT_TRUE(contains(refused(bad, Status::kInvalidArgument), "without anything in it"));
    for (const char *name : {"two words", "2nd", "a-b", "\xc3\xa4"}) {
        bad = good;
        bad.parameters[0].name = name;
        EXPECT_TRUE(contains(refused(bad, Status::kInvalidArgument), "letters, digits and '_'")) << name;
    }
    bad = good;
    bad.parameters[1].name = "part";
    EXPECT_TRUE(contains(refused(bad, Status::kInvalidArgument), "two parameters with the name \"part\""));
    bad = good;
    for (const char *name : {"c", "d", "e"})
        bad.parameters.push_back({name, "1", 0.0, 1.0, 0.1, 0.5});
    EXPECT_TRUE(contains(refused(bad, Status::kInvalidArgument), "has 5 parameters"));
    // The compiler's log names the hypothesis and the line.
    bad = good;
    bad.id = "bad";
    bad.opencl_source = returning("values.party");
    try {
        Simulator(context, small_layout(), {good, bad});
        FAIL() << "it builds";
    } catch (const Error &error) {
        EXPECT_EQ(error.status(), Status::kBuild);
        EXPECT_TRUE(contains(error.what(), "the OpenCL source of the hypothesis \"bad\" does not build"));
        EXPECT_TRUE(contains(error.build_log(), "bad:2")) << error.build_log();
        EXPECT_TRUE(contains(error.build_log(), "party"));
    }
    bad.opencl_source = "float hypotesis(uint x) { return x; }";
    EXPECT_TRUE(contains(refused(bad, Status::kBuild), "it must define float hypothesis("));
    // As a compiler reads it, not as it is spelled.
    for (const char *line : {"#include \"philox.h\"\n",
                             "  # include <stdio.h>\n",
                             "%:include \"a\"\n",
                             "%: include \"a\"\n",
                             "?\?=include \"a\"\n",
                             "#inc\\\nlude \"a\"\n",
                             "#\\\ninclude \"a\"\n",
                             "#inc?\?/\nlude \"a\"\n",
                             "#inc\\ \t\nlude \"a\"\n",
                             "#inc\\\r\nlude \"a\"\n",
                             "%\\\n:include \"a\"\n",
                             "/* a */ # /* b */ include \"a\"\n",
                             "#/* b\n */ /**/ include \"a\"\n",
                             "/* #\n*/ #include \"a\"\n",
                             "\"# /*\"\n# /*/ */ include \"a\"\n",
                             "'\n#include \"a\"\n",
                             "#\vinclude \"a\"\n",
                             "\r#include \"a\"\n",
                             "#\xc2\xa0include \"a\"\n",
                             "#include_next \"a\"\n",
                             "#import \"a\"\n",
                             "#embed \"a\"\n",
                             "#if __has_include(\"a\")\n#endif\n",
                             "#define A #\n A include \"a\"\n#include A\n",
                             "#include/**/\"a\"\n",
                             "// ?\?/\n#include \"a\"\n",
                             "// don't\n#include \"a\"\n",
                             "/* \" */ #include \"a\"\n",
                             "constant char a[] = \"//\"; /* ' */\n#include \"a\"\n",
                             "constant char a = '\\''; /*'*/\n#include \"a\"\n",
                             "#define A(x, y) x##y\n#if A(__has_, include)(\"a\")\n#endif\n",
                             "#define A(x, y) x %:%: y\n",
                             "#pragma GCC dependency \"a\"\n",
                             "# /**/ pragma clang module import a\n",
                             "_Pragma(\"GCC dependency \\\"a\\\"\")\n",
                             "__asm__(\".incbin \\\"a\\\"\");\n",
                             "void f(void) { asm volatile(\"\"); }\n"}) {
        bad.opencl_source = line + good.opencl_source;
        EXPECT_TRUE(contains(refused(bad, Status::kInvalidArgument), "must stand alone")) << line;
    }
    for (const char *line :
         {"#define included 1\n", "// it includes noise: #1 of many\n", "#define imports\n", "#define A(x) #x\n",
          "int has_include;\n", "/* ? include */\n", "# // include\n", "// do not #include\n", "/* #include \"a\" */\n",
          "// \\\n#include \"a\"\n", "constant char a[] = \"#include\", b = '#';\n", "// asm, ##, __has_include\n",
          "#pragma OPENCL FP_CONTRACT OFF\n", "#pragma unroll 4\n", "#pragma STDC FP_CONTRACT OFF\n",
          "int asmx, my_asm;\n", "constant char q[] = \"a\\\"#include\";\n"})
        EXPECT_EQ(word_that_reads_files(line + good.opencl_source), "") << line;
    // Of a size that a quadratic reader would take minutes for.
    std::string hashes, comments;
    for (int i = 0; i < 200000; ++i) {
        hashes += "#/*";
        comments += "/**/";
    }
    EXPECT_EQ(word_that_reads_files(hashes + "*/" + comments), "");
    EXPECT_EQ(word_that_reads_files(hashes + "*/" + comments + "include"), "#include");
    for (const char *name : {"constant", "global", "half", "float"}) {
        bad = good;
        bad.parameters[0].name = name;
        EXPECT_TRUE(contains(refused(bad, Status::kInvalidArgument), "a word of OpenCL C's own")) << name;
    }
    // What it computes is checked like what a function does.
    Simulator simulator(
        context, small_layout(),
        {from_source("nan", HypothesisPoint::kIntensity, returning("x == 3u && y == 2u ? NAN : 1.0f"))});
    EXPECT_TRUE(contains(message_of(
                             [&] {
                                 draw(simulator, kFlat, {{"nan", {0.0, 0.0}}});
                             },
                             Status::kInvalidData),
                         "frame 0 made the pixel x = 3, y = 2"));
}

} // namespace
} // namespace clsp::gap_simulator_test
