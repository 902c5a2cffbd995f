// What kernels/stages/sensor_camera.h needs to know of a sensor.
#pragma once

#include "runtime/opencl.hpp"

namespace clsp {

// The same numbers as there.
enum SensorSwitch : cl_uint {
    kSensorReadNoise = 1,
    kSensorShotNoise = 2,
    kSensorRowNoise = 4,
    kSensorColumnNoise = 8,
    kSensorMosaic = 16,
    kSensorGamma = 32,
    kSensorLagFirst = 64,
    kSensorQuantize = 128,
    kSensorCrosstalk = 256,
    kSensorCubic = 512,
    kSensorTelegraph = 1024,
    kSensorLagSecond = 2048,
    kSensorCodeWidths = 4096,
    kSensorCorrelated = 8192,
};

// The same members as sensor_t there.
struct SensorConstants {
    cl_uint switches, width, height, quarter;
    cl_uint key_low, key_high;
    cl_uint frame_low, frame_high;
    cl_float gain, crosstalk, mosaic[4], dark_signal, dn_per_electron, electrons_per_dn, saturation, lag;
    cl_float gamma, gamma_full, gamma_scale, black_level, read_noise, row_noise, column_noise, code_step, steps_per_dn,
        top_code, output_scale;
    cl_float cubic, telegraph_fraction, telegraph_low, telegraph_high;
    cl_float code_wave, code_wave_frequency, widest_code;
    cl_uint nonlinearity_power;
    cl_float read_noise_own, read_noise_left; // parts of the pixel's own deviate and of its left neighbour's
};
static_assert(sizeof(SensorConstants) == 40 * 4, "only members of four bytes");

} // namespace clsp
