// Pass C of the fused speckle engine: STRIPS times LANES columns at once from the kept lines back to the image plane, and the intensity.
//   OVERSAMPLING n  a pixel's value is weight times the sum over its n x n samples; 1, 2, 4 or 8, at most LANES
//   STRIPS n        strips of LANES columns side by side, as in pass A
//   SENSOR 1        what the sensor makes of the intensity, which itself is not stored (OUTPUT_FORMAT as in sensor_lanes.h); OVERSAMPLING 1
#if SENSOR
#include "sensor_lanes.h"
#else
#include "fused_lanes.h"
#endif

#define FFT_TILE __local
#define FFT_STRIPS STRIPS
#define FFT_INPUT(strip, p, re, im)
#if OVERSAMPLING == 1 && !SENSOR
#define FFT_OUTPUT(strip, p, re, im) store_power(&images[strip], p, fma(re, re, (im) * (im)))
#else
// The powers stay in the tile until all of a pixel's samples are there, or all four pixels that share their random numbers.
#define FFT_OUTPUT(strip, p, re, im) tile[2u * (p)] = fma(re, re, (im) * (im))
#endif

typedef struct {
#if !SENSOR
    __global float *intensity;
    uint pitch;
#endif
    __global const float *before;
    uint before_pitch;
    int adds;
    uint x, count, height;
    int whole;
    float weight;
} image_t;

#if !SENSOR
// One row of the strip.
static inline void store_power(const image_t *image, uint y, lanes_f power) {
    if (y >= image->height)
        return;
    power *= image->weight;
    const ulong at = (ulong)y * image->pitch + image->x;
    const ulong before = (ulong)y * image->before_pitch + image->x;
    if (image->whole) {
        if (image->adds)
            power += vload_lanes(0, image->before + before);
        vstore_lanes(power, 0, image->intensity + at);
        return;
    }
    float values[LANES];
    vstore_lanes(power, 0, values);
    for (uint lane = 0; lane < image->count; ++lane) {
        if (image->adds)
            values[lane] += image->before[before + lane];
        image->intensity[at + lane] = values[lane];
    }
}
#endif

#include "fused_codelets.h"

// positions: of the kept lines (as in pass A), then of all others. blocks: for each block of the transform three numbers; the second counts the
// groups that reach into it or lie before it, the third the other lines up to its end. width, height: of the image in pixels. adds 1: the
// intensity is added to `before`, which may be the same pixels; a switch at run time, as the transform takes long to compile.
__kernel void fused_columns_inverse(__global const lanes_f *lines, uint grid_width, __global const float *twiddles,
                                    __global const uint *positions, uint groups, __global const uint *blocks, float weight,
                                    uint adds, __global const float *before, ulong before_offset, uint before_pitch,
#if SENSOR
                                    SENSOR_PARAMETERS,
#else
                                    __global float *intensity, ulong intensity_offset, uint intensity_pitch,
#endif
                                    uint width, uint height, __local lanes_f *tiles) {
    if (get_global_id(0) * STRIPS * LANES >= OVERSAMPLING * width)
        return;
    image_t images[STRIPS];
    for (uint strip = 0; strip < STRIPS; ++strip) {
        image_t image;
        const uint x = (get_global_id(0) * STRIPS + strip) * LANES;
#if !SENSOR
        image.intensity = intensity + intensity_offset;
        image.pitch = intensity_pitch;
#endif
        image.before = before + before_offset;
        image.before_pitch = before_pitch;
        image.adds = adds != 0;
        image.x = x / OVERSAMPLING;
        image.count = image.x < width ? min((uint)LANES / OVERSAMPLING, width - image.x) : 0u;
        image.height = height;
        image.whole = image.count == LANES;
        image.weight = weight;
        images[strip] = image;

        __local lanes_f *tile = tiles + strip * FFT_TILE_VECTORS;
        const uint count = x < grid_width ? min((uint)LANES, grid_width - x) : 0u;
        uint group = 0, other = 0;
        __global const uint *others = positions + groups * LANES;
        for (uint block = 0; block < FFT_BLOCKS; ++block) {
            for (; other < blocks[3u * block + 2u]; ++other) {
                const uint p = others[other];
                tile[2u * p] = tile[2u * p + 1u] = SPREAD(0.0f);
            }
            for (; group < blocks[3u * block + 1u]; ++group) {
                lanes_f re[LANES], im[LANES];
                __global const lanes_f *in = lines + 2 * ((ulong)group * grid_width + x);
                if (count == LANES) {
                    for (uint l = 0; l < LANES; ++l) {
                        re[l] = in[2u * l];
                        im[l] = in[2u * l + 1u];
                    }
                } else {
                    for (uint l = 0; l < LANES; ++l) {
                        re[l] = l < count ? in[2u * l] : SPREAD(0.0f);
                        im[l] = l < count ? in[2u * l + 1u] : SPREAD(0.0f);
                    }
                }
                transpose_lanes(re);
                transpose_lanes(im);
                for (uint l = 0; l < LANES; ++l) {
                    const uint p = positions[group * LANES + l];
                    tile[2u * p] = re[l];
                    tile[2u * p + 1u] = im[l];
                }
            }
            fft_inverse_block(block, tile, twiddles);
        }
    }
    fft_inverse_last
#if SENSOR
    const camera_t camera = SENSOR_CAMERA;
    for (uint row = 0; row < sensor.quarter; ++row)
        for (uint strip = 0; strip < STRIPS && images[strip].count > 0; ++strip) {
            const image_t *image = &images[strip];
            __local const lanes_f *tile = tiles + strip * FFT_TILE_VECTORS;
            frame_noise_t noise;
            draw_noise(&camera.s, image->x, row, &noise);
#pragma unroll
            for (uint j = 0; j < 4; ++j) {
                const uint y = row + j * sensor.quarter;
                if (y >= height)
                    break;
                lanes_f power = tile[2u * y] * image->weight;
                if (image->adds)
                    power += load_some(image->before + (ulong)y * image->before_pitch + image->x, image->count);
                expose_lanes(&camera, image->x, image->count, y, j, &noise, signals_of(&camera.s, power));
            }
        }
#elif OVERSAMPLING > 1
    for (uint y = 0; y < height; ++y)
        for (uint strip = 0; strip < STRIPS; ++strip) {
            const image_t *image = &images[strip];
            lanes_f sum = SPREAD(0.0f);
            for (uint i = 0; i < OVERSAMPLING; ++i)
                sum += tiles[strip * FFT_TILE_VECTORS + 2u * (OVERSAMPLING * y + i)];
            float samples[LANES];
            vstore_lanes(sum, 0, samples);
            for (uint pixel = 0; pixel < image->count; ++pixel) {
                float value = 0.0f;
                for (uint i = 0; i < OVERSAMPLING; ++i)
                    value += samples[OVERSAMPLING * pixel + i];
                value *= weight;
                if (image->adds)
                    value += image->before[(ulong)y * before_pitch + image->x + pixel];
                image->intensity[(ulong)y * intensity_pitch + image->x + pixel] = value;
            }
        }
#endif
}
