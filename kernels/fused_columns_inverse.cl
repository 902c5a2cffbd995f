// Pass C of the fused speckle engine: STRIPS times LANES columns at once from the kept lines back to the image plane, and the intensity.
//   OVERSAMPLING n  a pixel's value is weight times the sum over its n x n samples; 1, 2, 4 or 8, at most LANES
//   STRIPS n        strips of LANES columns side by side, as in pass A
//   POLARIZATIONS 2 the sum over both, whose lines lie one after the other
//   STREAM 1        rows of the intensity, or of the codes, go past the caches, where they begin as vectors do
//   SENSOR 1        what the sensor makes of the intensity, which itself is not stored (OUTPUT_FORMAT as in sensor_lanes.h); OVERSAMPLING 1
#if SENSOR
#include "sensor_lanes.h"
#else
#include "fused_lanes.h"
#endif

#define FFT_TILE __local
#define FFT_STRIPS (STRIPS * POLARIZATIONS)
#define FFT_INPUT(strip, p, re, im)
#define FFT_ENDS
#if OVERSAMPLING == 1 && !SENSOR && POLARIZATIONS == 1
#define FFT_OUTPUT(strip, p, re, im) store_power(&images[strip], p, fma(re, re, (im) * (im)))
#elif OVERSAMPLING == 1 && !SENSOR
// The first polarization's power waits in its tile for the second's.
#define FFT_OUTPUT(strip, p, re, im)                                                                                                    \
    if (strip < STRIPS)                                                                                                                 \
        tile[2u * (p)] = fma(re, re, (im) * (im));                                                                                      \
    else                                                                                                                                \
        store_powers(&images[strip - STRIPS], p, tiles[(strip - STRIPS) * FFT_TILE_VECTORS + 2u * (p)], fma(re, re, (im) * (im)))
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
    float weight, second_weight;
    int streams;
} image_t;

// The image before this one at row y, or nothing.
static inline lanes_f with_before(const image_t *image, uint y, lanes_f power) {
    if (!image->adds)
        return power;
    return power + load_some(image->before + (ulong)y * image->before_pitch + image->x, image->count);
}

// What a pixel gets from the powers of its polarizations.
static inline lanes_f weighted(const image_t *image, uint y, lanes_f first, lanes_f second) {
    const lanes_f power = with_before(image, y, first * image->weight);
#if POLARIZATIONS == 2
    return second * image->second_weight + power;
#else
    return power;
#endif
}

#if !SENSOR
// One row of the strip.
static inline void store_powers(const image_t *image, uint y, lanes_f first, lanes_f second) {
    if (y >= image->height || image->count == 0)
        return;
    const lanes_f power = weighted(image, y, first, second);
    __global float *to = image->intensity + (ulong)y * image->pitch + image->x;
#if STREAM
    if (image->streams) {
        __builtin_nontemporal_store(power, (__global lanes_f *)to);
        return;
    }
#endif
    store_some(power, to, image->count);
}
#define store_power(image, y, power) store_powers(image, y, power, SPREAD(0.0f))
#endif

#include "fused_codelets.h"

#if SENSOR
// The codes of NOISE_BLOCKS / STRIPS rows of each quarter from row `first` of it on. kind: best a constant.
static inline ALWAYS_INLINE void expose_rows(const camera_t *camera, camera_kind_t kind, const image_t *images, __local const lanes_f *tiles,
                                             uint first, const frame_noise_t *noise) {
    const uint quarter = camera->s.quarter, rows = min((uint)NOISE_BLOCKS / STRIPS, quarter - first);
    for (uint j = 0; j < 4; ++j)
        for (uint row = 0; row < rows; ++row) {
            const uint y = first + row + j * quarter;
            if (y >= images[0].height)
                return;
#pragma unroll
            for (uint strip = 0; strip < STRIPS; ++strip) {
                const image_t *image = &images[strip];
                if (image->count == 0)
                    continue;
                const uint k = row * STRIPS + strip;
                __local const lanes_f *at = tiles + strip * FFT_TILE_VECTORS + 2u * y;
                const lanes_f power = weighted(image, y, at[0], at[(POLARIZATIONS - 1u) * STRIPS * FFT_TILE_VECTORS]);
                const lanes_f signals = signals_of(&camera->s, power);
                store_codes(camera, image->x, image->count, y, image->streams,
                            kind == CAMERA_ANY ? expose_lanes(camera, image->x, image->count, y, j, k, noise, signals)
                                               : expose_plain_lanes(camera, kind, j, k, noise, signals));
            }
        }
}
#endif

// positions: of the kept lines (as in pass A), then of all others that are read. blocks: for each block of the transform three numbers; the
// second counts the groups that reach into it or lie before it, the third the other lines up to its end. ends: as in pass A. width, height:
// of the image in pixels. adds 1: the intensity is added to `before`, which may be the same pixels; a switch at run time, as the transform
// takes long to compile.
__kernel void fused_columns_inverse(__global const lanes_f *lines, uint grid_width, __global const float *twiddles,
                                    __global const uint *positions, uint groups, __global const uint *blocks,
                                    __global const uchar *ends, float weight,
                                    float second_weight, uint adds, __global const float *before, ulong before_offset, uint before_pitch,
#if SENSOR
                                    SENSOR_PARAMETERS,
#else
                                    __global float *intensity, ulong intensity_offset, uint intensity_pitch,
#endif
                                    uint width, uint height, __local lanes_f *tiles) {
    if (get_global_id(0) * STRIPS * LANES >= OVERSAMPLING * width)
        return;
    image_t images[STRIPS];
    for (uint strip = 0; strip < FFT_STRIPS; ++strip) {
        image_t image;
        const uint x = (get_global_id(0) * STRIPS + strip % STRIPS) * LANES;
#if SENSOR
        image.streams = STREAM && x + LANES <= width && output_pitch % LANES == 0 &&
                        ((size_t)(output + output_offset) & (sizeof(lanes_output) - 1)) == 0;
#else
        image.intensity = intensity + intensity_offset;
        image.pitch = intensity_pitch;
#if STREAM && OVERSAMPLING == 1
        image.streams = x + LANES <= width && intensity_pitch % LANES == 0 &&
                        ((size_t)image.intensity & (sizeof(lanes_f) - 1)) == 0;
#else
        image.streams = 0;
#endif
#endif
        image.before = before + before_offset;
        image.before_pitch = before_pitch;
        image.adds = adds != 0;
        image.x = x / OVERSAMPLING;
        image.count = image.x < width ? min((uint)LANES / OVERSAMPLING, width - image.x) : 0u;
        image.height = height;
        image.weight = weight;
        image.second_weight = second_weight;
        images[strip % STRIPS] = image;

        __local lanes_f *tile = tiles + strip * FFT_TILE_VECTORS;
        const uint count = x < grid_width ? min((uint)LANES, grid_width - x) : 0u;
        __global const lanes_f *strip_lines = lines + 2 * (ulong)(strip / STRIPS * groups) * grid_width;
        uint group = 0, other = 0;
        __global const uint *others = positions + groups * LANES;
        for (uint block = 0; block < FFT_BLOCKS; ++block) {
            for (; other < blocks[3u * block + 2u]; ++other) {
                const uint p = others[other];
                tile[2u * p] = tile[2u * p + 1u] = SPREAD(0.0f);
            }
            for (; group < blocks[3u * block + 1u]; ++group) {
                __global const lanes_f *in = strip_lines + 2 * ((ulong)group * grid_width + x);
                __global const uint *places = positions + group * LANES;
                // One part after the other: both at once are more than there are registers.
                for (uint part = 0; part < 2; ++part) {
                    lanes_f v[LANES];
                    if (count == LANES) {
#pragma unroll
                        for (uint l = 0; l < LANES; ++l)
                            v[l] = in[2u * l + part];
                    } else {
#pragma unroll
                        for (uint l = 0; l < LANES; ++l)
                            v[l] = l < count ? in[2u * l + part] : SPREAD(0.0f);
                    }
                    transpose_lanes(v);
#pragma unroll
                    for (uint l = 0; l < LANES; ++l)
                        tile[2u * places[l] + part] = v[l];
                }
            }
            fft_inverse_block(block, tile, twiddles FFT_ENDS_ARGUMENT);
        }
    }
    fft_inverse_last
#if SENSOR
    const camera_t camera = SENSOR_CAMERA;
    const camera_kind_t kind = kind_of(&camera);
    for (uint first = 0; first < sensor.quarter; first += NOISE_BLOCKS / STRIPS) {
        const noise_blocks_t blocks = {images[0].x, STRIPS, first, min((uint)NOISE_BLOCKS, (sensor.quarter - first) * STRIPS)};
        frame_noise_t noise;
        draw_noise(&camera.s, &blocks, &noise);
        if (kind == CAMERA_WHOLE_CODES)
            expose_rows(&camera, CAMERA_WHOLE_CODES, images, tiles, first, &noise);
        else if (kind == CAMERA_PLAIN)
            expose_rows(&camera, CAMERA_PLAIN, images, tiles, first, &noise);
        else
            expose_rows(&camera, CAMERA_ANY, images, tiles, first, &noise);
    }
#elif OVERSAMPLING > 1
    for (uint y = 0; y < height; ++y)
        for (uint strip = 0; strip < STRIPS; ++strip) {
            const image_t *image = &images[strip];
            float samples[POLARIZATIONS][LANES];
            for (uint k = 0; k < POLARIZATIONS; ++k) {
                lanes_f sum = SPREAD(0.0f);
                for (uint i = 0; i < OVERSAMPLING; ++i)
                    sum += tiles[(k * STRIPS + strip) * FFT_TILE_VECTORS + 2u * (OVERSAMPLING * y + i)];
                vstore_lanes(sum, 0, samples[k]);
            }
            for (uint pixel = 0; pixel < image->count; ++pixel) {
                float value = 0.0f;
                for (uint k = 0; k < POLARIZATIONS; ++k) {
                    float power = 0.0f;
                    for (uint i = 0; i < OVERSAMPLING; ++i)
                        power += samples[k][OVERSAMPLING * pixel + i];
                    power *= k == 0 ? weight : second_weight;
                    if (k > 0)
                        power += value;
                    else if (image->adds)
                        power += image->before[(ulong)y * before_pitch + image->x + pixel];
                    value = power;
                }
                image->intensity[(ulong)y * intensity_pitch + image->x + pixel] = value;
            }
        }
#endif
#if STREAM
    __sync_synchronize(); // such stores wait for nobody: here they end before the kernel does
#endif
}
