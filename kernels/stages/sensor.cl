// From intensity to codes. The equations are in sensor.h of the C API.
#include "common/philox.h"

#if FIXED_PATTERN

// Drawn once. offset (with DARK_FRAME_GIVEN the dark frame is already in it) gets hot pixels, DSNU, column and row
// offsets and a wave. response is 0 at cold pixels and 1 elsewhere. pixel_gain (with GAIN_MAP_GIVEN the map is already
// in it) is the PRNU of pixels, columns and rows, less at dull pixels, 0 at cold ones. read_noise_map is each pixel's
// standard deviation. periodic_x, periodic_y: 2^-32 turns from pixel to pixel; dull_slope: of a dull pixel's gain over
// its random number. What is 0 is off, and a buffer that nothing is written to may be NULL: cameras differ in these
// sets without end, so that no program is built for each. One work-item a Philox block.
#define DARK_FRAME_GIVEN 1
#define GAIN_MAP_GIVEN 2
__kernel void sensor_fixed_pattern(__global float *offset, __global uchar *response, __global float *pixel_gain,
                                   __global float *read_noise_map, uint given, uint width, uint height, uint quarter,
                                   uint2 key, float hot_fraction, float hot_mean, float cold_fraction, float prnu,
                                   float column_prnu, float row_prnu, float dull_fraction, float dull_slope, float dsnu,
                                   float column_offset, float row_offset, float periodic, uint periodic_x,
                                   uint periodic_y, float read_noise, float read_noise_spread) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= width || row >= quarter)
        return;
    const words4 no_words = {0, 0, 0, 0};
    const normals4 no_normals = {0.0f, 0.0f, 0.0f, 0.0f};
    words4 hot = no_words, hot_offset = no_words, cold = no_words, dull = no_words, periodic_phase = no_words;
    normals4 gains = no_normals, offsets = no_normals, column = no_normals, row_offsets = no_normals,
             spread = no_normals, column_gain = no_normals, row_gains = no_normals;
    if (hot_fraction > 0.0f) {
        hot = image_block(x, row, 0, 0, STREAM_HOT_PIXEL, key);
        hot_offset = image_block(x, row, 0, 0, STREAM_HOT_OFFSET, key);
    }
    if (dsnu > 0.0f)
        offsets = normals_from_block(image_block(x, row, 0, 0, STREAM_DSNU, key));
    if (column_offset > 0.0f)
        column = normals_from_block(image_block(x, 0, 0, 0, STREAM_COLUMN_OFFSET, key));
    if (row_offset > 0.0f)
        row_offsets = normals_from_block(image_block(0, row, 0, 0, STREAM_ROW_OFFSET, key));
    if (periodic > 0.0f)
        periodic_phase = image_block(0, 0, 0, 0, STREAM_PERIODIC_PHASE, key);
    if (cold_fraction > 0.0f)
        cold = image_block(x, row, 0, 0, STREAM_COLD_PIXEL, key);
    if (prnu > 0.0f)
        gains = normals_from_block(image_block(x, row, 0, 0, STREAM_PRNU, key));
    if (column_prnu > 0.0f)
        column_gain = normals_from_block(image_block(x, 0, 0, 0, STREAM_COLUMN_PRNU, key));
    if (row_prnu > 0.0f)
        row_gains = normals_from_block(image_block(0, row, 0, 0, STREAM_ROW_PRNU, key));
    if (dull_fraction > 0.0f)
        dull = image_block(x, row, 0, 0, STREAM_DULL_PIXEL, key);
    if (read_noise_map)
        spread = normals_from_block(image_block(x, row, 0, 0, STREAM_READ_NOISE_SPREAD, key));
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= height)
            continue;
        const ulong i = (ulong)y * width + x;
        if (offset) {
            float sum = given & DARK_FRAME_GIVEN ? offset[i] : 0.0f;
            if (hot_fraction > 0.0f && uniform_from_word(word_of(hot, j)) < hot_fraction)
                sum += hot_mean * minus_log(uniform_from_word(word_of(hot_offset, j)));
            if (dsnu > 0.0f)
                sum += dsnu * normal_of(offsets, j);
            if (column_offset > 0.0f)
                sum += column_offset * column.n0;
            if (row_offset > 0.0f)
                sum += row_offset * normal_of(row_offsets, j);
            if (periodic > 0.0f)
                sum += periodic * phasor_from_word(periodic_phase.w0 + x * periodic_x + y * periodic_y).im;
            offset[i] = sum;
        }
        const bool is_cold = cold_fraction > 0.0f && uniform_from_word(word_of(cold, j)) < cold_fraction;
        if (response)
            response[i] = is_cold ? 0 : 1;
        if (pixel_gain) {
            // A normal number that was not drawn is 0, and the factor of what is off 1.
            float gain = is_cold ? 0.0f : fmax(fma(prnu, normal_of(gains, j), 1.0f), 0.0f);
            gain *= fmax(fma(column_prnu, column_gain.n0, 1.0f), 0.0f);
            gain *= fmax(fma(row_prnu, normal_of(row_gains, j), 1.0f), 0.0f);
            const float chance = uniform_from_word(word_of(dull, j));
            gain *= dull_fraction > 0.0f && chance < dull_fraction ? fma(dull_slope, chance, 1.0f) : 1.0f;
            if (given & GAIN_MAP_GIVEN)
                gain *= pixel_gain[i];
            pixel_gain[i] = gain;
        }
        if (read_noise_map)
            // E exp(2 s n) = exp(2 s^2), so exp(s n - s^2) has mean square 1.
            read_noise_map[i] = read_noise * exp_of(read_noise_spread * (normal_of(spread, j) - read_noise_spread));
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

// Bilinear. The sites of red are x & 1 == red_x, y & 1 == red_y. Beyond the border the image is mirrored at its
// outermost pixels, which keeps every site's colour.
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

// One work-item four pixels, one in each quarter of the rows, which share Philox blocks (that of the read noise with
// the row beside, whose item draws it once more).
//   CROSSTALK 1  each pixel gives some of its signal to its four neighbours; the others' switches are in sensor_pixel.h
__kernel void sensor_expose(__global const float *intensity, ulong intensity_offset, uint intensity_pitch,
                            SENSOR_PARAMETERS) {
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
