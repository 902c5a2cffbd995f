// What both orders of the passes share: which lengths there are, the aperture, and the pass in the middle, which takes
// one column block of lines through transform, aperture and inverse transform.
#pragma once

#include "native/line_plan.hpp"
#include "native/native_passes.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace native {

// Radices of a length. Eights fit 32 registers; the first one leaves blocks for the first-level cache.
template <unsigned N> struct PlanOf;
#define NATIVE_PLAN(length, ...)                                                                                       \
    template <> struct PlanOf<length> {                                                                                \
        using type = Plan<__VA_ARGS__>;                                                                                \
        static_assert(type::kLength == length);                                                                        \
    };
NATIVE_PLAN(16, 4, 4)
NATIVE_PLAN(32, 8, 4)
NATIVE_PLAN(64, 8, 8)
NATIVE_PLAN(80, 8, 10)
NATIVE_PLAN(96, 12, 8)
NATIVE_PLAN(120, 8, 3, 5)
NATIVE_PLAN(128, 8, 4, 4)
NATIVE_PLAN(160, 5, 8, 4)
NATIVE_PLAN(240, 8, 6, 5)
NATIVE_PLAN(256, 8, 8, 4)
NATIVE_PLAN(512, 8, 8, 8)
NATIVE_PLAN(720, 5, 9, 4, 4)
NATIVE_PLAN(1024, 8, 8, 4, 4)
NATIVE_PLAN(1080, 8, 5, 9, 3)
NATIVE_PLAN(1280, 8, 5, 8, 4)
NATIVE_PLAN(1920, 8, 8, 5, 6)
NATIVE_PLAN(2048, 8, 8, 8, 4)
NATIVE_PLAN(4096, 8, 8, 8, 8)
#undef NATIVE_PLAN

// Of the lengths N the table of the one that equals `length`.
template <class T> struct Entry {
    std::uint32_t length;
    T table;
};
template <class T> T entry_of(std::uint32_t length, std::initializer_list<Entry<T>> entries, const char *what) {
    for (const Entry<T> &entry : entries)
        if (entry.length == length)
            return entry.table;
    throw std::invalid_argument("no native transform of " + std::to_string(length) + " points along " + what);
}

// Whether a frequency passes is decided in integers: kx^2 H^2 + ky^2 W^2 < D^2 H^2 W^2 / 4. The rim is out, as in
// the engine.
class Aperture {
  public:
    Aperture(std::uint32_t width, std::uint32_t height, double relative_diameter)
        : w2_(std::int64_t{width} * width), h2_(std::int64_t{height} * height) {
        const long double d = relative_diameter, rim = (1.0L - 0x1p-40L) * d * d * w2_ * h2_ / 4.0L;
        limit_ = std::int64_t(std::ceil(rim)) - 1;
    }
    // The largest square of a kx that passes at this ky, or of a ky at this kx; negative if none does.
    std::int32_t kx_square_limit(std::int64_t ky) const { return square_limit(ky * ky * w2_, h2_); }
    std::int32_t ky_square_limit(std::int64_t kx) const { return square_limit(kx * kx * h2_, w2_); }

  private:
    std::int32_t square_limit(std::int64_t other, std::int64_t weight) const {
        return other > limit_ ? -1 : std::int32_t((limit_ - other) / weight);
    }
    std::int64_t w2_, h2_, limit_;
};

// The largest whole number whose square is at most `square`; -1 for negative ones.
inline int root_below(std::int32_t square) {
    int root = square < 0 ? -1 : int(std::sqrt(double(square)));
    while (root >= 0 && std::int64_t{root} * root > square)
        --root;
    while (root >= 0 && std::int64_t{root + 1} * (root + 1) <= square)
        ++root;
    return root;
}

// Of a transform's frequency k of n: its distance from 0.
inline std::int64_t distance(std::int64_t k, std::int64_t n) {
    return std::min(k, n - k);
}

// Takes numbers below `count` until there are none left: a thread that is held up takes fewer.
template <class F> void share(std::atomic<std::uint32_t> &next, std::uint32_t count, F &&f) {
    for (std::uint32_t i = next.fetch_add(1, std::memory_order_relaxed); i < count;
         i = next.fetch_add(1, std::memory_order_relaxed))
        f(i);
}

struct FilterTables {
    std::vector<float> twiddles;
    std::vector<unsigned> frequencies;
    std::vector<std::int32_t> squares; // of the frequency at each position
};

template <class P> FilterTables filter_tables() {
    FilterTables tables{P::twiddle_table(), P::frequencies(), {}};
    for (const unsigned frequency : tables.frequencies) {
        const auto k = std::int32_t(std::min(frequency, P::kLength - frequency));
        tables.squares.push_back(k * k);
    }
    return tables;
}

// One column block of lines, in place: lane l passes where the frequency's square is at most limits[l].
template <class P>
void filter_lines(const FilterTables &tables, const std::uint8_t *ends, Integers limits, float scale, Lanes *line) {
    constexpr unsigned R = P::kFirst, M = P::kBlock;
    const float *const twiddles = tables.twiddles.data();
    const float *w = twiddles;
    for (unsigned j = 0; j < M; ++j, w += 2 * (R - 1)) {
        Complex x[R];
        read(x, line + 2 * j, M);
        Butterfly<R>::forward(x);
        forward_twiddles(x, w);
        write(x, line + 2 * j, M);
    }
    for (unsigned b = 0; b < R; ++b) {
        Lanes *const block = line + 2 * b * M;
        forward_middle<P>(block, twiddles);
        // The last stage, the aperture and the first stage of the way back, without a stop in memory.
        constexpr unsigned L = P::kLast;
        const std::int32_t *const squares = tables.squares.data() + b * M;
        for (unsigned base = 0; base < M; base += L)
            with_ends<L>(
                ends[(b * M + base) / L], [&](auto constant) __attribute__((always_inline)) {
                    constexpr unsigned E = decltype(constant)::value;
                    Complex x[L] = {};
                    if constexpr (E != 0) {
                        read(x, block + 2 * base, 1);
                        Butterfly<L>::forward(x);
#pragma GCC unroll 16
                        for (unsigned d = 0; d < L; ++d)
                            if (at_ends<L>(d, E)) {
                                const Integers passes = Integers{} + squares[base + d] <= limits;
                                x[d].re = passes ? x[d].re * scale : Lanes{};
                                x[d].im = passes ? x[d].im * scale : Lanes{};
                            } else
                                x[d] = Complex{};
                        inverse_butterfly(x);
                    }
                    write(x, block + 2 * base, 1);
                });
        inverse_middle<P>(block, twiddles);
    }
    w = twiddles;
    for (unsigned j = 0; j < M; ++j, w += 2 * (R - 1)) {
        Complex x[R];
        read(x, line + 2 * j, M);
        inverse_twiddles(x, w);
        inverse_butterfly(x);
        write(x, line + 2 * j, M);
    }
}

// A column block's limits, and what follows from them for the transform's last stage.
struct ColumnBlock {
    Integers square_limits = Integers{} - 1;
    std::vector<std::uint8_t> ends;
};

// The pass of one length.
struct Filter {
    FilterTables (*tables)();
    std::vector<std::uint8_t> (*ends)(const std::vector<unsigned> &, int limit);
    void (*run)(const FilterTables &, const std::uint8_t *, Integers, float, Lanes *);
};
Filter filter_of(std::uint32_t length, const char *what);

} // namespace native
