#include "simulator/optics.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <utility>

namespace clsp {
namespace {

// Each has a field's buffers, which grow with the square of the oversampling.
constexpr std::size_t kMostCameras = 3;

// The list of dots is the layout's, and never another.
DotsParameters without_list(DotsParameters dots) {
    dots.count = 0;
    dots.positions_px = dots.sigmas_px = dots.peaks = nullptr;
    return dots;
}

Illumination illumination_of(CaptureScene scene) {
    return is_laser(scene) ? Illumination::kLaser : Illumination::kIncoherent;
}

} // namespace

Optics::Optics(std::shared_ptr<Context> context, const CaptureLayout &layout)
    : context_(std::move(context)), layout_(layout), pixels_(layout.pixel_count()) {
    const std::vector<float> ones(pixels_, 1.0f);
    uniform_ = DeviceBuffer(context_, pixels_ * sizeof(float), ones.data());
}

ImageDescription Optics::image(const cl::Buffer &buffer, std::size_t index) const {
    return {buffer(), index * pixels_ * sizeof(float), 0, layout_.width, layout_.height, Format::kFloat32};
}

Pipeline &Optics::camera_for(const PipelineModel &model) {
    const auto same_grid = [&](const Camera &camera) { return camera.oversampling == model.phase.oversampling; };
    const auto found = std::find_if(cameras_.begin(), cameras_.end(), same_grid);
    if (found != cameras_.end()) {
        std::rotate(cameras_.begin(), found, found + 1);
    } else {
        PipelineStages stages;
        stages.phase = std::make_shared<Phase>(context_, model.phase);
        stages.aperture = std::make_shared<Aperture>(context_, model.aperture);
        PipelineOptions options;
        options.keeps_irradiance = options.independent_exposures = options.keeps_filters = true;
        auto pipeline = std::make_unique<Pipeline>(context_, std::move(stages), model.pipeline, options);
        if (cameras_.size() == kMostCameras)
            cameras_.pop_back();
        cameras_.insert(cameras_.begin(), {model.phase.oversampling, std::move(pipeline)});
    }
    cameras_.front().pipeline->configure(model);
    return *cameras_.front().pipeline;
}

const DeviceBuffer &Optics::enqueue_irradiance(cl_command_queue queue, const SequenceModel &model, CaptureScene scene) {
    if (scene != CaptureScene::kDots)
        return uniform_;
    const DotsParameters &dots = *model.model.dots;
    if (!dots_)
        dots_ = std::make_unique<Dots>(context_, dots);
    else if (without_list(dots_->parameters()) != without_list(dots))
        dots_->configure(dots);
    if (!irradiance_)
        irradiance_ = DeviceBuffer(context_, pixels_ * sizeof(float));
    CommandChain chain(queue, 0, nullptr);
    dots_->enqueue_render(chain, check_image(image(irradiance_.get()), "irradiance", context_->cl_context()(),
                                             {layout_.width, layout_.height}, {Format::kFloat32}));
    return irradiance_;
}

void Optics::enqueue_render(cl_command_queue queue, const SequenceModel &sequence_model, std::size_t sequence,
                            std::uint64_t seed, std::uint32_t frame_count, const FrameCallback &on_irradiance,
                            const DeviceBuffer &intensities) {
    const SequenceLayout &layout = layout_.sequences[sequence];
    const std::uint32_t frames = sequence_model.frames_differ ? frame_count : 1;
    if (layout.scene == CaptureScene::kDark) {
        const cl_float zero = 0.0f;
        check_opencl(clEnqueueFillBuffer(queue, intensities.get()(), &zero, sizeof zero, 0, pixels_ * sizeof(float), 0,
                                         nullptr, nullptr),
                     "clEnqueueFillBuffer");
        return;
    }
    const DeviceBuffer *irradiance = &enqueue_irradiance(queue, sequence_model, layout.scene);
    std::vector<float> ideal, changed;
    if (on_irradiance) {
        ideal.resize(pixels_);
        check_opencl(clEnqueueReadBuffer(queue, irradiance->get()(), CL_TRUE, 0, pixels_ * sizeof(float), ideal.data(),
                                         0, nullptr, nullptr),
                     "clEnqueueReadBuffer");
        if (!shaped_)
            shaped_ = DeviceBuffer(context_, pixels_ * sizeof(float));
        irradiance = &shaped_;
    }
    PipelineModel model = sequence_model.model;
    model.pipeline.seed = model.phase.seed = seed;
    model.dots.reset(); // the camera sees what is above, and ends at the lens
    model.sensor.reset();
    Pipeline &camera = camera_for(model);
    if (is_laser(layout.scene))
        camera.forget();
    Frame frame;
    frame.illumination = illumination_of(layout.scene);
    frame.refresh = is_laser(layout.scene) && layout.moving ? Refresh::kAll : Refresh::kMask;
    frame.irradiance = image(irradiance->get());
    for (std::uint32_t i = 0; i < frames; ++i) {
        if (on_irradiance) {
            changed = ideal;
            on_irradiance(i, changed.data());
            check_opencl(clEnqueueWriteBuffer(queue, shaped_.get()(), CL_TRUE, 0, pixels_ * sizeof(float),
                                              changed.data(), 0, nullptr, nullptr),
                         "clEnqueueWriteBuffer");
        }
        frame.keeps_irradiance = i > 0 && !on_irradiance; // it is the same in every frame
        frame.frame_index = frame_number(sequence, i);
        frame.output = image(intensities.get(), i);
        camera.enqueue_frame(queue, frame, 0, nullptr, nullptr);
    }
}

} // namespace clsp
