// sensor_expose with explicit vectors for CPU devices: a work-item has two rows of each quarter of the image, which
// share random numbers.
#include "stages/sensor_lanes.h"

// Signals of the pixels step columns to the right of x and on; beyond the border those of the outermost.
static inline lanes_f neighbour_signals(const sensor_t *s, __global const float *row, uint x, int step) {
    const int first = (int)x + step;
    if (first >= 0 && first + LANES <= (int)s->width)
        return signals_of(s, vload_lanes(0, row + first));
    float values[LANES];
    for (int lane = 0; lane < LANES; ++lane)
        values[lane] = row[clamp(first + lane, 0, (int)s->width - 1)];
    return signals_of(s, vload_lanes(0, values));
}

__kernel void sensor_expose_lanes(__global const float *intensity, ulong intensity_offset, uint intensity_pitch,
                                  SENSOR_PARAMETERS) {
    const camera_t camera = SENSOR_CAMERA;
    const sensor_t *s = &camera.s;
    const uint quarter_row = 2u * get_global_id(0);
    if (quarter_row >= s->quarter)
        return;
    intensity += intensity_offset;
    const uint rows = min(2u, s->quarter - quarter_row);
    const camera_kind_t kind = kind_of(&camera);
    for (uint first = 0; first < s->width; first += NOISE_BLOCKS / 2 * LANES) {
        const uint across = min((uint)NOISE_BLOCKS / 2, (s->width - first + LANES - 1) / LANES);
        const noise_blocks_t blocks = {first, across, quarter_row, across * rows};
        frame_noise_t noise;
        draw_noise(s, &blocks, &noise);
        for (uint j = 0; j < 4; ++j)
            for (uint k = 0; k < blocks.count; ++k) {
                const uint y = block_row(&blocks, k) + j * s->quarter;
                if (y >= s->height)
                    break;
                __global const float *row = intensity + (ulong)y * intensity_pitch;
                const uint x = block_x(&blocks, k), count = min((uint)LANES, s->width - x);
                __global output_t *to = camera.output + (ulong)y * camera.output_pitch + x;
                lanes_f value = signals_of(s, load_some(row + x, count));
                if (kind != CAMERA_ANY) {
                    store_codes(
                        to, count,
                        expose_plain_lanes(&camera, kind, s->switches & SENSOR_READ_NOISE, noise.read[k][j], value));
                    continue;
                }
                if (s->switches & SENSOR_CROSSTALK) {
                    const lanes_f neighbours =
                        (neighbour_signals(s, row, x, -1) + neighbour_signals(s, row, x, 1)) +
                        (neighbour_signals(s, y > 0 ? row - intensity_pitch : row, x, 0) +
                         neighbour_signals(s, y + 1 < s->height ? row + intensity_pitch : row, x, 0));
                    value = fma(SPREAD(0.25f * s->crosstalk), neighbours, (1.0f - s->crosstalk) * value);
                }
                store_codes(to, count, expose_lanes(&camera, x, count, y, j, k, &noise, value));
            }
    }
}
