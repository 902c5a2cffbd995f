#include "stages/sensor.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/philox.hpp"

#include <cmath>
#include <fmt/core.h>
#include <vector>

namespace clsp {
Sensor::Sensor(std::shared_ptr<Context> context, const SensorParameters &p)
    : context_(std::move(context)), parameters_(p) {
    check_image_size(p.width, p.height, "the sensor");
    if (p.bits < 8 || p.bits > 16)
        throw Error(Status::kInvalidArgument, fmt::format("bits is {}, it must be 8 to 16", p.bits));
    check_not_negative(p.exposure_gain_dn, "exposure_gain_dn");
    if (!(p.saturation_dn > 0.0))
        throw Error(
            Status::kInvalidArgument,
            fmt::format("saturation_dn is {}, it must be above 0 (infinity for a sensor that only the ADC clips)",
                        p.saturation_dn));
    if (!(std::abs(p.black_level_dn) <= kLargestNumber))
        throw Error(Status::kInvalidArgument, fmt::format("black_level_dn is {}, it must be finite and at most {}",
                                                          p.black_level_dn, kLargestNumber));
    check_not_negative(p.read_noise_dn, "read_noise_dn");
    check_fraction(p.hot_pixel_fraction, "hot_pixel_fraction");
    check_not_negative(p.hot_pixel_mean_dn, "hot_pixel_mean_dn");
    check_fraction(p.cold_pixel_fraction, "cold_pixel_fraction");
    check_positive(p.float_full_scale, "float_full_scale");
    has_defects_ = p.hot_pixel_fraction > 0.0 || p.cold_pixel_fraction > 0.0;
    has_offset_ = p.dark_frame_dn || p.hot_pixel_fraction > 0.0;
    if (has_defects_ || has_offset_)
        make_fixed_pattern();
    parameters_.dark_frame_dn = nullptr;
}

void Sensor::make_fixed_pattern() {
    const SensorParameters &p = parameters_;
    std::vector<float> dark(std::size_t{p.width} * p.height, 0.0f);
    if (p.dark_frame_dn)
        dark = copy_host_image(
            {p.dark_frame_dn, p.width, p.height, p.dark_frame_pitch_bytes, "dark_frame_dn", "dark_frame_pitch_bytes"},
            [](float value) { return std::isfinite(value); }, "it must be finite");
    offset_ = DeviceBuffer(context_, dark.size() * sizeof(float), dark.data());
    if (!has_defects_)
        return;
    response_ = DeviceBuffer(context_, dark.size());
    const std::uint32_t quarter = quarter_rows(p.height);
    cl::Kernel kernel = context_->kernel("sensor.cl", "sensor_defects");
    KernelArguments(kernel)
        .add(offset_.get())
        .add(response_.get())
        .add(cl_uint{p.width})
        .add(cl_uint{p.height})
        .add(cl_uint{quarter})
        .add(philox_key(p.seed))
        .add(static_cast<cl_float>(p.hot_pixel_fraction))
        .add(static_cast<cl_float>(p.hot_pixel_mean_dn))
        .add(static_cast<cl_float>(p.cold_pixel_fraction));
    cl::CommandQueue queue(context_->cl_context(), context_->device());
    CommandChain chain(queue(), 0, nullptr);
    chain.run("sensor", kernel, p.width, quarter);
    queue.finish();
}

void Sensor::set_exposure_gain(double exposure_gain_dn) {
    check_not_negative(exposure_gain_dn, "exposure_gain_dn");
    parameters_.exposure_gain_dn = exposure_gain_dn;
}

cl::Kernel &Sensor::kernel_for(Format output) {
    const auto found = kernels_.find(output);
    if (found != kernels_.end())
        return found->second;
    const bool quantize = parameters_.quantize || output != Format::kFloat32;
    const std::string options = fmt::format("-DOUTPUT_FORMAT={} -DREAD_NOISE={} -DDEFECTS={} -DOFFSET={} -DQUANTIZE={}",
                                            static_cast<std::uint32_t>(output), parameters_.read_noise_dn > 0.0 ? 1 : 0,
                                            has_defects_ ? 1 : 0, has_offset_ ? 1 : 0, quantize ? 1 : 0);
    return kernels_.emplace(output, context_->kernel("sensor.cl", "sensor_expose", options)).first->second;
}

ImageView Sensor::check_output(const ImageDescription &output) {
    const ImageView view =
        check_image(output, "output", context_->cl_context()(), {parameters_.width, parameters_.height},
                    {Format::kUint16, Format::kUint8, Format::kFloat32});
    if (view.format == Format::kUint8 && parameters_.bits > 8)
        throw Error(
            Status::kInvalidFormat,
            fmt::format("output.format is CLSP_FORMAT_UINT8, but the sensor has {} bits; use CLSP_FORMAT_UINT16",
                        parameters_.bits));
    check_writable(view, "output");
    kernel_for(view.format); // built now if it must be, not after the first commands of a frame
    return view;
}

void Sensor::enqueue_expose(CommandChain &chain, const ImageView &intensity, std::uint64_t frame_index,
                            const ImageView &output) {
    check_frame_index(frame_index);
    if (overlap(intensity, output) && !same_pixels(intensity, output))
        throw Error(Status::kOverlap,
                    "intensity and output overlap; only a FLOAT32 output may be the intensity image itself");
    const SensorParameters &p = parameters_;
    cl::Kernel &kernel = kernel_for(output.format);
    const double top_code = double((1u << p.bits) - 1u);
    const std::uint32_t quarter = quarter_rows(p.height);
    KernelArguments(kernel)
        .add(intensity)
        .add(offset_.get())
        .add(response_.get())
        .add(cl_uint{p.width})
        .add(cl_uint{p.height})
        .add(cl_uint{quarter})
        .add(philox_key(p.seed))
        .add(frame_low(frame_index))
        .add(frame_high(frame_index))
        .add(static_cast<cl_float>(p.exposure_gain_dn))
        .add(static_cast<cl_float>(p.saturation_dn))
        .add(static_cast<cl_float>(p.black_level_dn))
        .add(static_cast<cl_float>(p.read_noise_dn))
        .add(static_cast<cl_float>(top_code))
        .add(static_cast<cl_float>(p.float_full_scale / top_code))
        .add(output);
    chain.run("sensor", kernel, p.width, quarter);
}

} // namespace clsp
