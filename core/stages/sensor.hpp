// From intensity to codes. The equations are in sensor.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/image_view.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/sensor_parameters.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

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
    bool lags() const { return bool(lag_state_); }
    // Checks an output image against this sensor, and makes ready for its format.
    // in_last_pass: the frame is an aperture engine's, and needs no kernel of the sensor's own.
    ImageView check_output(const ImageDescription &output, bool in_last_pass = false);
    // To be followed by keep_frame().
    void enqueue_expose(CommandChain &chain, const ImageView &intensity, std::uint64_t frame_index,
                        const ImageView &output);
    // All commands of a frame are enqueued: the next one has it before it. Without this, a frame is as if it had not
    // been.
    void keep_frame();
    // Whether each pixel's intensity alone makes its code, so that other kernels can include
    // kernels/stages/sensor_lanes.h or stages/sensor_pixel.h.
    bool exposes_pixels() const { return parameters_.crosstalk_fraction == 0.0; }
    // The switches of stages/sensor_pixel.h.
    std::string pixel_options(Format output) const;
    // SENSOR_PARAMETERS of kernels/stages/sensor_camera.h, for a kernel that makes the next frame.
    void add_arguments(KernelArguments &arguments, std::uint64_t frame_index, const ImageView &output) const;
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
    bool lag_started_ = false, lag_second_ = false; // lag_second_: the frame before is in the second half of lag_state_
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
