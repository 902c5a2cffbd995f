// Pass C of the fused speckle engine for work-groups: FFT_LINES neighbouring columns from the kept lines back to the image plane, and the
// intensity.
//   OVERSAMPLING n  a pixel's value is weight times the sum over its n x n samples; FFT_LINES is a multiple of n
//   SENSOR 1        the intensity goes through the camera's chain, and only the frame is written; sensor_pixel.h's switches
#include "fused_groups.h"
#if SENSOR
#include "sensor_pixel.h"
#endif

// slots: of each position's line, in the order of last_entry(). width, height: of the image in pixels. adds 1: the intensity is added to
// `before`, which may be the same pixels.
__kernel GROUP_SIZE void fused_groups_columns_inverse(__global const float2 *lines, uint grid_width, __global const float2 *twiddles,
                                                      __global const uint *slots, float weight, uint adds,
                                                      __global const float *before, ulong before_offset, uint before_pitch,
#if SENSOR
                                                      SENSOR_PARAMETERS,
#else
                                                      __global float *intensity, ulong intensity_offset, uint intensity_pitch,
#endif
                                                      uint width, uint height, __local float *tiles) {
    const uint line = GROUP_LINE, t = GROUP_T, x = (uint)get_group_id(0) * FFT_LINES + line;
    __local float *tile = tiles + line * FFT_LINE_STRIDE;
    float re[FFT_HELD], im[FFT_HELD];
#pragma unroll
    for (uint c = 0; c < FFT_LAST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_last_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_LAST_RADIX; ++q) {
                const uint slot = slots[last_entry(b, q)];
                float2 v = (float2)(0.0f, 0.0f);
                if (slot != NO_SLOT && x < grid_width)
                    v = lines[(ulong)slot * grid_width + x];
                re[c * FFT_LAST_RADIX + q] = v.x;
                im[c * FFT_LAST_RADIX + q] = v.y;
            }
        }
    }
    fft_inverse(t, re, im, tile, twiddles);
    before += before_offset;
#if !SENSOR
    intensity += intensity_offset;
#endif
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q) {
                const uint y = fft_first_point(b, q), i = c * FFT_FIRST_RADIX + q;
                const float power = fma(re[i], re[i], im[i] * im[i]);
#if OVERSAMPLING == 1 && !SENSOR
                if (x < width && y < height) {
                    const float value = weight * power;
                    intensity[(ulong)y * intensity_pitch + x] = adds ? value + before[(ulong)y * before_pitch + x] : value;
                }
#else
                // The powers stay in the tile until all of a pixel's samples are there.
                tile[FFT_TILE_STRIDE * (fft_tile_at(y))] = power;
#endif
            }
        }
    }
#if OVERSAMPLING > 1 || SENSOR
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint across = FFT_LINES / OVERSAMPLING, left = (uint)get_group_id(0) * across;
#if SENSOR
    // Four rows share blocks of random numbers.
    const camera_t camera = SENSOR_CAMERA;
    const uint quarter = sensor.quarter;
#else
    const uint quarter = height;
#endif
    for (uint i = get_local_id(0); i < across * quarter; i += FFT_GROUP_ITEMS) {
        const uint column = i % across, row = i / across, pixel_x = left + column;
        if (pixel_x >= width)
            continue;
#if SENSOR
        const pixel_noise_t noise = draw_pixel_noise(&camera.s, pixel_x, row);
#pragma unroll
        for (uint j = 0; j < 4; ++j)
#else
        const uint j = 0;
#endif
        {
            const uint y = row + j * quarter;
#if SENSOR
            if (y >= height)
                break;
#endif
            float value = 0.0f;
            for (uint sample_y = OVERSAMPLING * y; sample_y < OVERSAMPLING * (y + 1u); ++sample_y)
                for (uint sample_x = OVERSAMPLING * column; sample_x < OVERSAMPLING * (column + 1u); ++sample_x)
                    value += tiles[sample_x * FFT_LINE_STRIDE + FFT_TILE_STRIDE * (fft_tile_at(sample_y))];
            value *= weight;
            if (adds)
                value += before[(ulong)y * before_pitch + pixel_x];
#if SENSOR
            expose_pixel(&camera, pixel_x, y, j, &noise, signal_of(&camera.s, value));
#else
            intensity[(ulong)y * intensity_pitch + pixel_x] = value;
#endif
        }
    }
#endif
}
