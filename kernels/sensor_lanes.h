// The camera's chain with explicit vectors for CPU devices: LANES pixels of a row at once, the same bits as expose_pixel() in sensor_pixel.h.
// What is on is decided at run time: pass C of the fused engine includes this, and a transform takes long to compile.
//   OUTPUT_FORMAT
#ifndef CLSP_SENSOR_LANES_H
#define CLSP_SENSOR_LANES_H

#include "fused_lanes.h"
#include "sensor_camera.h"

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

// What is random in LANES columns of four rows, one in each quarter of the image.
typedef struct {
    lanes_f read[4], shot[4], column;
    lanes_u shot_words[4];
    float rows[4];
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
    if (any(is_small)) {
        const lanes_f t = uniforms_from_words(word), low_mean = select(SPREAD(0.0f), mean, is_small);
        lanes_f probability = exps(-low_mean), above = 1.0f - probability;
        lanes_i goes_on = is_small & (t < above);
        for (int k = 1; k < 41 && any(goes_on); ++k) {
            probability *= low_mean * (1.0f / k);
            goes_on &= probability >= 0x1p-32f;
            count += select(SPREAD(0.0f), SPREAD(1.0f), goes_on);
            above -= probability;
            goes_on &= t < above;
        }
        if (all(is_small))
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

static inline void draw_normals(const sensor_t *s, uint x, uint row, uint stream, lanes_f *normals) {
    lanes_words4 blocks;
    image_blocks(x, row, s->frame_low, s->frame_high, stream, (uint2)(s->key_low, s->key_high), &blocks);
    normals_from_blocks(&blocks, normals);
}

static inline void draw_noise(const sensor_t *s, uint x, uint row, frame_noise_t *noise) {
    if (s->switches & SENSOR_READ_NOISE)
        draw_normals(s, x, row, STREAM_READ_NOISE, noise->read);
    if (s->switches & SENSOR_SHOT_NOISE) {
        draw_normals(s, x, row, STREAM_SHOT_NOISE, noise->shot);
        lanes_words4 blocks;
        image_blocks(x, row, s->frame_low, s->frame_high, STREAM_SHOT_NOISE + 1, (uint2)(s->key_low, s->key_high), &blocks);
        noise->shot_words[0] = blocks.w0;
        noise->shot_words[1] = blocks.w1;
        noise->shot_words[2] = blocks.w2;
        noise->shot_words[3] = blocks.w3;
    }
    if (s->switches & SENSOR_ROW_NOISE) {
        const words4 block = image_block(0, row, s->frame_low, s->frame_high, STREAM_ROW_NOISE, (uint2)(s->key_low, s->key_high));
        const normals4 rows = normals_from_block(block);
        noise->rows[0] = rows.n0;
        noise->rows[1] = rows.n1;
        noise->rows[2] = rows.n2;
        noise->rows[3] = rows.n3;
    }
    if (s->switches & SENSOR_COLUMN_NOISE) {
        lanes_f columns[4];
        draw_normals(s, x, 0, STREAM_COLUMN_NOISE, columns);
        noise->column = s->column_noise * columns[0];
    }
}

// The signals that the intensities give.
static inline lanes_f signals_of(const sensor_t *s, lanes_f intensity) { return positive(s->gain * intensity); }

// count pixels of row y = row + j quarter from x on, a multiple of LANES; noise: of that row and x; value: their signals.
static inline void expose_lanes(const camera_t *c, uint x, uint count, uint y, uint j, const frame_noise_t *noise, lanes_f value) {
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
        value = s->dn_per_electron * poissons(smaller(value * s->electrons_per_dn, SPREAD(1e30f)), noise->shot[j], noise->shot_words[j]);
    value = smaller(value, SPREAD(s->saturation));
    if (c->lag_state) {
        if (!(switches & SENSOR_LAG_FIRST))
            value = fma(SPREAD(s->lag), load_some(c->lag_state + i, count), (1.0f - s->lag) * value);
        store_some(value, c->lag_state + i, count);
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
    if (switches & (SENSOR_READ_NOISE | SENSOR_ROW_NOISE | SENSOR_COLUMN_NOISE)) {
        lanes_f total = SPREAD(0.0f);
        if (switches & SENSOR_READ_NOISE)
            total = (c->read_noise_map ? load_some(c->read_noise_map + i, count) : SPREAD(s->read_noise)) * noise->read[j];
        if (switches & SENSOR_ROW_NOISE)
            total = fma(SPREAD(s->row_noise), SPREAD(noise->rows[j]), total);
        if (switches & SENSOR_COLUMN_NOISE)
            total += noise->column;
        value += total;
    }
    if (switches & SENSOR_QUANTIZE)
        value = nearest(value * s->steps_per_dn) * s->code_step; // what is out of its range is clipped
    value = smaller(positive(value), SPREAD(s->top_code));
#if OUTPUT_FORMAT == FORMAT_FLOAT32
    const lanes_output codes = value * s->output_scale;
#else
    const lanes_output codes = convert_lanes_output(convert_lanes_i(value));
#endif
    __global output_t *to = c->output + (ulong)y * c->output_pitch + x;
    if (count == LANES) {
        store_lanes_output(codes, to);
        return;
    }
    output_t each[LANES];
    vstore_lanes(codes, 0, each);
    for (uint lane = 0; lane < count; ++lane)
        to[lane] = each[lane];
}

#endif
