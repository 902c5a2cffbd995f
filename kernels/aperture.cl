// The lens's aperture: pupil in the frequency plane, intensity in the image plane.
#include "common.h"

// Multiplies the spectrum by the pupil's amplitude transmission.
__kernel void aperture_pupil(__global float2 *spectrum, __global const float *pupil, ulong count) {
    const ulong i = get_global_id(0);
    if (i < count)
        spectrum[i] *= pupil[i];
}

// Adds weight * |V|^2, averaged over the samples of a pixel, to `before` (or to nothing). before and intensity may be the same
// pixels.
__kernel void aperture_intensity(__global const float2 *field, uint grid_width, uint oversampling, float weight,
#if ACCUMULATE
                                 __global const float *before, ulong before_offset, uint before_pitch,
#endif
                                 __global float *intensity, ulong intensity_offset, uint intensity_pitch, uint width,
                                 uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float sum = 0.0f;
    for (uint j = 0; j < oversampling; ++j)
        for (uint i = 0; i < oversampling; ++i) {
            const float2 v = field[(ulong)(y * oversampling + j) * grid_width + (x * oversampling + i)];
            sum = fma(v.x, v.x, fma(v.y, v.y, sum));
        }
    sum *= weight / convert_float(oversampling * oversampling);
#if ACCUMULATE
    sum += before[before_offset + (ulong)y * before_pitch + x];
#endif
    intensity[intensity_offset + (ulong)y * intensity_pitch + x] = sum;
}
