// The first pass of the engine for GPUs: the field of FFT_LINES rows, its transform along the rows, and of that only
// the frequencies that the pupil lets through.
//   MATERIALS, COHERENT, LINES, SCREEN, PADDED as in field_sample.h; FIELD_UNIT_PHASOR, PHASE_CONTINUOUS as in
//   phase_state.h
//   OVERSAMPLING n
#include "stages/field_sample.h"
#include "fft/gpu/work_groups.h"

// slots: of each position's line, in the order of last_entry().
__kernel WORK_GROUP_SIZE void gpu_rows_forward(FIELD_PARAMETERS, __global float2 *lines, uint pitch, __global uint *bad,
                                               __global const float2 *twiddles, __global const uint *slots,
                                               __local float *tiles) {
    const uint line = ITEM_LINE, t = ITEM_T, y = (uint)get_group_id(0) * FFT_LINES + line;
    const uint row =
        min(y, grid_height - 1u); // work-items beyond the last row do what those of that row do, and store nothing
    float re[FFT_POINTS], im[FFT_POINTS];
    // No branch and no store stands between the reads: a GPU's compiler then issues many before it waits for the first.
    // Bad pixels are told afterwards.
    uint wrong = 0;
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_first_takes(b)) {
            field_input_t input[FFT_FIRST_RADIX];
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q)
                input[q] = field_input(FIELD_ARGUMENTS(OVERSAMPLING), fft_first_point((size_t)b, q), row);
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q) {
                const complex_float u =
                    field_value(FIELD_ARGUMENTS(OVERSAMPLING), input[q], &wrong, fft_first_point((size_t)b, q), row);
                re[c * FFT_FIRST_RADIX + q] = u.re;
                im[c * FFT_FIRST_RADIX + q] = u.im;
            }
        }
    }
    if (wrong && y < grid_height)
#pragma unroll 1
        for (uint b = t; b < FFT_FIRST_BUTTERFLIES; b += FFT_ITEMS)
#pragma unroll 1
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q)
                field_report(FIELD_ARGUMENTS(OVERSAMPLING), bad, fft_first_point(b, q), row);
    fft_forward(t, re, im, tiles + line * FFT_LINE_STRIDE, twiddles);
    if (y >= grid_height)
        return;
    lines += y * pitch;
#pragma unroll
    for (uint c = 0; c < FFT_LAST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_last_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_LAST_RADIX; ++q) {
                if (last_is_never(q))
                    continue;
                const size_t slot = last_slot(slots, b, q);
                if (last_is_always(q) || slot != NO_SLOT)
                    lines[slot] = (float2)(re[c * FFT_LAST_RADIX + q], im[c * FFT_LAST_RADIX + q]);
            }
        }
    }
}
