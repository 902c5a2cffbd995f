// The image plane behind the lens's aperture.
//   ACCUMULATE 1     the intensity is added to what there is
//   SAMPLE_POWERS 1  aperture_intensity takes |V|^2 of the samples, not V
//   PIXEL_TAPS n     a pixel's value is a weighted sum over n x n samples around its centre; 0: the mean of its own
//                    samples
#include "common/common.h"

#if SAMPLE_POWERS
typedef float sample_t;
static inline float power_of(float power) { return power; }
#else
typedef float2 sample_t;
static inline float power_of(float2 v) { return fma(v.x, v.x, v.y * v.y); }
#endif

// weight * |V|^2 of a pixel, alone or added to `before`. before and intensity may be the same pixels.
__kernel void aperture_intensity(__global const sample_t *field, uint grid_width, uint grid_height, uint oversampling,
                                 float weight,
#if PIXEL_TAPS
                                 __global const float *taps,
#endif
#if ACCUMULATE
                                 __global const float *before, ulong before_offset, uint before_pitch,
#endif
                                 __global float *intensity, ulong intensity_offset, uint intensity_pitch, uint width,
                                 uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float sum = 0.0f;
#if PIXEL_TAPS
    // The taps are centred on the pixel; the field is periodic, and no narrower than they. Counting on: a division for
    // each tap would take longer than all else.
    const uint first = (PIXEL_TAPS - oversampling) / 2u;
    const uint left = (x * oversampling + grid_width - first) % grid_width;
    uint row = (y * oversampling + grid_height - first) % grid_height;
    for (uint j = 0; j < PIXEL_TAPS; ++j) {
        __global const sample_t *line = field + (ulong)row * grid_width;
        uint column = left;
        float row_sum = 0.0f;
        for (uint i = 0; i < PIXEL_TAPS; ++i) {
            row_sum = fma(taps[i], power_of(line[column]), row_sum);
            column = column + 1u == grid_width ? 0u : column + 1u;
        }
        row = row + 1u == grid_height ? 0u : row + 1u;
        sum = fma(taps[j], row_sum, sum);
    }
    // The taps stand for an integral, whose value cannot fall below 0; theirs can, by a rounding's worth at dark
    // places.
    sum = fmax(sum, 0.0f) * weight;
#else
    for (uint j = 0; j < oversampling; ++j)
        for (uint i = 0; i < oversampling; ++i)
            sum += power_of(field[(ulong)(y * oversampling + j) * grid_width + (x * oversampling + i)]);
    sum *= weight / convert_float(oversampling * oversampling);
#endif
#if ACCUMULATE
    sum += before[before_offset + (ulong)y * before_pitch + x];
#endif
    intensity[intensity_offset + (ulong)y * intensity_pitch + x] = sum;
}

// Incoherent light: no speckle, the same mean. factor is the pupil's mean transmission. in and out may be the same
// pixels.
__kernel void aperture_incoherent(__global const float *irradiance, ulong irradiance_offset, uint irradiance_pitch,
                                  float factor, __global float *intensity, ulong intensity_offset, uint intensity_pitch,
                                  uint width, uint height, __global uint *bad) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x < width && y < height)
        intensity[intensity_offset + (ulong)y * intensity_pitch + x] =
            factor * sanitized(irradiance[irradiance_offset + (ulong)y * irradiance_pitch + x], bad, y * width + x);
}

// No light at all.
__kernel void aperture_dark(__global float *intensity, ulong intensity_offset, uint intensity_pitch, uint width,
                            uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x < width && y < height)
        intensity[intensity_offset + (ulong)y * intensity_pitch + x] = 0.0f;
}
