#include "simulator/sensor_side.hpp"

#include "runtime/kernel_arguments.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace clsp {
namespace {

void grow(const std::shared_ptr<Context> &context, DeviceBuffer &buffer, std::size_t bytes) {
    if (!buffer || buffer.bytes() < bytes)
        buffer = DeviceBuffer(context, bytes);
}

Vignetting vignetting_of(const SequenceModel &model) {
    LensParameters lens = model.model.lens;
    lens.vignetting_corner_loss = model.corner_loss;
    return Vignetting(lens);
}

} // namespace

SensorSide::SensorSide(std::shared_ptr<Context> context, const CaptureLayout &layout)
    : context_(std::move(context)), layout_(layout), pixels_(layout.pixel_count()),
      finish_(context_->kernel("diagnosis/light.cl", "light_finish")) {}

std::vector<float> SensorSide::laser_factors(const SequenceModel &model, std::size_t sequence, std::uint64_t seed,
                                             std::uint32_t frame_count) const {
    std::vector<float> factors(frame_count, 1.0f);
    if (model.power_flicker > 0.0)
        for (std::uint32_t frame = 0; frame < frame_count; ++frame)
            factors[frame] = static_cast<float>(
                std::max(0.0, 1.0 + model.power_flicker *
                                        host_normals(seed, frame_number(sequence, frame), kStreamFlicker)[0]));
    const SequenceLayout &of = layout_.sequences[sequence];
    const double part = variation_of_source(of.frame_light_level_dn, model.ambient_dn);
    for (std::size_t frame = 0; frame < std::min<std::size_t>(frame_count, of.frame_light.size()); ++frame)
        factors[frame] *= static_cast<float>(std::max(0.0, 1.0 + part * (double{of.frame_light[frame]} - 1.0)));
    return factors;
}

const SensorSide::Unevenness &SensorSide::unevenness_of(std::size_t sequence) {
    Unevenness &result = unevenness_[sequence];
    if (!result.host.empty())
        return result;
    const SmoothLight &light = layout_.sequences[sequence].illumination;
    for (std::uint32_t y = 0; y < layout_.height; ++y)
        for (std::uint32_t x = 0; x < layout_.width; ++x)
            result.host.push_back(static_cast<float>(light.at(x, y) - 1.0));
    result.device = DeviceBuffer(context_, pixels_ * sizeof(float), result.host.data());
    return result;
}

std::vector<float> SensorSide::fall_off(const SequenceModel &model, std::size_t sequence) {
    std::vector<float> kept(pixels_, 1.0f);
    if (const float part = uneven_part(model, sequence); part > 0.0f) {
        const std::vector<float> &off = unevenness_of(sequence).host;
        std::transform(off.begin(), off.end(), kept.begin(),
                       [part](float x) { return std::max(0.0f, 1.0f + part * x); });
    }
    if (model.corner_loss == 0.0)
        return kept;
    const Vignetting vignetting = vignetting_of(model);
    for (std::uint32_t y = 0; y < layout_.height; ++y)
        for (std::uint32_t x = 0; x < layout_.width; ++x)
            kept[std::size_t{y} * layout_.width + x] *= static_cast<float>(vignetting.transmission(x, y));
    return kept;
}

void SensorSide::enqueue_light(cl_command_queue queue, const SequenceModel &model, std::size_t sequence,
                               const std::vector<float> &factors, double ambient, const DeviceBuffer &intensities,
                               std::uint32_t frame_count) {
    grow(context_, light_, frame_count * pixels_ * sizeof(float));
    grow(context_, factors_, frame_count * sizeof(float));
    // The host's numbers are gone when this returns.
    check_opencl(clEnqueueWriteBuffer(queue, factors_.get()(), CL_TRUE, 0, frame_count * sizeof(float), factors.data(),
                                      0, nullptr, nullptr),
                 "clEnqueueWriteBuffer");
    KernelArguments(finish_)
        .add(intensities.get())
        .add(cl_ulong{model.frames_differ ? pixels_ : 0})
        .add(factors_.get())
        .add(model.uneven ? unevenness_of(sequence).device.get() : factors_.get())
        .add(cl_float{uneven_part(model, sequence)})
        .add(static_cast<cl_float>(ambient))
        .add(vignetting_of(model).kernel_argument())
        .add(light_.get())
        .add(cl_uint{layout_.width})
        .add(cl_uint{layout_.height});
    CommandChain chain(queue, 0, nullptr);
    chain.run("light", finish_, layout_.width, layout_.height, frame_count);
}

void SensorSide::configure(const SequenceModel &model, const SimulationLevels &levels, std::uint64_t seed) {
    SensorParameters p = *model.model.sensor;
    p.seed = seed;
    p.exposure_gain_dn = levels.gain_dn;
    p.black_level_dn = levels.black_level_dn;
    p.read_noise_dn = levels.read_noise_dn;
    if (!sensor_) {
        sensor_ = std::make_unique<Sensor>(context_, p);
        return;
    }
    SensorParameters now = sensor_->parameters();
    now.exposure_gain_dn = p.exposure_gain_dn;
    if (p != now)
        sensor_->configure(p);
    else
        sensor_->set_exposure_gain(p.exposure_gain_dn);
    sensor_->reset_lag();
}

void SensorSide::enqueue_expose(cl_command_queue queue, const SequenceModel &model, const SimulationLevels &levels,
                                std::size_t sequence, std::uint64_t seed, const DeviceBuffer &light, bool one_light,
                                std::uint32_t frame_count) {
    configure(model, levels, seed);
    grow(context_, codes_, frame_count * pixels_ * sizeof(cl_ushort));
    const std::uint32_t w = layout_.width, h = layout_.height;
    CommandChain chain(queue, 0, nullptr);
    for (std::uint32_t frame = 0; frame < frame_count; ++frame) {
        const ImageView in =
            check_image({light.get()(), one_light ? 0 : frame * pixels_ * sizeof(float), 0, w, h, Format::kFloat32},
                        "intensity", context_->cl_context()(), {w, h}, {Format::kFloat32});
        const ImageView out =
            sensor_->check_output({codes_.get()(), frame * pixels_ * sizeof(cl_ushort), 0, w, h, Format::kUint16});
        sensor_->enqueue_expose(chain, in, frame_number(sequence, frame), out);
        sensor_->keep_frame();
    }
}

} // namespace clsp
