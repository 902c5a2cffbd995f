// The camera's chain, one pixel at a time, for GPUs. What is on is compiled in, each 0 or 1:
//   READ_NOISE, READ_NOISE_SPREAD, READ_NOISE_CORRELATED, ROW_NOISE, COLUMN_NOISE, SHOT_NOISE, TELEGRAPH
//   MOSAIC, PRNU, COLD, DARK_CURRENT, LAG, CUBIC, GAMMA, OFFSET, QUANTIZE, CODE_WIDTHS, CODE_STEP
// The equations are in sensor.h of the C API.
#ifndef CLSP_SENSOR_PIXEL_H
#define CLSP_SENSOR_PIXEL_H

#include "common/phasor.h"
#include "stages/sensor_camera.h"

#if SHOT_NOISE
// Poisson deviate of the given mean. Below 12 by inversion: the number of k with t < P(N > k), t uniform. An N whose
// probability is below the resolution of a word, 2^-32, never occurs; those above the mean end at 40. From 12 on
// floor(x), where x solves P(Poisson <= x - 1) = Phi(w) for a standard normal w, by the Cornish-Fisher series in 1 /
// sqrt(mean) (Giles, ACM TOMS 42 (2016), Algorithm 955); the coefficients of the last term are fitted to the inverse
// incomplete gamma function.
static inline ALWAYS_INLINE float poisson(float mean, float w, uint word) {
    if (mean < 12.0f) {
        const float t = uniform_from_word(word);
        float probability = exp_of(-mean), above = 1.0f - probability, count = 0.0f;
        for (int k = 1; k < 41 && t < above; ++k) {
            probability *= mean * (1.0f / k);
            if (probability < 0x1p-32f)
                break;
            count += 1.0f;
            above -= probability;
        }
        return count;
    }
    const float root = sqrt(mean), per_root = 1.0f / root;
    const float w2 = w * w;
    float tail = w * fma(w2, fma(w2, -0.00141f, -0.00288f), 0.01627f) * per_root;
    tail = (tail + fma(w2, fma(w2, 1.0f / 270.0f, 7.0f / 810.0f), -8.0f / 405.0f)) * per_root;
    tail = (tail - w * fma(w2, 1.0f / 72.0f, 1.0f / 36.0f)) * per_root;
    tail += fma(w2, 1.0f / 6.0f, 1.0f / 3.0f);
    return fmax(floor(mean + fma(root, w, tail)), 0.0f);
}
#endif

// What is random in one column's four rows that share a Philox block, one in each quarter of the image.
typedef struct {
    normals4 read, shot, rows;
    words4 shot_words, telegraph_pixels, telegraph_states;
    float column;
} pixel_noise_t;

#if READ_NOISE
// A word of the block of rows 2 n and 2 n + 1 makes a pair of normals: the first is the even row's.
static inline ALWAYS_INLINE float read_normal(uint word, uint row) {
    const normals2 pair = normal_pair_from_word(word);
    return (row & 1u) ? pair.n1 : pair.n0;
}

static inline ALWAYS_INLINE normals4 read_normals(const sensor_t *s, uint x, uint row) {
    const words4 words = image_block(x, row >> 1, s->frame_low, s->frame_high, STREAM_READ_NOISE,
                                     (uint2)(s->key_low, s->key_high));
    const normals4 normals = {read_normal(words.w0, row), read_normal(words.w1, row), read_normal(words.w2, row),
                              read_normal(words.w3, row)};
    return normals;
}
#endif

static inline ALWAYS_INLINE pixel_noise_t draw_pixel_noise(const sensor_t *s, uint x, uint row) {
    const uint2 key = (uint2)(s->key_low, s->key_high);
    pixel_noise_t noise = {.column = 0.0f}; // a camera may draw nothing
#if READ_NOISE
    noise.read = read_normals(s, x, row);
#if READ_NOISE_CORRELATED
    const normals4 left = read_normals(s, x - 1u, row);
    noise.read.n0 = fma(s->read_noise_left, left.n0, s->read_noise_own * noise.read.n0);
    noise.read.n1 = fma(s->read_noise_left, left.n1, s->read_noise_own * noise.read.n1);
    noise.read.n2 = fma(s->read_noise_left, left.n2, s->read_noise_own * noise.read.n2);
    noise.read.n3 = fma(s->read_noise_left, left.n3, s->read_noise_own * noise.read.n3);
#endif
#endif
#if SHOT_NOISE
    noise.shot = normals_from_block(image_block(x, row, s->frame_low, s->frame_high, STREAM_SHOT_NOISE, key));
    noise.shot_words = image_block(x, row, s->frame_low, s->frame_high, STREAM_SHOT_NOISE + 1, key);
#endif
    // Row and column noise are images one pixel wide and one pixel high. They are drawn again by every pixel: no pass,
    // no memory, nothing that frames on several queues could share.
#if ROW_NOISE
    noise.rows = normals_from_block(image_block(0, row, s->frame_low, s->frame_high, STREAM_ROW_NOISE, key));
#endif
#if COLUMN_NOISE
    noise.column = s->column_noise *
                   normals_from_block(image_block(x, 0, s->frame_low, s->frame_high, STREAM_COLUMN_NOISE, key)).n0;
#endif
#if TELEGRAPH
    noise.telegraph_pixels = image_block(x, row, 0, 0, STREAM_TELEGRAPH_PIXEL, key);
    noise.telegraph_states = image_block(x, row, s->frame_low, s->frame_high, STREAM_TELEGRAPH_STATE, key);
#endif
    return noise;
}

#if CODE_WIDTHS
static inline ALWAYS_INLINE float code_wave_at(const sensor_t *s, float at) {
    return s->code_wave * phasor_from_turns((at - s->widest_code) * s->code_wave_frequency).im;
}

// Where a code begins.
static inline ALWAYS_INLINE float level_of_code(const sensor_t *s, float code) {
    return (code - 0.5f) + code_wave_at(s, code - 0.5f);
}

// The code whose level is the last one below the value. The wave at the value for that at the level leads one code
// astray at most.
static inline ALWAYS_INLINE float code_between_levels(const sensor_t *s, float value) {
    const float code = rint(value - code_wave_at(s, value));
    return value < level_of_code(s, code) ? code - 1.0f : value >= level_of_code(s, code + 1.0f) ? code + 1.0f : code;
}
#endif

// part of full scale, to the power of the nonlinearity.
static inline ALWAYS_INLINE float bend_of(const sensor_t *s, float part) {
    const float square = part * part;
    return s->nonlinearity_power == 3u ? part * square : s->nonlinearity_power == 2u ? square : part;
}

// The signal that the intensity gives. fmax drops NaN.
static inline ALWAYS_INLINE float signal_of(const sensor_t *s, float intensity) {
    return fmax(s->gain * intensity, 0.0f);
}

// Pixel (x, y), y = row + j quarter; noise: of x and row; value: its signal.
static inline ALWAYS_INLINE void expose_pixel(const camera_t *c, uint x, uint y, uint j, const pixel_noise_t *noise,
                                              float value) {
    const sensor_t *s = &c->s;
    const ulong i = (ulong)y * s->width + x;
#if MOSAIC
    value *= (y & 1) ? ((x & 1) ? s->mosaic_11 : s->mosaic_01) : ((x & 1) ? s->mosaic_10 : s->mosaic_00);
#endif
#if PRNU
    value *= c->pixel_gain[i];
#endif
#if COLD
    value = c->response[i] == 0 ? 0.0f : value;
#endif
#if DARK_CURRENT
    value += s->dark_signal;
#endif
#if SHOT_NOISE
    value = s->dn_per_electron *
            poisson(fmin(value * s->electrons_per_dn, 1e30f), normal_of(noise->shot, j), word_of(noise->shot_words, j));
#endif
    value = fmin(value, s->saturation);
#if LAG
    value = (s->switches & SENSOR_LAG_FIRST) ? value : fma(s->lag, lag_before(c)[i], (1.0f - s->lag) * value);
    lag_after(c)[i] = value;
#endif
#if CUBIC
    // What the converter clips bends no further.
    const float part = fmin(value * s->gamma_scale, 1.0f);
    value = fma(-s->cubic * value, bend_of(s, part), value);
#endif
#if GAMMA
    // Below 2^-100 of full scale a signal counts as 0, above 2^12 as 2^12, so that no power leaves the range of a
    // float.
    const float relative = fmin(value * s->gamma_scale, 4096.0f);
    value = relative >= 0x1p-100f ? s->gamma_full * exp_of(-s->gamma * minus_log(relative)) : 0.0f;
#endif
    value += s->black_level;
#if OFFSET
    value += c->offset[i];
#endif
#if ROW_NOISE
    value = fma(s->row_noise, normal_of(noise->rows, j), value);
#endif
#if COLUMN_NOISE
    value += noise->column;
#endif
#if TELEGRAPH
    if (uniform_from_word(word_of(noise->telegraph_pixels, j)) < s->telegraph_fraction)
        value += word_of(noise->telegraph_states, j) >> 31 ? s->telegraph_high : s->telegraph_low;
#endif
#if READ_NOISE_SPREAD
    value = fma(c->read_noise_map[i], normal_of(noise->read, j), value);
#elif READ_NOISE
    value = fma(s->read_noise, normal_of(noise->read, j), value);
#endif
#if QUANTIZE
#if CODE_WIDTHS
    value = code_between_levels(s, value * s->steps_per_dn) * s->code_step;
#elif CODE_STEP
    value = rint(value * s->steps_per_dn) * s->code_step;
#else
    value = rint(value);
#endif
#endif
    value = fmin(fmax(value, 0.0f), s->top_code);
    __global output_t *to = c->output + (ulong)y * c->output_pitch + x;
#if OUTPUT_FORMAT == FORMAT_FLOAT32
    *to = value * s->output_scale;
#else
    *to = (output_t)(int)value;
#endif
}

#endif
