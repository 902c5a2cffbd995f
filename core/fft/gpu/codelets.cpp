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
std::uint32_t room_every(const FusedPlan &plan) {
    return plan.radices.size() > 1 && plan.radices.back() % 2 == 0 ? plan.radices.back() : 0;
}

std::uint32_t tile_points(const FusedPlan &plan) {
    const std::uint32_t every = room_every(plan);
    return plan.length + (every ? plan.length / every : 0);
}

// Code of one stage: the butterflies b = t, t + items, .. of a line.
class GroupStage {
  public:
    GroupStage(const FusedPlan &plan, const FusedStage &stage, std::size_t number, std::uint32_t items,
               std::uint32_t first_twiddle, const GroupBand &band)
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
            body += fmt::format("        const lanes_f x{0}r = re[{1}], x{0}i = im[{1}];\n", q, held(q));
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
            body += fmt::format("        re[{0}] = {1};\n        im[{0}] = {2};\n", held(q), value.re, value.im);
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
            put += fmt::format("        {} = v[{}];\n", place, held(q));
            take += fmt::format("        v[{}] = {};\n", held(q), place);
        }
        return function(fmt::format("fft_put_{}", number_), "const lanes_f *v, __local lanes_f *tile", put) +
               function(fmt::format("fft_take_{}", number_), "lanes_f *v, __local const lanes_f *tile", take);
    }

  private:
    bool exact() const { return butterflies_ % items_ == 0; }
    std::string held(std::uint32_t q) const {
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

    const FusedPlan &plan_;
    FusedStage stage_;
    std::size_t number_;
    std::uint32_t items_, first_twiddle_, butterflies_;
    GroupBand band_;
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

GroupBand group_band(const FusedPlan &plan, const std::vector<bool> &passes) {
    const std::uint32_t radix = plan.radices.back();
    GroupBand band{0, (1u << radix) - 1u};
    band.always = band.never;
    for (std::uint32_t position = 0; position < plan.length; ++position)
        (passes[plan.frequencies[position]] ? band.never : band.always) &= ~(1u << position % radix);
    return band;
}

std::uint32_t held_points(const FusedPlan &plan, std::uint32_t items) {
    std::uint32_t most = 0;
    for (const std::uint32_t radix : plan.radices)
        most = std::max(most, rounds(plan.length / radix, items) * radix);
    return most;
}

namespace {

// Points in registers, the best first: sixteen leave room for what else a kernel needs.
constexpr std::uint32_t kHeldPoints[] = {16, 32, kMostHeldPoints};

// More work-items for a line have nothing to do in any stage.
std::uint32_t most_butterflies(const FusedPlan &plan) {
    return plan.length / *std::min_element(plan.radices.begin(), plan.radices.end());
}

// As few points for each of at most `limit` work-items of a line as may be: all of a long line's in one work-item would
// be a kernel that compilers take minutes for.
std::uint32_t fewest_held(const FusedPlan &plan, std::uint32_t limit) {
    std::uint32_t fewest = plan.length;
    for (std::uint32_t items = 1; items <= std::min(limit, most_butterflies(plan)); ++items)
        fewest = std::min(fewest, held_points(plan, items));
    return fewest;
}

} // namespace

std::uint32_t items_for(const FusedPlan &plan, std::uint32_t limit, std::uint32_t held) {
    std::uint32_t best = 0;
    std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
    const std::uint32_t most = std::min(limit, most_butterflies(plan));
    for (std::uint32_t items = 1; items <= most; ++items) {
        if (held_points(plan, items) > held)
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

std::uint64_t group_tile_bytes(const FusedPlan &plan, const GroupShape &shape) {
    return std::uint64_t{tile_points(plan)} * shape.lines * (shape.split ? 1 : 2) * sizeof(float);
}

std::optional<GroupShape> choose_group_shape(const FusedPlan &plan, const GroupLimits &limits, bool across) {
    constexpr std::uint32_t kWavefront = 64;
    const std::uint32_t group_items = std::min(limits.group_items, kMostGroupItems);
    // held 0: as few as may be.
    const auto fitting = [&](std::uint32_t lines, std::uint32_t held) -> std::optional<GroupShape> {
        const std::uint32_t limit = group_items / lines;
        const std::uint32_t items = items_for(plan, limit, held ? held : fewest_held(plan, limit));
        for (const bool split : {false, true}) {
            const GroupShape shape{lines, items, split, across};
            if (items != 0 && group_tile_bytes(plan, shape) <= limits.local_bytes)
                return shape;
        }
        return {};
    };
    if (across) {
        for (const std::vector<std::uint32_t> &counts : {std::vector<std::uint32_t>{8, 4}, {2}, {1}})
            for (const std::uint32_t held : kHeldPoints)
                for (const std::uint32_t lines : counts)
                    if (const auto shape = fitting(lines, held))
                        return shape;
        return fitting(1, 0);
    }
    for (const std::uint32_t held : kHeldPoints) {
        std::optional<GroupShape> best;
        for (const std::uint32_t lines : {1u, 2u, 4u, 8u}) {
            const std::optional<GroupShape> shape = fitting(lines, held);
            if (shape && (!best || !shape->split))
                best = shape;
            if (best && best->group_items() >= kWavefront)
                break;
        }
        if (best)
            return best;
    }
    return fitting(1, 0);
}

namespace {

// With the tile whole if it fits, else split; none if it does not fit either way.
std::optional<GroupShape> with_tile(const FusedPlan &plan, GroupShape shape, const GroupLimits &limits) {
    if (shape.items == 0 || shape.group_items() > limits.group_items)
        return {};
    for (const bool split : {false, true}) {
        shape.split = split;
        if (group_tile_bytes(plan, shape) <= limits.local_bytes)
            return shape;
    }
    return {};
}

// Work-items for a line that do not hold more points than may be.
std::uint32_t good_items(const FusedPlan &plan, std::uint32_t limit) {
    for (const std::uint32_t held : kHeldPoints)
        if (const std::uint32_t items = items_for(plan, limit, held); items != 0)
            return items;
    return items_for(plan, limit, fewest_held(plan, limit));
}

} // namespace

std::optional<GroupShape> picked_group_shape(const FusedPlan &plan, const GroupLimits &limits, bool across,
                                             const GroupPick &pick) {
    if (pick.lines == 0 || pick.lines > limits.group_items || pick.items > most_butterflies(plan))
        return {};
    const std::uint32_t items =
        pick.items ? pick.items : good_items(plan, std::min(limits.group_items, kMostGroupItems) / pick.lines);
    return with_tile(plan, {pick.lines, items, false, across}, limits);
}

std::vector<GroupPick> group_picks(const FusedPlan &plan, const GroupLimits &limits, bool across) {
    std::vector<GroupPick> picks;
    for (const std::uint32_t lines : {1u, 2u, 4u, 8u, 16u})
        for (const std::uint32_t held : {8u, 16u, 32u}) {
            const GroupPick pick{lines, items_for(plan, limits.group_items / lines, held)};
            if (pick.items != 0 && std::find(picks.begin(), picks.end(), pick) == picks.end() &&
                picked_group_shape(plan, limits, across, pick))
                picks.push_back(pick);
        }
    return picks;
}

std::optional<GroupShape> smaller_group_shape(const FusedPlan &plan, const GroupShape &shape, const GroupLimits &limits,
                                              std::uint32_t lines_of) {
    // Never larger than it was: a kernel whose limits change with its shape must not be asked in circles.
    const std::uint64_t tile_bytes = group_tile_bytes(plan, shape);
    const GroupLimits smaller{std::min(limits.group_items, shape.group_items()),
                              std::min(limits.local_bytes, tile_bytes)};
    // Fewer lines before more points in registers.
    for (const bool is_makeshift : {false, true})
        for (std::uint32_t lines = shape.lines; lines >= lines_of; lines /= 2) {
            const std::uint32_t items = good_items(plan, smaller.group_items / lines);
            if (lines % lines_of != 0 || items == 0 || (held_points(plan, items) > kMostHeldPoints) != is_makeshift)
                continue;
            const auto fitting = with_tile(plan, {lines, items, false, shape.across}, smaller);
            if (fitting &&
                (fitting->group_items() < shape.group_items() || group_tile_bytes(plan, *fitting) < tile_bytes))
                return fitting;
        }
    return {};
}

std::string group_codelets(const FusedPlan &plan, const GroupShape &shape, const GroupBand &band) {
    const std::vector<FusedStage> stages = stages_of(plan);
    std::string text = fmt::format("// {} points =", plan.length);
    for (const FusedStage &stage : stages)
        text += fmt::format(" {}", stage.radix);
    const std::uint32_t points = tile_points(plan), every = room_every(plan);
    text += fmt::format(
        "\n#define FFT_LENGTH {}u\n#define FFT_LINES {}u\n#define FFT_ITEMS {}u\n#define FFT_GROUP_ITEMS {}\n"
        "#define FFT_ACROSS {}\n#define FFT_HELD {}\n#define FFT_TILE_STRIDE {}u\n#define FFT_LINE_STRIDE {}u\n"
        "#define FFT_PLANE {}u\n#define fft_tile_at(p) ({})\n#define FFT_LAST_ALWAYS {:#x}u\n#define FFT_LAST_NEVER "
        "{:#x}u\n",
        plan.length, shape.lines, shape.items, shape.group_items(), shape.across ? 1 : 0,
        held_points(plan, shape.items), shape.across ? shape.lines : 1, shape.across ? 1 : points, points * shape.lines,
        every ? fmt::format("(p) + (p) / {}u", every) : std::string("(p)"), band.always, band.never);
    std::string forward, inverse;
    const std::size_t count = stages.size();
    std::uint32_t twiddles = 0;
    for (std::size_t s = 0; s < count; ++s) {
        const GroupStage stage(plan, stages[s], s, shape.items, twiddles, band);
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

std::vector<float> group_twiddles(const FusedPlan &plan) {
    std::vector<float> result;
    for (const FusedStage &stage : stages_of(plan))
        if (stage.m > 1)
            for (std::uint32_t k = 1; k < stage.radix; ++k)
                for (std::uint32_t j = 0; is_read(k, stage.radix) && j < stage.m; ++j)
                    for (std::uint32_t part = 0; part < 2; ++part)
                        result.push_back(plan.twiddles[stage.twiddles + 2 * (j * (stage.radix - 1) + k - 1) + part]);
    return result;
}

} // namespace clsp
