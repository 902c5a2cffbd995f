// From intensity to codes. The equations are in sensor.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/fields.hpp"
#include "runtime/image_view.hpp"
#include "runtime/kernel_arguments.hpp"

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

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
    const float *gain_map = nullptr; // of the pixels, relative: mean 1; host memory, as dark_frame_dn
    std::uint64_t gain_map_pitch_bytes = 0;
};
CLSP_EQUALITY(SensorParameters, width, height, bits, seed, exposure_gain_dn, saturation_dn, black_level_dn,
              read_noise_dn, hot_pixel_fraction, hot_pixel_mean_dn, cold_pixel_fraction, float_full_scale,
              dark_frame_dn, dark_frame_pitch_bytes, quantize, conversion_gain_dn_per_e, crosstalk_fraction, prnu,
              column_prnu, row_prnu, mosaic_gain, dark_current_e_per_s, dark_current_reference_temperature_c,
              dark_current_doubling_k, temperature_c, exposure_time_s, lag_fraction, gamma, dsnu_dn, column_offset_dn,
              row_noise_dn, column_noise_dn, read_noise_spread, shot_noise, effective_bits,
              row_offset_dn, dull_pixel_fraction, cubic_nonlinearity, periodic_offset_dn, periodic_frequency_x,
              periodic_frequency_y, telegraph_fraction, telegraph_step_dn, telegraph_centered, gain_map,
              gain_map_pitch_bytes)

// Where the colours of a mosaic lie; the numbers are those of CLSP_BAYER_*, named by the first two rows' sites.
enum class Bayer : std::uint32_t { kRggb = 1, kBggr = 2, kGrbg = 3, kGbrg = 4 };
// The mosaic_gain of a colour filter.
std::array<double, 4> mosaic_gain_of(Bayer bayer, double red, double green, double blue);

class Sensor {
  public:
    Sensor(std::shared_ptr<Context> context, const SensorParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    std::uint32_t width() const { return parameters_.width; }
    std::uint32_t height() const { return parameters_.height; }
    // As they are in force; dark_frame_dn and gain_map point to copies that live until the next configure().
    const SensorParameters &parameters() const { return parameters_; }
    // Takes new parameters of the same size: draws the fixed pattern again, starts the lag afresh. Commands that were
    // enqueued before keep what they were enqueued with. Waits for the device. If it throws, nothing has changed.
    void configure(const SensorParameters &parameters);
    void set_exposure_gain(double exposure_gain_dn);
    // The next frame has no frame before it.
    void reset_lag() { lag_started_ = false; }
    // Checks an output image against this sensor, and makes ready for its format.
    // in_last_pass: the frame is an aperture engine's, and needs no kernel of the sensor's own.
    ImageView check_output(const ImageDescription &output, bool in_last_pass = false);
    void enqueue_expose(CommandChain &chain, const ImageView &intensity, std::uint64_t frame_index,
                        const ImageView &output);
    // Whether each pixel's intensity alone makes its code, so that other kernels can include kernels/stages/sensor_lanes.h or
    // stages/sensor_pixel.h.
    bool exposes_pixels() const { return parameters_.crosstalk_fraction == 0.0; }
    // The switches of stages/sensor_pixel.h.
    std::string pixel_options(Format output) const;
    // SENSOR_PARAMETERS of kernels/stages/sensor_camera.h, for a kernel that makes the next frame.
    void add_arguments(KernelArguments &arguments, std::uint64_t frame_index, const ImageView &output) const;
    // That kernel is enqueued: the next frame has one before it.
    void exposed() { lag_started_ = bool(lag_state_); }
    void enqueue_demosaic(CommandChain &chain, const ImageView &raw, Bayer bayer, const ImageView &rgb);

  private:
    void make_fixed_pattern();
    void make_switches();
    cl::Kernel &kernel_for(Format output);
    double top_code(Format output) const;

    std::shared_ptr<Context> context_;
    SensorParameters parameters_;
    std::vector<float> dark_frame_, gain_map_;                                 // tightly packed; empty without one
    DeviceBuffer offset_, response_, pixel_gain_, read_noise_map_, lag_state_; // what is off is empty
    bool lag_started_ = false;
    bool in_lanes_ = false;
    std::string switches_; // of stages/sensor_pixel.h, but for what depends on the output's format
    std::map<Format, cl::Kernel> kernels_;          // by output format
    std::map<Format, cl::Kernel> demosaic_kernels_; // by input format
};

// Frames of one camera in the dark, in host memory.
struct DarkCaptures {
    const std::uint16_t *frames;
    std::uint32_t count, width, height;
    std::uint64_t row_pitch_bytes, frame_pitch_bytes; // 0: tightly packed
    double black_level_dn;
};

// The mean over the frames less the black level (width x height, tightly packed), and the root mean square over the
// pixels of the temporal standard deviation; either may be nullptr.
void dark_frame_from_captures(const DarkCaptures &captures, float *dark_frame_dn, double *temporal_noise_dn);

} // namespace clsp
