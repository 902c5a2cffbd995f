// What a sensor does.
#pragma once

#include "runtime/fields.hpp"

#include <array>
#include <cstdint>
#include <limits>

namespace clsp {

// What a sensor does, all in DN; sensor_datasheet.hpp has the view in photons and electrons.
struct SensorParameters {
    std::uint32_t width = 0, height = 0;
    std::uint32_t bits = 10;
    std::uint64_t seed = 0;
    double exposure_gain_dn = 512.0;
    double saturation_dn = std::numeric_limits<double>::infinity();
    double black_level_dn = 64.0;
    double read_noise_dn = 4.0;
    double hot_pixel_fraction = 0.0, hot_pixel_mean_dn = 150.0, cold_pixel_fraction = 0.0;
    double float_full_scale = 1.0;
    const float *dark_frame_dn = nullptr; // host memory, only read during construction and configure()
    std::uint64_t dark_frame_pitch_bytes = 0;
    bool quantize = true;

    double conversion_gain_dn_per_e = 0.0; // 0: no electrons
    double crosstalk_fraction = 0.0;
    double prnu = 0.0, column_prnu = 0.0, row_prnu = 0.0;
    std::array<double, 4> mosaic_gain{{1.0, 1.0, 1.0, 1.0}}; // sites (x & 1) + 2 (y & 1)
    double dark_current_e_per_s = 0.0, dark_current_reference_temperature_c = 25.0, dark_current_doubling_k = 8.0;
    double temperature_c = 25.0, exposure_time_s = 0.01;
    double lag_fraction = 0.0;
    double gamma = 1.0;
    double dsnu_dn = 0.0, column_offset_dn = 0.0, row_noise_dn = 0.0, column_noise_dn = 0.0;
    double read_noise_spread = 0.0;
    bool shot_noise = false;
    std::uint32_t effective_bits = 0; // 0: bits
    double row_offset_dn = 0.0, dull_pixel_fraction = 0.0, cubic_nonlinearity = 0.0;
    double periodic_offset_dn = 0.0, periodic_frequency_x = 0.0, periodic_frequency_y = 0.0; // cycles per pixel
    double telegraph_fraction = 0.0, telegraph_step_dn = 0.0;
    bool telegraph_centered = false; // half the step up and down, not up alone
    double code_width_wave = 0.0, code_width_period = 4.0, widest_code = 0.0;
    std::uint32_t nonlinearity_power = 3;
    double read_noise_correlation = 0.0; // of neighbours in a row
    const float *gain_map = nullptr; // of the pixels, relative: mean 1; host memory, as dark_frame_dn
    std::uint64_t gain_map_pitch_bytes = 0;
};
CLSP_EQUALITY(SensorParameters, width, height, bits, seed, exposure_gain_dn, saturation_dn, black_level_dn,
              read_noise_dn, hot_pixel_fraction, hot_pixel_mean_dn, cold_pixel_fraction, float_full_scale,
              dark_frame_dn, dark_frame_pitch_bytes, quantize, conversion_gain_dn_per_e, crosstalk_fraction, prnu,
              column_prnu, row_prnu, mosaic_gain, dark_current_e_per_s, dark_current_reference_temperature_c,
              dark_current_doubling_k, temperature_c, exposure_time_s, lag_fraction, gamma, dsnu_dn, column_offset_dn,
              row_noise_dn, column_noise_dn, read_noise_spread, shot_noise, effective_bits, row_offset_dn,
              dull_pixel_fraction, cubic_nonlinearity, periodic_offset_dn, periodic_frequency_x, periodic_frequency_y,
              telegraph_fraction, telegraph_step_dn, telegraph_centered, code_width_wave, code_width_period,
              widest_code, nonlinearity_power, read_noise_correlation, gain_map, gain_map_pitch_bytes)

} // namespace clsp
