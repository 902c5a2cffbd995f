// From intensity to codes. The equations are in sensor.h of the C API.
#include "common/philox.h"

#if FIXED_PATTERN

// Drawn once. offset (dark frame already in it) gains hot pixels, DSNU, column and row offsets and a wave; response is 0
// at cold pixels and 1 elsewhere; pixel_gain (with GAIN_MAP the map is already in it) is the PRNU of pixels, columns and
// rows, less at dull pixels, 0 at cold ones;
// read_noise_map is each pixel's standard deviation. periodic_x, periodic_y: 2^-32 turns from pixel to pixel; dull_slope:
// of a dull pixel's gain over its random number. Only what is on is written: the other buffers may be NULL. One work-item
// a Philox block.
__kernel void sensor_fixed_pattern(__global float *offset, __global uchar *response, __global float *pixel_gain,
                                   __global float *read_noise_map, uint width, uint height, uint quarter, uint2 key,
                                   float hot_fraction, float hot_mean, float cold_fraction, float prnu,
                                   float column_prnu, float row_prnu, float dull_fraction, float dull_slope, float dsnu,
                                   float column_offset, float row_offset, float periodic, uint periodic_x, uint periodic_y,
                                   float read_noise, float read_noise_spread) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= width || row >= quarter)
        return;
    const words4 hot = image_block(x, row, 0, 0, STREAM_HOT_PIXEL, key);
    const words4 hot_offset = image_block(x, row, 0, 0, STREAM_HOT_OFFSET, key);
    const words4 cold = image_block(x, row, 0, 0, STREAM_COLD_PIXEL, key);
    const normals4 gains = normals_from_block(image_block(x, row, 0, 0, STREAM_PRNU, key));
    const normals4 offsets = normals_from_block(image_block(x, row, 0, 0, STREAM_DSNU, key));
    const normals4 column = normals_from_block(image_block(x, 0, 0, 0, STREAM_COLUMN_OFFSET, key));
    const normals4 spread = normals_from_block(image_block(x, row, 0, 0, STREAM_READ_NOISE_SPREAD, key));
    const normals4 column_gain = normals_from_block(image_block(x, 0, 0, 0, STREAM_COLUMN_PRNU, key));
    const normals4 row_gains = normals_from_block(image_block(0, row, 0, 0, STREAM_ROW_PRNU, key));
    const words4 dull = image_block(x, row, 0, 0, STREAM_DULL_PIXEL, key);
    const normals4 row_offsets = normals_from_block(image_block(0, row, 0, 0, STREAM_ROW_OFFSET, key));
    const words4 periodic_phase = image_block(0, 0, 0, 0, STREAM_PERIODIC_PHASE, key);
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= height)
            continue;
        const ulong i = (ulong)y * width + x;
#if HOT
        if (uniform_from_word(word_of(hot, j)) < hot_fraction)
            offset[i] += hot_mean * minus_log(uniform_from_word(word_of(hot_offset, j)));
#endif
#if DSNU
        offset[i] += dsnu * normal_of(offsets, j);
#endif
#if COLUMN_OFFSET
        offset[i] += column_offset * column.n0;
#endif
#if ROW_OFFSET
        offset[i] += row_offset * normal_of(row_offsets, j);
#endif
#if PERIODIC
        offset[i] += periodic * phasor_from_word(periodic_phase.w0 + x * periodic_x + y * periodic_y).im;
#endif
        const bool is_cold = uniform_from_word(word_of(cold, j)) < cold_fraction;
#if COLD
        response[i] = is_cold ? 0 : 1;
#endif
#if PRNU
        float gain = is_cold ? 0.0f : fmax(fma(prnu, normal_of(gains, j), 1.0f), 0.0f);
#if COLUMN_PRNU
        gain *= fmax(fma(column_prnu, column_gain.n0, 1.0f), 0.0f);
#endif
#if ROW_PRNU
        gain *= fmax(fma(row_prnu, normal_of(row_gains, j), 1.0f), 0.0f);
#endif
#if DULL
        const float chance = uniform_from_word(word_of(dull, j));
        gain *= chance < dull_fraction ? fma(dull_slope, chance, 1.0f) : 1.0f;
#endif
#if GAIN_MAP
        gain *= pixel_gain[i];
#endif
        pixel_gain[i] = gain;
#endif
#if READ_NOISE_SPREAD
        // E exp(2 s n) = exp(2 s^2), so exp(s n - s^2) has mean square 1.
        read_noise_map[i] = read_noise * exp_of(read_noise_spread * (normal_of(spread, j) - read_noise_spread));
#endif
    }
}

#elif DEMOSAIC

#if INPUT_FORMAT == FORMAT_UINT8
typedef uchar input_t;
#elif INPUT_FORMAT == FORMAT_UINT16
typedef ushort input_t;
#else
typedef float input_t;
#endif

// Bilinear. The sites of red are x & 1 == red_x, y & 1 == red_y. Beyond the border the image is mirrored at its outermost pixels, which
// keeps every site's colour.
__kernel void sensor_demosaic(__global const input_t *raw, ulong raw_offset, uint raw_pitch, uint width, uint height,
                              uint red_x, uint red_y, __global float *rgb, ulong rgb_offset, uint rgb_pitch) {
    const uint x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    const uint left = x > 0 ? x - 1 : 1, right = x + 1 < width ? x + 1 : x - 1;
    const __global input_t *here = raw + raw_offset + (ulong)y * raw_pitch;
    const __global input_t *above = raw + raw_offset + (ulong)(y > 0 ? y - 1 : 1) * raw_pitch;
    const __global input_t *below = raw + raw_offset + (ulong)(y + 1 < height ? y + 1 : y - 1) * raw_pitch;
    const float own = (float)here[x];
    const float row_pair = 0.5f * ((float)here[left] + (float)here[right]);
    const float column_pair = 0.5f * ((float)above[x] + (float)below[x]);
    const float cross = 0.5f * (row_pair + column_pair);
    const float corners =
        0.25f * (((float)above[left] + (float)above[right]) + ((float)below[left] + (float)below[right]));
    const bool red_column = (x & 1) == red_x, red_row = (y & 1) == red_y;
    const bool green = red_column != red_row;
    __global float *out = rgb + rgb_offset + (ulong)y * rgb_pitch + 3 * x;
    out[0] = green ? (red_row ? row_pair : column_pair) : red_row ? own : corners;
    out[1] = green ? own : cross;
    out[2] = green ? (red_row ? column_pair : row_pair) : red_row ? corners : own;
}

#else

#include "stages/sensor_pixel.h"

// One work-item four pixels, one in each quarter of the rows, which share Philox blocks (that of the read noise with the row beside, whose item draws
// it once more).
//   CROSSTALK 1  each pixel gives some of its signal to its four neighbours; the others' switches are in sensor_pixel.h
__kernel void sensor_expose(__global const float *intensity, ulong intensity_offset, uint intensity_pitch, SENSOR_PARAMETERS) {
    const camera_t camera = SENSOR_CAMERA;
    const sensor_t *s = &camera.s;
    const uint x = get_global_id(0), row = get_global_id(1);
    intensity += intensity_offset;
    const pixel_noise_t noise = draw_pixel_noise(s, x, row);
#pragma unroll
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * s->quarter;
        if (y >= s->height)
            break;
        const ulong at = (ulong)y * intensity_pitch + x;
        float value = signal_of(s, intensity[at]);
#if CROSSTALK
        const float neighbours =
            (signal_of(s, intensity[x > 0 ? at - 1 : at]) + signal_of(s, intensity[x + 1 < s->width ? at + 1 : at])) +
            (signal_of(s, intensity[y > 0 ? at - intensity_pitch : at]) +
             signal_of(s, intensity[y + 1 < s->height ? at + intensity_pitch : at]));
        value = fma(0.25f * s->crosstalk, neighbours, (1.0f - s->crosstalk) * value);
#endif
        expose_pixel(&camera, x, y, j, &noise, value);
    }
}

#endif
