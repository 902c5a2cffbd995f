// From intensity to codes. The equations are in sensor.h of the C API.
#include "philox.h"

// exp(x), |x| < 87: x = n ln 2 + r in two parts of ln 2, Taylor polynomial of exp(r), |r| <= ln(2) / 2 (relative error 8e-9 before
// rounding). Not the built-in: this feeds random numbers.
static inline ALWAYS_INLINE float exp_of(float x) {
    const float n = rint(x * 1.44269504f);
    const float r = fma(n, -1.428606765330187e-06f, fma(n, -0.693145751953125f, x));
    float p = fma(r, 1.98412698e-4f, 1.38888889e-3f);
    p = fma(r, p, 8.33333333e-3f);
    p = fma(r, p, 4.16666667e-2f);
    p = fma(r, p, 1.66666667e-1f);
    p = fma(r, p, 0.5f);
    p = fma(r, p, 1.0f);
    p = fma(r, p, 1.0f);
    return p * as_float(((int)n + 127) << 23);
}

static inline ALWAYS_INLINE float normal_of(normals4 normals, uint j) {
    return j == 0 ? normals.n0 : j == 1 ? normals.n1 : j == 2 ? normals.n2 : normals.n3;
}

#if FIXED_PATTERN

// Drawn once. offset (dark frame already in it) gains hot pixels, DSNU and column offsets; response is 0 at cold pixels and 1
// elsewhere; pixel_gain is the PRNU, 0 at cold pixels; read_noise_map is each pixel's standard deviation. Only what is on is
// written: the other buffers may be NULL. One work-item a Philox block.
__kernel void sensor_fixed_pattern(__global float *offset, __global uchar *response, __global float *pixel_gain,
                                   __global float *read_noise_map, uint width, uint height, uint quarter, uint2 key,
                                   float hot_fraction, float hot_mean, float cold_fraction, float prnu, float dsnu,
                                   float column_offset, float read_noise, float read_noise_spread) {
    const uint x = get_global_id(0), row = get_global_id(1);
    if (x >= width || row >= quarter)
        return;
    const words4 hot = image_block(x, row, 0, 0, STREAM_HOT_PIXEL, key);
    const words4 hot_offset = image_block(x, row, 0, 0, STREAM_HOT_OFFSET, key);
    const words4 cold = image_block(x, row, 0, 0, STREAM_COLD_PIXEL, key);
    const normals4 gains = normals_from_block(image_block(x, row, 0, 0, STREAM_PRNU, key));
    const normals4 offsets = normals_from_block(image_block(x, row, 0, 0, STREAM_DSNU, key));
    const normals4 column = normals_from_block(image_block(x, 0, 0, 0, STREAM_COLUMN_OFFSET, key));
    const normals4 spread = normals_from_block(image_block(x, row, 0, 0, STREAM_READ_NOISE_SPREAD, key));
    for (uint j = 0; j < 4; ++j) {
        const uint y = row + j * quarter;
        if (y >= height)
            continue;
        const ulong i = (ulong)y * width + x;
#if HOT
        if (uniform_from_word(word_of(hot, j)) < hot_fraction)
            offset[i] += hot_mean * minus_log(uniform_from_word(word_of(hot_offset, j)));
#endif
#if DSNU
        offset[i] += dsnu * normal_of(offsets, j);
#endif
#if COLUMN_OFFSET
        offset[i] += column_offset * column.n0;
#endif
        const bool is_cold = uniform_from_word(word_of(cold, j)) < cold_fraction;
#if COLD
        response[i] = is_cold ? 0 : 1;
#endif
#if PRNU
        pixel_gain[i] = is_cold ? 0.0f : fmax(fma(prnu, normal_of(gains, j), 1.0f), 0.0f);
#endif
#if READ_NOISE_SPREAD
        // E exp(2 s n) = exp(2 s^2), so exp(s n - s^2) has mean square 1.
        read_noise_map[i] = read_noise * exp_of(read_noise_spread * (normal_of(spread, j) - read_noise_spread));
#endif
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

// Bilinear. The sites of red are x & 1 == red_x, y & 1 == red_y. Beyond the border the image is mirrored at its outermost pixels, which
// keeps every site's colour.
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

#if OUTPUT_FORMAT == FORMAT_UINT8
typedef uchar output_t;
#elif OUTPUT_FORMAT == FORMAT_UINT16
typedef ushort output_t;
#else
typedef float output_t;
#endif

#if SHOT_NOISE
// Poisson deviate of the given mean. Below 12 by inversion: the number of k with t < P(N > k), t uniform. An N whose
// probability is below the resolution of a word, 2^-32, never occurs; those above the mean end at 40. From 12 on floor(x), where
// x solves P(Poisson <= x - 1) = Phi(w) for a standard normal w, by the Cornish-Fisher series in 1 / sqrt(mean) (Giles, ACM TOMS 42
// (2016), Algorithm 955); the coefficients of the last term are fitted to the inverse incomplete gamma function.
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

// What a pixel's chain needs beside its place.
typedef struct {
    float gain, saturation, black_level, top_code, output_scale;
    float crosstalk, mosaic_00, mosaic_10, mosaic_01, mosaic_11, dark_signal, dn_per_electron, electrons_per_dn, lag;
    float gamma, gamma_full, gamma_scale, code_step, steps_per_dn;
    uint lag_first;
} camera_t;

// The signal that the intensity gives. fmax drops NaN.
static inline ALWAYS_INLINE float signal_of(float intensity, const camera_t c) { return fmax(c.gain * intensity, 0.0f); }

// One pixel: intensity to output.
static inline ALWAYS_INLINE void expose(const camera_t c, uint x, uint y, uint width, uint height, __global const float *intensity, uint pitch,
                          float noise, float shot_normal, uint shot_word, __global const float *offset,
                          __global const uchar *response, __global const float *pixel_gain, __global float *lag_state,
                          __global output_t *output) {
    const ulong i = (ulong)y * width + x;
    const ulong at = (ulong)y * pitch + x;
    float value = signal_of(intensity[at], c);
#if CROSSTALK
    const float neighbours =
        (signal_of(intensity[x > 0 ? at - 1 : at], c) + signal_of(intensity[x + 1 < width ? at + 1 : at], c)) +
        (signal_of(intensity[y > 0 ? at - pitch : at], c) + signal_of(intensity[y + 1 < height ? at + pitch : at], c));
    value = fma(0.25f * c.crosstalk, neighbours, (1.0f - c.crosstalk) * value);
#endif
#if MOSAIC
    value *= (y & 1) ? ((x & 1) ? c.mosaic_11 : c.mosaic_01) : ((x & 1) ? c.mosaic_10 : c.mosaic_00);
#endif
#if PRNU
    value *= pixel_gain[i];
#endif
#if COLD
    value = response[i] == 0 ? 0.0f : value;
#endif
#if DARK_CURRENT
    value += c.dark_signal;
#endif
#if SHOT_NOISE
    value = c.dn_per_electron * poisson(fmin(value * c.electrons_per_dn, 1e30f), shot_normal, shot_word);
#endif
    value = fmin(value, c.saturation);
#if LAG
    value = c.lag_first ? value : fma(c.lag, lag_state[i], (1.0f - c.lag) * value);
    lag_state[i] = value;
#endif
#if GAMMA
    // Below 2^-100 of full scale a signal counts as 0, above 2^12 as 2^12, so that no power leaves the range of a float.
    const float relative = fmin(value * c.gamma_scale, 4096.0f);
    value = relative >= 0x1p-100f ? c.gamma_full * exp_of(-c.gamma * minus_log(relative)) : 0.0f;
#endif
    value += c.black_level;
#if OFFSET
    value += offset[i];
#endif
    value += noise;
#if QUANTIZE
#if CODE_STEP
    value = rint(value * c.steps_per_dn) * c.code_step;
#else
    value = rint(value);
#endif
#endif
    value = fmin(fmax(value, 0.0f), c.top_code);
#if OUTPUT_FORMAT == FORMAT_FLOAT32
    *output = value * c.output_scale;
#else
    *output = (output_t)(int)value;
#endif
}

// One work-item a Philox block: four pixels, one in each quarter of the rows.
__kernel void sensor_expose(__global const float *intensity, ulong intensity_offset, uint intensity_pitch,
                            __global const float *offset, __global const uchar *response,
                            __global const float *pixel_gain, __global const float *read_noise_map,
                            __global float *lag_state, uint width, uint height, uint quarter, uint2 key, uint frame_low,
                            uint frame_high, float gain, float saturation, float black_level, float read_noise,
                            float top_code, float output_scale, float crosstalk, float mosaic_00, float mosaic_10,
                            float mosaic_01, float mosaic_11, float dark_signal, float dn_per_electron,
                            float electrons_per_dn, float lag, uint lag_first, float gamma, float gamma_full,
                            float gamma_scale, float row_noise, float column_noise, float code_step, float steps_per_dn,
                            __global output_t *output, ulong output_offset, uint output_pitch) {
    const uint x = get_global_id(0), row = get_global_id(1);
    const camera_t c = {gain, saturation, black_level, top_code, output_scale, crosstalk, mosaic_00, mosaic_10, mosaic_01,
                        mosaic_11, dark_signal, dn_per_electron, electrons_per_dn, lag, gamma, gamma_full, gamma_scale,
                        code_step, steps_per_dn, lag_first};
#if READ_NOISE
    const normals4 noise = normals_from_block(image_block(x, row, frame_low, frame_high, STREAM_READ_NOISE, key));
#else
    const normals4 noise = {0.0f, 0.0f, 0.0f, 0.0f};
#endif
#if SHOT_NOISE
    const normals4 shot = normals_from_block(image_block(x, row, frame_low, frame_high, STREAM_SHOT_NOISE, key));
    const words4 shot_words = image_block(x, row, frame_low, frame_high, STREAM_SHOT_NOISE + 1, key);
#else
    const normals4 shot = {0.0f, 0.0f, 0.0f, 0.0f};
    const words4 shot_words = {0, 0, 0, 0};
#endif
    // Row and column noise are images one pixel wide and one pixel high. They are drawn again by every pixel: no pass, no memory,
    // nothing that frames on several queues could share.
#if ROW_NOISE
    const normals4 rows = normals_from_block(image_block(0, row, frame_low, frame_high, STREAM_ROW_NOISE, key));
#define WITH_ROW_NOISE(value, j) fma(row_noise, rows.n##j, value)
#else
#define WITH_ROW_NOISE(value, j) value
#endif
#if COLUMN_NOISE
    const float column = column_noise * normals_from_block(image_block(x, 0, frame_low, frame_high, STREAM_COLUMN_NOISE, key)).n0;
#define WITH_COLUMN_NOISE(value) (value + column)
#else
#define WITH_COLUMN_NOISE(value) value
#endif
#if READ_NOISE_SPREAD
#define READ_NOISE_OF(y) read_noise_map[(ulong)(y)*width + x]
#else
#define READ_NOISE_OF(y) read_noise
#endif
// WHOLE_QUARTERS 1: the height is a multiple of 4. A store under a condition cannot be vectorized where there are no masked stores of 16
// bits (AVX2).
#define EXPOSE(j)                                                                                                              \
    if (WHOLE_QUARTERS || row + j * quarter < height) {                                                                        \
        const uint y = row + j * quarter;                                                                                      \
        expose(c, x, y, width, height, intensity + intensity_offset, intensity_pitch,                                          \
               WITH_COLUMN_NOISE(WITH_ROW_NOISE(READ_NOISE_OF(y) * noise.n##j, j)), shot.n##j, shot_words.w##j, offset, response, \
               pixel_gain, lag_state, output + output_offset + (ulong)y * output_pitch + x);                                   \
    }
    EXPOSE(0)
    EXPOSE(1)
    EXPOSE(2)
    EXPOSE(3)
}

#endif
