// From intensity to codes. The equations are in sensor.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/image_view.hpp"

#include <cstdint>
#include <limits>
#include <map>
#include <memory>

namespace clsp {

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
    const float *dark_frame_dn = nullptr; // host memory, only read during construction
    std::uint64_t dark_frame_pitch_bytes = 0;
    bool quantize = true;
};

class Sensor {
  public:
    Sensor(std::shared_ptr<Context> context, const SensorParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    std::uint32_t width() const { return parameters_.width; }
    std::uint32_t height() const { return parameters_.height; }
    void set_exposure_gain(double exposure_gain_dn);
    // Checks an output image against this sensor, and makes ready for its format.
    ImageView check_output(const ImageDescription &output);
    void enqueue_expose(CommandChain &chain, const ImageView &intensity, std::uint64_t frame_index,
                        const ImageView &output);

  private:
    void make_fixed_pattern();
    cl::Kernel &kernel_for(Format output);

    std::shared_ptr<Context> context_;
    SensorParameters parameters_;
    bool has_offset_ = false, has_defects_ = false;
    DeviceBuffer offset_, response_;
    std::map<Format, cl::Kernel> kernels_; // by output format
};

} // namespace clsp
