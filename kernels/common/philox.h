// Philox4x32-10 (Salmon et al., SC'11) and its conversions, the same bits on every device: integer arithmetic, fma(),
// conversions and square roots that round correctly; no other built-in.
#ifndef CLSP_PHILOX_H
#define CLSP_PHILOX_H

#include "common/common.h"

// Streams: the fourth counter word below bit 16. The same numbers as core/stages/philox.hpp.
#define STREAM_PHASE 0x01u      // + polarization
#define STREAM_MAGNITUDE 0x03u  // + polarization
#define STREAM_READ_NOISE 0x10u
#define STREAM_HOT_PIXEL 0x11u
#define STREAM_HOT_OFFSET 0x12u
#define STREAM_COLD_PIXEL 0x13u
#define STREAM_PRNU 0x14u
#define STREAM_DSNU 0x15u
#define STREAM_COLUMN_OFFSET 0x16u
#define STREAM_ROW_NOISE 0x17u
#define STREAM_SHOT_NOISE 0x18u         // and 0x19
#define STREAM_READ_NOISE_SPREAD 0x1au
#define STREAM_COLUMN_NOISE 0x1bu
#define STREAM_COLUMN_PRNU 0x1cu
#define STREAM_ROW_PRNU 0x1du
#define STREAM_ROW_OFFSET 0x1eu
#define STREAM_DULL_PIXEL 0x1fu
#define STREAM_NEXT_PHASE 0x20u         // + polarization: the knot that a moving field turns towards
#define STREAM_NEXT_MAGNITUDE 0x22u     // + polarization
#define STREAM_PATH_START 0x24u
#define STREAM_BOIL_PHASE 0x26u         // + polarization; + 2 for the next knot
#define STREAM_BOIL_MAGNITUDE 0x2au     // + polarization; + 2 for the next knot
#define STREAM_SURFACE_HEIGHT 0x30u
#define STREAM_AIRFLOW 0x31u            // and 0x32; the host has 0x33 to 0x35, 0x40 to 0x46, 0x51 and 0x52
#define STREAM_PERIODIC_PHASE 0x36u
#define STREAM_TELEGRAPH_PIXEL 0x37u
#define STREAM_TELEGRAPH_STATE 0x38u
#define STREAM_ETCH_NOISE 0x50u
#define STREAM_HYPOTHESIS 0x60u         // + draw, 0 to 15
#define STREAM_HYPOTHESIS_FIXED 0x70u   // + draw, 0 to 15

// A call left in a kernel keeps compilers that vectorize across work-items from doing so; clang thinks Philox too large
// to be inlined twice.
#if defined(__clang__) || defined(__GNUC__)
#define ALWAYS_INLINE __attribute__((always_inline))
#else
#define ALWAYS_INLINE
#endif

// Four words, and two or four floats. Plain structs: compilers that vectorize across work-items (PoCL) give up on
// OpenCL's own vector types, and on mul_hi.
typedef struct {
    uint w0, w1, w2, w3;
} words4;
typedef struct {
    float re, im;
} complex_float;
typedef struct {
    float n0, n1, n2, n3;
} normals4;
typedef struct {
    float n0, n1;
} normals2;

static inline ALWAYS_INLINE words4 philox4x32_10(words4 counter, uint2 key) {
    uint k0 = key.x, k1 = key.y;
#pragma unroll
    for (int round = 0; round < 10; ++round) {
        const ulong p0 = (ulong)0xD2511F53u * counter.w0, p1 = (ulong)0xCD9E8D57u * counter.w2;
        const words4 next = {(uint)(p1 >> 32) ^ counter.w1 ^ k0, (uint)p1, (uint)(p0 >> 32) ^ counter.w3 ^ k1,
                             (uint)p0};
        counter = next;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    return counter;
}

// The block of column x and row y mod Q of an image (philox.h of the C API: four rows share a block).
static inline ALWAYS_INLINE words4 image_block(uint x, uint row, uint frame_low, uint frame_high, uint stream,
                                               uint2 key) {
    const words4 counter = {x, row, frame_low, stream | frame_high << 16};
    return philox4x32_10(counter, key);
}

static inline ALWAYS_INLINE uint word_of(words4 block, uint j) {
    return j == 0 ? block.w0 : j == 1 ? block.w1 : j == 2 ? block.w2 : block.w3;
}

// (0, 1].
static inline ALWAYS_INLINE float uniform_from_word(uint word) {
    return fma(convert_float_rte(word), 0x1p-32f, 0x1p-33f);
}

// exp(2 pi i word / 2^32). The quadrant is split off exactly in integers; what is left, f in [-1/8, 1/8) turns, goes
// through minimax polynomials of sin(2 pi f) / f and (cos(2 pi f) - 1) / f^2 in f^2 (errors 5e-12 and 6e-11 before
// rounding).
static inline ALWAYS_INLINE complex_float phasor_from_word(uint word) {
    const uint quadrant = (word + 0x20000000u) >> 30;
    const float f = convert_float_rte((int)(word - (quadrant << 30))) * 0x1p-32f;
    const float g = f * f;
    float s = fma(g, 41.46989059448242f, -76.6977767944336f);
    s = fma(g, s, 81.6052017211914f);
    s = fma(g, s, -41.34170150756836f);
    s = fma(g, s, 6.2831854820251465f) * f;
    float c = fma(g, 59.24596405029297f, -85.44374084472656f);
    c = fma(g, c, 64.93932342529297f);
    c = fma(g, c, -19.739208221435547f);
    c = fma(g, c, 1.0f);
    const float re = (quadrant & 1u) ? -s : c, im = (quadrant & 1u) ? c : s;
    const complex_float phasor = {(quadrant & 2u) ? -re : re, (quadrant & 2u) ? -im : im};
    return phasor;
}

// -ln(u) of a uniform u in (0, 1]: exponent and mantissa m in [sqrt(1/2), sqrt(2)) split in bits, t = m - 1,
// ln(1 + t) = t - t^2/2 + t^3 P(t) with P minimax (relative error 6e-9 before rounding).
static inline ALWAYS_INLINE float minus_log(float u) {
    const int bits = as_int(u);
    const int shifted = bits - 0x3f3504f3; // 0x3f3504f3 is sqrt(1/2)
    const int exponent = shifted >> 23;
    const float e = convert_float_rte(exponent);
    const float t = as_float(bits - (exponent << 23)) - 1.0f;
    float p = fma(t, -0.07634496688842773f, 0.1276157647371292f);
    p = fma(t, p, -0.13160182535648346f);
    p = fma(t, p, 0.14201757311820984f);
    p = fma(t, p, -0.16623356938362122f);
    p = fma(t, p, 0.20001226663589478f);
    p = fma(t, p, -0.2500081956386566f);
    p = fma(t, p, 0.3333333134651184f);
    const float t2 = t * t;
    // ln 2 in two parts: the first has 15 significant bits, so its product with the exponent is exact.
    const float low = fma(e, 1.428606765330187e-06f, fma(t2 * t, p, -0.5f * t2));
    return -(fma(e, 0.693145751953125f, t) + low);
}

// Box-Muller: four normals from the four words of a block, two from each pair.
static inline ALWAYS_INLINE normals4 normals_from_block(words4 block) {
    const float r0 = sqrt(2.0f * minus_log(uniform_from_word(block.w0)));
    const float r1 = sqrt(2.0f * minus_log(uniform_from_word(block.w2)));
    const complex_float p0 = phasor_from_word(block.w1), p1 = phasor_from_word(block.w3);
    const normals4 normals = {r0 * p0.re, r0 * p0.im, r1 * p1.re, r1 * p1.im};
    return normals;
}

static inline ALWAYS_INLINE float normal_of(normals4 normals, uint j) {
    return j == 0 ? normals.n0 : j == 1 ? normals.n1 : j == 2 ? normals.n2 : normals.n3;
}

// Two normals from one word, for noise drawn anew for every pixel of every frame. Box-Muller with a radius r = sqrt(-ln
// u), u the word's uniform, and an angle of the first quadrant, pi / 4 + 2 pi f. f = word K / 2^34 with the product in
// 32 bits and with its sign. The word's two lowest bits are the signs of the two. The points (u, f) are a lattice, and
// so are those of each quadrant; K makes both cover the square nearly as evenly as lattices can (shortest vectors of
// 0.87 of the longest possible). r sqrt(2) cos(pi / 4 + a) = r (cos a - sin a). Minimax polynomials of ln(1 + t) / t
// (relative error 1.1e-6), sin(2 pi f) / f (1.5e-6) and cos(2 pi f) - 1 (3e-8): a normal is right to 2e-6 of the pair's
// radius (1.4e-6 was seen).
static inline ALWAYS_INLINE normals2 normal_pair_from_word(uint word) {
    const int bits = as_int(uniform_from_word(word));
    const int exponent = (bits - 0x3f3504f3) >> 23;
    const float t = as_float(bits - (exponent << 23)) - 1.0f;
    float p = fma(t, -0.11896108835935593f, 0.18667860329151154f);
    p = fma(t, p, -0.2049633115530014f);
    p = fma(t, p, 0.24909743666648865f);
    p = fma(t, p, -0.3331450819969177f);
    p = fma(t, p, 0.500011146068573f);
    p = fma(t, p, -1.0000009536743164f);
    const float r = sqrt(fma(convert_float_rte(exponent), -0.693147182464599609375f, t * p));
    const float f = convert_float_rte((int)(word * 0xE78DDE6Du)) * 0x1p-34f;
    const float g = f * f;
    const float s = fma(g, fma(g, 79.810546875f, -41.331077575683594f), 6.283175945281982f) * f;
    const float c = fma(g, fma(g, fma(g, -83.6659164428711f, 64.92322540283203f), -19.739168167114258f), 1.0f);
    const float rc = r * c;
    const normals2 pair = {as_float(as_uint(fma(-r, s, rc)) ^ word << 31),
                           as_float(as_uint(fma(r, s, rc)) ^ (word << 30 & 0x80000000u))};
    return pair;
}

// exp(x), |x| < 87: x = n ln 2 + r in two parts of ln 2, Taylor polynomial of exp(r), |r| <= ln(2) / 2 (relative error
// 8e-9 before rounding). Not the built-in: this feeds random numbers.
static inline ALWAYS_INLINE float exp_of(float x) {
    const float n = rint(x * 1.44269504f);
    const float r = fma(n, -1.428606765330187e-06f, fma(n, -0.693145751953125f, x));
    float p = fma(r, 1.98412698e-4f, 1.38888889e-3f);
    p = fma(r, p, 8.33333333e-3f);
    p = fma(r, p, 4.16666667e-2f);
    p = fma(r, p, 1.66666667e-1f);
    p = fma(r, p, 0.5f);
    p = fma(r, p, 1.0f);
    p = fma(r, p, 1.0f);
    return p * as_float(((int)n + 127) << 23);
}

#endif
