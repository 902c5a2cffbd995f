// sensor_expose with explicit vectors for CPU devices: a work-item has a row of each quarter of the image.
#include "sensor_lanes.h"

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

__kernel void sensor_expose_lanes(__global const float *intensity, ulong intensity_offset, uint intensity_pitch, SENSOR_PARAMETERS) {
    const camera_t camera = SENSOR_CAMERA;
    const sensor_t *s = &camera.s;
    const uint quarter_row = get_global_id(0);
    if (quarter_row >= s->quarter)
        return;
    intensity += intensity_offset;
    const int plain = is_plain(&camera);
    for (uint first = 0; first < s->width; first += NOISE_BLOCKS * LANES) {
        const noise_blocks_t blocks = {first, NOISE_BLOCKS, quarter_row, min((uint)NOISE_BLOCKS, (s->width - first + LANES - 1) / LANES)};
        frame_noise_t noise;
        draw_noise(s, &blocks, &noise);
        for (uint j = 0; j < 4; ++j) {
            const uint y = quarter_row + j * s->quarter;
            if (y >= s->height)
                break;
            __global const float *row = intensity + (ulong)y * intensity_pitch;
            for (uint k = 0; k < blocks.count; ++k) {
                const uint x = block_x(&blocks, k), count = min((uint)LANES, s->width - x);
                lanes_f value = signals_of(s, load_some(row + x, count));
                if (plain) {
                    expose_plain_lanes(&camera, x, count, y, j, k, &noise, value);
                    continue;
                }
                if (s->switches & SENSOR_CROSSTALK) {
                    const lanes_f neighbours = (neighbour_signals(s, row, x, -1) + neighbour_signals(s, row, x, 1)) +
                                               (neighbour_signals(s, y > 0 ? row - intensity_pitch : row, x, 0) +
                                                neighbour_signals(s, y + 1 < s->height ? row + intensity_pitch : row, x, 0));
                    value = fma(SPREAD(0.25f * s->crosstalk), neighbours, (1.0f - s->crosstalk) * value);
                }
                expose_lanes(&camera, x, count, y, j, k, &noise, value);
            }
        }
    }
}
