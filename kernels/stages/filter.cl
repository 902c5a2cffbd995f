// A linear filter of a real image by Fourier transforms. core/stages/filter.hpp has the equations.
#include "common/common.h"
#include "common/field_grid.h"

typedef struct {
    float re, im;
} complex_float;

// What the filter takes for a pixel's value: a bad one counts as 0 here, or the transform would spread it over the
// whole image.
static inline float filterable(float value) { return value >= 0.0f && value <= FLT_MAX ? value : 0.0f; }

#if HAS_WEIGHT
static inline float clean_weight(float weight) { return fmin(fmax(weight, 0.0f), 1.0f); } // fmax drops NaN
#endif

// The image on the padded grid (padding repeats the nearest edge pixel), times the weight f(x) if there is one.
__kernel void filter_load(__global const float *image, ulong image_offset, uint image_pitch, uint width, uint height,
#if HAS_WEIGHT
                          __global const float *weight, ulong weight_offset, uint weight_pitch,
#endif
                          __global float *field, uint grid_width, uint grid_height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    const uint pixel_x = pixel_of_sample(x, 1u, width, grid_width),
               pixel_y = pixel_of_sample(y, 1u, height, grid_height);
    float value = filterable(image[image_offset + (ulong)pixel_y * image_pitch + pixel_x]);
#if HAS_WEIGHT
    value *= clean_weight(weight[weight_offset + (ulong)pixel_y * weight_pitch + pixel_x]);
#endif
    field[(ulong)y * grid_width + x] = value;
}

// A real image of 2 M columns, transformed as M columns of complex numbers: Z(k, l) = E + i O, where E and O are the
// transforms of the even and of the odd columns, and
//     E = (Z(k, l) + conj Z(-k, -l)) / 2,   O = (Z(k, l) - conj Z(-k, -l)) / 2i,
//     F(k, l) = E + w O,   F(k + M, l) = E - w O,   w = exp(-2 pi i k / 2M) = roots[k]
// is the image's own. Z(-k, -l): the indices are periodic in M and in the number of rows.
typedef struct {
    complex_float even, odd;
} halves_t;
static inline halves_t halves_of(complex_float z, complex_float mirrored) {
    const halves_t h = {{0.5f * (z.re + mirrored.re), 0.5f * (z.im - mirrored.im)},
                        {0.5f * (z.im + mirrored.im), 0.5f * (mirrored.re - z.re)}};
    return h;
}
static inline uint mirrored_index(uint k, uint count) { return k == 0u ? 0u : count - k; }

// The transfer function T of a point spread that is real and symmetric: the real part of its transform F, 1 at
// frequency 0. What a filter needs of it: (T(k, l) + T(k + M, l)) / 2 and (T(k, l) - T(k + M, l)) / 2.
__kernel void filter_transfer(__global const complex_float *spectrum, __global const complex_float *roots,
                              __global float2 *transfer, uint columns, uint rows) {
    const uint k = get_global_id(0), l = get_global_id(1);
    if (k >= columns || l >= rows)
        return;
    const halves_t h = halves_of(spectrum[(ulong)l * columns + k],
                                 spectrum[(ulong)mirrored_index(l, rows) * columns + mirrored_index(k, columns)]);
    const float sum = spectrum[0].re + spectrum[0].im;
    const complex_float w = roots[k];
    const float odd = 2u * k == columns && (l == 0u || 2u * l == rows) ? 0.0f : w.re * h.odd.re - w.im * h.odd.im;
    transfer[(ulong)l * columns + k] = (float2)(h.even.re / sum, odd / sum);
}

// Z where F is multiplied by T: even and odd columns become s E + d w O and s O + d E / w, (s, d) = transfer. One
// work-item a pair of frequencies, Z(k, l) and Z(-k, -l).
__kernel void filter_multiply(__global complex_float *spectrum, __global const complex_float *roots,
                              __global const float2 *transfer, uint columns, uint rows) {
    const uint k = get_global_id(0), l = get_global_id(1);
    const uint mirrored_k = mirrored_index(k, columns), mirrored_l = mirrored_index(l, rows);
    if (k >= columns || l > mirrored_l || (l == mirrored_l && k > mirrored_k))
        return;
    const ulong here = (ulong)l * columns + k, there = (ulong)mirrored_l * columns + mirrored_k;
    const halves_t h = halves_of(spectrum[here], spectrum[there]);
    const complex_float w = roots[k];
    const float s = transfer[here].x, d = transfer[here].y;
    const complex_float even = {fma(s, h.even.re, d * fma(w.re, h.odd.re, -w.im * h.odd.im)),
                                fma(s, h.even.im, d * fma(w.re, h.odd.im, w.im * h.odd.re))};
    const complex_float odd = {fma(s, h.odd.re, d * fma(w.re, h.even.re, w.im * h.even.im)),
                               fma(s, h.odd.im, d * fma(w.re, h.even.im, -w.im * h.even.re))};
    const complex_float z = {even.re - odd.im, even.im + odd.re}, mirrored = {even.re + odd.im, odd.re - even.im};
    spectrum[here] = z;
    spectrum[there] = mirrored;
}

// out = (1 - f) in + fraction * field, f the fraction or f(x) (then the field has it already). image and output may be
// the same pixels. A bad pixel stays what it was, for the stage that reports it.
__kernel void filter_store(__global const float *field, uint grid_width, float fraction, __global const float *image,
                           ulong image_offset, uint image_pitch,
#if HAS_WEIGHT
                           __global const float *weight, ulong weight_offset, uint weight_pitch,
#endif
                           __global float *output, ulong output_offset, uint output_pitch, uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const float value = image[image_offset + (ulong)y * image_pitch + x];
    const float spread = field[(ulong)y * grid_width + x];
#if HAS_WEIGHT
    const float f = clean_weight(weight[weight_offset + (ulong)y * weight_pitch + x]);
    const float filtered = fma(1.0f - f, value, spread);
#else
    const float filtered = fma(1.0f - fraction, value, fraction * spread);
#endif
    // The transform's rounding must not make light negative.
    output[output_offset + (ulong)y * output_pitch + x] =
        value >= 0.0f && value <= FLT_MAX ? fmax(filtered, 0.0f) : value;
}
