// The last pass of the engine for GPUs: FFT_LINES rows from the pupil columns back to the image plane, and the
// intensity.
//   OVERSAMPLING n  a pixel's value is weight times the sum over its n x n samples; FFT_LINES is a multiple of n
//   SENSOR 1        the intensity goes through the camera's chain, and only the frame is written; sensor_pixel.h's
//                   switches
//   PADDED 1        the field grid is larger than the image's samples
//   QUARTERS 1      (with SENSOR) FFT_LINES is 4 n, one row of pixels in each quarter of the image: they share blocks
//                   of random numbers
#include "fft/gpu/work_groups.h"
#if SENSOR
#include "stages/sensor_pixel.h"
#endif

#if PADDED
#define IN_IMAGE(x) ((x) < width)
#else
#define IN_IMAGE(x) 1
#endif

// slots: of each position's line, in the order of last_entry(). width, height: of the image in pixels. adds 1: the
// intensity is added to `before`, which may be the same pixels.
__kernel WORK_GROUP_SIZE void gpu_rows_inverse(__global const float2 *lines, uint pitch, uint grid_height,
                                               __global const float2 *twiddles, __global const uint *slots,
                                               float weight, uint adds, __global const float *before,
                                               ulong before_offset, uint before_pitch,
#if SENSOR
                                               SENSOR_PARAMETERS,
#else
                                               __global float *intensity, ulong intensity_offset, uint intensity_pitch,
#endif
                                               uint width, uint height, __local float *tiles) {
    const uint line = ITEM_LINE, t = ITEM_T, group = (uint)get_group_id(0);
#if QUARTERS
    const uint pixel_y = group + line / OVERSAMPLING * sensor.quarter;
#else
    const uint pixel_y = group * (FFT_LINES / OVERSAMPLING) + line / OVERSAMPLING;
#endif
    const uint y = min(pixel_y * OVERSAMPLING + line % OVERSAMPLING, grid_height - 1u);
    __local float *tile = tiles + line * FFT_LINE_STRIDE;
    float re[FFT_POINTS], im[FFT_POINTS];
    lines += y * pitch;
#pragma unroll
    for (uint c = 0; c < FFT_LAST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_last_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_LAST_RADIX; ++q) {
                if (last_is_never(q)) // fft_inverse() does not ask for it
                    continue;
                const size_t slot = last_slot(slots, b, q);
                float2 v = (float2)(0.0f, 0.0f);
                if (last_is_always(q) || slot != NO_SLOT)
                    v = lines[slot];
                re[c * FFT_LAST_RADIX + q] = v.x;
                im[c * FFT_LAST_RADIX + q] = v.y;
            }
        }
    }
    fft_inverse(t, re, im, tile, twiddles);
    before += before_offset;
#if OVERSAMPLING == 1 && !SENSOR
    if (y != pixel_y || pixel_y >= height)
        return;
    intensity += intensity_offset + (ulong)y * intensity_pitch;
    before += (ulong)y * before_pitch;
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q) {
                const uint i = c * FFT_FIRST_RADIX + q;
                re[i] = weight * fma(re[i], re[i], im[i] * im[i]);
                const size_t x = fft_first_point((size_t)b, q);
                if (adds && IN_IMAGE(x))
                    re[i] += before[x];
                if (IN_IMAGE(x))
                    intensity[x] = re[i];
            }
        }
    }
#else
    // The powers stay in the tile until all of a pixel's samples are there.
#pragma unroll
    for (uint c = 0; c < FFT_FIRST_COUNT; ++c) {
        const uint b = t + c * FFT_ITEMS;
        if (fft_first_takes(b)) {
#pragma unroll
            for (uint q = 0; q < FFT_FIRST_RADIX; ++q) {
                const uint i = c * FFT_FIRST_RADIX + q;
                tile[FFT_TILE_STRIDE * (fft_tile_at(fft_first_point(b, q)))] = fma(re[i], re[i], im[i] * im[i]);
            }
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
#if SENSOR
    const camera_t camera = SENSOR_CAMERA;
#endif
    const uint rows = FFT_LINES / OVERSAMPLING; // of pixels
#if QUARTERS
    for (uint x = get_local_id(0); x < width; x += FFT_WORK_ITEMS) {
        const pixel_noise_t noise = draw_pixel_noise(&camera.s, x, group);
#pragma unroll
        for (uint j = 0; j < 4; ++j) {
            const uint row = j, to_y = group + j * sensor.quarter;
            if (to_y >= height)
                break;
#else
    for (uint i = get_local_id(0); i < width * rows; i += FFT_WORK_ITEMS) {
        const uint x = i % width, row = i / width, to_y = group * rows + row;
        if (to_y < height) {
#if SENSOR
            const uint j = to_y / sensor.quarter;
            const pixel_noise_t noise = draw_pixel_noise(&camera.s, x, to_y - j * sensor.quarter);
#endif
#endif
            float value = 0.0f;
            for (uint sample_y = OVERSAMPLING * row; sample_y < OVERSAMPLING * (row + 1u); ++sample_y)
                for (uint sample_x = OVERSAMPLING * x; sample_x < OVERSAMPLING * (x + 1u); ++sample_x)
                    value += tiles[sample_y * FFT_LINE_STRIDE + FFT_TILE_STRIDE * (fft_tile_at(sample_x))];
            value *= weight;
            if (adds)
                value += before[(ulong)to_y * before_pitch + x];
#if SENSOR
            expose_pixel(&camera, x, to_y, j, &noise, signal_of(&camera.s, value));
#else
            intensity[intensity_offset + (ulong)to_y * intensity_pitch + x] = value;
#endif
        }
    }
#endif
}
