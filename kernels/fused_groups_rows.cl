// Pass B of the fused speckle engine for work-groups: FFT_LINES kept lines, transformed along the rows, multiplied by the pupil and transformed
// back, in place (the layout is in fused_groups.h).
//   COMPLEX_PUPIL 1  the pupil has a phase (defocus, aberrations)
//   SHIFT 1          the image is shifted, by a phase ramp over the pupil
#include "fused_groups.h"

#if COMPLEX_PUPIL
typedef float2 pupil_t;
#else
typedef float pupil_t;
#endif

// kept: how many lines. pupil: amplitude / samples of the field grid, for each line in the order of last_entry(). frequencies: in the same
// order, in cycles per sample along the row; line_frequencies: of each line, along the column. shift_x, shift_y: in samples.
__kernel GROUP_SIZE void fused_groups_rows(__global float2 *lines, uint kept, __global const float2 *twiddles,
                                           __global const pupil_t *pupil,
#if SHIFT
                                           __global const float *frequencies, __global const float *line_frequencies, float shift_x,
                                           float shift_y,
#endif
                                           __local float *tiles) {
    const uint line = GROUP_LINE, t = GROUP_T, k = (uint)get_group_id(0) * FFT_LINES + line;
    __local float *tile = tiles + line * FFT_LINE_STRIDE;
    __global float2 *points = lines + (ulong)k * FFT_LENGTH;
    float re[FFT_HELD], im[FFT_HELD];
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q) {
                const float2 v = k < kept ? points[fft_first_point(b, q)] : (float2)(0.0f, 0.0f);
                re[c * FFT_FIRST_RADIX + q] = v.x;
                im[c * FFT_FIRST_RADIX + q] = v.y;
            }
        }
    }
    fft_forward(t, re, im, tile, twiddles);
    if (k < kept) {
        pupil += (ulong)k * FFT_LENGTH;
#if SHIFT
        const float row_turns = line_frequencies[k] * shift_y;
#endif
#pragma unroll
        for (uint c = 0; c < FFT_LAST_COUNT; ++c) {
            const uint b = t + c * FFT_ITEMS;
            if (fft_last_takes(b)) {
#pragma unroll
                for (uint q = 0; q < FFT_LAST_RADIX; ++q) {
                    complex_float v = {re[c * FFT_LAST_RADIX + q], im[c * FFT_LAST_RADIX + q]};
#if SHIFT
                    v = product(v, phasor_from_turns(-(frequencies[last_entry(b, q)] * shift_x + row_turns)));
#endif
#if COMPLEX_PUPIL
                    const complex_float p = {pupil[last_entry(b, q)].x, pupil[last_entry(b, q)].y};
                    v = product(v, p);
#else
                    v.re *= pupil[last_entry(b, q)];
                    v.im *= pupil[last_entry(b, q)];
#endif
                    re[c * FFT_LAST_RADIX + q] = v.re;
                    im[c * FFT_LAST_RADIX + q] = v.im;
                }
            }
        }
    }
    fft_inverse(t, re, im, tile, twiddles);
    if (k >= kept)
        return;
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q)
                points[fft_first_point(b, q)] = (float2)(re[c * FFT_FIRST_RADIX + q], im[c * FFT_FIRST_RADIX + q]);
        }
    }
}
