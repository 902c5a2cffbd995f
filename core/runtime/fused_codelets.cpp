#include "runtime/fused_codelets.hpp"

#include <cmath>
#include <fmt/core.h>
#include <iterator>
#include <numeric>

namespace clsp {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Straight-line code of one butterfly. Every value gets a name of its own; the compiler finds the registers.
class Butterfly {
  public:
    struct Value {
        std::string re, im;
    };
    using Values = std::vector<Value>;

    Butterfly(std::string indent, bool inverse) : indent_(std::move(indent)), inverse_(inverse) {}

    const std::string &text() const { return text_; }

    // sum_q x[q] exp(-+ 2 pi i q k / n), k = 0 .. n - 1; + for the inverse.
    Values transform(const Values &x) {
        const std::size_t n = x.size();
        if (n == 1)
            return x;
        if (n == 2)
            return {sum(x[0], x[1]), difference(x[0], x[1])};
        if (n == 4)
            return transform_4(x);
        for (const std::size_t radix : {2u, 3u})
            if (n % radix == 0 && n > radix)
                return transform_composite(x, radix);
        return transform_prime(x);
    }

    // x times the twiddle factor of which `table` holds re and im, or its conjugate for the inverse.
    Value twiddled(const Value &x, const std::string &table) {
        const std::string re = name("lanes_f", fmt::format("SPREAD({}[0])", table)),
                          im = name("lanes_f", fmt::format("SPREAD({}[1])", table));
        return product(x, re, im, inverse_);
    }

  private:
    std::string name(const char *type, const std::string &expression) {
        std::string result = fmt::format("t{}", count_++);
        text_ += fmt::format("{}const {} {} = {};\n", indent_, type, result, expression);
        return result;
    }
    Value value(const std::string &re, const std::string &im) { return {name("lanes_f", re), name("lanes_f", im)}; }
    static std::string constant(double c) { return fmt::format("SPREAD({:a}f)", static_cast<float>(c)); }

    Value sum(const Value &a, const Value &b) { return value(a.re + " + " + b.re, a.im + " + " + b.im); }
    Value difference(const Value &a, const Value &b) { return value(a.re + " - " + b.re, a.im + " - " + b.im); }
    // a - i b, or a + i b.
    Value sum_turned(const Value &a, const Value &b, bool backwards) {
        return backwards ? value(a.re + " - " + b.im, a.im + " + " + b.re)
                         : value(a.re + " + " + b.im, a.im + " - " + b.re);
    }
    // (a.re + i a.im)(re + i im), or with the conjugate of the second.
    Value product(const Value &a, const std::string &re, const std::string &im, bool conjugate) {
        return conjugate ? value(fmt::format("fma({}, {}, {} * {})", a.im, im, a.re, re),
                                 fmt::format("fma(-{}, {}, {} * {})", a.re, im, a.im, re))
                         : value(fmt::format("fma(-{}, {}, {} * {})", a.im, im, a.re, re),
                                 fmt::format("fma({}, {}, {} * {})", a.re, im, a.im, re));
    }
    // a exp(-+ 2 pi i e / n).
    Value rotated(const Value &a, std::size_t e, std::size_t n) {
        e %= n;
        if (inverse_ && e != 0)
            e = n - e;
        if (e == 0)
            return a;
        if (4 * e % n == 0) {
            const std::size_t quarter = 4 * e / n;
            return quarter == 1 ? value(a.im, "-" + a.re) : quarter == 2 ? value("-" + a.re, "-" + a.im) : value("-" + a.im, a.re);
        }
        if (8 * e % n == 0) {
            const std::string c = constant(std::sqrt(0.5));
            const std::string plus = name("lanes_f", fmt::format("({} + {}) * {}", a.re, a.im, c)),
                              minus = name("lanes_f", fmt::format("({} - {}) * {}", a.im, a.re, c));
            switch (8 * e / n) {
            case 1:
                return {plus, minus};
            case 3:
                return value(minus, "-" + plus);
            case 5:
                return value("-" + plus, "-" + minus);
            default:
                return value("-" + minus, plus);
            }
        }
        const double angle = -2.0 * kPi * double(e) / double(n);
        return product(a, constant(std::cos(angle)), constant(std::sin(angle)), false);
    }

    Values transform_4(const Values &x) {
        const Value a = sum(x[0], x[2]), b = difference(x[0], x[2]), c = sum(x[1], x[3]), d = difference(x[1], x[3]);
        return {sum(a, c), sum_turned(b, d, inverse_), difference(a, c), sum_turned(b, d, !inverse_)};
    }

    // n = radix * m, by decimation in frequency.
    Values transform_composite(const Values &x, std::size_t radix) {
        const std::size_t n = x.size(), m = n / radix;
        std::vector<Values> blocks(radix, Values(m));
        for (std::size_t j = 0; j < m; ++j) {
            Values column(radix);
            for (std::size_t q = 0; q < radix; ++q)
                column[q] = x[j + q * m];
            column = transform(column);
            for (std::size_t k = 0; k < radix; ++k)
                blocks[k][j] = rotated(column[k], j * k, n);
        }
        Values result(n);
        for (std::size_t k = 0; k < radix; ++k) {
            const Values block = transform(blocks[k]);
            for (std::size_t f = 0; f < m; ++f)
                result[k + radix * f] = block[f];
        }
        return result;
    }

    // An odd prime: points j and n - j enter as their sum and their difference, with a cosine and a sine.
    Values transform_prime(const Values &x) {
        const std::size_t n = x.size(), half = (n - 1) / 2;
        Values sums, differences;
        for (std::size_t j = 1; j <= half; ++j) {
            sums.push_back(sum(x[j], x[n - j]));
            differences.push_back(difference(x[j], x[n - j]));
        }
        Values result(n);
        result[0] = x[0];
        for (const Value &s : sums)
            result[0] = sum(result[0], s);
        for (std::size_t k = 1; k <= half; ++k) {
            Value even = x[0], odd;
            for (std::size_t j = 1; j <= half; ++j) {
                const double angle = 2.0 * kPi * double(j * k % n) / double(n);
                const std::string c = constant(std::cos(angle)), s = constant(std::sin(angle));
                const Value &a = sums[j - 1], &b = differences[j - 1];
                even = value(fmt::format("fma({}, {}, {})", a.re, c, even.re), fmt::format("fma({}, {}, {})", a.im, c, even.im));
                odd = j == 1 ? value(fmt::format("{} * {}", b.re, s), fmt::format("{} * {}", b.im, s))
                             : value(fmt::format("fma({}, {}, {})", b.re, s, odd.re), fmt::format("fma({}, {}, {})", b.im, s, odd.im));
            }
            result[k] = sum_turned(even, odd, inverse_);
            result[n - k] = sum_turned(even, odd, !inverse_);
        }
        return result;
    }

    std::string indent_;
    bool inverse_;
    std::string text_;
    int count_ = 0;
};

// One stage of a plan.
struct Stage {
    std::uint32_t radix, m;
    std::uint32_t twiddles; // where its table begins, in floats
};

std::vector<Stage> stages_of(const FusedPlan &plan) {
    std::vector<Stage> stages;
    std::uint32_t block = plan.length, twiddles = 0;
    for (const std::uint32_t radix : plan.radices) {
        const std::uint32_t m = block / radix;
        stages.push_back({radix, m, twiddles});
        if (m > 1)
            twiddles += 2 * m * (radix - 1);
        block = m;
    }
    return stages;
}

// Where the points of a butterfly come from or go to.
enum class Place { kTile, kMacro };

// Code for the butterfly of point j of the block that begins at `base`.
class StageText {
  public:
    StageText(const Stage &stage, std::string indent) : stage_(stage), indent_(std::move(indent)) {}

    std::string read(Place place) const {
        std::string text;
        // What a point is made of can be long: once in the code is enough.
        if (place == Place::kMacro)
            text = fmt::format("{0}lanes_f xr[{1}], xi[{1}];\n{0}for (uint q = 0; q < {1}u; ++q)\n"
                               "{0}    FFT_INPUT(strip, base + j + q * {2}u, xr[q], xi[q]);\n",
                               indent_, stage_.radix, stage_.m);
        for (std::uint32_t q = 0; q < stage_.radix; ++q)
            text += place == Place::kTile
                        ? fmt::format("{0}const lanes_f x{1}r = tile[2u * ({2})], x{1}i = tile[2u * ({2}) + 1u];\n", indent_,
                                      q, point(q))
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
                text += fmt::format("{0}tile[2u * ({1})] = {2};\n{0}tile[2u * ({1}) + 1u] = {3};\n", indent_, at, values[q].re,
                                    values[q].im);
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
            values[k] = butterfly.twiddled(values[k], twiddle_table(k));
    }

    Stage stage_;
    std::string indent_;
};

constexpr const char *kParameters = "FFT_TILE lanes_f *tile, __global const float *twiddles";

// A function that takes every butterfly of a stage within one block of the first stage.
std::string block_stage(const std::string &name, const Stage &stage, std::uint32_t block_length, bool inverse) {
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
            text += fmt::format("    {{\n        const lanes_f a = v[{0}], b = v[{1}];\n        v[{0}] = (lanes_f)({2});\n"
                                "        v[{1}] = (lanes_f)({3});\n    }}\n",
                                i, i + step, low, high);
        }
    return text + "}\n";
}

} // namespace

std::string fused_codelets(const FusedPlan &plan, std::uint32_t lanes) {
    const std::vector<Stage> stages = stages_of(plan);
    const std::size_t count = stages.size();
    const std::uint32_t block = plan.block_length();
    std::string text = fmt::format("// {} points =", plan.length);
    for (const Stage &stage : stages)
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
        const Stage &stage = stages[s];
        const StageText step(stage, "        ");
        Butterfly forward("        ", false);
        const Butterfly::Values spectrum = forward.transform(step.inputs());
        text += fmt::format("#ifdef FFT_PUPIL\nstatic inline void fft_filter_{}(uint first, {} FFT_PUPIL_PARAMETERS) {{\n"
                            "    const uint j = 0;\n    for (uint base = first; base < first + {}u; base += {}u) {{\n",
                            s, kParameters, block, stage.radix);
        text += step.read(Place::kTile) + forward.text();
        Butterfly::Values filtered;
        for (std::uint32_t q = 0; q < stage.radix; ++q) {
            text += fmt::format("        lanes_f y{0}r = {1}, y{0}i = {2};\n        FFT_PUPIL(base + {0}u, y{0}r, y{0}i);\n", q,
                                spectrum[q].re, spectrum[q].im);
            filtered.push_back({fmt::format("y{}r", q), fmt::format("y{}i", q)});
        }
        Butterfly inverse("            ", true);
        const Butterfly::Values result = inverse.transform(filtered);
        text += "        {\n" + inverse.text() + StageText(stage, "            ").write(Place::kTile, result) +
                "        }\n    }\n}\n#endif\n";
    }
    if (count == 1)
        text += fmt::format("#ifdef FFT_PUPIL\nstatic inline void fft_filter_0(uint first, {} FFT_PUPIL_PARAMETERS) {{\n"
                            "    lanes_f re = tile[2u * first], im = tile[2u * first + 1u];\n"
                            "    FFT_PUPIL(first, re, im);\n"
                            "    tile[2u * first] = re;\n    tile[2u * first + 1u] = im;\n}}\n#endif\n",
                            kParameters);

    // First and last stage of the line as statements, so that the macros see the kernel's variables.
    const Stage &outer = stages.front();
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
        return fmt::format("static inline void {}(uint block, {}{}) {{\n    const uint first = block * FFT_BLOCK_LENGTH;\n{}}}\n", name,
                           kParameters, more_parameters, body);
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
