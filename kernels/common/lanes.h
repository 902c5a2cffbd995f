// Explicit vectors for CPU devices: one work-item works on LANES columns or rows at once, lane l on the l-th. The same
// numbers as the scalar functions of philox.h, bit for bit: the same operations in the same order. Pairs go to
// out-parameters: inlining a function that returns a structure leaves an intrinsic behind
// (llvm.experimental.noalias.scope.decl) that oclgrind 21.10 cannot run.
//   LANES  4, 8 or 16
#ifndef CLSP_LANES_H
#define CLSP_LANES_H

#include "common/philox.h"

#define CLSP_JOIN_(a, b) a##b
#define CLSP_JOIN(a, b) CLSP_JOIN_(a, b)
typedef CLSP_JOIN(float, LANES) lanes_f;
typedef CLSP_JOIN(int, LANES) lanes_i;
typedef CLSP_JOIN(uint, LANES) lanes_u;
#define vload_lanes CLSP_JOIN(vload, LANES)
#define vstore_lanes CLSP_JOIN(vstore, LANES)
#define convert_lanes_f CLSP_JOIN(convert_float, LANES)
#define convert_lanes_i CLSP_JOIN(convert_int, LANES)
#define convert_lanes_u CLSP_JOIN(convert_uint, LANES)
#define as_lanes_i CLSP_JOIN(as_int, LANES)
#define as_lanes_u CLSP_JOIN(as_uint, LANES)
#define as_lanes_f CLSP_JOIN(as_float, LANES)
// Vectors of 64-bit numbers that fill the registers that LANES floats fill.
#if LANES == 16
#define HALF_LANES 8
#elif LANES == 8
#define HALF_LANES 4
#else
#define HALF_LANES 2
#endif
typedef CLSP_JOIN(ulong, HALF_LANES) half_ul;
#define as_half_ul CLSP_JOIN(as_ulong, HALF_LANES)
#define SPREAD(value) ((lanes_f)(value))
// LANES numbers side by side, wherever they begin, and elements of two vectors: `places` names a macro that lists their
// numbers, as OpenCL C has no variadic macros. PoCL's built-ins go through large vectors in parts.
#ifdef __clang__
typedef lanes_f unaligned_lanes_f __attribute__((aligned(4)));
typedef lanes_u unaligned_lanes_u __attribute__((aligned(4)));
#define shuffle_lanes(a, b, places) __builtin_shufflevector(a, b, places)
#define load_lanes_f(from) (*(__global const unaligned_lanes_f *)(from))
#define load_lanes_u(from) (*(__global const unaligned_lanes_u *)(from))
#define load_local_f(from) (*(__local const unaligned_lanes_f *)(from))
#define store_lanes_f(values, to) (*(__global unaligned_lanes_f *)(to) = (values))
#define store_local_f(values, to) (*(__local unaligned_lanes_f *)(to) = (values))
#define store_lanes_u(values, to) (*(__global unaligned_lanes_u *)(to) = (values))
#else
#define shuffle_lanes(a, b, places) shuffle2(a, b, (lanes_u)(places))
#define load_lanes_f(from) vload_lanes(0, from)
#define load_lanes_u(from) vload_lanes(0, from)
#define load_local_f(from) vload_lanes(0, from)
#define store_lanes_f(values, to) vstore_lanes(values, 0, to)
#define store_local_f(values, to) vstore_lanes(values, 0, to)
#define store_lanes_u(values, to) vstore_lanes(values, 0, to)
#endif

// Asks for the cache line at `address`. locality: into which cache, a constant as __builtin_prefetch() has it. OpenCL's
// own prefetch() does nothing on PoCL; kernels that use this one are told to by an option.
#define prefetch_line(address, locality) __builtin_prefetch((const void *)(size_t)(address), 0, locality)

typedef struct {
    lanes_f re, im;
} lanes_complex;
typedef struct {
    lanes_u w0, w1, w2, w3;
} lanes_words4;

// 0, 1, 2 ..
static inline lanes_u lane_numbers(void) {
    const uint numbers[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return vload_lanes(0, numbers);
}

// Whether a comparison, which sets all bits of a lane or none, holds in any lane. PoCL's any() and all() go through the
// lanes two by two.
static inline bool holds_anywhere(lanes_i comparison) {
#if LANES == 16
    const int8 eight = comparison.lo | comparison.hi;
    const int4 four = eight.lo | eight.hi;
#elif LANES == 8
    const int4 four = comparison.lo | comparison.hi;
#else
    const int4 four = comparison;
#endif
    const int2 two = four.lo | four.hi;
    return (two.x | two.y) != 0;
}

// count of LANES numbers side by side: of the last strip only those that there are.
static inline lanes_f load_some(__global const float *from, uint count) {
    if (count == LANES)
        return load_lanes_f(from);
    float values[LANES];
    for (uint lane = 0; lane < LANES; ++lane)
        values[lane] = lane < count ? from[lane] : 0.0f;
    return vload_lanes(0, values);
}

static inline void store_some(lanes_f values, __global float *to, uint count) {
    if (count == LANES) {
        store_lanes_f(values, to);
        return;
    }
    float each[LANES];
    vstore_lanes(values, 0, each);
    for (uint lane = 0; lane < count; ++lane)
        to[lane] = each[lane];
}

static inline lanes_u load_some_words(__global const uint *from, uint count) {
    if (count == LANES)
        return load_lanes_u(from);
    uint words[LANES];
    for (uint lane = 0; lane < LANES; ++lane)
        words[lane] = lane < count ? from[lane] : 0u;
    return vload_lanes(0, words);
}

static inline void store_some_words(lanes_u words, __global uint *to, uint count) {
    if (count == LANES) {
        store_lanes_u(words, to);
        return;
    }
    uint each[LANES];
    vstore_lanes(words, 0, each);
    for (uint lane = 0; lane < count; ++lane)
        to[lane] = each[lane];
}

// Complex numbers that lie in memory as re, im, re, im ..
static inline void load_interleaved(__global const float *from, lanes_complex *z) {
    const lanes_f a = load_lanes_f(from), b = load_lanes_f(from + LANES);
    z->re = (lanes_f)(a.even, b.even);
    z->im = (lanes_f)(a.odd, b.odd);
}

// count of LANES of them.
static inline void load_some_interleaved(__global const float *from, uint count, lanes_complex *z) {
    if (count == LANES) {
        load_interleaved(from, z);
        return;
    }
    float re[LANES], im[LANES];
    for (uint lane = 0; lane < LANES; ++lane) {
        re[lane] = lane < count ? from[2 * lane] : 0.0f;
        im[lane] = lane < count ? from[2 * lane + 1] : 0.0f;
    }
    z->re = vload_lanes(0, re);
    z->im = vload_lanes(0, im);
}

static inline void store_some_interleaved(const lanes_complex *z, __global float *to, uint count) {
    lanes_f low, high;
    low.even = z->re.lo;
    low.odd = z->im.lo;
    high.even = z->re.hi;
    high.odd = z->im.hi;
    if (count == LANES) {
        store_lanes_f(low, to);
        store_lanes_f(high, to + LANES);
        return;
    }
    float values[2 * LANES];
    vstore_lanes(low, 0, values);
    vstore_lanes(high, 1, values);
    for (uint i = 0; i < 2u * count; ++i)
        to[i] = values[i];
}

// exp(2 pi i word / 2^32), as phasor_from_word().
static inline void phasors_from_words(lanes_u word, lanes_complex *phasors) {
    const lanes_u quadrant = (word + 0x20000000u) >> 30;
    const lanes_f f = convert_lanes_f(as_lanes_i(word - (quadrant << 30))) * 0x1p-32f;
    const lanes_f g = f * f;
    lanes_f s = fma(g, SPREAD(41.46989059448242f), SPREAD(-76.6977767944336f));
    s = fma(g, s, SPREAD(81.6052017211914f));
    s = fma(g, s, SPREAD(-41.34170150756836f));
    s = fma(g, s, SPREAD(6.2831854820251465f)) * f;
    lanes_f c = fma(g, SPREAD(59.24596405029297f), SPREAD(-85.44374084472656f));
    c = fma(g, c, SPREAD(64.93932342529297f));
    c = fma(g, c, SPREAD(-19.739208221435547f));
    c = fma(g, c, SPREAD(1.0f));
    // Odd quadrants take the other function; then signs: re is negative in quadrants 1 and 2, im in 2 and 3.
    const lanes_i odd = as_lanes_i(quadrant << 31) >> 31;
    const lanes_i sine = as_lanes_i(s), cosine = as_lanes_i(c);
    const lanes_i re = (odd & sine) | (~odd & cosine), im = (odd & cosine) | (~odd & sine);
    phasors->re = as_lanes_f(re ^ as_lanes_i((quadrant ^ (quadrant << 1)) << 30 & 0x80000000u));
    phasors->im = as_lanes_f(im ^ as_lanes_i(quadrant << 30 & 0x80000000u));
}

// rint() of |a| < 2^22; what is larger stays as large. The built-in is a dozen instructions on PoCL.
static inline lanes_f nearest(lanes_f a) { return (a + 0x1.8p23f) - 0x1.8p23f; }

// exp(2 pi i turns) of |turns| up to some thousands.
static inline void phasors_from_turns(lanes_f turns, lanes_complex *phasors) {
    const lanes_f fraction = turns - nearest(turns);
    phasors_from_words(as_lanes_u(convert_lanes_i(fraction * 0x1p31f)) << 1, phasors);
}

static inline lanes_f uniforms_from_words(lanes_u word) {
    return fma(convert_lanes_f(word), SPREAD(0x1p-32f), SPREAD(0x1p-33f));
}

// -ln(u), as minus_log().
static inline lanes_f minus_logs(lanes_f u) {
    const lanes_i bits = as_lanes_i(u);
    const lanes_i shifted = bits - 0x3f3504f3;
    const lanes_i exponent = shifted >> 23;
    const lanes_f e = convert_lanes_f(exponent);
    const lanes_f t = as_lanes_f(bits - (exponent << 23)) - 1.0f;
    lanes_f p = fma(t, SPREAD(-0.07634496688842773f), SPREAD(0.1276157647371292f));
    p = fma(t, p, SPREAD(-0.13160182535648346f));
    p = fma(t, p, SPREAD(0.14201757311820984f));
    p = fma(t, p, SPREAD(-0.16623356938362122f));
    p = fma(t, p, SPREAD(0.20001226663589478f));
    p = fma(t, p, SPREAD(-0.2500081956386566f));
    p = fma(t, p, SPREAD(0.3333333134651184f));
    const lanes_f t2 = t * t;
    const lanes_f low = fma(e, SPREAD(1.428606765330187e-06f), fma(t2 * t, p, -0.5f * t2));
    return -(fma(e, SPREAD(0.693145751953125f), t) + low);
}

// Circular Gaussian numbers with E|z|^2 = 1, as gaussian_from_words() in phase.cl.
static inline void gaussians_from_words(lanes_u phase, lanes_u magnitude, lanes_complex *z) {
    const lanes_f r = sqrt(minus_logs(uniforms_from_words(magnitude)));
    phasors_from_words(phase, z);
    z->re *= r;
    z->im *= r;
}

// One of Philox's rounds on HALF_LANES blocks. Each word lies in the lower half of 64 bits, where a product finds and
// leaves it: no word moves, and what stands above is nobody's.
static inline ALWAYS_INLINE void philox_round(half_ul *c0, half_ul *c1, half_ul *c2, half_ul *c3, uint k0, uint k1) {
    const half_ul p0 = (*c0 & 0xfffffffful) * 0xD2511F53ul, p1 = (*c2 & 0xfffffffful) * 0xCD9E8D57ul;
    *c0 = (p1 >> 32) ^ *c1 ^ (ulong)k0;
    *c2 = (p0 >> 32) ^ *c3 ^ (ulong)k1;
    *c1 = p1;
    *c3 = p0;
}

#if LANES == 16
#define LOWER_HALVES 0, 16, 2, 18, 4, 20, 6, 22, 8, 24, 10, 26, 12, 28, 14, 30
#elif LANES == 8
#define LOWER_HALVES 0, 8, 2, 10, 4, 12, 6, 14
#else
#define LOWER_HALVES 0, 4, 2, 6
#endif
static inline lanes_u words_of_halves(half_ul even, half_ul odd) {
    return shuffle_lanes(as_lanes_u(even), as_lanes_u(odd), LOWER_HALVES);
}

// image_block() of the columns x, x + 1 ..
static inline ALWAYS_INLINE void image_blocks(uint x, uint row, uint frame_low, uint frame_high, uint stream, uint2 key,
                                              lanes_words4 *blocks) {
    const half_ul columns = as_half_ul(x + lane_numbers());
    half_ul even0 = columns, even1 = (half_ul)(row), even2 = (half_ul)(frame_low),
            even3 = (half_ul)(stream | frame_high << 16);
    half_ul odd0 = columns >> 32, odd1 = even1, odd2 = even2, odd3 = even3;
    uint k0 = key.x, k1 = key.y;
#pragma unroll
    for (int round = 0; round < 10; ++round) {
        philox_round(&even0, &even1, &even2, &even3, k0, k1);
        philox_round(&odd0, &odd1, &odd2, &odd3, k0, k1);
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    blocks->w0 = words_of_halves(even0, odd0);
    blocks->w1 = words_of_halves(even1, odd1);
    blocks->w2 = words_of_halves(even2, odd2);
    blocks->w3 = words_of_halves(even3, odd3);
}

static inline lanes_u words_of(const lanes_words4 *blocks, uint j) {
    return j == 0 ? blocks->w0 : j == 1 ? blocks->w1 : j == 2 ? blocks->w2 : blocks->w3;
}

static inline void normals_from_pair(lanes_u radius, lanes_u turn, lanes_f *first, lanes_f *second) {
    const lanes_f r = sqrt(2.0f * minus_logs(uniforms_from_words(radius)));
    lanes_complex p;
    phasors_from_words(turn, &p);
    *first = r * p.re;
    *second = r * p.im;
}

// normal_pair_from_word().
static inline void normal_pairs_from_words(lanes_u word, lanes_f *first, lanes_f *second) {
    const lanes_i bits = as_lanes_i(uniforms_from_words(word));
    const lanes_i exponent = (bits - 0x3f3504f3) >> 23;
    const lanes_f t = as_lanes_f(bits - (exponent << 23)) - 1.0f;
    lanes_f p = fma(t, SPREAD(-0.11896108835935593f), SPREAD(0.18667860329151154f));
    p = fma(t, p, SPREAD(-0.2049633115530014f));
    p = fma(t, p, SPREAD(0.24909743666648865f));
    p = fma(t, p, SPREAD(-0.3331450819969177f));
    p = fma(t, p, SPREAD(0.500011146068573f));
    p = fma(t, p, SPREAD(-1.0000009536743164f));
    const lanes_f r = sqrt(fma(convert_lanes_f(exponent), SPREAD(-0.693147182464599609375f), t * p));
    const lanes_f f = convert_lanes_f(as_lanes_i(word * 0xE78DDE6Du)) * 0x1p-34f;
    const lanes_f g = f * f;
    const lanes_f s =
        fma(g, fma(g, SPREAD(79.810546875f), SPREAD(-41.331077575683594f)), SPREAD(6.283175945281982f)) * f;
    const lanes_f c =
        fma(g, fma(g, fma(g, SPREAD(-83.6659164428711f), SPREAD(64.92322540283203f)), SPREAD(-19.739168167114258f)),
            SPREAD(1.0f));
    const lanes_f rc = r * c;
    *first = as_lanes_f(as_lanes_u(fma(-r, s, rc)) ^ word << 31);
    *second = as_lanes_f(as_lanes_u(fma(r, s, rc)) ^ (word << 30 & 0x80000000u));
}

// The four normals that normals_from_block() makes of each block.
static inline void normals_from_blocks(const lanes_words4 *blocks, lanes_f *normals) {
    normals_from_pair(blocks->w0, blocks->w1, &normals[0], &normals[1]);
    normals_from_pair(blocks->w2, blocks->w3, &normals[2], &normals[3]);
}

#endif
