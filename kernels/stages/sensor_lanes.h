// The camera's chain with explicit vectors for CPU devices: LANES pixels of a row at once, the same bits as
// expose_pixel() in sensor_pixel.h. What is on is decided at run time: rows_inverse of the engine for CPUs includes
// this, and a transform takes long to compile.
//   OUTPUT_FORMAT
//   STREAM 1  codes may go past the caches
#ifndef CLSP_SENSOR_LANES_H
#define CLSP_SENSOR_LANES_H

#include "common/lanes.h"
#include "stages/sensor_camera.h"

#if OUTPUT_FORMAT == FORMAT_UINT8
typedef CLSP_JOIN(uchar, LANES) lanes_output;
#elif OUTPUT_FORMAT == FORMAT_UINT16
typedef CLSP_JOIN(ushort, LANES) lanes_output;
#else
typedef lanes_f lanes_output;
#endif
// The built-ins go through small numbers one by one on PoCL.
#ifdef __clang__
#define convert_lanes_output(values) __builtin_convertvector(values, lanes_output)
typedef lanes_output unaligned_output __attribute__((aligned(1)));
#define store_lanes_output(codes, to) *(__global unaligned_output *)(to) = codes
#elif OUTPUT_FORMAT == FORMAT_UINT8
#define convert_lanes_output CLSP_JOIN(convert_uchar, LANES)
#else
#define convert_lanes_output CLSP_JOIN(convert_ushort, LANES)
#endif
#ifndef store_lanes_output
#define store_lanes_output(codes, to) vstore_lanes(codes, 0, to)
#endif

// Vectors in four rows each whose random words are drawn one after the other, before any is used: the words of a block
// of them are one long chain of multiplications; side by side they fill the time in which each waits for itself.
#define NOISE_BLOCKS 16

// What is random in LANES columns of four rows, one in each quarter of the image, for each block.
typedef struct {
    lanes_f read[NOISE_BLOCKS][4], shot[NOISE_BLOCKS][4], column[NOISE_BLOCKS];
    lanes_u shot_words[NOISE_BLOCKS][4];
    lanes_f telegraph[NOISE_BLOCKS][4];
    float rows[NOISE_BLOCKS][4];
} frame_noise_t;

static inline lanes_f smaller(lanes_f a, lanes_f b) { return select(b, a, a < b); }
// NaN counts as 0.
static inline lanes_f positive(lanes_f a) { return select(SPREAD(0.0f), a, a > 0.0f); }

// exp_of() in philox.h.
static inline lanes_f exps(lanes_f x) {
    const lanes_f n = nearest(x * 1.44269504f);
    const lanes_f r = fma(n, SPREAD(-1.428606765330187e-06f), fma(n, SPREAD(-0.693145751953125f), x));
    lanes_f p = fma(r, SPREAD(1.98412698e-4f), SPREAD(1.38888889e-3f));
    p = fma(r, p, SPREAD(8.33333333e-3f));
    p = fma(r, p, SPREAD(4.16666667e-2f));
    p = fma(r, p, SPREAD(1.66666667e-1f));
    p = fma(r, p, SPREAD(0.5f));
    p = fma(r, p, SPREAD(1.0f));
    p = fma(r, p, SPREAD(1.0f));
    return p * as_lanes_f((convert_lanes_i(n) + 127) << 23);
}

// poisson() in sensor_pixel.h.
static inline lanes_f poissons(lanes_f mean, lanes_f w, lanes_u word) {
    const lanes_i is_small = mean < 12.0f;
    lanes_f count = SPREAD(0.0f);
    if (holds_anywhere(is_small)) {
        const lanes_f t = uniforms_from_words(word), low_mean = select(SPREAD(0.0f), mean, is_small);
        lanes_f probability = exps(-low_mean), above = 1.0f - probability;
        lanes_i goes_on = is_small & (t < above);
        for (int k = 1; k < 41 && holds_anywhere(goes_on); ++k) {
            probability *= low_mean * (1.0f / k);
            goes_on &= probability >= 0x1p-32f;
            count += select(SPREAD(0.0f), SPREAD(1.0f), goes_on);
            above -= probability;
            goes_on &= t < above;
        }
        if (!holds_anywhere(~is_small))
            return count;
    }
    const lanes_f root = sqrt(mean), per_root = 1.0f / root;
    const lanes_f w2 = w * w;
    lanes_f tail = w * fma(w2, fma(w2, SPREAD(-0.00141f), SPREAD(-0.00288f)), SPREAD(0.01627f)) * per_root;
    tail = (tail + fma(w2, fma(w2, SPREAD(1.0f / 270.0f), SPREAD(7.0f / 810.0f)), SPREAD(-8.0f / 405.0f))) * per_root;
    tail = (tail - w * fma(w2, SPREAD(1.0f / 72.0f), SPREAD(1.0f / 36.0f))) * per_root;
    tail += fma(w2, SPREAD(1.0f / 6.0f), SPREAD(1.0f / 3.0f));
    return select(positive(floor(mean + fma(root, w, tail))), count, is_small);
}

// Where some blocks lie: `across` of them side by side from column x on, then those of the next row.
typedef struct {
    uint x, across, row, count;
} noise_blocks_t;
#define block_x(blocks, k) ((blocks)->x + (k) % (blocks)->across * LANES)
#define block_row(blocks, k) ((blocks)->row + (k) / (blocks)->across)

static inline void draw_words_of(const sensor_t *s, const noise_blocks_t *blocks, uint frame_low, uint frame_high,
                                 uint stream, lanes_u (*words)[4]) {
    const uint2 key = (uint2)(s->key_low, s->key_high);
    for (uint k = 0, row = blocks->row; k < blocks->count; ++row)
        for (uint across = 0; across < blocks->across && k < blocks->count; ++across, ++k) {
            lanes_words4 block;
            image_blocks(blocks->x + across * LANES, row, frame_low, frame_high, stream, key, &block);
            words[k][0] = block.w0;
            words[k][1] = block.w1;
            words[k][2] = block.w2;
            words[k][3] = block.w3;
        }
}

static inline void draw_words(const sensor_t *s, const noise_blocks_t *blocks, uint stream, lanes_u (*words)[4]) {
    draw_words_of(s, blocks, s->frame_low, s->frame_high, stream, words);
}

static inline void draw_normals(const sensor_t *s, const noise_blocks_t *blocks, uint stream, lanes_f (*normals)[4]) {
    lanes_u words[NOISE_BLOCKS][4];
    draw_words(s, blocks, stream, words);
    for (uint k = 0; k < blocks->count; ++k) {
        normals_from_pair(words[k][0], words[k][1], &normals[k][0], &normals[k][1]);
        normals_from_pair(words[k][2], words[k][3], &normals[k][2], &normals[k][3]);
    }
}

// Rows 2 n and 2 n + 1 share a block of words, each of which makes a normal for either: blocks begin at an even row.
// The block of rows row + 2 n and row + 2 n + 1 that is the k-th from the left is words[n * across + k]; returns how
// many there are.
static inline uint draw_read_words(const sensor_t *s, const noise_blocks_t *blocks, lanes_u (*words)[4]) {
    const uint across = blocks->across, rows = (blocks->count + across - 1) / across;
    const noise_blocks_t pairs = {blocks->x, across, blocks->row / 2, (rows + 1) / 2 * across};
    draw_words(s, &pairs, STREAM_READ_NOISE, words);
    return pairs.count;
}

static inline void draw_read_noise(const sensor_t *s, const noise_blocks_t *blocks, lanes_f (*normals)[4]) {
    const uint across = blocks->across;
    lanes_u words[NOISE_BLOCKS / 2][4];
    const uint count = draw_read_words(s, blocks, words);
    for (uint pair = 0; pair < count; ++pair) {
        const uint k = pair + pair / across * across;
#pragma unroll
        for (uint j = 0; j < 4; ++j)
            normal_pairs_from_words(words[pair][j], &normals[k][j], &normals[k + across][j]);
    }
}

// The jumps of telegraph noise, 0 at most pixels.
static inline void draw_telegraph(const sensor_t *s, const noise_blocks_t *blocks, lanes_f (*jumps)[4]) {
    lanes_u pixels[NOISE_BLOCKS][4], states[NOISE_BLOCKS][4];
    draw_words_of(s, blocks, 0, 0, STREAM_TELEGRAPH_PIXEL, pixels);
    draw_words(s, blocks, STREAM_TELEGRAPH_STATE, states);
    for (uint k = 0; k < blocks->count; ++k)
        for (uint j = 0; j < 4; ++j) {
            const lanes_f jump =
                select(SPREAD(s->telegraph_low), SPREAD(s->telegraph_high), as_lanes_i(states[k][j]) < 0);
            jumps[k][j] = select(SPREAD(0.0f), jump, uniforms_from_words(pixels[k][j]) < s->telegraph_fraction);
        }
}

static inline void draw_noise(const sensor_t *s, const noise_blocks_t *blocks, frame_noise_t *noise) {
    if (s->switches & SENSOR_READ_NOISE)
        draw_read_noise(s, blocks, noise->read);
    if (s->switches & SENSOR_CORRELATED) {
        noise_blocks_t left_blocks = *blocks;
        left_blocks.x -= 1u;
        lanes_f left[NOISE_BLOCKS][4];
        draw_read_noise(s, &left_blocks, left);
        for (uint k = 0; k < blocks->count; ++k)
            for (uint j = 0; j < 4; ++j)
                noise->read[k][j] =
                    fma(SPREAD(s->read_noise_left), left[k][j], s->read_noise_own * noise->read[k][j]);
    }
    if (s->switches & SENSOR_SHOT_NOISE) {
        draw_normals(s, blocks, STREAM_SHOT_NOISE, noise->shot);
        draw_words(s, blocks, STREAM_SHOT_NOISE + 1, noise->shot_words);
    }
    if (s->switches & SENSOR_ROW_NOISE)
        for (uint k = 0; k < blocks->count; ++k) {
            const words4 block = image_block(0, block_row(blocks, k), s->frame_low, s->frame_high, STREAM_ROW_NOISE,
                                             (uint2)(s->key_low, s->key_high));
            const normals4 rows = normals_from_block(block);
            noise->rows[k][0] = rows.n0;
            noise->rows[k][1] = rows.n1;
            noise->rows[k][2] = rows.n2;
            noise->rows[k][3] = rows.n3;
        }
    if (s->switches & SENSOR_COLUMN_NOISE)
        for (uint k = 0; k < blocks->count; ++k) {
            const noise_blocks_t top = {block_x(blocks, k), 1, 0, 1};
            lanes_f columns[1][4];
            draw_normals(s, &top, STREAM_COLUMN_NOISE, columns);
            noise->column[k] = s->column_noise * columns[0][0];
        }
    if (s->switches & SENSOR_TELEGRAPH)
        draw_telegraph(s, blocks, noise->telegraph);
}

// The signals that the intensities give.
static inline lanes_f signals_of(const sensor_t *s, lanes_f intensity) { return positive(s->gain * intensity); }

// code_between_levels() in sensor_pixel.h.
static inline lanes_f code_wave_at(const sensor_t *s, lanes_f at) {
    lanes_complex wave;
    phasors_from_turns((at - s->widest_code) * s->code_wave_frequency, &wave);
    return s->code_wave * wave.im;
}
static inline lanes_f levels_of_codes(const sensor_t *s, lanes_f code) {
    return (code - 0.5f) + code_wave_at(s, code - 0.5f);
}
static inline lanes_f codes_between_levels(const sensor_t *s, lanes_f value) {
    const lanes_f code = nearest(value - code_wave_at(s, value));
    const lanes_f above = select(code, code + 1.0f, value >= levels_of_codes(s, code + 1.0f));
    return select(above, code - 1.0f, value < levels_of_codes(s, code));
}

static inline lanes_output codes_of(const sensor_t *s, lanes_f value) {
#if OUTPUT_FORMAT == FORMAT_FLOAT32
    return value * s->output_scale;
#else
    return convert_lanes_output(convert_lanes_i(value));
#endif
}

// count of LANES codes side by side.
static inline void store_codes(__global output_t *to, uint count, lanes_output codes) {
    if (count == LANES) {
        store_lanes_output(codes, to);
        return;
    }
    output_t each[LANES];
    vstore_lanes(codes, 0, each);
    for (uint lane = 0; lane < count; ++lane)
        to[lane] = each[lane];
}

#if STREAM
typedef output_t lanes_output_pair __attribute__((ext_vector_type(2 * LANES)));
#if LANES == 16
#define ONE_AFTER_THE_OTHER                                                                                            \
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31
#elif LANES == 8
#define ONE_AFTER_THE_OTHER 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
#else
#define ONE_AFTER_THE_OTHER 0, 1, 2, 3, 4, 5, 6, 7
#endif
#endif
// 2 LANES codes side by side. streams: past the caches, at once: part of a cache line by itself may be on its way
// before the rest comes (16 codes of 16 bits are half of one, 32 all of it).
static inline void store_two(__global output_t *to, int streams, lanes_output first, lanes_output second) {
#if STREAM
    if (streams) {
        const lanes_output_pair both = __builtin_shufflevector(first, second, ONE_AFTER_THE_OTHER);
        __builtin_nontemporal_store(both, (__global lanes_output_pair *)to);
        return;
    }
#endif
    store_lanes_output(first, to);
    store_lanes_output(second, to + LANES);
}

// How much there is besides read noise and the converter.
typedef enum {
    CAMERA_WHOLE_CODES, // nothing
    CAMERA_PLAIN,       // a dark signal and a coarse converter at most
    CAMERA_ANY
} camera_kind_t;

static inline camera_kind_t kind_of(const camera_t *c) {
    const sensor_t *s = &c->s;
    if ((s->switches & ~(SENSOR_READ_NOISE | SENSOR_LAG_FIRST)) != SENSOR_QUANTIZE || c->pixel_gain || c->response ||
        c->lag_state || c->offset || c->read_noise_map)
        return CAMERA_ANY;
    return s->dark_signal == 0.0f && s->code_step == 1.0f ? CAMERA_WHOLE_CODES : CAMERA_PLAIN;
}

// expose_lanes() where the kind is not CAMERA_ANY: the same bits. normal: of the read noise, if there is any.
static inline lanes_output expose_plain_lanes(const camera_t *c, camera_kind_t kind, int has_read_noise, lanes_f normal,
                                              lanes_f value) {
    const sensor_t *s = &c->s;
    if (kind == CAMERA_PLAIN)
        value += s->dark_signal;
    value = smaller(value, SPREAD(s->saturation)) + s->black_level;
    if (has_read_noise)
        value = fma(SPREAD(s->read_noise), normal, value);
    if (kind == CAMERA_PLAIN)
        value = nearest(value * s->steps_per_dn) * s->code_step;
    value = smaller(positive(value), SPREAD(s->top_code));
#if OUTPUT_FORMAT != FORMAT_FLOAT32 && defined(__clang__)
    // The sum's lowest bits are the nearest whole number, for which both ends of the range may come before rounding.
    if (kind == CAMERA_WHOLE_CODES)
        return convert_lanes_output(as_lanes_u(value + 0x1.8p23f));
#endif
    return codes_of(s, kind == CAMERA_PLAIN ? value : nearest(value));
}

// count pixels of row y in quarter j from x on, a multiple of LANES; their noise is that of block k; value: their
// signals.
static inline lanes_output expose_lanes(const camera_t *c, uint x, uint count, uint y, uint j, uint k,
                                        const frame_noise_t *noise, lanes_f value) {
    const sensor_t *s = &c->s;
    const uint switches = s->switches;
    const ulong i = (ulong)y * s->width + x;
    if (switches & SENSOR_MOSAIC) {
        lanes_f site;
        site.even = (y & 1) ? s->mosaic_01 : s->mosaic_00;
        site.odd = (y & 1) ? s->mosaic_11 : s->mosaic_10;
        value *= site;
    }
    if (c->pixel_gain)
        value *= load_some(c->pixel_gain + i, count);
    if (c->response) {
        float values[LANES];
        vstore_lanes(value, 0, values);
        for (uint lane = 0; lane < count; ++lane)
            values[lane] = c->response[i + lane] == 0 ? 0.0f : values[lane];
        value = vload_lanes(0, values);
    }
    value += s->dark_signal;
    if (switches & SENSOR_SHOT_NOISE)
        value = s->dn_per_electron * poissons(smaller(value * s->electrons_per_dn, SPREAD(1e30f)), noise->shot[k][j],
                                              noise->shot_words[k][j]);
    value = smaller(value, SPREAD(s->saturation));
    if (c->lag_state) {
        if (!(switches & SENSOR_LAG_FIRST))
            value = fma(SPREAD(s->lag), load_some(lag_before(c) + i, count), (1.0f - s->lag) * value);
        store_some(value, lag_after(c) + i, count);
    }
    if (switches & SENSOR_CUBIC) {
        const lanes_f part = smaller(value * s->gamma_scale, SPREAD(1.0f));
        const lanes_f square = part * part;
        const lanes_f bend = s->nonlinearity_power == 3u   ? part * square
                             : s->nonlinearity_power == 2u ? square
                                                           : part;
        value = fma(-s->cubic * value, bend, value);
    }
    if (switches & SENSOR_GAMMA) {
        const lanes_f relative = smaller(value * s->gamma_scale, SPREAD(4096.0f));
        const lanes_i is_light = relative >= 0x1p-100f;
        const lanes_f power = exps(-s->gamma * minus_logs(select(SPREAD(1.0f), relative, is_light)));
        value = select(SPREAD(0.0f), s->gamma_full * power, is_light);
    }
    value += s->black_level;
    if (c->offset)
        value += load_some(c->offset + i, count);
    if (switches & SENSOR_ROW_NOISE)
        value = fma(SPREAD(s->row_noise), SPREAD(noise->rows[k][j]), value);
    if (switches & SENSOR_COLUMN_NOISE)
        value += noise->column[k];
    if (switches & SENSOR_TELEGRAPH)
        value += noise->telegraph[k][j];
    if (switches & SENSOR_READ_NOISE)
        value = fma(c->read_noise_map ? load_some(c->read_noise_map + i, count) : SPREAD(s->read_noise),
                    noise->read[k][j], value);
    if (switches & SENSOR_CODE_WIDTHS)
        value = codes_between_levels(s, value * s->steps_per_dn) * s->code_step;
    else if (switches & SENSOR_QUANTIZE)
        value = nearest(value * s->steps_per_dn) * s->code_step; // what is out of its range is clipped
    return codes_of(s, smaller(positive(value), SPREAD(s->top_code)));
}

#endif
