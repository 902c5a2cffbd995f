// The surface's random field: state, refresh, export. FIELD_UNIT_PHASOR 1: the state is the phase word itself (phase =
// 2 pi word / 2^32). 0: the state is the complex number z, circular Gaussian with E|z|^2 = 1.
#include "field_grid.h"
#include "philox.h"

#if FIELD_UNIT_PHASOR
typedef uint state_t;
#else
typedef complex_float state_t;
#endif

// One work-item a Philox block: four samples, one in each quarter of the grid's rows; the third dimension is the polarization.
__kernel void phase_refresh(__global state_t *state, uint grid_width, uint grid_height, uint quarter, uint2 key,
                            uint frame_low, uint frame_high
#if HAS_MASK
                            ,
                            __global const uchar *mask, ulong mask_offset, uint mask_pitch, uint width, uint height,
                            uint oversampling
#endif
) {
    const uint x = get_global_id(0), row = get_global_id(1), polarization = get_global_id(2);
    if (x >= grid_width || row >= quarter)
        return;
#if HAS_MASK
    const uint pixel_x = pixel_of_sample(x, oversampling, width, grid_width);
    uint selected = 0;
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y < grid_height) {
            const uint pixel_y = pixel_of_sample(y, oversampling, height, grid_height);
            selected |= (mask[mask_offset + (ulong)pixel_y * mask_pitch + pixel_x] != 0 ? 1u : 0u) << j;
        }
    }
    if (selected == 0)
        return;
#else
    const uint selected = 15u;
#endif
    const words4 phase = image_block(x, row, frame_low, frame_high, STREAM_PHASE + polarization, key);
#if !FIELD_UNIT_PHASOR
    const words4 magnitude = image_block(x, row, frame_low, frame_high, STREAM_MAGNITUDE + polarization, key);
#endif
    state += (ulong)polarization * grid_width * grid_height;
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= grid_height || !(selected >> j & 1u))
            continue;
        const ulong i = (ulong)y * grid_width + x;
#if FIELD_UNIT_PHASOR
        state[i] = word_of(phase, j);
#else
        // |z|^2 is exponential with mean 1 (Goodman): |z| = sqrt(-ln u).
        const float r = sqrt(minus_log(uniform_from_word(word_of(magnitude, j))));
        const complex_float p = phasor_from_word(word_of(phase, j));
        const state_t z = {r * p.re, r * p.im};
        state[i] = z;
#endif
    }
}

static inline complex_float unit_field(state_t state) {
#if FIELD_UNIT_PHASOR
    return phasor_from_word(state);
#else
    return state;
#endif
}

// z of one polarization, for inspection.
__kernel void phase_field(__global const state_t *state, ulong first, uint grid_width, uint grid_height,
                          __global float *field, ulong field_offset, uint field_pitch) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    const complex_float z = unit_field(state[first + (ulong)y * grid_width + x]);
    __global float *out = field + field_offset + (ulong)y * field_pitch + 2u * x;
    out[0] = z.re;
    out[1] = z.im;
}

// U = sqrt(I0) z on the field grid: the input of the aperture's transform (thesis section 3.3).
__kernel void phase_illuminate(__global const state_t *state, ulong first, uint grid_width, uint grid_height,
                               __global const float *irradiance, ulong irradiance_offset, uint irradiance_pitch, uint width,
                               uint height, uint oversampling, __global complex_float *field, __global uint *bad) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= grid_width || y >= grid_height)
        return;
    const uint pixel_x = pixel_of_sample(x, oversampling, width, grid_width);
    const uint pixel_y = pixel_of_sample(y, oversampling, height, grid_height);
    float i0 = irradiance[irradiance_offset + (ulong)pixel_y * irradiance_pitch + pixel_x];
    if (!(i0 >= 0.0f && i0 <= FLT_MAX)) {
        // Several samples, the padding and the second polarization share a pixel: it is counted once.
        if (first == 0 && x == oversampling * pixel_x && y == oversampling * pixel_y)
            report_bad(bad, i0, pixel_y * width + pixel_x);
        i0 = 0.0f;
    }
    const ulong i = (ulong)y * grid_width + x;
    const complex_float z = unit_field(state[first + i]);
    const float amplitude = sqrt(i0);
    const complex_float u = {amplitude * z.re, amplitude * z.im};
    field[i] = u;
}
