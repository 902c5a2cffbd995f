// Smooth random phase screens, correlated in time. core/stages/airflow.hpp has the equations.
#include "common/philox.h"

// The state: a complex number for each frequency of a box around 0, columns and rows from the lowest frequency to the
// highest. One work-item a Philox block: four rows of the box. state <- keep * state turned by -k wind + draw * w, w
// with independent standard normal parts, k the column's frequency bin, wind the part of the grid's width that the
// screen moves to the right.
__kernel void airflow_advance(__global complex_float *state, uint box_width, uint box_height, uint quarter, uint2 key,
                              uint frame_low, uint frame_high, uint substep, float keep, float draw, float wind) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= box_width || row >= quarter)
        return;
    // Words of 16 bits for the stream: the substep is its upper half.
    const uint stream = STREAM_AIRFLOW | substep << 8;
    const float angle = -2.0f * wind * ((float)x - (float)(box_width / 2u)); // half turns
    const float turn_re = wind == 0.0f ? keep : keep * cospi(angle),
                turn_im = wind == 0.0f ? 0.0f : keep * sinpi(angle);
    const normals4 re = normals_from_block(image_block(x, row, frame_low, frame_high, stream, key));
    const normals4 im = normals_from_block(image_block(x, row, frame_low, frame_high, stream + 1u, key));
#define ADVANCE(j, a, b)                                                                                               \
    if (row + j * quarter < box_height) {                                                                              \
        const ulong i = (ulong)(row + j * quarter) * box_width + x;                                                    \
        complex_float next = {draw * a, draw * b};                                                                     \
        if (keep > 0.0f) {                                                                                             \
            const complex_float last = state[i];                                                                       \
            next.re = fma(turn_re, last.re, fma(-turn_im, last.im, next.re));                                          \
            next.im = fma(turn_re, last.im, fma(turn_im, last.re, next.im));                                           \
        }                                                                                                              \
        state[i] = next;                                                                                               \
    }
    ADVANCE(0, re.n0, im.n0)
    ADVANCE(1, re.n1, im.n1)
    ADVANCE(2, re.n2, im.n2)
    ADVANCE(3, re.n3, im.n3)
}

typedef struct {
    __global const complex_float *state;
    __global const float *filter_x, *filter_y;
    uint box_width, box_height, grid_width, grid_height;
} box_t;

// Whether a frequency, in FFT order, lies in the box, whose sides are odd with frequency 0 in the middle.
static inline bool in_box(const box_t *b, uint x, uint y) {
    const uint half_width = b->box_width / 2u, half_height = b->box_height / 2u;
    return (x <= half_width || x >= b->grid_width - half_width) &&
           (y <= half_height || y >= b->grid_height - half_height);
}

// State times the filter, which is a product of one factor for each axis, at a frequency in the box.
static inline complex_float filtered(const box_t *b, uint x, uint y) {
    const uint half_width = b->box_width / 2u, half_height = b->box_height / 2u;
    const uint column = x <= half_width ? x + half_width : x - (b->grid_width - half_width);
    const uint row = y <= half_height ? y + half_height : y - (b->grid_height - half_height);
    const complex_float s = b->state[(ulong)row * b->box_width + column];
    const float g = b->filter_x[column] * b->filter_y[row];
    const complex_float value = {g * s.re, g * s.im};
    return value;
}

#if HALVES
// Of a spectrum V whose inverse transform's real part is wanted: that part's own, (V(f) + conj V(-f)) / 2. Frequency 0
// or above it in x.
static inline complex_float of_real_part(const box_t *b, uint x, uint y) {
    complex_float sum = {0.0f, 0.0f};
    if (in_box(b, x, y)) {
        const complex_float here = filtered(b, x, y);
        const complex_float there = filtered(b, x == 0u ? 0u : b->grid_width - x, y == 0u ? 0u : b->grid_height - y);
        sum.re = 0.5f * (here.re + there.re);
        sum.im = 0.5f * (here.im - there.im);
    }
    return sum;
}

// The spectrum of a field of half the width, M, whose numbers' parts are neighbours in a row of the screen:
// kernels/stages/filter.cl has how. roots: exp(-2 pi i k / 2M).
__kernel void airflow_spectrum(__global const complex_float *state, uint box_width, uint box_height,
                               __global const float *filter_x, __global const float *filter_y,
                               __global const complex_float *roots, __global complex_float *spectrum, uint grid_width,
                               uint grid_height) {
    const uint columns = grid_width / 2u;
    const uint k = get_global_id(0), y = get_global_id(1);
    if (k >= columns || y >= grid_height)
        return;
    const box_t b = {state, filter_x, filter_y, box_width, box_height, grid_width, grid_height};
    complex_float z = {0.0f, 0.0f};
    if (in_box(&b, k, y) || in_box(&b, k + columns, y)) {
        const complex_float low = of_real_part(&b, k, y), high = of_real_part(&b, k + columns, y), w = roots[k];
        const float re = 0.5f * (low.re - high.re), im = 0.5f * (low.im - high.im);
        const complex_float odd = {fma(w.re, re, w.im * im), fma(w.re, im, -w.im * re)};
        z.re = 0.5f * (low.re + high.re) - odd.im;
        z.im = 0.5f * (low.im + high.im) + odd.re;
    }
    spectrum[(ulong)y * columns + k] = z;
}
#else
// V in FFT order, 0 outside the box.
__kernel void airflow_spectrum(__global const complex_float *state, uint box_width, uint box_height,
                               __global const float *filter_x, __global const float *filter_y,
                               __global complex_float *spectrum, uint grid_width, uint grid_height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    const box_t b = {state, filter_x, filter_y, box_width, box_height, grid_width, grid_height};
    complex_float value = {0.0f, 0.0f};
    if (in_box(&b, x, y))
        value = filtered(&b, x, y);
    spectrum[(ulong)y * grid_width + x] = value;
}

__kernel void airflow_screen(__global const complex_float *field, __global float *screen, ulong count) {
    const ulong i = get_global_id(0);
    if (i < count)
        screen[i] = field[i].re;
}
#endif
