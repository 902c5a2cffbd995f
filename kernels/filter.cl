// A linear filter of a real image by Fourier transforms. core/stages/filter.hpp has the equations.
#include "common.h"
#include "field_grid.h"

typedef struct {
    float re, im;
} complex_float;

// What the filter takes for a pixel's value: a bad one counts as 0 here, or the transform would spread it over the whole image.
static inline float filterable(float value) { return value >= 0.0f && value <= FLT_MAX ? value : 0.0f; }

#if HAS_WEIGHT
static inline float clean_weight(float weight) { return fmin(fmax(weight, 0.0f), 1.0f); } // fmax drops NaN
#endif

// The image on the padded grid (padding repeats the nearest edge pixel), times the weight f(x) if there is one.
__kernel void filter_load(__global const float *image, ulong image_offset, uint image_pitch, uint width, uint height,
#if HAS_WEIGHT
                          __global const float *weight, ulong weight_offset, uint weight_pitch,
#endif
                          __global complex_float *field, uint grid_width, uint grid_height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    const uint pixel_x = pixel_of_sample(x, 1u, width, grid_width), pixel_y = pixel_of_sample(y, 1u, height, grid_height);
    float value = filterable(image[image_offset + (ulong)pixel_y * image_pitch + pixel_x]);
#if HAS_WEIGHT
    value *= clean_weight(weight[weight_offset + (ulong)pixel_y * weight_pitch + pixel_x]);
#endif
    const complex_float sample = {value, 0.0f};
    field[(ulong)y * grid_width + x] = sample;
}

// The transfer function of a point spread that is real and symmetric: the real part of its transform, 1 at frequency 0.
__kernel void filter_transfer(__global const complex_float *spectrum, __global float *transfer, ulong count) {
    const ulong i = get_global_id(0);
    if (i < count)
        transfer[i] = spectrum[i].re / spectrum[0].re;
}

__kernel void filter_multiply(__global complex_float *spectrum, __global const float *transfer, ulong count) {
    const ulong i = get_global_id(0);
    if (i >= count)
        return;
    const float h = transfer[i];
    const complex_float product = {h * spectrum[i].re, h * spectrum[i].im};
    spectrum[i] = product;
}

// out = (1 - f) in + fraction * field, f the fraction or f(x) (then the field has it already). image and output may be the same
// pixels. A bad pixel stays what it was, for the stage that reports it.
__kernel void filter_store(__global const complex_float *field, uint grid_width, float fraction, __global const float *image,
                           ulong image_offset, uint image_pitch,
#if HAS_WEIGHT
                           __global const float *weight, ulong weight_offset, uint weight_pitch,
#endif
                           __global float *output, ulong output_offset, uint output_pitch, uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const float value = image[image_offset + (ulong)y * image_pitch + x];
    const float spread = field[(ulong)y * grid_width + x].re;
#if HAS_WEIGHT
    const float f = clean_weight(weight[weight_offset + (ulong)y * weight_pitch + x]);
    const float filtered = fma(1.0f - f, value, spread);
#else
    const float filtered = fma(1.0f - fraction, value, fraction * spread);
#endif
    // The transform's rounding must not make light negative.
    output[output_offset + (ulong)y * output_pitch + x] = value >= 0.0f && value <= FLT_MAX ? fmax(filtered, 0.0f) : value;
}
