// The last pass of the engine for CPUs: LANES rows at once from the pupil columns back to the image plane, and the
// intensity.
//   OVERSAMPLING n  a pixel's value is weight times the sum over its n x n samples; 1, 2, 4 or 8, at most LANES
//   POLARIZATIONS 2 the sum over both, whose lines lie one after the other
//   PREFETCH_LINES 1  pupil columns are asked for ahead: those of the second polarization, or of the work-item that
//                     follows
//   STREAM 1          rows of the intensity, or of the codes, go past the caches, where they begin as vectors do
//   SENSOR 1          what the sensor makes of the intensity, which itself is not stored (OUTPUT_FORMAT as in
//                     sensor_lanes.h); OVERSAMPLING 1
#if SENSOR
#include "stages/sensor_lanes.h"
#else
#include "common/lanes.h"
#endif

#define FFT_TILE __local
#define FFT_STRIPS 1
#define FFT_INPUT(strip, p, re, im)
#define FFT_ENDS
// The powers wait where they can be had across rows: neighbours in a vector are of different ones, in memory of the
// same. The first polarization's must outlive the second's transform.
#if POLARIZATIONS == 1
#define POWER(p) tiles[2u * (p)]
#define FFT_OUTPUT(strip, p, re, im) POWER(p) = weight * fma(re, re, (im) * (im))
#else
#define POWER(p) tiles[FFT_TILE_VECTORS + (p)]
#define FFT_OUTPUT(strip, p, re, im)                                                                                   \
    POWER(p) = k == 0 ? weight * fma(re, re, (im) * (im)) : POWER(p) + second_weight * fma(re, re, (im) * (im))
#endif

// Spans of LANES pixels side by side that are written together: what a row gets at once are whole cache lines.
#if SENSOR
// Rows of each quarter of the image that a work-item has, whose random numbers are the same blocks', and those that are
// drawn for them.
#define QUARTER_ROWS (LANES / 4)
#define NOISE_ROWS (QUARTER_ROWS < 2 ? 2 : QUARTER_ROWS)
#define SPANS (NOISE_BLOCKS / NOISE_ROWS)
#else
#define SPANS (16 / LANES)
#endif
// From a work-item's rows to the next one's.
#if SENSOR
#define NEXT_ROWS QUARTER_ROWS
#else
#define NEXT_ROWS LANES
#endif

typedef struct {
#if !SENSOR
    __global float *intensity;
    uint pitch;
#endif
    __global const float *before;
    uint before_pitch;
    int adds;
    uint width, height;
    int streams;
} image_t;

// SPANS spans of pixels: of each row of samples, the sums of the powers along it.
typedef struct {
    lanes_f of[SPANS][LANES];
} spans_t;

#include "fft/cpu/codelets.h"

// Those from column x on.
static inline void load_spans(__local const lanes_f *tiles, uint x, uint width, spans_t *spans) {
    for (uint span = 0; span < SPANS; ++span) {
        const uint first = x + span * LANES;
        if (first >= width)
            break;
        const uint count = min((uint)LANES, width - first);
        lanes_f v[LANES];
        if (count == LANES) {
#pragma unroll
            for (uint l = 0; l < LANES; ++l) {
                v[l] = POWER(OVERSAMPLING * (first + l));
                for (uint i = 1; i < OVERSAMPLING; ++i)
                    v[l] += POWER(OVERSAMPLING * (first + l) + i);
            }
        } else {
#pragma unroll
            for (uint l = 0; l < LANES; ++l) {
                v[l] = SPREAD(0.0f);
                for (uint i = 0; i < OVERSAMPLING && l < count; ++i)
                    v[l] += POWER(OVERSAMPLING * (first + l) + i);
            }
        }
        transpose_lanes(v);
#pragma unroll
        for (uint l = 0; l < LANES; ++l)
            spans->of[span][l] = v[l];
    }
}

#if SENSOR
// A row of pixels that a work-item has: where its signals are, what is added to them, and where its codes go.
typedef struct {
    int exists;
    uint lane;
    __global const float *before;
    __global output_t *to;
} row_t;

// Row `row` of quarter j, from column x on, of a work-item whose first is row `first`. One that does not exist can be
// read like others.
static inline row_t row_of(const camera_t *camera, const image_t *image, uint j, uint row, uint first, uint x) {
    const uint y = row + j * camera->s.quarter, i = row - first;
    const int exists = row >= first && i < QUARTER_ROWS && row < camera->s.quarter && y < image->height;
    const row_t found = {exists, j * QUARTER_ROWS + (exists ? i : 0u),
                         image->before + (ulong)(exists ? y : 0u) * image->before_pitch + x,
                         camera->output + (ulong)y * camera->output_pitch + x};
    return found;
}

// power: of span `span` from the row's first column on.
static inline lanes_f signals_at(const camera_t *camera, int adds, lanes_f power, const row_t *row, uint span,
                                 uint count) {
    if (adds)
        power += load_some(row->before + span * LANES, count);
    return signals_of(&camera->s, power);
}

// LANES codes in both rows of a pair, of which the random words make a normal each; also of one that does not exist, so
// that there is nothing to ask before the normals.
static inline ALWAYS_INLINE void expose_pair(const camera_t *camera, camera_kind_t kind, int adds, const spans_t *spans,
                                             const row_t *even, const row_t *odd, uint span, lanes_u words,
                                             lanes_output *codes) {
    lanes_f normal, other;
    normal_pairs_from_words(words, &normal, &other);
    codes[0] = expose_plain_lanes(camera, kind, 1, normal,
                                  signals_at(camera, adds, spans->of[span][even->lane], even, span, LANES));
    codes[1] = expose_plain_lanes(camera, kind, 1, other,
                                  signals_at(camera, adds, spans->of[span][odd->lane], odd, span, LANES));
}

// The codes of `whole` spans, none of which reaches over the border, of a camera that has read noise and is not of kind
// CAMERA_ANY. Normals are made where they are needed, between stores that go past the caches: those come not all at
// once. kind, adds: best constants.
static inline ALWAYS_INLINE void expose_plain_spans(const camera_t *camera, camera_kind_t kind, int adds,
                                                    const image_t *image, const spans_t *spans, uint whole, uint first,
                                                    const noise_blocks_t *blocks) {
    lanes_u words[NOISE_BLOCKS / 2][4];
    draw_read_words(&camera->s, blocks, words);
    for (uint j = 0; j < 4; ++j)
        for (uint pair = 0; pair < NOISE_ROWS / 2; ++pair) {
            const row_t even = row_of(camera, image, j, blocks->row + 2 * pair, first, blocks->x);
            const row_t odd = row_of(camera, image, j, blocks->row + 2 * pair + 1, first, blocks->x);
            if (!even.exists && !odd.exists)
                continue;
            const uint k = pair * blocks->across;
            uint span = 0;
            for (; span + 2 <= whole; span += 2) {
                lanes_output codes[2], next[2];
                expose_pair(camera, kind, adds, spans, &even, &odd, span, words[k + span][j], codes);
                expose_pair(camera, kind, adds, spans, &even, &odd, span + 1, words[k + span + 1][j], next);
                if (even.exists)
                    store_two(even.to + span * LANES, image->streams, codes[0], next[0]);
                if (odd.exists)
                    store_two(odd.to + span * LANES, image->streams, codes[1], next[1]);
            }
            if (span < whole) {
                lanes_output codes[2];
                expose_pair(camera, kind, adds, spans, &even, &odd, span, words[k + span][j], codes);
                if (even.exists)
                    store_codes(even.to + span * LANES, LANES, codes[0]);
                if (odd.exists)
                    store_codes(odd.to + span * LANES, LANES, codes[1]);
            }
        }
}

// The codes of all other spans: those from `begin` on. blocks: where their noise lies.
static inline void expose_spans(const camera_t *camera, const image_t *image, const spans_t *spans, uint begin,
                                uint first, const noise_blocks_t *blocks) {
    frame_noise_t noise;
    draw_noise(&camera->s, blocks, &noise);
    for (uint j = 0; j < 4; ++j)
        for (uint row = first; row < first + QUARTER_ROWS; ++row) {
            const row_t at = row_of(camera, image, j, row, first, blocks->x);
            for (uint span = 0; span < blocks->across && at.exists; ++span) {
                const uint x = blocks->x + span * LANES, count = min((uint)LANES, image->width - x);
                const uint k = (row - blocks->row) * blocks->across + span;
                const lanes_f power = spans->of[begin + span][at.lane];
                store_codes(at.to + span * LANES, count,
                            expose_lanes(camera, x, count, row + j * camera->s.quarter, j, k, &noise,
                                         signals_at(camera, image->adds, power, &at, span, count)));
            }
        }
}
#else
// The sum over the OVERSAMPLING rows of samples of a row of pixels.
static inline lanes_f row_sum(const lanes_f *rows) {
    lanes_f sum = rows[0];
    for (uint i = 1; i < OVERSAMPLING; ++i)
        sum += rows[i];
    return sum;
}

// Rows of pixels from row y on.
static inline void store_spans(const image_t *image, const spans_t *spans, uint x, uint y) {
    for (uint row = 0; row < LANES / OVERSAMPLING && y + row < image->height; ++row)
        for (uint span = 0; span < SPANS && x + span * LANES < image->width; ++span) {
            const uint at = x + span * LANES, count = min((uint)LANES, image->width - at);
            lanes_f power = row_sum(&spans->of[span][OVERSAMPLING * row]);
            if (image->adds)
                power += load_some(image->before + (ulong)(y + row) * image->before_pitch + at, count);
            __global float *to = image->intensity + (ulong)(y + row) * image->pitch + at;
#if STREAM
            if (image->streams && count == LANES) {
                __builtin_nontemporal_store(power, (__global lanes_f *)to);
                continue;
            }
#endif
            store_some(power, to, count);
        }
}
#endif

// positions: of the pupil columns (as in rows_forward), then of all others that are read. blocks: for each block of the
// transform three numbers; the second counts the column blocks that reach into it or lie before it, the third the other
// lines up to its end. ends: as in rows_forward. width, height: of the image in pixels. adds 1: the intensity is added
// to `before`, which may be the same pixels; a switch at run time, as the transform takes long to compile.
__kernel void cpu_rows_inverse(__global const lanes_f *lines, uint grid_height, __global const float *twiddles,
                               __global const uint *positions, uint column_blocks, __global const uint *blocks,
                               __global const uchar *ends, float weight, float second_weight, uint adds,
                               __global const float *before, ulong before_offset, uint before_pitch,
#if SENSOR
                               SENSOR_PARAMETERS,
#else
                               __global float *intensity, ulong intensity_offset, uint intensity_pitch,
#endif
                               uint width, uint height, __local lanes_f *tiles) {
#if SENSOR
    const uint first = get_global_id(0) * QUARTER_ROWS;
    if (first >= sensor.quarter)
        return;
#else
    const uint first = get_global_id(0) * LANES;
    if (first >= OVERSAMPLING * height)
        return;
#endif
    // The row of samples in each lane. Lanes beyond the image have its last row, and write nothing.
    uint rows[LANES];
    for (uint lane = 0; lane < LANES; ++lane) {
#if SENSOR
        const uint row = first + lane % QUARTER_ROWS + lane / QUARTER_ROWS * sensor.quarter;
#else
        const uint row = first + lane;
#endif
        rows[lane] = min(row, OVERSAMPLING * height - 1u);
    }
    image_t image;
#if SENSOR
    image.streams = STREAM && output_pitch % (2 * LANES) == 0 &&
                    ((size_t)(output + output_offset) & (2 * sizeof(lanes_output) - 1)) == 0;
#else
    image.intensity = intensity + intensity_offset;
    image.pitch = intensity_pitch;
    image.streams = STREAM && intensity_pitch % LANES == 0 && ((size_t)image.intensity & (sizeof(lanes_f) - 1)) == 0;
#endif
    image.before = before + before_offset;
    image.before_pitch = before_pitch;
    image.adds = adds != 0;
    image.width = width;
    image.height = height;

    for (uint k = 0; k < POLARIZATIONS; ++k) {
        uint column_block = 0, other = 0;
        __global const uint *others = positions + column_blocks * LANES;
        for (uint block = 0; block < FFT_BLOCKS; ++block) {
            for (; other < blocks[3u * block + 2u]; ++other) {
                const uint p = others[other];
                tiles[2u * p] = tiles[2u * p + 1u] = SPREAD(0.0f);
            }
            for (; column_block < blocks[3u * block + 1u]; ++column_block) {
                __global const lanes_f *in = lines + 2 * (ulong)column_block * grid_height;
                __global const uint *places = positions + column_block * LANES;
#if PREFETCH_LINES
                const ulong polarization = 2 * (ulong)column_blocks * grid_height;
                __global const lanes_f *next =
                    k + 1 < POLARIZATIONS ? in + polarization : in + 2u * NEXT_ROWS - k * polarization;
                for (uint l = 0; l < LANES; ++l)
                    for (uint part = 0; part < 2; ++part)
                        prefetch_line(next + 2u * rows[l] + part, 3);
#endif
                // One part after the other: both at once are more than there are registers.
                for (uint part = 0; part < 2; ++part) {
                    lanes_f v[LANES];
#pragma unroll
                    for (uint l = 0; l < LANES; ++l)
                        v[l] = in[2u * rows[l] + part];
                    transpose_lanes(v);
#pragma unroll
                    for (uint l = 0; l < LANES; ++l)
                        tiles[2u * places[l] + part] = v[l];
                }
            }
            fft_inverse_block(block, tiles, twiddles FFT_ENDS_ARGUMENT);
        }
        fft_inverse_last
        lines += 2 * (ulong)column_blocks * grid_height;
    }
#if SENSOR
    const camera_t camera = SENSOR_CAMERA;
    const camera_kind_t kind = kind_of(&camera);
    const uint noise_row = first / NOISE_ROWS * NOISE_ROWS,
               noise_rows = min((uint)NOISE_ROWS, sensor.quarter - noise_row);
#endif
    for (uint x = 0; x < width; x += SPANS * LANES) {
        spans_t spans;
        load_spans(tiles, x, width, &spans);
#if SENSOR
        const uint across = min((uint)SPANS, (width - x + LANES - 1u) / LANES);
        const noise_blocks_t blocks_of_noise = {x, across, noise_row, across * noise_rows};
        const uint whole =
            kind == CAMERA_ANY || !(camera.s.switches & SENSOR_READ_NOISE) ? 0u : min(across, (width - x) / LANES);
        if (whole > 0 && kind == CAMERA_WHOLE_CODES && !image.adds)
            expose_plain_spans(&camera, CAMERA_WHOLE_CODES, 0, &image, &spans, whole, first, &blocks_of_noise);
        else if (whole > 0) // whole codes, too: the same bits
            expose_plain_spans(&camera, CAMERA_PLAIN, image.adds, &image, &spans, whole, first, &blocks_of_noise);
        if (whole < across) {
            const noise_blocks_t others = {x + whole * LANES, across - whole, noise_row, (across - whole) * noise_rows};
            expose_spans(&camera, &image, &spans, whole, first, &others);
        }
#else
        store_spans(&image, &spans, x, first / OVERSAMPLING);
#endif
    }
#if STREAM
    __sync_synchronize(); // such stores wait for nobody: here they end before the kernel does
#endif
}
