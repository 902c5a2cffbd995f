// phase_refresh of everything, with explicit vectors: the same bits as phase.cl. A work-item draws row y mod Q of the
// grid, and with it the rows Q, 2 Q and 3 Q below (Q: a quarter of the rows), LANES columns at once.
//   FIELD_UNIT_PHASOR, PHASE_CONTINUOUS, PHASE_TRANSLATE as in phase.cl
#include "stages/phase_state.h"
#include "common/lanes.h"

static inline void store_gaussians(const lanes_words4 *phase, const lanes_words4 *magnitude, uint j, __global float *to,
                                   uint count) {
    lanes_complex z;
    gaussians_from_words(words_of(phase, j), words_of(magnitude, j), &z);
    store_some_interleaved(&z, to, count);
}

__kernel void phase_refresh_lanes(__global state_word *state, uint grid_width, uint grid_height, uint quarter,
                                  uint2 key, uint frame_low, uint frame_high, ulong rest_offset) {
    const uint row = get_global_id(0), polarization = get_global_id(2);
    if (row >= quarter)
        return;
    const ulong samples = (ulong)grid_width * grid_height, first = polarization * samples;
    for (uint x = 0; x < grid_width; x += LANES) {
        const uint count = min((uint)LANES, grid_width - x);
        lanes_words4 phase;
        image_blocks(x, row, frame_low, frame_high, STREAM_PHASE + polarization, key, &phase);
#if !FIELD_UNIT_PHASOR
        lanes_words4 magnitude;
        image_blocks(x, row, frame_low, frame_high, STREAM_MAGNITUDE + polarization, key, &magnitude);
#endif
#if PHASE_CONTINUOUS
        lanes_words4 next_phase, next_magnitude, start;
        image_blocks(x, row, frame_low, frame_high, STREAM_NEXT_PHASE + polarization, key, &next_phase);
        image_blocks(x, row, frame_low, frame_high, STREAM_NEXT_MAGNITUDE + polarization, key, &next_magnitude);
        image_blocks(x, row, frame_low, frame_high, STREAM_PATH_START, key, &start);
#endif
        for (uint j = 0; j < 4; ++j) {
            const uint y = row + j * quarter;
            if (y >= grid_height)
                break;
            const ulong i = (ulong)y * grid_width + x;
#if FIELD_UNIT_PHASOR
            store_some_words(words_of(&phase, j), state + first + i, count);
#else
            store_gaussians(&phase, &magnitude, j, state + knot_offset(samples, first, 0) + 2 * i, count);
#endif
#if PHASE_CONTINUOUS
            store_gaussians(&next_phase, &next_magnitude, j, state + knot_offset(samples, first, 1) + 2 * i, count);
            if (polarization == 0)
                store_some_words(words_of(&start, j), (__global uint *)state + i, count);
#endif
#if PHASE_TRANSLATE
            if (polarization == 0) {
                __global float *rest = (__global float *)(state + rest_offset) + 2 * i;
                for (uint k = 0; k < 2u * count; ++k)
                    rest[k] = 0.0f;
            }
#endif
        }
    }
}
