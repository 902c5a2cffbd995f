// The pupil in the frequency plane.
//   COMPLEX_PUPIL 1  it has a phase (defocus, aberrations)
//   SHIFT 1          the image is shifted, by a phase ramp over the pupil
#include "common/phasor.h"

#if COMPLEX_PUPIL || SHIFT
// Multiplies the spectrum by the pupil's amplitude, and by exp(-2 pi i (fx shift_x + fy shift_y)), shift in samples.
__kernel void apply_pupil(__global complex_float *spectrum,
#if COMPLEX_PUPIL
                          __global const complex_float *pupil,
#else
                          __global const float *pupil,
#endif
#if SHIFT
                          float shift_x, float shift_y,
#endif
                          uint width, uint height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const ulong i = (ulong)y * width + x;
#if COMPLEX_PUPIL
    complex_float p = pupil[i];
#else
    complex_float p = {pupil[i], 0.0f};
#endif
#if SHIFT
    const float kx = (float)((int)x - (2u * x < width ? 0 : (int)width)),
                ky = (float)((int)y - (2u * y < height ? 0 : (int)height));
    p = product(p, phasor_from_turns(-(kx / (float)width * shift_x + ky / (float)height * shift_y)));
#endif
    spectrum[i] = product(spectrum[i], p);
}
#else
// Multiplies the spectrum by the pupil's amplitude transmission.
__kernel void apply_pupil(__global float2 *spectrum, __global const float *pupil, ulong count) {
    const ulong i = get_global_id(0);
    if (i < count)
        spectrum[i] *= pupil[i];
}
#endif
