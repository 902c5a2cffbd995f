#include "fft/gpu/codelets.hpp"

#include "fft/plan/butterfly.hpp"

#include <algorithm>
#include <fmt/core.h>
#include <limits>

namespace clsp {
namespace {

// Of a butterfly's twiddle factors w^k, k = 1 .. radix - 1, those with k below 4 and the multiples of 4 are read; the
// others are products of two of them, where that saves reads: they wait for memory, and hold registers while they do. A
// product has half an ulp more of error.
constexpr std::uint32_t kTwiddleBase = 4, kLeastRadixOfProducts = 8;

bool is_read(std::uint32_t k, std::uint32_t radix) {
    return radix < kLeastRadixOfProducts || k < kTwiddleBase || k % kTwiddleBase == 0;
}

std::uint32_t reads_below(std::uint32_t k, std::uint32_t radix) {
    std::uint32_t count = 0;
    for (std::uint32_t i = 1; i < k; ++i)
        count += is_read(i, radix) ? 1 : 0;
    return count;
}

std::uint32_t rounds(std::uint32_t count, std::uint32_t items) {
    return (count + items - 1) / items;
}

// A stop in the tile is followed by the points of another stage, which are an even number of points apart where radices
// are even: a point of room behind every block of the last stage makes that odd.
std::uint32_t room_every(const LinePlan &plan) {
    return plan.radices.size() > 1 && plan.radices.back() % 2 == 0 ? plan.radices.back() : 0;
}

std::uint32_t tile_points(const LinePlan &plan) {
    const std::uint32_t every = room_every(plan);
    return plan.length + (every ? plan.length / every : 0);
}

// Code of one stage: the butterflies b = t, t + items, .. of a line.
class GpuStage {
  public:
    GpuStage(const LinePlan &plan, const LineStage &stage, std::size_t number, std::uint32_t items,
             std::uint32_t first_twiddle, const PassBand &band)
        : plan_(plan), stage_(stage), number_(number), items_(items), first_twiddle_(first_twiddle),
          butterflies_(plan.length / stage.radix), band_(band) {}

    // How many of the table are its own.
    std::uint32_t twiddles() const { return stage_.m > 1 ? reads_below(stage_.radix, stage_.radix) * stage_.m : 0; }

    // The numbers of its butterflies, and where their points are.
    std::string defines(const char *name, const char *small_name) const {
        return fmt::format("#define {0}_RADIX {2}u\n#define {0}_BUTTERFLIES {3}u\n#define {0}_COUNT {4}u\n"
                           "#define {1}_takes(b) {5}\n#define {1}_point(b, q) ({6})\n",
                           name, small_name, stage_.radix, butterflies_, rounds(butterflies_, items_),
                           exact() ? "1" : fmt::format("((b) < {}u)", butterflies_),
                           stage_.m == 1 ? fmt::format("(b) * {}u + (q)", stage_.radix)
                                         : fmt::format("(b) + (q) * {}u", stage_.m));
    }

    // From the points in registers to the points in registers.
    std::string step(bool inverse) const {
        Butterfly butterfly("        ", inverse);
        Butterfly::Values values;
        std::string body;
        for (std::uint32_t q = 0; q < stage_.radix; ++q) {
            if (inverse && stage_.m == 1 && (band_.never >> q & 1u)) {
                values.emplace_back(); // zero: neither read nor added
                continue;
            }
            body += fmt::format("        const lanes_f x{0}r = re[{1}], x{0}i = im[{1}];\n", q, point(q));
            values.push_back({fmt::format("x{}r", q), fmt::format("x{}i", q)});
        }
        std::string factors;
        if (stage_.m > 1) {
            factors += fmt::format("        __global const float2 *w = twiddles + {};\n",
                                   butterflies_ == stage_.m ? "b" : fmt::format("b % {}u", stage_.m));
            for (std::uint32_t k = 1; k < stage_.radix; ++k) {
                const std::uint32_t high = k / kTwiddleBase * kTwiddleBase, low = k - high;
                factors +=
                    is_read(k, stage_.radix)
                        ? fmt::format("        const float2 w{} = w[{}u];\n", k,
                                      first_twiddle_ + reads_below(k, stage_.radix) * stage_.m)
                        : fmt::format("        const float2 w{0} = (float2)(fma(-w{1}.y, w{2}.y, w{1}.x * w{2}.x), "
                                      "fma(w{1}.y, w{2}.x, w{1}.x * w{2}.y));\n",
                                      k, high, low);
            }
        }
        if (inverse)
            twiddle(butterfly, values);
        values = butterfly.transform(values);
        if (!inverse)
            twiddle(butterfly, values);
        body += factors + butterfly.text();
        for (std::uint32_t q = 0; q < stage_.radix; ++q) {
            const Butterfly::Value value = values[q].is_zero() ? Butterfly::Value{"0.0f", "0.0f"} : values[q];
            body += fmt::format("        re[{0}] = {1};\n        im[{0}] = {2};\n", point(q), value.re, value.im);
        }
        return function(fmt::format("fft_{}_{}", inverse ? "inverse" : "forward", number_),
                        "lanes_f *re, lanes_f *im, __global const float2 *twiddles", body);
    }

    // Its points between registers and the tile.
    std::string exchange() const {
        const std::uint32_t every = room_every(plan_), span = stage_.radix * stage_.m;
        std::string at;
        std::uint32_t apart = stage_.m;
        if (stage_.m == 1) {
            at = fmt::format("b * {}u", span + (every ? 1 : 0));
        } else {
            // Blocks and strides of this stage are multiples of the last one's.
            const std::uint32_t room = every ? span / every : 0;
            apart += every ? stage_.m / every : 0;
            const bool one_block = butterflies_ == stage_.m;
            const std::string j = one_block ? "b" : fmt::format("(b % {}u)", stage_.m);
            at = (one_block ? std::string() : fmt::format("b / {}u * {}u + ", stage_.m, span + room)) + j +
                 (every ? fmt::format(" + {} / {}u", j, every) : std::string());
        }
        // A pointer and constants behind it: a sum of numbers may wrap around, so that compilers keep each by itself.
        std::string put = fmt::format("        __local lanes_f *points = tile + FFT_TILE_STRIDE * ({});\n", at),
                    take = fmt::format("        __local const lanes_f *points = tile + FFT_TILE_STRIDE * ({});\n", at);
        for (std::uint32_t q = 0; q < stage_.radix; ++q) {
            const std::string place = fmt::format("points[FFT_TILE_STRIDE * {}u]", q * apart);
            put += fmt::format("        {} = v[{}];\n", place, point(q));
            take += fmt::format("        v[{}] = {};\n", point(q), place);
        }
        return function(fmt::format("fft_put_{}", number_), "const lanes_f *v, __local lanes_f *tile", put) +
               function(fmt::format("fft_take_{}", number_), "lanes_f *v, __local const lanes_f *tile", take);
    }

  private:
    bool exact() const { return butterflies_ % items_ == 0; }
    std::string point(std::uint32_t q) const {
        return rounds(butterflies_, items_) == 1 ? fmt::format("{}", q) : fmt::format("{}u * c + {}u", stage_.radix, q);
    }

    // The body for each of the work-item's butterflies.
    std::string function(const std::string &name, const char *parameters, const std::string &body) const {
        const std::uint32_t count = rounds(butterflies_, items_);
        std::string text = fmt::format("static inline ALWAYS_INLINE void {}(uint t, {}) {{\n", name, parameters);
        if (count == 1)
            text += "    const uint b = t;\n    {\n";
        else
            text += fmt::format(
                "#pragma unroll\n    for (uint c = 0; c < {}u; ++c) {{\n        const uint b = t + c * {}u;\n", count,
                items_);
        if (exact())
            return text + body + "    }\n}\n";
        return text + fmt::format("        if (b < {}u) {{\n", butterflies_) + body + "        }\n    }\n}\n";
    }

    void twiddle(Butterfly &butterfly, Butterfly::Values &values) const {
        if (stage_.m == 1)
            return;
        for (std::uint32_t k = 1; k < stage_.radix; ++k)
            values[k] = butterfly.twiddled(values[k], fmt::format("w{}.x", k), fmt::format("w{}.y", k));
    }

    const LinePlan &plan_;
    LineStage stage_;
    std::size_t number_;
    std::uint32_t items_, first_twiddle_, butterflies_;
    PassBand band_;
};

// Points go from one stage's work-items to another's. What a work-item puts down it has read itself, so that nobody
// waits before.
std::string exchange(std::size_t from, std::size_t to, bool split) {
    const char *barrier = "    barrier(CLK_LOCAL_MEM_FENCE);\n";
    const auto put = [&](const char *values, const char *tile) {
        return fmt::format("    fft_put_{}(t, {}, {});\n", from, values, tile);
    };
    const auto take = [&](const char *values, const char *tile) {
        return fmt::format("    fft_take_{}(t, {}, {});\n", to, values, tile);
    };
    if (split)
        return put("re", "tile") + barrier + take("re", "tile") + barrier + put("im", "tile") + barrier +
               take("im", "tile");
    return put("re", "tile") + put("im", "tile + FFT_PLANE") + barrier + take("re", "tile") +
           take("im", "tile + FFT_PLANE");
}

} // namespace

PassBand pass_band(const LinePlan &plan, const std::vector<bool> &passes) {
    const std::uint32_t radix = plan.radices.back();
    PassBand band{0, (1u << radix) - 1u};
    band.always = band.never;
    for (std::uint32_t position = 0; position < plan.length; ++position)
        (passes[plan.frequencies[position]] ? band.never : band.always) &= ~(1u << position % radix);
    return band;
}

std::uint32_t points_per_item(const LinePlan &plan, std::uint32_t items) {
    std::uint32_t most = 0;
    for (const std::uint32_t radix : plan.radices)
        most = std::max(most, rounds(plan.length / radix, items) * radix);
    return most;
}

namespace {

// Points in registers, the best first: sixteen leave room for what else a kernel needs.
constexpr std::uint32_t kPointsPerItem[] = {16, 32, kMostPointsPerItem};

// More work-items for a line have nothing to do in any stage.
std::uint32_t most_butterflies(const LinePlan &plan) {
    return plan.length / *std::min_element(plan.radices.begin(), plan.radices.end());
}

// As few points for each of at most `limit` work-items of a line as may be: all of a long line's in one work-item would
// be a kernel that compilers take minutes for.
std::uint32_t fewest_points(const LinePlan &plan, std::uint32_t limit) {
    std::uint32_t fewest = plan.length;
    for (std::uint32_t items = 1; items <= std::min(limit, most_butterflies(plan)); ++items)
        fewest = std::min(fewest, points_per_item(plan, items));
    return fewest;
}

} // namespace

std::uint32_t items_for(const LinePlan &plan, std::uint32_t limit, std::uint32_t points) {
    std::uint32_t best = 0;
    std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
    const std::uint32_t most = std::min(limit, most_butterflies(plan));
    for (std::uint32_t items = 1; items <= most; ++items) {
        if (points_per_item(plan, items) > points)
            continue;
        std::uint64_t slots = 0; // for points, all work-items and stages, idle ones included
        for (const std::uint32_t radix : plan.radices)
            slots += std::uint64_t{items} * rounds(plan.length / radix, items) * radix;
        if (slots < least) {
            least = slots;
            best = items;
        }
    }
    return best;
}

std::uint64_t gpu_tile_bytes(const LinePlan &plan, const WorkGroupShape &shape) {
    return std::uint64_t{tile_points(plan)} * shape.lines * (shape.split ? 1 : 2) * sizeof(float);
}

std::optional<WorkGroupShape> choose_shape(const LinePlan &plan, const WorkGroupLimits &limits, bool across) {
    constexpr std::uint32_t kWavefront = 64;
    const std::uint32_t work_items = std::min(limits.work_items, kMostWorkItems);
    // points 0: as few as may be.
    const auto fitting = [&](std::uint32_t lines, std::uint32_t points) -> std::optional<WorkGroupShape> {
        const std::uint32_t limit = work_items / lines;
        const std::uint32_t items = items_for(plan, limit, points ? points : fewest_points(plan, limit));
        for (const bool split : {false, true}) {
            const WorkGroupShape shape{lines, items, split, across};
            if (items != 0 && gpu_tile_bytes(plan, shape) <= limits.local_bytes)
                return shape;
        }
        return {};
    };
    if (across) {
        for (const std::vector<std::uint32_t> &counts : {std::vector<std::uint32_t>{8, 4}, {2}, {1}})
            for (const std::uint32_t points : kPointsPerItem)
                for (const std::uint32_t lines : counts)
                    if (const auto shape = fitting(lines, points))
                        return shape;
        return fitting(1, 0);
    }
    for (const std::uint32_t points : kPointsPerItem) {
        std::optional<WorkGroupShape> best;
        for (const std::uint32_t lines : {1u, 2u, 4u, 8u}) {
            const std::optional<WorkGroupShape> shape = fitting(lines, points);
            if (shape && (!best || !shape->split))
                best = shape;
            if (best && best->work_items() >= kWavefront)
                break;
        }
        if (best)
            return best;
    }
    return fitting(1, 0);
}

namespace {

// With the tile whole if it fits, else split; none if it does not fit either way.
std::optional<WorkGroupShape> with_tile(const LinePlan &plan, WorkGroupShape shape, const WorkGroupLimits &limits) {
    if (shape.items == 0 || shape.work_items() > limits.work_items)
        return {};
    for (const bool split : {false, true}) {
        shape.split = split;
        if (gpu_tile_bytes(plan, shape) <= limits.local_bytes)
            return shape;
    }
    return {};
}

// Work-items for a line that do not hold more points than may be.
std::uint32_t good_items(const LinePlan &plan, std::uint32_t limit) {
    for (const std::uint32_t points : kPointsPerItem)
        if (const std::uint32_t items = items_for(plan, limit, points); items != 0)
            return items;
    return items_for(plan, limit, fewest_points(plan, limit));
}

} // namespace

std::optional<WorkGroupShape> picked_shape(const LinePlan &plan, const WorkGroupLimits &limits, bool across,
                                           const WorkGroup &pick) {
    if (pick.lines == 0 || pick.lines > limits.work_items || pick.items > most_butterflies(plan))
        return {};
    const std::uint32_t items =
        pick.items ? pick.items : good_items(plan, std::min(limits.work_items, kMostWorkItems) / pick.lines);
    return with_tile(plan, {pick.lines, items, false, across}, limits);
}

std::vector<WorkGroup> work_groups_to_try(const LinePlan &plan, const WorkGroupLimits &limits, bool across) {
    std::vector<WorkGroup> picks;
    for (const std::uint32_t lines : {1u, 2u, 4u, 8u, 16u})
        for (const std::uint32_t points : {8u, 16u, 32u}) {
            const WorkGroup pick{lines, items_for(plan, limits.work_items / lines, points)};
            if (pick.items != 0 && std::find(picks.begin(), picks.end(), pick) == picks.end() &&
                picked_shape(plan, limits, across, pick))
                picks.push_back(pick);
        }
    return picks;
}

std::optional<WorkGroupShape> smaller_shape(const LinePlan &plan, const WorkGroupShape &shape,
                                            const WorkGroupLimits &limits, std::uint32_t lines_of) {
    // Never larger than it was: a kernel whose limits change with its shape must not be asked in circles.
    const std::uint64_t tile_bytes = gpu_tile_bytes(plan, shape);
    const WorkGroupLimits smaller{std::min(limits.work_items, shape.work_items()),
                                  std::min(limits.local_bytes, tile_bytes)};
    // Fewer lines before more points in registers.
    for (const bool over_budget : {false, true})
        for (std::uint32_t lines = shape.lines; lines >= lines_of; lines /= 2) {
            const std::uint32_t items = good_items(plan, smaller.work_items / lines);
            if (lines % lines_of != 0 || items == 0 ||
                (points_per_item(plan, items) > kMostPointsPerItem) != over_budget)
                continue;
            const auto fitting = with_tile(plan, {lines, items, false, shape.across}, smaller);
            if (fitting && (fitting->work_items() < shape.work_items() || gpu_tile_bytes(plan, *fitting) < tile_bytes))
                return fitting;
        }
    return {};
}

std::string gpu_codelets(const LinePlan &plan, const WorkGroupShape &shape, const PassBand &band) {
    const std::vector<LineStage> stages = stages_of(plan);
    std::string text = fmt::format("// {} points =", plan.length);
    for (const LineStage &stage : stages)
        text += fmt::format(" {}", stage.radix);
    const std::uint32_t points = tile_points(plan), every = room_every(plan);
    text += fmt::format(
        "\n#define FFT_LENGTH {}u\n#define FFT_LINES {}u\n#define FFT_ITEMS {}u\n#define FFT_WORK_ITEMS {}\n"
        "#define FFT_ACROSS {}\n#define FFT_POINTS {}\n#define FFT_TILE_STRIDE {}u\n#define FFT_LINE_STRIDE {}u\n"
        "#define FFT_PLANE {}u\n#define fft_tile_at(p) ({})\n#define FFT_LAST_ALWAYS {:#x}u\n#define FFT_LAST_NEVER "
        "{:#x}u\n",
        plan.length, shape.lines, shape.items, shape.work_items(), shape.across ? 1 : 0,
        points_per_item(plan, shape.items), shape.across ? shape.lines : 1, shape.across ? 1 : points,
        points * shape.lines, every ? fmt::format("(p) + (p) / {}u", every) : std::string("(p)"), band.always,
        band.never);
    std::string forward, inverse;
    const std::size_t count = stages.size();
    std::uint32_t twiddles = 0;
    for (std::size_t s = 0; s < count; ++s) {
        const GpuStage stage(plan, stages[s], s, shape.items, twiddles, band);
        twiddles += stage.twiddles();
        if (s == 0)
            text += stage.defines("FFT_FIRST", "fft_first");
        if (s + 1 == count)
            text += stage.defines("FFT_LAST", "fft_last");
        text += stage.step(false) + stage.step(true);
        if (count > 1)
            text += stage.exchange();
        if (s > 0)
            forward += exchange(s - 1, s, shape.split);
        forward += fmt::format("    fft_forward_{}(t, re, im, twiddles);\n", s);
        const std::size_t back = count - 1 - s;
        if (s > 0)
            inverse += exchange(back + 1, back, shape.split);
        inverse += fmt::format("    fft_inverse_{}(t, re, im, twiddles);\n", back);
    }
    for (const auto &[name, body] : {std::pair{"fft_forward", forward}, std::pair{"fft_inverse", inverse}})
        text +=
            fmt::format("static inline ALWAYS_INLINE void {}(uint t, lanes_f *re, lanes_f *im, __local lanes_f *tile,\n"
                        "                                    __global const float2 *twiddles) {{\n{}}}\n",
                        name, body);
    return text;
}

std::vector<float> gpu_twiddles(const LinePlan &plan) {
    std::vector<float> result;
    for (const LineStage &stage : stages_of(plan))
        if (stage.m > 1)
            for (std::uint32_t k = 1; k < stage.radix; ++k)
                for (std::uint32_t j = 0; is_read(k, stage.radix) && j < stage.m; ++j)
                    for (std::uint32_t part = 0; part < 2; ++part)
                        result.push_back(plan.twiddles[stage.twiddles + 2 * (j * (stage.radix - 1) + k - 1) + part]);
    return result;
}

} // namespace clsp
