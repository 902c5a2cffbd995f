// Smooth random phase screens, correlated in time. core/stages/airflow.hpp has the equations.
#include "philox.h"

// The state: a complex number for each frequency of a box around 0, columns and rows from the lowest frequency to the highest. One
// work-item a Philox block: four rows of the box. state <- keep * state + draw * w, w with independent standard normal parts.
__kernel void airflow_advance(__global complex_float *state, uint box_width, uint box_height, uint quarter, uint2 key,
                              uint frame_low, uint frame_high, uint substep, float keep, float draw) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= box_width || row >= quarter)
        return;
    // Words of 16 bits for the stream: the substep is its upper half.
    const uint stream = STREAM_AIRFLOW | substep << 8;
    const normals4 re = normals_from_block(image_block(x, row, frame_low, frame_high, stream, key));
    const normals4 im = normals_from_block(image_block(x, row, frame_low, frame_high, stream + 1u, key));
#define ADVANCE(j, a, b)                                                                                               \
    if (row + j * quarter < box_height) {                                                                              \
        const ulong i = (ulong)(row + j * quarter) * box_width + x;                                                    \
        complex_float next = {draw * a, draw * b};                                                                     \
        if (keep > 0.0f) {                                                                                             \
            next.re = fma(keep, state[i].re, next.re);                                                                 \
            next.im = fma(keep, state[i].im, next.im);                                                                 \
        }                                                                                                              \
        state[i] = next;                                                                                               \
    }
    ADVANCE(0, re.n0, im.n0)
    ADVANCE(1, re.n1, im.n1)
    ADVANCE(2, re.n2, im.n2)
    ADVANCE(3, re.n3, im.n3)
}

// The screen's spectrum, FFT order: state times the filter, which is a product of one factor for each axis; 0 outside the box.
__kernel void airflow_spectrum(__global const complex_float *state, uint box_width, uint box_height,
                               __global const float *filter_x, __global const float *filter_y,
                               __global complex_float *spectrum, uint grid_width, uint grid_height) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    // Frequency 0 lies in the middle of the box, whose sides are odd.
    const uint half_width = box_width / 2u, half_height = box_height / 2u;
    const uint column = x <= half_width ? x + half_width : x - (grid_width - half_width);
    const uint row = y <= half_height ? y + half_height : y - (grid_height - half_height);
    complex_float value = {0.0f, 0.0f};
    if ((x <= half_width || x >= grid_width - half_width) && (y <= half_height || y >= grid_height - half_height)) {
        const complex_float s = state[(ulong)row * box_width + column];
        const float g = filter_x[column] * filter_y[row];
        value.re = g * s.re;
        value.im = g * s.im;
    }
    spectrum[(ulong)y * grid_width + x] = value;
}

__kernel void airflow_screen(__global const complex_float *field, __global float *screen, ulong count) {
    const ulong i = get_global_id(0);
    if (i < count)
        screen[i] = field[i].re;
}
