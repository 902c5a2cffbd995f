#include "runtime/fused_codelets.hpp"

#include "runtime/fused_butterfly.hpp"

#include <fmt/core.h>
#include <iterator>
#include <numeric>

namespace clsp {
namespace {

// Where the points of a butterfly come from or go to.
enum class Place { kTile, kMacro };

// Code for the butterfly of point j of the block that begins at `base`.
class StageText {
  public:
    StageText(const FusedStage &stage, std::string indent) : stage_(stage), indent_(std::move(indent)) {}

    std::string read(Place place) const {
        std::string text;
        // What a point is made of can be long: once in the code is enough.
        if (place == Place::kMacro)
            text = fmt::format("{0}lanes_f xr[{1}], xi[{1}];\n{0}for (uint q = 0; q < {1}u; ++q)\n"
                               "{0}    FFT_INPUT(strip, base + j + q * {2}u, xr[q], xi[q]);\n",
                               indent_, stage_.radix, stage_.m);
        for (std::uint32_t q = 0; q < stage_.radix; ++q)
            text += place == Place::kTile
                        ? fmt::format("{0}const lanes_f x{1}r = tile[2u * ({2})], x{1}i = tile[2u * ({2}) + 1u];\n",
                                      indent_, q, point(q))
                        : fmt::format("{0}const lanes_f x{1}r = xr[{1}], x{1}i = xi[{1}];\n", indent_, q);
        return text;
    }

    Butterfly::Values inputs() const {
        Butterfly::Values values;
        for (std::uint32_t q = 0; q < stage_.radix; ++q)
            values.push_back({fmt::format("x{}r", q), fmt::format("x{}i", q)});
        return values;
    }

    std::string write(Place place, const Butterfly::Values &values) const {
        std::string text;
        for (std::uint32_t q = 0; q < stage_.radix; ++q) {
            const std::string at = point(q);
            if (place == Place::kTile)
                text += fmt::format("{0}tile[2u * ({1})] = {2};\n{0}tile[2u * ({1}) + 1u] = {3};\n", indent_, at,
                                    values[q].re, values[q].im);
            else
                text += fmt::format("{}FFT_OUTPUT(strip, {}, {}, {});\n", indent_, at, values[q].re, values[q].im);
        }
        return text;
    }

    std::string twiddle_table(std::uint32_t k) const {
        return fmt::format("(twiddles + {}u + {}u * j + {}u)", stage_.twiddles, 2 * (stage_.radix - 1), 2 * (k - 1));
    }

    // Forward: butterfly, twiddles. Inverse: twiddles, butterfly.
    std::string step(bool inverse, Place from, Place to) const {
        std::string text = read(from);
        Butterfly butterfly(indent_, inverse);
        Butterfly::Values values = inputs();
        if (inverse)
            twiddle(butterfly, values);
        values = butterfly.transform(values);
        if (!inverse)
            twiddle(butterfly, values);
        return text + butterfly.text() + write(to, values);
    }

  private:
    std::string point(std::uint32_t q) const { return fmt::format("base + j + {}u", q * stage_.m); }

    void twiddle(Butterfly &butterfly, Butterfly::Values &values) const {
        if (stage_.m == 1)
            return;
        for (std::uint32_t k = 1; k < stage_.radix; ++k)
            values[k] = butterfly.twiddled(values[k], fmt::format("SPREAD({}[0])", twiddle_table(k)),
                                           fmt::format("SPREAD({}[1])", twiddle_table(k)));
    }

    FusedStage stage_;
    std::string indent_;
};

constexpr const char *kParameters = "FFT_TILE lanes_f *tile, __global const float *twiddles";

// A function that takes every butterfly of a stage within one block of the first stage.
std::string block_stage(const std::string &name, const FusedStage &stage, std::uint32_t block_length, bool inverse) {
    const StageText text(stage, "            ");
    const std::uint32_t span = stage.radix * stage.m;
    return fmt::format("static inline void {}(uint first, {}) {{\n"
                       "    for (uint base = first; base < first + {}u; base += {}u) {{\n"
                       "        for (uint j = 0; j < {}u; ++j) {{\n{}        }}\n    }}\n}}\n",
                       name, kParameters, block_length, span, stage.m, text.step(inverse, Place::kTile, Place::kTile));
}

std::string transpose(std::uint32_t lanes) {
    std::string text = "// v[i] lane l becomes v[l] lane i: blocks of 1, 2, 4 .. lanes change places.\n"
                       "static inline void transpose_lanes(lanes_f *v) {\n";
    const char *digits = "0123456789abcdef";
    for (std::uint32_t step = 1; step < lanes; step *= 2)
        for (std::uint32_t i = 0; i < lanes; ++i) {
            if (i & step)
                continue;
            std::string low, high;
            for (std::uint32_t l = 0; l < lanes; ++l) {
                low += fmt::format("{}{}.s{}", l ? ", " : "", l & step ? "b" : "a", digits[l & step ? l - step : l]);
                high += fmt::format("{}{}.s{}", l ? ", " : "", l & step ? "b" : "a", digits[l & step ? l : l + step]);
            }
            text +=
                fmt::format("    {{\n        const lanes_f a = v[{0}], b = v[{1}];\n        v[{0}] = (lanes_f)({2});\n"
                            "        v[{1}] = (lanes_f)({3});\n    }}\n",
                            i, i + step, low, high);
        }
    return text + "}\n";
}

} // namespace

std::string fused_codelets(const FusedPlan &plan, std::uint32_t lanes) {
    const std::vector<FusedStage> stages = stages_of(plan);
    const std::size_t count = stages.size();
    const std::uint32_t block = plan.block_length();
    std::string text = fmt::format("// {} points =", plan.length);
    for (const FusedStage &stage : stages)
        text += fmt::format(" {}", stage.radix);
    text += fmt::format("\n#define FFT_LENGTH {}u\n#define FFT_BLOCKS {}u\n#define FFT_BLOCK_LENGTH {}u\n"
                        "#define FFT_TILE_VECTORS (2u * (FFT_LENGTH + 1u))\n",
                        plan.length, plan.radices.front(), block);
    text += transpose(lanes);

    for (std::size_t s = 1; s < count; ++s) {
        const bool middle = s + 1 == count;
        text += block_stage(fmt::format("fft_forward_{}", s), stages[s], block, false);
        text += block_stage(fmt::format("fft_inverse_{}", s), stages[s], block, true);
        if (!middle)
            continue;
        // The last stage, the pupil and the first stage of the way back, without a stop in the tile.
        const FusedStage &stage = stages[s];
        const StageText step(stage, "        ");
        Butterfly forward("        ", false);
        const Butterfly::Values spectrum = forward.transform(step.inputs());
        text +=
            fmt::format("#ifdef FFT_PUPIL\nstatic inline void fft_filter_{}(uint first, {} FFT_PUPIL_PARAMETERS) {{\n"
                        "    const uint j = 0;\n    for (uint base = first; base < first + {}u; base += {}u) {{\n",
                        s, kParameters, block, stage.radix);
        text += step.read(Place::kTile) + forward.text();
        Butterfly::Values filtered;
        for (std::uint32_t q = 0; q < stage.radix; ++q) {
            text += fmt::format(
                "        lanes_f y{0}r = {1}, y{0}i = {2};\n        FFT_PUPIL(base + {0}u, y{0}r, y{0}i);\n", q,
                spectrum[q].re, spectrum[q].im);
            filtered.push_back({fmt::format("y{}r", q), fmt::format("y{}i", q)});
        }
        Butterfly inverse("            ", true);
        const Butterfly::Values result = inverse.transform(filtered);
        text += "        {\n" + inverse.text() + StageText(stage, "            ").write(Place::kTile, result) +
                "        }\n    }\n}\n#endif\n";
    }
    if (count == 1)
        text +=
            fmt::format("#ifdef FFT_PUPIL\nstatic inline void fft_filter_0(uint first, {} FFT_PUPIL_PARAMETERS) {{\n"
                        "    lanes_f re = tile[2u * first], im = tile[2u * first + 1u];\n"
                        "    FFT_PUPIL(first, re, im);\n"
                        "    tile[2u * first] = re;\n    tile[2u * first + 1u] = im;\n}}\n#endif\n",
                        kParameters);

    // First and last stage of the line as statements, so that the macros see the kernel's variables.
    const FusedStage &outer = stages.front();
    const StageText step(outer, "            ");
    const auto statement = [](const std::string &body, std::uint32_t m) {
        const std::string lines =
            fmt::format("{{\n    const uint base = 0;\n    for (uint j = 0; j < {}u; ++j)\n"
                        "        for (uint strip = 0; strip < FFT_STRIPS; ++strip) {{\n"
                        "            FFT_TILE lanes_f *tile = tiles + strip * FFT_TILE_VECTORS;\n{}        }}\n}}\n",
                        m, body);
        std::string joined;
        for (const char c : lines)
            joined += c == '\n' ? std::string(" \\\n") : std::string(1, c);
        return joined + "\n";
    };
    text += "#define fft_forward_first \\\n" + statement(step.step(false, Place::kMacro, Place::kTile), outer.m);
    text += "#define fft_inverse_last \\\n" + statement(step.step(true, Place::kTile, Place::kMacro), outer.m);

    const auto sequence = [&](const char *name, const char *more_parameters, const std::string &body) {
        return fmt::format(
            "static inline void {}(uint block, {}{}) {{\n    const uint first = block * FFT_BLOCK_LENGTH;\n{}}}\n",
            name, kParameters, more_parameters, body);
    };
    std::string forward, inverse, filter;
    for (std::size_t s = 1; s < count; ++s)
        forward += fmt::format("    fft_forward_{}(first, tile, twiddles);\n", s);
    for (std::size_t s = count - 1; s >= 1; --s)
        inverse += fmt::format("    fft_inverse_{}(first, tile, twiddles);\n", s);
    for (std::size_t s = 1; s + 1 < count; ++s)
        filter += fmt::format("    fft_forward_{}(first, tile, twiddles);\n", s);
    filter += fmt::format("    fft_filter_{}(first, tile, twiddles FFT_PUPIL_ARGUMENTS);\n", count - 1);
    for (std::size_t s = count - 1; s > 1; --s)
        filter += fmt::format("    fft_inverse_{}(first, tile, twiddles);\n", s - 1);
    text += sequence("fft_forward_block", "", forward) + sequence("fft_inverse_block", "", inverse);
    text += "#ifdef FFT_PUPIL\n" + sequence("fft_filter_block", " FFT_PUPIL_PARAMETERS", filter) + "#endif\n";
    return text;
}

} // namespace clsp
