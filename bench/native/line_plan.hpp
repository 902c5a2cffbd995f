// In which radices a line is taken apart, at compile time, and its stages. A stage of radix R leaves R blocks of M
// points; what comes out stands in digit-reversed order, and the inverse takes the same steps backwards.
#pragma once

#include "native/butterflies.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace native {

template <unsigned... R> struct Plan {
    static constexpr unsigned kCount = sizeof...(R);
    static constexpr std::array<unsigned, kCount> kRadices{R...};
    static constexpr unsigned kLength = (R * ...);
    static constexpr unsigned kFirst = kRadices.front(), kLast = kRadices.back();
    static constexpr unsigned kBlock = kLength / kFirst;
    static_assert(kCount >= 2, "the first and the last stage differ");

    // Points of the blocks that a stage leaves, and where its twiddle factors begin.
    static constexpr unsigned block(unsigned stage) {
        unsigned m = kLength;
        for (unsigned s = 0; s <= stage; ++s)
            m /= kRadices[s];
        return m;
    }
    static constexpr unsigned twiddles(unsigned stage) {
        unsigned begin = 0;
        for (unsigned s = 0; s < stage; ++s)
            begin += 2 * block(s) * (kRadices[s] - 1);
        return begin;
    }

    // Of each stage but the last: for each j the parts of w^j, w^(2 j) .., w = exp(-2 pi i / (R M)).
    static std::vector<float> twiddle_table() {
        std::vector<float> table;
        for (unsigned s = 0; s + 1 < kCount; ++s)
            for (unsigned j = 0; j < block(s); ++j)
                for (unsigned k = 1; k < kRadices[s]; ++k) {
                    const unsigned n = block(s) * kRadices[s];
                    const double angle = -2.0 * M_PI * double(j * k % n) / n;
                    table.push_back(float(std::cos(angle)));
                    table.push_back(float(std::sin(angle)));
                }
        return table;
    }

    // Frequency at each position behind the forward transform.
    static std::vector<unsigned> frequencies() {
        std::vector<unsigned> result(kLength);
        for (unsigned position = 0; position < kLength; ++position) {
            unsigned rest = position, weight = 1;
            for (unsigned s = 0; s < kCount; ++s) {
                result[position] += weight * (rest / block(s));
                rest %= block(s);
                weight *= kRadices[s];
            }
        }
        return result;
    }
};

// The last stage leaves frequencies k + d N / R, d = 0 .. R - 1. A low-pass needs those at both ends only: `ends` of
// them, which are rounded up to one of these.
constexpr unsigned kAll = 255;
template <unsigned R> constexpr unsigned rounded_ends(unsigned ends) {
    for (const unsigned e : {0u, 1u, 2u, 4u})
        if (ends <= e && 2 * e < R)
            return e;
    return kAll;
}
template <unsigned R> constexpr bool at_ends(unsigned d, unsigned ends) {
    return d < ends || d + ends >= R;
}

// Which ends the butterfly of each R positions needs so that all |frequency| <= limit are there.
template <class P> std::vector<std::uint8_t> ends_of(const std::vector<unsigned> &frequencies, int limit) {
    constexpr unsigned R = P::kLast;
    constexpr int M = int(P::kLength / R);
    std::vector<std::uint8_t> result;
    for (unsigned base = 0; base < P::kLength; base += R) {
        const int k = int(frequencies[base]);
        const int low = limit >= k ? (limit - k) / M + 1 : 0, high = limit >= 0 ? (limit + k) / M : 0;
        result.push_back(std::uint8_t(rounded_ends<R>(unsigned(low > high ? low : high))));
    }
    return result;
}

// Calls f with the ends as a constant.
template <unsigned R, class F> NATIVE_INLINE void with_ends(unsigned ends, F &&f) {
    switch (ends) {
    case 0:
        f(std::integral_constant<unsigned, 0>{});
        break;
    case 1:
        if constexpr (R > 2)
            f(std::integral_constant<unsigned, 1>{});
        break;
    case 2:
        if constexpr (R > 4)
            f(std::integral_constant<unsigned, 2>{});
        break;
    case 4:
        if constexpr (R > 8)
            f(std::integral_constant<unsigned, 4>{});
        break;
    default:
        f(std::integral_constant<unsigned, kAll>{});
    }
}

template <unsigned R> NATIVE_INLINE void read(Complex (&x)[R], const Lanes *from, unsigned step) {
#pragma GCC unroll 16
    for (unsigned q = 0; q < R; ++q)
        x[q] = {from[2 * q * step], from[2 * q * step + 1]};
}
template <unsigned R> NATIVE_INLINE void write(const Complex (&x)[R], Lanes *to, unsigned step) {
#pragma GCC unroll 16
    for (unsigned q = 0; q < R; ++q) {
        to[2 * q * step] = x[q].re;
        to[2 * q * step + 1] = x[q].im;
    }
}
template <unsigned R> NATIVE_INLINE void inverse_butterfly(Complex (&x)[R]) {
#pragma GCC unroll 16
    for (unsigned q = 0; q < R; ++q)
        x[q] = {x[q].im, x[q].re};
    Butterfly<R>::forward(x);
#pragma GCC unroll 16
    for (unsigned q = 0; q < R; ++q)
        x[q] = {x[q].im, x[q].re};
}
template <unsigned R> NATIVE_INLINE void forward_twiddles(Complex (&x)[R], const float *w) {
#pragma GCC unroll 16
    for (unsigned k = 1; k < R; ++k)
        x[k] = times(x[k], w[2 * k - 2], w[2 * k - 1]);
}
template <unsigned R> NATIVE_INLINE void inverse_twiddles(Complex (&x)[R], const float *w) {
#pragma GCC unroll 16
    for (unsigned k = 1; k < R; ++k)
        x[k] = times_conjugate(x[k], w[2 * k - 2], w[2 * k - 1]);
}

// A stage between the first and the last, of one block of the first; in place.
template <class P, unsigned S, bool Inverse>
__attribute__((noinline)) void middle_stage(Lanes *block, const float *twiddles) {
    constexpr unsigned R = P::kRadices[S], M = P::block(S);
    for (unsigned base = 0; base < P::kBlock; base += R * M) {
        const float *w = twiddles + P::twiddles(S);
        for (unsigned j = 0; j < M; ++j, w += 2 * (R - 1)) {
            Lanes *const at = block + 2 * (base + j);
            Complex x[R];
            read(x, at, M);
            if constexpr (Inverse) {
                inverse_twiddles(x, w);
                inverse_butterfly(x);
            } else {
                Butterfly<R>::forward(x);
                forward_twiddles(x, w);
            }
            write(x, at, M);
        }
    }
}

template <class P, unsigned S = 1> NATIVE_INLINE void forward_middle(Lanes *block, const float *twiddles) {
    if constexpr (S + 1 < P::kCount) {
        middle_stage<P, S, false>(block, twiddles);
        forward_middle<P, S + 1>(block, twiddles);
    }
}
template <class P, unsigned S = P::kCount - 2> NATIVE_INLINE void inverse_middle(Lanes *block, const float *twiddles) {
    if constexpr (S > 0) {
        middle_stage<P, S, true>(block, twiddles);
        inverse_middle<P, S - 1>(block, twiddles);
    }
}

// The last stage of a block: only what stands at the ends is computed and written.
template <class P> __attribute__((noinline)) void forward_last(Lanes *block, const std::uint8_t *ends) {
    constexpr unsigned R = P::kLast;
    for (unsigned base = 0; base < P::kBlock; base += R)
        with_ends<R>(
            ends[base / R], [&](auto constant) __attribute__((always_inline)) {
                constexpr unsigned E = decltype(constant)::value;
                if constexpr (E != 0) {
                    Complex x[R];
                    read(x, block + 2 * base, 1);
                    Butterfly<R>::forward(x);
#pragma GCC unroll 16
                    for (unsigned d = 0; d < R; ++d)
                        if (at_ends<R>(d, E)) {
                            block[2 * (base + d)] = x[d].re;
                            block[2 * (base + d) + 1] = x[d].im;
                        }
                }
            });
}

// Back: what does not stand at the ends counts as 0 and is not read.
template <class P> __attribute__((noinline)) void inverse_last(Lanes *block, const std::uint8_t *ends) {
    constexpr unsigned R = P::kLast;
    for (unsigned base = 0; base < P::kBlock; base += R)
        with_ends<R>(
            ends[base / R], [&](auto constant) __attribute__((always_inline)) {
                constexpr unsigned E = decltype(constant)::value;
                Complex x[R] = {};
                if constexpr (E != 0) {
#pragma GCC unroll 16
                    for (unsigned d = 0; d < R; ++d)
                        if (at_ends<R>(d, E))
                            x[d] = {block[2 * (base + d)], block[2 * (base + d) + 1]};
                    inverse_butterfly(x);
                }
                write(x, block + 2 * base, 1);
            });
}

} // namespace native
