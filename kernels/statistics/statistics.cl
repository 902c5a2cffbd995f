// Reductions for the statistics calls. Each work-item strides over the pixels and leaves partial sums for the host to
// add in double precision; inside a work-item sums are carried as two floats (Knuth's two-sum), so the pixel count does
// not cost accuracy.
#include "common/pixel.h"

static inline float2 add(float2 sum, float value) {
    const float s = sum.x + value;
    const float v = s - sum.x;
    return (float2)(s, sum.y + ((sum.x - (s - v)) + (value - v)));
}

static inline float2 add_product(float2 sum, float a, float b) {
    const float p = a * b;
    sum.y += fma(a, b, -p);
    return add(sum, p);
}

static inline bool counts(__global const uchar *mask, ulong mask_offset, uint mask_pitch, uint x, uint y) {
#if HAS_MASK
    return mask[mask_offset + (ulong)y * mask_pitch + x] != 0;
#else
    return true;
#endif
}

// Per work-item: sum high, sum low, minimum, maximum (floats) and count, not finite (uints).
__kernel void statistics_first_moment(__global const pixel_t *image, ulong image_offset, uint image_pitch, uint width,
                                      uint height, __global const uchar *mask, ulong mask_offset, uint mask_pitch,
                                      __global float4 *partial, __global uint2 *counted) {
    const uint item = get_global_id(0), items = get_global_size(0);
    float2 sum = (float2)(0.0f, 0.0f);
    float low = INFINITY, high = -INFINITY;
    uint count = 0, not_finite = 0;
    for (uint p = item; p < width * height; p += items) {
        const uint y = p / width, x = p - y * width;
        if (!counts(mask, mask_offset, mask_pitch, x, y))
            continue;
        const float value = convert_float(image[image_offset + (ulong)y * image_pitch + x]);
        if (!isfinite(value)) {
            ++not_finite;
            continue;
        }
        ++count;
        sum = add(sum, value);
        low = fmin(low, value);
        high = fmax(high, value);
    }
    partial[item] = (float4)(sum.x, sum.y, low, high);
    counted[item] = (uint2)(count, not_finite);
}

// Per work-item: sums of d, d^2, d^3, d^4 with d = (value - mean) / scale; each as high and low float.
__kernel void statistics_central_moments(__global const pixel_t *image, ulong image_offset, uint image_pitch,
                                         uint width, uint height, __global const uchar *mask, ulong mask_offset,
                                         uint mask_pitch, float mean, float inverse_scale, __global float8 *partial) {
    const uint item = get_global_id(0), items = get_global_size(0);
    float2 s1 = (float2)(0.0f, 0.0f), s2 = s1, s3 = s1, s4 = s1;
    for (uint p = item; p < width * height; p += items) {
        const uint y = p / width, x = p - y * width;
        if (!counts(mask, mask_offset, mask_pitch, x, y))
            continue;
        const float d = (convert_float(image[image_offset + (ulong)y * image_pitch + x]) - mean) * inverse_scale;
        const float d2 = d * d;
        s1 = add(s1, d);
        s2 = add_product(s2, d, d);
        s3 = add_product(s3, d2, d);
        s4 = add_product(s4, d2, d2);
    }
    partial[item] = (float8)(s1, s2, s3, s4);
}

// counts[0]: below low, counts[bins + 1]: high and above, counts[bins + 2]: not finite.
__kernel void statistics_histogram(__global const pixel_t *image, ulong image_offset, uint image_pitch, uint width,
                                   uint height, __global const uchar *mask, ulong mask_offset, uint mask_pitch,
                                   float low, float high, float bins_per_unit, uint bins, __global uint *histogram) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height || !counts(mask, mask_offset, mask_pitch, x, y))
        return;
    const float value = convert_float(image[image_offset + (ulong)y * image_pitch + x]);
    uint bin;
    if (!isfinite(value))
        bin = bins + 2;
    else if (value < low)
        bin = 0;
    else if (value >= high)
        bin = bins + 1;
    else
        bin = 1u + min((uint)((value - low) * bins_per_unit), bins - 1u);
    atomic_inc(&histogram[bin]);
}

// The image less its mean, zero-padded to the grid, as a complex field.
__kernel void statistics_load(__global const pixel_t *image, ulong image_offset, uint image_pitch, uint width,
                              uint height, float mean, uint grid_width, uint grid_height, __global float2 *field) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    float value = 0.0f;
    if (x < width && y < height)
        value = convert_float(image[image_offset + (ulong)y * image_pitch + x]) - mean;
    field[(ulong)y * grid_width + x] = (float2)(value, 0.0f);
}

__kernel void statistics_power(__global float2 *field, ulong count) {
    const ulong i = get_global_id(0);
    if (i < count)
        field[i] = (float2)(dot(field[i], field[i]), 0.0f);
}
