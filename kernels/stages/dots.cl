// Ideal projected dots. The equations are in dots.h of the C API.
#include "common/common.h"

#define TILE_PX 16

// No built-in exp, log2 or pow: these let compilers vectorize (PoCL calls the built-ins one by one), and all devices
// agree.

// exp(g) for |g| <= ln(2) / 2: Cephes's polynomial of expf, error 1e-7.
static inline float exp_near_0(float g) {
    float e = fma(g, 1.9875691500e-4f, 1.3981999507e-3f);
    e = fma(g, e, 8.3334519073e-3f);
    e = fma(g, e, 4.1665795894e-2f);
    e = fma(g, e, 1.6666665459e-1f);
    e = fma(g, e, 5.0000001201e-1f);
    return fma(g * g, e, g) + 1.0f;
}

// exp(-t) for 0 <= t <= 87: 2^-k exp(k ln 2 - t), ln 2 in two parts.
static inline float exp_of_minus(float t) {
    const float k = floor(fma(t, 1.44269504f, 0.5f));
    const float g = fma(k, -2.12194440e-4f, fma(k, 0.693359375f, -t));
    return exp_near_0(g) * as_float((127 - (int)k) << 23);
}

// x^power / 2 for x >= 0 and power >= 1, at most 128. x = 2^e m with m in [sqrt(1/2), sqrt(2)), log(m) by Cephes's
// polynomial of logf.
static inline float half_power(float x, float power) {
    const int bits = as_int(x), e = (bits - 0x3f3504f3) >> 23;
    const float m = as_float(bits - (int)((uint)e << 23)) - 1.0f;
    float log_m = fma(m, 7.0376836292e-2f, -1.1514610310e-1f);
    log_m = fma(m, log_m, 1.1676998740e-1f);
    log_m = fma(m, log_m, -1.2420140846e-1f);
    log_m = fma(m, log_m, 1.4249322787e-1f);
    log_m = fma(m, log_m, -1.6668057665e-1f);
    log_m = fma(m, log_m, 2.0000714765e-1f);
    log_m = fma(m, log_m, -2.4999993993e-1f);
    log_m = fma(m, log_m, 3.3333331174e-1f);
    log_m = fma(m * m, fma(m, log_m, -0.5f), m);
    const float y = clamp(power * fma(log_m, 1.44269504f, convert_float(e)), -100.0f, 8.0f);
    const float k = floor(y + 0.5f);
    return exp_near_0((y - k) * 0.693147181f) * as_float(((int)k + 126) << 23);
}

// A dot's profile at (u, v), in units of its sigma.
static inline float profile(float u, float v, float cosine, float sine, float skew_sixth, float power) {
    const float r2 = fma(u, u, v * v);
#if FLAT_TOP
    const float t = half_power(r2, power);
#else
    const float t = 0.5f * r2;
#endif
    const float e = exp_of_minus(fmin(t, 87.0f));
#if SKEW
    // Bounded, so that 0 times infinity cannot happen far away.
    const float a = clamp(fma(cosine, u, sine * v), -30.0f, 30.0f);
    return e * fmax(0.0f, fma(skew_sixth, a * fma(a, a, -3.0f), 1.0f));
#else
    return e;
#endif
}

// The dots of a tile at the pixels of one of its rows, summed in the order of their indices. A position is the nearest
// pixel and the rest, so that the difference from a pixel is good to 3e-8 px anywhere in the image. The loop over the
// pixels is the inner one for the sake of CPUs, whose compilers vectorize nothing but innermost loops.
static inline void dots_of_row(uint tile_x, uint y, uint tiles_x, __global const uint *first,
                               __global const uint *members, __global const int *nearest, __global const float *shape,
                               float cosine, float sine, float skew_sixth, float power, float *sums) {
    float lost[TILE_PX]; // Kahan's summation: thousands of wide dots may overlap
    for (int i = 0; i < TILE_PX; ++i)
        sums[i] = lost[i] = 0.0f;
    const uint tile = y / TILE_PX * tiles_x + tile_x, end = first[tile + 1];
    for (uint m = first[tile]; m < end; ++m) {
        const uint j = members[m];
        const int left = (int)(tile_x * TILE_PX) - nearest[2 * j];
        const float rest = shape[4 * j], scale = shape[4 * j + 2], peak = shape[4 * j + 3];
        const float v = (convert_float((int)y - nearest[2 * j + 1]) - shape[4 * j + 1]) * scale;
        for (int i = 0; i < TILE_PX; ++i) {
            const float u = (convert_float(left + i) - rest) * scale;
            const float value = fma(peak, profile(u, v, cosine, sine, skew_sixth, power), -lost[i]);
            const float next = sums[i] + value;
            lost[i] = (next - sums[i]) - value;
            sums[i] = next;
        }
    }
}

// first: of each tile the first index into members, and the end; members: dots that reach the tile. nearest: x, y of
// the nearest pixel; shape: what is left of the position in x and y, 1 / sigma, peak. One work-item: a row of a tile.
__kernel void dots_render(__global const uint *first, __global const uint *members, __global const int *nearest,
                          __global const float *shape, float cosine, float sine, float skew_sixth, float power,
                          uint tiles_x, uint width, uint height, float kept, float background,
                          __global float *irradiance, ulong irradiance_offset, uint irradiance_pitch) {
    const uint tile_x = get_global_id(0), y = get_global_id(1);
    if (tile_x >= tiles_x || y >= height)
        return;
    float sums[TILE_PX];
    dots_of_row(tile_x, y, tiles_x, first, members, nearest, shape, cosine, sine, skew_sixth, power, sums);
    __global float *row = irradiance + irradiance_offset + (ulong)y * irradiance_pitch + tile_x * TILE_PX;
    const int count = min(TILE_PX, (int)(width - tile_x * TILE_PX));
    for (int i = 0; i < count; ++i) {
#if SCATTER
        row[i] = fma(sums[i], kept, background);
#else
        row[i] = sums[i];
#endif
    }
}

// The sum over the pixels of each row of each tile, for the mean of the image.
__kernel void dots_row_sums(__global const uint *first, __global const uint *members, __global const int *nearest,
                            __global const float *shape, float cosine, float sine, float skew_sixth, float power,
                            uint tiles_x, uint width, uint height, __global float *row_sums) {
    const uint tile_x = get_global_id(0), y = get_global_id(1);
    if (tile_x >= tiles_x || y >= height)
        return;
    float sums[TILE_PX];
    dots_of_row(tile_x, y, tiles_x, first, members, nearest, shape, cosine, sine, skew_sixth, power, sums);
    const int count = min(TILE_PX, (int)(width - tile_x * TILE_PX));
    float sum = 0.0f;
    for (int i = 0; i < count; ++i)
        sum += sums[i];
    row_sums[y * tiles_x + tile_x] = sum;
}
