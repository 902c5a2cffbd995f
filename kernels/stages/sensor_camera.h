// What kernels that make a sensor's frames are given for it.
//   OUTPUT_FORMAT
#ifndef CLSP_SENSOR_CAMERA_H
#define CLSP_SENSOR_CAMERA_H

#include "common/common.h"

#if OUTPUT_FORMAT == FORMAT_UINT8
typedef uchar output_t;
#elif OUTPUT_FORMAT == FORMAT_UINT16
typedef ushort output_t;
#else
typedef float output_t;
#endif

// The same numbers as core/stages/sensor_camera.hpp.
#define SENSOR_READ_NOISE 1u
#define SENSOR_SHOT_NOISE 2u
#define SENSOR_ROW_NOISE 4u
#define SENSOR_COLUMN_NOISE 8u
#define SENSOR_MOSAIC 16u
#define SENSOR_GAMMA 32u
#define SENSOR_LAG_FIRST 64u
#define SENSOR_QUANTIZE 128u
#define SENSOR_CROSSTALK 256u
#define SENSOR_CUBIC 512u
#define SENSOR_TELEGRAPH 1024u
#define SENSOR_LAG_SECOND 2048u
#define SENSOR_CODE_WIDTHS 4096u
#define SENSOR_CORRELATED 8192u

// The same members as SensorConstants there, of four bytes each.
typedef struct {
    uint switches, width, height, quarter, key_low, key_high, frame_low, frame_high;
    float gain, crosstalk, mosaic_00, mosaic_10, mosaic_01, mosaic_11, dark_signal, dn_per_electron, electrons_per_dn,
        saturation, lag;
    float gamma, gamma_full, gamma_scale, black_level, read_noise, row_noise, column_noise, code_step, steps_per_dn,
        top_code, output_scale;
    float cubic, telegraph_fraction, telegraph_low, telegraph_high;
    float code_wave, code_wave_frequency, widest_code;
    uint nonlinearity_power;
    float read_noise_own, read_noise_left;
} sensor_t;

// Maps are NULL where their effect is off.
#define SENSOR_PARAMETERS                                                                                              \
    sensor_t sensor, __global const float *offset, __global const uchar *response, __global const float *pixel_gain,   \
        __global const float *read_noise_map, __global float *lag_state, __global output_t *output,                    \
        ulong output_offset, uint output_pitch
#define SENSOR_CAMERA                                                                                                  \
    { sensor, offset, response, pixel_gain, read_noise_map, lag_state, output + output_offset, output_pitch }

typedef struct {
    sensor_t s;
    __global const float *offset;
    __global const uchar *response;
    __global const float *pixel_gain;
    __global const float *read_noise_map;
    __global float *lag_state;
    __global output_t *output;
    uint output_pitch;
} camera_t;

// lag_state has two halves: what is read of the frame before, and where this one leaves what the next reads. A frame
// that is made again finds the same.
static inline __global const float *lag_before(const camera_t *c) {
    return c->lag_state + (c->s.switches & SENSOR_LAG_SECOND ? (ulong)c->s.width * c->s.height : 0);
}
static inline __global float *lag_after(const camera_t *c) {
    return c->lag_state + (c->s.switches & SENSOR_LAG_SECOND ? 0 : (ulong)c->s.width * c->s.height);
}

#endif
