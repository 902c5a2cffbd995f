#include "fft/cpu/codelets.hpp"

#include "fft/plan/butterfly.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace clsp {
namespace {

// Where the points of a butterfly come from or go to.
enum class Place { kTile, kMacro };

// Code for the butterfly of point j of the block that begins at `base`.
class StageText {
  public:
    StageText(const LineStage &stage, std::string indent) : stage_(stage), indent_(std::move(indent)) {}

    std::string read(Place place) const {
        std::string text;
        // What a point is made of can be long, so it is a loop; a kernel with room for it has it unrolled
        // (FFT_INPUT_LOOP), so that loads need not wait for sums.
        if (place == Place::kMacro)
            text = fmt::format("{0}lanes_f xr[{1}], xi[{1}];\n{0}FFT_INPUT_LOOP\n{0}for (uint q = 0; q < {1}u; ++q)\n"
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

    LineStage stage_;
    std::string indent_;
};

constexpr const char *kParameters = "FFT_TILE lanes_f *tile, __global const float *twiddles";

// Points of a last stage's butterfly that count: `ends` at its beginning and as many at its end, all of them where
// that is no fewer.
bool at_ends(std::uint32_t point, std::uint32_t radix, std::uint32_t ends) {
    return 2 * ends >= radix || point < ends || point + ends >= radix;
}

// The last stage of one block, which all leaves its points side by side. What is not at the ends is neither made nor
// written (forward), counts as zero and is not read (inverse), or both (filter: with the pupil and the way back in
// one, without a stop in the tile).
enum class Last { kForward, kInverse, kFilter };
std::string last_butterfly(Last what, std::uint32_t radix, std::uint32_t ends) {
    const std::string indent = "            ";
    const StageText step({radix, 1, 0}, indent);
    const auto counts = [&](std::uint32_t q) { return at_ends(q, radix, ends); };
    std::string text;
    Butterfly::Values values(radix);
    for (std::uint32_t q = 0; q < radix && ends > 0; ++q)
        if (what != Last::kInverse || counts(q)) {
            text += fmt::format(
                "{0}const lanes_f x{1}r = tile[2u * (base + {1}u)], x{1}i = tile[2u * (base + {1}u) + 1u];\n", indent,
                q);
            values[q] = {fmt::format("x{}r", q), fmt::format("x{}i", q)};
        }
    if (what != Last::kInverse && ends > 0) {
        Butterfly forward(indent, false, "f");
        values = forward.transform(values);
        text += forward.text();
        for (std::uint32_t q = 0; q < radix; ++q)
            if (!counts(q))
                values[q] = {};
            else if (what == Last::kFilter) {
                text += fmt::format("{0}lanes_f y{1}r = {2}, y{1}i = {3};\n{0}FFT_PUPIL(base + {1}u, y{1}r, y{1}i);\n",
                                    indent, q, values[q].re, values[q].im);
                values[q] = {fmt::format("y{}r", q), fmt::format("y{}i", q)};
            }
    }
    if (what != Last::kForward && ends > 0) {
        Butterfly inverse(indent, true);
        values = inverse.transform(values);
        text += inverse.text();
    }
    for (std::uint32_t q = 0; q < radix; ++q)
        if (!values[q].is_zero())
            text += fmt::format("{0}tile[2u * (base + {1}u)] = {2};\n{0}tile[2u * (base + {1}u) + 1u] = {3};\n", indent,
                                q, values[q].re, values[q].im);
        else if (what != Last::kForward)
            text +=
                fmt::format("{0}tile[2u * (base + {1}u)] = tile[2u * (base + {1}u) + 1u] = SPREAD(0.0f);\n", indent, q);
    return text;
}

std::string last_stage(const std::string &name, Last what, std::uint32_t radix, std::uint32_t block_length) {
    std::string text =
        fmt::format("static inline void {}(uint first, {} FFT_ENDS_PARAMETER{}) {{\n"
                    "    for (uint base = first; base < first + {}u; base += {}u)\n"
                    "        switch (FFT_ENDS_OF(base)) {{\n",
                    name, kParameters, what == Last::kFilter ? " FFT_PUPIL_PARAMETERS" : "", block_length, radix);
    for (const std::uint32_t ends : kEnds)
        if (2 * ends < radix)
            text += fmt::format("        case {}u: {{\n{}            break;\n        }}\n", ends,
                                last_butterfly(what, radix, ends));
    return text +
           fmt::format("        default: {{\n{}        }}\n        }}\n}}\n", last_butterfly(what, radix, radix));
}

// A function that takes every butterfly of a stage within one block of the first stage.
std::string block_stage(const std::string &name, const LineStage &stage, std::uint32_t block_length, bool inverse) {
    const StageText text(stage, "            ");
    const std::uint32_t span = stage.radix * stage.m;
    return fmt::format("static inline void {}(uint first, {}) {{\n"
                       "    for (uint base = first; base < first + {}u; base += {}u) {{\n"
                       "        for (uint j = 0; j < {}u; ++j) {{\n{}        }}\n    }}\n}}\n",
                       name, kParameters, block_length, span, stage.m, text.step(inverse, Place::kTile, Place::kTile));
}

// The matrix of `lanes` vectors changed over in place, two at a time at distance 1, 2, 4 .. Each pair's two new vectors
// take elements within quarters of four lanes or whole quarters: one instruction each, without a table of places. What
// is written element by element does not all become such instructions again.
std::string transpose(std::uint32_t lanes) {
    // The first vector of a pair takes element pick(l), those of the second vector count from `lanes` on; the second
    // vector takes what lies `step` behind.
    const auto within_pairs = [&](std::uint32_t l) { return l / 4 * 4 + l % 4 / 2 + l % 2 * lanes; };
    const auto pairs = [&](std::uint32_t l) { return l / 4 * 4 + l % 2 + l % 4 / 2 * lanes; };
    const auto quarters = [&](std::uint32_t l) { return l / 4 * 8 % lanes + l % 4 + l * 2 / lanes * lanes; };
    const auto pick = [&](std::uint32_t distance, std::uint32_t l) {
        return distance == 1 ? within_pairs(l) : distance == 2 ? pairs(l) : quarters(l);
    };
    std::string text = "// v[i] lane l becomes v[l] lane i.\nstatic inline void transpose_lanes(lanes_f *v) {\n",
                places;
    for (std::uint32_t distance = 1; distance < lanes; distance *= 2) {
        std::vector<std::uint32_t> low, high;
        for (std::uint32_t l = 0; l < lanes; ++l) {
            low.push_back(pick(distance, l));
            high.push_back(low.back() + (distance < 4 ? 2 : 4));
        }
        places += fmt::format("#define FFT_LOW_PLACES_{0} {1}\n#define FFT_HIGH_PLACES_{0} {2}\n", distance,
                              fmt::join(low, ", "), fmt::join(high, ", "));
        for (std::uint32_t i = 0; i < lanes; ++i)
            if (!(i & distance))
                text += fmt::format("    {{\n        const lanes_f a = v[{0}], b = v[{1}];\n"
                                    "        v[{0}] = shuffle_lanes(a, b, FFT_LOW_PLACES_{2});\n"
                                    "        v[{1}] = shuffle_lanes(a, b, FFT_HIGH_PLACES_{2});\n    }}\n",
                                    i, i + distance, distance);
    }
    // Columns 4 c + 1 and 4 c + 2 have ended in each other's places.
    for (std::uint32_t i = 0; i < lanes; i += 4)
        text += fmt::format(
            "    {{\n        const lanes_f a = v[{0}];\n        v[{0}] = v[{1}];\n        v[{1}] = a;\n    }}\n", i + 1,
            i + 2);
    return places + text + "}\n";
}

} // namespace

std::string cpu_codelets(const LinePlan &plan, std::uint32_t lanes) {
    const std::vector<LineStage> stages = stages_of(plan);
    const std::size_t count = stages.size();
    const std::uint32_t block = plan.block_length();
    std::string text = fmt::format("// {} points =", plan.length);
    for (const LineStage &stage : stages)
        text += fmt::format(" {}", stage.radix);
    text += fmt::format("\n#define FFT_LENGTH {}u\n#define FFT_BLOCKS {}u\n#define FFT_BLOCK_LENGTH {}u\n"
                        "#define FFT_TILE_VECTORS (2u * (FFT_LENGTH + 1u))\n",
                        plan.length, plan.radices.front(), block);
    // Without a table of its own a kernel has all points of a line.
    text += fmt::format("#ifdef FFT_ENDS\n"
                        "#define FFT_ENDS_PARAMETER , __global const uchar *ends\n"
                        "#define FFT_ENDS_ARGUMENT , ends\n"
                        "#define FFT_ENDS_OF(base) ends[(base) / {0}u]\n"
                        "#define FFT_ENDS_COUNT (FFT_LENGTH / {0}u)\n"
                        "#else\n"
                        "#define FFT_ENDS_PARAMETER\n"
                        "#define FFT_ENDS_ARGUMENT\n"
                        "#define FFT_ENDS_OF(base) {1}u\n"
                        "#endif\n"
                        "#ifndef FFT_INPUT_LOOP\n"
                        "#define FFT_INPUT_LOOP\n"
                        "#endif\n",
                        plan.radices.back(), kAllEnds);
    text += transpose(lanes);

    for (std::size_t s = 1; s < count; ++s) {
        const std::string forward = fmt::format("fft_forward_{}", s), inverse = fmt::format("fft_inverse_{}", s);
        if (s + 1 < count) {
            text += block_stage(forward, stages[s], block, false) + block_stage(inverse, stages[s], block, true);
            continue;
        }
        const std::uint32_t radix = stages[s].radix;
        text += last_stage(forward, Last::kForward, radix, block) + last_stage(inverse, Last::kInverse, radix, block) +
                "#ifdef FFT_PUPIL\n" + last_stage(fmt::format("fft_filter_{}", s), Last::kFilter, radix, block) +
                "#endif\n";
    }
    if (count == 1)
        text +=
            fmt::format("#ifdef FFT_PUPIL\nstatic inline void fft_filter_0(uint first, {} FFT_PUPIL_PARAMETERS) {{\n"
                        "    lanes_f re = tile[2u * first], im = tile[2u * first + 1u];\n"
                        "    FFT_PUPIL(first, re, im);\n"
                        "    tile[2u * first] = re;\n    tile[2u * first + 1u] = im;\n}}\n#endif\n",
                        kParameters);

    // First and last stage of the line as statements, so that the macros see the kernel's variables.
    const LineStage &outer = stages.front();
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
        return fmt::format("static inline void {}(uint block, {} FFT_ENDS_PARAMETER{}) {{\n    const uint first = "
                           "block * FFT_BLOCK_LENGTH;\n{}}}\n",
                           name, kParameters, more_parameters, body);
    };
    const auto call = [&](const char *what, std::size_t stage) {
        return fmt::format("    fft_{}_{}(first, tile, twiddles{});\n", what, stage,
                           stage + 1 == count ? " FFT_ENDS_ARGUMENT" : "");
    };
    std::string forward, inverse, filter;
    for (std::size_t s = 1; s < count; ++s)
        forward += call("forward", s);
    for (std::size_t s = count - 1; s >= 1; --s)
        inverse += call("inverse", s);
    for (std::size_t s = 1; s + 1 < count; ++s)
        filter += call("forward", s);
    filter += fmt::format("    fft_filter_{}(first, tile, twiddles{} FFT_PUPIL_ARGUMENTS);\n", count - 1,
                          count > 1 ? " FFT_ENDS_ARGUMENT" : "");
    for (std::size_t s = count - 1; s > 1; --s)
        filter += call("inverse", s - 1);
    text += sequence("fft_forward_block", "", forward) + sequence("fft_inverse_block", "", inverse);
    text += "#ifdef FFT_PUPIL\n" + sequence("fft_filter_block", " FFT_PUPIL_PARAMETERS", filter) + "#endif\n";
    return text;
}

std::vector<std::uint8_t> needed_ends(const LinePlan &plan, const std::function<bool(std::uint32_t)> &counts) {
    if (plan.radices.size() == 1)
        return {kAllEnds}; // the first stage is the last one, too: it takes all points
    const std::uint32_t radix = plan.radices.back();
    std::vector<std::uint8_t> table;
    for (std::uint32_t base = 0; base < plan.length; base += radix) {
        std::uint32_t needed = 0;
        for (std::uint32_t q = 0; q < radix; ++q)
            if (counts(base + q))
                needed = std::max(needed, std::min(q + 1, radix - q));
        std::uint8_t ends = kAllEnds;
        for (const std::uint8_t choice : kEnds)
            if (ends == kAllEnds && needed <= choice && 2u * choice < radix)
                ends = choice;
        table.push_back(ends);
    }
    return table;
}

bool within_ends(const LinePlan &plan, const std::vector<std::uint8_t> &ends, std::uint32_t position) {
    const std::uint32_t radix = plan.radices.back();
    return at_ends(position % radix, radix, ends[position / radix]);
}

} // namespace clsp
