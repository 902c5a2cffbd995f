// Pass A of the fused speckle engine for work-groups: the field of FFT_LINES neighbouring columns, its transform along the columns, and of
// that only the lines that the pupil lets through.
//   MATERIALS, COHERENT, LINES, SCREEN as in field_sample.h; FIELD_UNIT_PHASOR, PHASE_CONTINUOUS as in phase_state.h
//   OVERSAMPLING n
#include "field_sample.h"
#include "fused_groups.h"

// slots: of each position's line, in the order of last_entry().
__kernel GROUP_SIZE void fused_groups_columns_forward(FIELD_PARAMETERS, __global float2 *lines, __global uint *bad,
                                                      __global const float2 *twiddles, __global const uint *slots,
                                                      __local float *tiles) {
    const uint line = GROUP_LINE, t = GROUP_T, x = (uint)get_group_id(0) * FFT_LINES + line;
    float re[FFT_HELD], im[FFT_HELD];
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q) {
                complex_float u = {0.0f, 0.0f};
                if (x < grid_width)
                    u = field_sample(FIELD_ARGUMENTS(OVERSAMPLING), bad, x, fft_first_point(b, q));
                re[c * FFT_FIRST_RADIX + q] = u.re;
                im[c * FFT_FIRST_RADIX + q] = u.im;
            }
        }
    }
    fft_forward(t, re, im, tiles + line * FFT_LINE_STRIDE, twiddles);
    if (x >= grid_width)
        return;
#pragma unroll
    for (uint c = 0; c < FFT_LAST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_last_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_LAST_RADIX; ++q) {
                const uint slot = slots[last_entry(b, q)];
                if (slot != NO_SLOT)
                    lines[(ulong)slot * grid_width + x] = (float2)(re[c * FFT_LAST_RADIX + q], im[c * FFT_LAST_RADIX + q]);
            }
        }
    }
}
