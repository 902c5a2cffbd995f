#include "pipeline/pipeline.hpp"

#include "runtime/error.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <fmt/core.h>
#include <utility>

namespace clsp {

Pipeline::Pipeline(std::shared_ptr<Context> context, PipelineStages stages)
    : context_(std::move(context)), stages_(std::move(stages)) {
    if (!stages_.phase || !stages_.aperture)
        throw Error(Status::kInvalidArgument, fmt::format("{} is NULL; a pipeline needs a phase and an aperture",
                                                          stages_.phase ? "aperture" : "phase"));
    const ::cl_context ours = context_->cl_context()();
    const auto check_context = [&](const auto &stage, const char *name) {
        if (stage && stage->context()->cl_context()() != ours)
            throw Error(Status::kWrongContext, fmt::format("{} belongs to another context than the pipeline", name));
    };
    check_context(stages_.pattern, "pattern");
    check_context(stages_.phase, "phase");
    check_context(stages_.aperture, "aperture");
    check_context(stages_.sensor, "sensor");
    stages_.aperture->check_phase(*stages_.phase);
    const FieldGrid &grid = stages_.aperture->grid();
    if (stages_.sensor && (stages_.sensor->width() != grid.width || stages_.sensor->height() != grid.height))
        throw Error(Status::kInvalidArgument,
                    fmt::format("the sensor has {} x {} pixels (width x height), the aperture {} x {}",
                                stages_.sensor->width(), stages_.sensor->height(), grid.width, grid.height));
    if (stages_.pattern || stages_.sensor)
        image_ = DeviceBuffer(context_, std::size_t{grid.width} * grid.height * sizeof(float));
}

void Pipeline::enqueue_frame(cl_command_queue queue, const Frame &frame, cl_uint num_waits, const cl_event *waits,
                             cl_event *event) {
    // Everything that can be checked is checked before the first command, so that a refused frame changes nothing.
    context_->check_queue(queue);
    const ::cl_context cl_context = context_->cl_context()();
    check_wait_list(cl_context, num_waits, waits);
    check_frame_index(frame.frame_index);
    stages_.aperture->check_workspace();
    const FieldGrid &grid = stages_.aperture->grid();
    const ImageSize size{grid.width, grid.height};
    if (frame.refresh != Refresh::kMask && frame.refresh != Refresh::kAll)
        throw Error(Status::kInvalidArgument,
                    fmt::format("refresh is {}, expected CLSP_REFRESH_MASK or CLSP_REFRESH_ALL",
                                static_cast<std::uint32_t>(frame.refresh)));
    const ImageView output = stages_.sensor ? stages_.sensor->check_output(frame.output)
                                            : check_image(frame.output, "output", cl_context, size, {Format::kFloat32});
    check_writable(output, "output");
    stages_.aperture->refuse_workspace(output, "output");
    ImageView mask;
    if (frame.refresh_mask) {
        mask = stages_.phase->check_mask(frame.refresh_mask, "refresh_mask");
        refuse_overlap(output, "output", mask, "refresh_mask");
    }
    ImageView own;
    if (image_)
        own = check_image({image_.get()(), 0, 0, size.width, size.height, Format::kFloat32}, "image", cl_context, size,
                          {Format::kFloat32});
    ImageView irradiance = own;
    if (stages_.pattern) {
        if (!frame.geometry)
            throw Error(Status::kInvalidArgument,
                        "geometry is NULL; this pipeline has a pattern and needs the frame's geometry");
        if (frame.irradiance)
            throw Error(Status::kInvalidArgument,
                        "irradiance was given to a pipeline with a pattern; give geometry alone, or make the "
                        "pipeline without a pattern");
        for (const ImageDescription *image :
             {&frame.geometry->position, &frame.geometry->depth, &frame.geometry->normal, &frame.geometry->albedo,
              &frame.geometry->visibility})
            if (*image)
                refuse_overlap(output, "output",
                               check_image(*image, "geometry", cl_context, size,
                                           {Format::kFloat32, Format::kFloat32x3, Format::kFloat32x4, Format::kUint8}),
                               "an image of the geometry");
    } else {
        if (frame.geometry)
            throw Error(Status::kInvalidArgument,
                        "geometry was given to a pipeline without a pattern; give irradiance, or make the "
                        "pipeline with a pattern");
        irradiance = check_image(frame.irradiance, "irradiance", cl_context, size, {Format::kFloat32});
        refuse_overlap(output, "output", irradiance, "irradiance");
        stages_.aperture->refuse_workspace(irradiance, "irradiance");
    }

    next_profile_.entries.clear();
    CommandChain chain(queue, num_waits, waits, &next_profile_);
    if (stages_.pattern)
        stages_.pattern->enqueue_lookup(chain, *frame.geometry, irradiance);
    if (frame.refresh == Refresh::kAll || !stages_.phase->refreshed())
        stages_.phase->enqueue_refresh(chain, frame.frame_index, {});
    else if (mask)
        stages_.phase->enqueue_refresh(chain, frame.frame_index, mask);
    stages_.aperture->enqueue_intensity(chain, *stages_.phase, irradiance, stages_.sensor ? own : output);
    if (stages_.sensor)
        stages_.sensor->enqueue_expose(chain, own, frame.frame_index, output);
    chain.finish(event);
    // Only now is it the last frame: a refused one leaves the times of the one before.
    std::swap(profile_, next_profile_);
    has_frame_ = true;
}

void Pipeline::warm_up(cl_command_queue queue, const Frame &frame) {
    Phase &phase = *stages_.phase;
    context_->check_queue(queue);
    if (!phase.refreshed()) {
        enqueue_frame(queue, frame, 0, nullptr, nullptr);
        check_opencl(clFinish(queue), "clFinish");
        phase.forget();
        return;
    }
    const DeviceBuffer saved(context_, phase.state_bytes());
    CommandChain save(queue, 0, nullptr);
    phase.enqueue_save(save, saved.get()(), 0);
    check_opencl(clFinish(queue), "clFinish");
    const auto restore = [&] {
        CommandChain chain(queue, 0, nullptr);
        phase.enqueue_restore(chain, saved.get()(), 0);
        check_opencl(clFinish(queue), "clFinish");
    };
    try {
        enqueue_frame(queue, frame, 0, nullptr, nullptr);
        check_opencl(clFinish(queue), "clFinish");
    } catch (...) {
        restore();
        throw;
    }
    restore();
}

void Pipeline::check(cl_command_queue queue) {
    context_->check_queue(queue);
    check_opencl(clFinish(queue), "clFinish");
    std::string message;
    const auto report = [&](const BadPixels &bad, const char *what) {
        if (bad.not_finite == 0 && bad.negative == 0)
            return;
        const std::uint32_t width = stages_.aperture->grid().width;
        message += fmt::format("{}{}: {} NaN or infinite and {} negative pixels since the last check, the first at x = "
                               "{}, y = {}; they were "
                               "taken as 0",
                               message.empty() ? "" : "; ", what, bad.not_finite, bad.negative, bad.first_index % width,
                               bad.first_index / width);
    };
    if (stages_.pattern)
        report(stages_.pattern->bad_pixels().take(queue), "albedo or visibility");
    report(stages_.aperture->bad_pixels().take(queue), "irradiance");
    if (!message.empty())
        throw Error(Status::kInvalidData, message);
}

std::vector<StageTiming> Pipeline::timings() {
    if (!has_frame_)
        throw Error(Status::kInvalidState, "no frame has been enqueued yet");
    if (profile_.entries.empty())
        throw Error(Status::kInvalidState,
                    "the last frame's queue had no profiling; make it with CLSP_QUEUE_PROFILING or "
                    "CL_QUEUE_PROFILING_ENABLE");
    profile_.entries.back().event.wait();
    std::vector<StageTiming> timings;
    cl_ulong previous_end = 0;
    for (const ChainProfile::Entry &entry : profile_.entries) {
        const cl_ulong end = entry.event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
        const cl_ulong own_start = entry.event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
        // A transform is several kernels of which we see the last one's event: its time runs from the end of the step
        // before.
        const std::string stage = entry.stage;
        const bool is_transform = stage == "fft" || stage == "inverse_fft";
        const cl_ulong start = is_transform && previous_end != 0 ? std::min(previous_end, own_start) : own_start;
        const auto same = [&](const StageTiming &timing) { return timing.stage == stage; };
        auto found = std::find_if(timings.begin(), timings.end(), same);
        if (found == timings.end())
            found = timings.insert(timings.end(), {stage, 0.0});
        found->milliseconds += double(end - start) * 1e-6;
        previous_end = end;
    }
    return timings;
}

} // namespace clsp
