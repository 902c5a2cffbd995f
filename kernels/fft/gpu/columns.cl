// The columns' pass of the engine for GPUs: FFT_LINES neighbouring pupil columns, transformed along the columns,
// multiplied by the pupil and transformed back, in place (the layout is in work_groups.h).
//   COMPLEX_PUPIL 1  the pupil has a phase (defocus, aberrations)
//   SHIFT 1          the image is shifted, by a phase ramp over the pupil
#include "fft/gpu/work_groups.h"

#if COMPLEX_PUPIL
typedef float2 pupil_t;
#else
typedef float pupil_t;
#endif

// pupil_columns: how many there are. pupil: amplitude / samples of the field grid, at last_entry() * pitch + line.
// frequencies: in the order of last_entry(), in cycles per sample along the column; line_frequencies: of each line,
// along the row. shift_x, shift_y: in samples. lines_back, pitch_back, twiddles_back: the same as lines, pitch and
// twiddles by other names, so that compilers do not keep all addresses and factors in registers on the way there and
// back.
__kernel WORK_GROUP_SIZE void gpu_columns(__global const float2 *lines, __global float2 *lines_back, uint pupil_columns,
                                          uint pitch, uint pitch_back, __global const float2 *twiddles,
                                          __global const float2 *twiddles_back, __global const pupil_t *pupil,
#if SHIFT
                                          __global const float *frequencies, __global const float *line_frequencies,
                                          float shift_x, float shift_y,
#endif
                                          __local float *tiles) {
    const uint line = ITEM_LINE, t = ITEM_T, k = (uint)get_group_id(0) * FFT_LINES + line;
    // Work-items beyond the last line read what lies behind it in each row, and store nothing.
    const uint column = min(k, pitch - 1u);
    __local float *tile = tiles + line * FFT_LINE_STRIDE;
    float re[FFT_POINTS], im[FFT_POINTS];
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        __global const float2 *from = lines + ((size_t)fft_first_point(b, 0u) * pitch + column);
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q) {
                const float2 v = from[(size_t)fft_first_point(0u, q) * pitch];
                re[c * FFT_FIRST_RADIX + q] = v.x;
                im[c * FFT_FIRST_RADIX + q] = v.y;
            }
        }
    }
    fft_forward(t, re, im, tile, twiddles);
#if SHIFT
    const float line_turns = line_frequencies[column] * shift_x;
#endif
#pragma unroll
    for (uint c = 0; c < FFT_LAST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        __global const pupil_t *amplitudes = pupil + ((size_t)b * pitch + column);
        if (fft_last_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_LAST_RADIX; ++q) {
                if (last_is_never(q)) // fft_inverse() does not ask for it
                    continue;
                complex_float v = {re[c * FFT_LAST_RADIX + q], im[c * FFT_LAST_RADIX + q]};
                const pupil_t transmission = amplitudes[(size_t)last_entry(0u, q) * pitch];
#if SHIFT
                v = product(v, phasor_from_turns(-(frequencies[last_entry(b, q)] * shift_y + line_turns)));
#endif
#if COMPLEX_PUPIL
                const complex_float p = {transmission.x, transmission.y};
                v = product(v, p);
#else
                v.re *= transmission;
                v.im *= transmission;
#endif
                re[c * FFT_LAST_RADIX + q] = v.re;
                im[c * FFT_LAST_RADIX + q] = v.im;
            }
        }
    }
    fft_inverse(t, re, im, tile, twiddles_back);
    if (k >= pupil_columns)
        return;
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        __global float2 *to = lines_back + ((size_t)fft_first_point(b, 0u) * pitch_back + k);
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q)
                to[(size_t)fft_first_point(0u, q) * pitch_back] =
                    (float2)(re[c * FFT_FIRST_RADIX + q], im[c * FFT_FIRST_RADIX + q]);
        }
    }
}
