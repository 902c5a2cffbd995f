// Explicit vectors of the compiler: lane l belongs to the l-th of several lines.
#pragma once

#include <cmath>
#include <cstdint>
#if defined(__AVX__)
#include <immintrin.h>
#endif

namespace native {

#if defined(__AVX512F__)
constexpr unsigned kLanes = 16;
#else
constexpr unsigned kLanes = 8;
#endif

typedef float Lanes __attribute__((vector_size(kLanes * sizeof(float))));
typedef std::int32_t Integers __attribute__((vector_size(kLanes * sizeof(std::int32_t))));

#define NATIVE_INLINE inline __attribute__((always_inline))

NATIVE_INLINE Lanes spread(float value) {
    return Lanes{} + value;
}
NATIVE_INLINE Lanes load(const float *from) {
    return *reinterpret_cast<const Lanes *>(from);
}
NATIVE_INLINE Lanes as_lanes(Integers v) {
    return reinterpret_cast<Lanes>(v);
}
NATIVE_INLINE Integers as_integers(Lanes v) {
    return reinterpret_cast<Integers>(v);
}

// Past the caches: what is not read again soon need not drive out what is.
NATIVE_INLINE void stream(float *to, Lanes v) {
#if defined(__AVX512F__)
    _mm512_stream_ps(to, v);
#elif defined(__AVX__)
    _mm256_stream_ps(to, v);
#else
    *reinterpret_cast<Lanes *>(to) = v;
#endif
}

// Streamed stores of this thread come before what it stores next.
NATIVE_INLINE void finish_streams() {
#if defined(__AVX__)
    _mm_sfence();
#endif
}

NATIVE_INLINE Lanes square_root(Lanes v) {
#if defined(__AVX512F__)
    return _mm512_maskz_sqrt_ps(0xffff, v); // the one without a mask has GCC 12 warn
#elif defined(__AVX__)
    return _mm256_sqrt_ps(v);
#else
    for (unsigned l = 0; l < kLanes; ++l)
        v[l] = std::sqrt(v[l]);
    return v;
#endif
}

// v[i] lane l becomes v[l] lane i. Each step is one instruction for two vectors.
NATIVE_INLINE void transpose(Lanes (&v)[kLanes]) {
    Lanes t[kLanes];
#if defined(__AVX512F__)
#pragma GCC unroll 16
    for (unsigned i = 0; i < 16; i += 2) {
        t[i] = __builtin_shufflevector(v[i], v[i + 1], 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
        t[i + 1] = __builtin_shufflevector(v[i], v[i + 1], 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
    }
    // t[i] holds columns 4 c, 4 c + 1 of rows i, i + 1 in quarter c; t[i + 1] columns 4 c + 2, 4 c + 3.
#pragma GCC unroll 16
    for (unsigned i = 0; i < 16; i += 4)
#pragma GCC unroll 2
        for (unsigned h = 0; h < 2; ++h) {
            const Lanes a = t[i + h], b = t[i + 2 + h];
            v[i + 2 * h] = __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29);
            v[i + 2 * h + 1] =
                __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31);
        }
        // v[i + k] holds column 4 c + k of rows i .. i + 3 in quarter c.
#pragma GCC unroll 4
    for (unsigned k = 0; k < 4; ++k) {
        const Lanes a = v[k], b = v[4 + k], c = v[8 + k], d = v[12 + k];
        const Lanes ab0 = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27);
        const Lanes ab1 = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15, 20, 21, 22, 23, 28, 29, 30, 31);
        const Lanes cd0 = __builtin_shufflevector(c, d, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27);
        const Lanes cd1 = __builtin_shufflevector(c, d, 4, 5, 6, 7, 12, 13, 14, 15, 20, 21, 22, 23, 28, 29, 30, 31);
        // ab0: quarters 0 and 2 of a, then of b.
        t[k] = __builtin_shufflevector(ab0, cd0, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27);
        t[8 + k] = __builtin_shufflevector(ab0, cd0, 4, 5, 6, 7, 12, 13, 14, 15, 20, 21, 22, 23, 28, 29, 30, 31);
        t[4 + k] = __builtin_shufflevector(ab1, cd1, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27);
        t[12 + k] = __builtin_shufflevector(ab1, cd1, 4, 5, 6, 7, 12, 13, 14, 15, 20, 21, 22, 23, 28, 29, 30, 31);
    }
#else
#pragma GCC unroll 8
    for (unsigned i = 0; i < 8; i += 2) {
        t[i] = __builtin_shufflevector(v[i], v[i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
        t[i + 1] = __builtin_shufflevector(v[i], v[i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
    }
#pragma GCC unroll 8
    for (unsigned i = 0; i < 8; i += 4)
#pragma GCC unroll 2
        for (unsigned h = 0; h < 2; ++h) {
            const Lanes a = t[i + h], b = t[i + 2 + h];
            v[i + 2 * h] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
            v[i + 2 * h + 1] = __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
        }
#pragma GCC unroll 4
    for (unsigned k = 0; k < 4; ++k) {
        t[k] = __builtin_shufflevector(v[k], v[4 + k], 0, 1, 2, 3, 8, 9, 10, 11);
        t[4 + k] = __builtin_shufflevector(v[k], v[4 + k], 4, 5, 6, 7, 12, 13, 14, 15);
    }
#endif
#pragma GCC unroll 16
    for (unsigned i = 0; i < kLanes; ++i)
        v[i] = t[i];
}

struct Complex {
    Lanes re, im;
};

NATIVE_INLINE Complex operator+(Complex a, Complex b) {
    return {a.re + b.re, a.im + b.im};
}
NATIVE_INLINE Complex operator-(Complex a, Complex b) {
    return {a.re - b.re, a.im - b.im};
}
// a (re + i im), and a (re - i im).
NATIVE_INLINE Complex times(Complex a, float re, float im) {
    return {a.re * re - a.im * im, a.re * im + a.im * re};
}
NATIVE_INLINE Complex times_conjugate(Complex a, float re, float im) {
    return {a.re * re + a.im * im, a.im * re - a.re * im};
}

// amplitude exp(i angle), |angle| up to some thousands: reduced to an eighth of a turn, then polynomials, to the last
// digits of a float.
NATIVE_INLINE Complex phasor(Lanes angle, Lanes amplitude) {
    const Lanes magic = spread(0x1.8p23f);
    const Lanes shifted = angle * 0.63661977236758134f + magic;
    const Lanes quarters = shifted - magic;
    const Lanes f = (angle - quarters * 1.5707963705062866f) + quarters * 4.3711388286737929e-08f;
    const Lanes g = f * f;
    const Lanes sine = f + (f * g) * (-1.6666654611e-1f + g * (8.3321608736e-3f + g * -1.9515295891e-4f));
    const Lanes cosine =
        1.0f + g * (-0.5f + g * (4.166664568298827e-2f + g * (-1.388731625493765e-3f + g * 2.443315711809948e-5f)));
    // Odd quadrants take the other function; re is negative in quadrants 1 and 2, im in 2 and 3.
    const Integers quadrant = as_integers(shifted), sign = Integers{} + INT32_MIN;
    const Integers odd = (quadrant & 1) != 0;
    const Integers im_sign = (quadrant << 30) & sign, re_sign = ((quadrant + 1) << 30) & sign;
    const Lanes re = odd ? sine : cosine, im = odd ? cosine : sine;
    return {amplitude * as_lanes(as_integers(re) ^ re_sign), amplitude * as_lanes(as_integers(im) ^ im_sign)};
}

} // namespace native
