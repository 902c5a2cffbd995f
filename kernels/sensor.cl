// From intensity to codes. The equations are in sensor.h of the C API.
#include "philox.h"

// Fixed pattern, drawn once: offset (dark frame already in it) gains the hot pixels' offsets; cold pixels get a NaN-free mark in
// `response`: 0 instead of 1. One work-item a Philox block.
__kernel void sensor_defects(__global float *offset, __global uchar *response, uint width, uint height, uint quarter,
                             uint2 key, float hot_fraction, float hot_mean, float cold_fraction) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= width || row >= quarter)
        return;
    const words4 hot = image_block(x, row, 0, 0, STREAM_HOT_PIXEL, key);
    const words4 hot_offset = image_block(x, row, 0, 0, STREAM_HOT_OFFSET, key);
    const words4 cold = image_block(x, row, 0, 0, STREAM_COLD_PIXEL, key);
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= height)
            continue;
        const ulong i = (ulong)y * width + x;
        if (uniform_from_word(word_of(hot, j)) < hot_fraction)
            offset[i] += hot_mean * minus_log(uniform_from_word(word_of(hot_offset, j)));
        response[i] = uniform_from_word(word_of(cold, j)) < cold_fraction ? 0 : 1;
    }
}

#if OUTPUT_FORMAT == FORMAT_UINT8
typedef uchar output_t;
#elif OUTPUT_FORMAT == FORMAT_UINT16
typedef ushort output_t;
#else
typedef float output_t;
#endif

// One pixel: signal to output.
static inline void expose(float intensity, float noise, ulong i, __global const float *offset, __global const uchar *response,
                          float gain, float saturation, float black_level, float top_code, float output_scale,
                          __global output_t *output) {
    // fmax first: it drops NaN.
    float value = fmin(fmax(gain * intensity, 0.0f), saturation);
#if DEFECTS
    value = response[i] == 0 ? 0.0f : value;
#endif
    value += black_level;
#if OFFSET
    value += offset[i];
#endif
    value += noise;
#if QUANTIZE
    value = rint(value);
#endif
    value = fmin(fmax(value, 0.0f), top_code);
#if OUTPUT_FORMAT == FORMAT_FLOAT32
    *output = value * output_scale;
#else
    *output = (output_t)(int)value;
#endif
}

// One work-item a Philox block: four pixels, one in each quarter of the rows.
__kernel void sensor_expose(__global const float *intensity, ulong intensity_offset, uint intensity_pitch,
                            __global const float *offset, __global const uchar *response, uint width, uint height,
                            uint quarter, uint2 key, uint frame_low, uint frame_high, float gain, float saturation,
                            float black_level, float read_noise, float top_code, float output_scale,
                            __global output_t *output, ulong output_offset, uint output_pitch) {
    const uint x = get_global_id(0), row = get_global_id(1);
#if READ_NOISE
    const normals4 noise = normals_from_block(image_block(x, row, frame_low, frame_high, STREAM_READ_NOISE, key));
#else
    const normals4 noise = {0.0f, 0.0f, 0.0f, 0.0f};
#endif
#define EXPOSE(j, n)                                                                                                   \
    if (row + j * quarter < height) {                                                                                  \
        const ulong y = row + j * quarter;                                                                             \
        expose(intensity[intensity_offset + y * intensity_pitch + x], n, y * width + x, offset, response, gain, saturation, \
               black_level, top_code, output_scale, output + output_offset + y * output_pitch + x);                    \
    }
    EXPOSE(0, read_noise * noise.n0)
    EXPOSE(1, read_noise * noise.n1)
    EXPOSE(2, read_noise * noise.n2)
    EXPOSE(3, read_noise * noise.n3)
}
