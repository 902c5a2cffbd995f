// The columns' pass of the engine for CPUs: LANES pupil columns at once, transformed along the columns, multiplied by
// the pupil and transformed back (the layout is in rows_forward.cl). All is done in place, also between the stages: a
// tile beside the lines would need as much of the caches again.
//   COMPLEX_PUPIL 1  the pupil has a phase (defocus, aberrations)
//   HARD_PUPIL 1     the pupil is 0 or one number: a bit for each line instead of a number, which would be a quarter as
//                    many bytes as the pupil columns
//   SHIFT 1          the image is shifted, by a phase ramp over the pupil
#include "common/lanes.h"

#define FFT_TILE __global
#define FFT_STRIPS 1
#define FFT_INPUT(strip, p, re, im) re = tiles[2u * (p)], im = tiles[2u * (p) + 1u]
#define FFT_ENDS
#define FFT_INPUT_LOOP _Pragma("unroll")
#define FFT_OUTPUT(strip, p, re, im) tiles[2u * (p)] = re, tiles[2u * (p) + 1u] = im

// *a times b.
static inline void multiply_lanes(lanes_complex *a, const lanes_complex *b) {
    const lanes_f re = a->re * b->re - a->im * b->im, im = a->re * b->im + a->im * b->re;
    a->re = re;
    a->im = im;
}

#if HARD_PUPIL
#define PUPIL_PARAMETERS __global const uint *pupil, float amplitude
#define PUPIL_ARGUMENTS pupil, amplitude
#define PUPIL_NUMBERS 1u
#elif COMPLEX_PUPIL
#define PUPIL_PARAMETERS __global const lanes_f *pupil
#define PUPIL_ARGUMENTS pupil
#define PUPIL_NUMBERS 2u
#else
#define PUPIL_PARAMETERS __global const lanes_f *pupil
#define PUPIL_ARGUMENTS pupil
#define PUPIL_NUMBERS 1u
#endif

#if SHIFT
// frequencies: of each position along the column, in cycles per sample; column_turns: frequency along the row times
// shift_x, of each lane.
#define FFT_PUPIL_PARAMETERS , PUPIL_PARAMETERS, __global const float *frequencies, float shift_y, lanes_f column_turns
#define FFT_PUPIL_ARGUMENTS , PUPIL_ARGUMENTS, frequencies, shift_y, column_turns
static inline void filter_lanes(lanes_complex *v, uint p FFT_PUPIL_PARAMETERS) {
    const lanes_f turns = -(frequencies[p] * shift_y + column_turns);
    lanes_complex ramp;
    phasors_from_turns(turns, &ramp);
    multiply_lanes(v, &ramp);
#else
#define FFT_PUPIL_PARAMETERS , PUPIL_PARAMETERS
#define FFT_PUPIL_ARGUMENTS , PUPIL_ARGUMENTS
static inline void filter_lanes(lanes_complex *v, uint p FFT_PUPIL_PARAMETERS) {
#endif
#if HARD_PUPIL
    const lanes_i passes = ((lanes_u)(pupil[p]) & ((lanes_u)(1u) << lane_numbers())) != 0u;
    v->re = select(SPREAD(0.0f), v->re * amplitude, passes);
    v->im = select(SPREAD(0.0f), v->im * amplitude, passes);
#elif COMPLEX_PUPIL
    const lanes_complex t = {pupil[2u * p], pupil[2u * p + 1u]};
    multiply_lanes(v, &t);
#else
    v->re *= pupil[p];
    v->im *= pupil[p];
#endif
}
#define FFT_PUPIL(p, real, imaginary)                                                                                  \
    {                                                                                                                  \
        lanes_complex v = {real, imaginary};                                                                           \
        filter_lanes(&v, p FFT_PUPIL_ARGUMENTS);                                                                       \
        real = v.re;                                                                                                   \
        imaginary = v.im;                                                                                              \
    }

#include "fft/cpu/codelets.h"

// pupil: amplitude / samples of the field grid, or the lanes' bits, in the order of positions, for each of pupil_blocks
// blocks of columns; then they begin anew. ends: of the transform (needed_ends() of the host), for each of the pupil's
// blocks.
__kernel void cpu_columns(__global lanes_f *lines, uint column_blocks, uint pupil_blocks,
                          __global const float *twiddles, __global const uchar *ends, PUPIL_PARAMETERS
#if SHIFT
                          ,
                          __global const float *frequencies, __global const lanes_f *line_frequencies, float shift_x,
                          float shift_y
#endif
) {
    const uint column_block = get_global_id(0);
    if (column_block >= column_blocks)
        return;
    __global lanes_f *tiles = lines + 2 * (ulong)column_block * FFT_LENGTH;
    const uint pupil_block = column_block % pupil_blocks;
    pupil += (ulong)pupil_block * PUPIL_NUMBERS * FFT_LENGTH;
    ends += pupil_block * FFT_ENDS_COUNT;
#if SHIFT
    const lanes_f column_turns = line_frequencies[pupil_block] * shift_x;
#endif
    fft_forward_first
    for (uint block = 0; block < FFT_BLOCKS; ++block)
        fft_filter_block(block, tiles, twiddles FFT_ENDS_ARGUMENT FFT_PUPIL_ARGUMENTS);
    fft_inverse_last
}
