#include "clspeckle/pipeline.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "motion.hpp"
#include "pipeline/pipeline.hpp"
#include "texts.hpp"

#include <fmt/core.h>
#include <string>
#include <vector>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(ExposureCorrelation, kGaussian, CLSP_EXPOSURE_CORRELATION_FIELD, CLSP_EXPOSURE_CORRELATION_GAUSSIAN)
CLSP_ENUM(Refresh, kAll, CLSP_REFRESH_MASK, CLSP_REFRESH_ALL)
CLSP_ENUM(Illumination, kDark, CLSP_ILLUMINATION_LASER, CLSP_ILLUMINATION_INCOHERENT, CLSP_ILLUMINATION_DARK)

} // namespace clsp::capi

namespace {

constexpr auto kPipelineFields = [](auto field, auto &d, auto &p) {
    field(d.seed, p.seed);
    field(d.line_count, p.line_count);
    field(d.sub_exposures, p.sub_exposures);
    field(d.dephasing_rad, p.dephasing_rad);
    field(d.power_flicker, p.power_flicker);
    field(d.coherent_fraction, p.coherent_fraction);
    field(d.subsurface_length_px, p.subsurface_length_px);
    field(d.subsurface_fraction, p.subsurface_fraction);
    field(d.exposure_path, p.exposure_path);
    field(d.boiling_correlation_frames, p.boiling_correlation_frames);
    field(d.airflow_rms_rad, p.airflow.rms_rad);
    field(d.airflow_scale_px, p.airflow.scale_px);
    field(d.airflow_correlation_frames, p.airflow.correlation_frames);
    field(d.airflow_wind_px, p.airflow.wind_px);
    field(d.vibration_rms_px, p.vibration_rms_px);
    field(d.shutter_fraction, p.shutter_fraction);
    field(d.exposure_correlation, p.exposure_correlation, "desc->exposure_correlation");
};

ClspPipelineDesc pipeline_defaults() {
    return to_c<ClspPipelineDesc>(kPipelineFields, PipelineParameters());
}

ClspFrame frame_defaults() {
    ClspFrame frame{};
    frame.struct_size = sizeof frame;
    frame.refresh = CLSP_REFRESH_MASK;
    return frame;
}

// The engine's view of a caller's frame, and what it points to.
struct FrameView {
    Geometry geometry;
    MotionInput motion;
    Frame frame;
};

// `prefix` comes before a member's name in messages.
void read_frame(const ClspFrame *user, const char *name, const std::string &prefix, FrameView &view) {
    const ClspFrame f = read_struct(user, frame_defaults(), name);
    if (f.geometry)
        view.geometry = geometry(f.geometry);
    if (f.motion)
        view.motion = motion_input(f.motion);
    const auto named = [&](const char *member) { return prefix + member; };
    Frame &frame = view.frame;
    frame.refresh = checked_enum<Refresh>(f.refresh, named("refresh").c_str());
    frame.frame_index = f.frame_index;
    frame.geometry = f.geometry ? &view.geometry : nullptr;
    frame.irradiance = optional_description(f.irradiance, named("irradiance"));
    frame.refresh_mask = optional_description(f.refresh_mask, named("refresh_mask"));
    frame.output = description(f.output, named("output"));
    frame.motion = f.motion ? &view.motion : nullptr;
    frame.material = optional_description(f.material, named("material"));
    frame.illumination = checked_enum<Illumination>(f.illumination, named("illumination").c_str());
    check_reserved(f.reserved, named("reserved").c_str());
}

} // namespace

extern "C" {

CLSP_INIT(PipelineDesc, desc, pipeline_defaults())

CLSP_INIT(Frame, frame, frame_defaults())

CLSP_API ClspStatus clspPipelineCreate(ClspContext context, const ClspPipelineDesc *desc, ClspPipeline *pipeline) {
    return guarded("clspPipelineCreate", [&] {
        const auto c = object(context);
        required(pipeline, "pipeline");
        const ClspPipelineDesc d = read_struct(desc, pipeline_defaults(), "desc");
        check_reserved(d.reserved, "desc->reserved");
        check_reserved(d.reserved_exposure, "desc->reserved_exposure");
        PipelineStages stages;
        Parts parts;
        stages.pattern = optional_part(d.pattern, parts);
        stages.dots = optional_part(d.dots, parts);
        stages.materials = optional_part(d.materials, parts);
        stages.motion = optional_part(d.motion, parts);
        stages.phase = optional_part(d.phase, parts);
        stages.aperture = optional_part(d.aperture, parts);
        stages.lens = optional_part(d.lens, parts);
        stages.sensor = optional_part(d.sensor, parts);
        const auto parameters = from_c<PipelineParameters>(kPipelineFields, d);
        give(pipeline, std::make_shared<Pipeline>(c, std::move(stages), parameters), parts);
    });
}

CLSP_REFERENCES(Pipeline)

CLSP_API ClspStatus clspPipelineEnqueueFrame(ClspPipeline pipeline, cl_command_queue queue, const ClspFrame *frame,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event) {
    return guarded("clspPipelineEnqueueFrame", [&] {
        const auto p = object(pipeline);
        FrameView view;
        read_frame(frame, "frame", "frame->", view);
        p->enqueue_frame(queue, view.frame, num_events_in_wait_list, event_wait_list, event);
    });
}

CLSP_API ClspStatus clspPipelineEnqueueFrames(ClspPipeline pipeline, cl_command_queue queue, uint32_t count,
                                              const ClspFrame *frames, uint32_t num_events_in_wait_list,
                                              const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspPipelineEnqueueFrames", [&] {
        const auto p = object(pipeline);
        required(frames, "frames");
        if (count == 0)
            throw Error(Status::kInvalidArgument, "count is 0; give at least one frame");
        // Elements lie as far apart as the caller's struct is long.
        const std::uint32_t size = frames->struct_size;
        if (size % alignof(ClspFrame) != 0)
            throw Error(Status::kInvalidStructSize,
                        fmt::format("frames[0].struct_size is {}, it must be a multiple of {}; call clspFrameInit() on "
                                    "each element",
                                    size, alignof(ClspFrame)));
        std::vector<FrameView> views(count);
        std::vector<Frame> list(count);
        for (std::uint32_t i = 0; i < count; ++i) {
            const auto *frame =
                reinterpret_cast<const ClspFrame *>(reinterpret_cast<const char *>(frames) + std::size_t{i} * size);
            if (frame->struct_size != size)
                throw Error(Status::kInvalidStructSize,
                            fmt::format("frames[{}].struct_size is {}, that of frames[0] {}; call clspFrameInit() on "
                                        "each element",
                                        i, frame->struct_size, size));
            read_frame(frame, fmt::format("(&frames[{}])", i).c_str(), fmt::format("frames[{}].", i), views[i]);
            list[i] = views[i].frame;
        }
        p->enqueue_frames(queue, list.data(), count, num_events_in_wait_list, event_wait_list, event);
    });
}

CLSP_API ClspStatus clspPipelineWarmUp(ClspPipeline pipeline, cl_command_queue queue, const ClspFrame *frame) {
    return guarded("clspPipelineWarmUp", [&] {
        const auto p = object(pipeline);
        FrameView view;
        read_frame(frame, "frame", "frame->", view);
        p->warm_up(queue, view.frame);
    });
}

CLSP_API ClspStatus clspPipelineCheck(ClspPipeline pipeline, cl_command_queue queue) {
    return guarded("clspPipelineCheck", [&] { object(pipeline)->check(queue); });
}

CLSP_API ClspStatus clspPipelineGetTimings(ClspPipeline pipeline, uint32_t capacity, ClspStageTiming *timings,
                                           uint32_t *count) {
    return guarded("clspPipelineGetTimings", [&] {
        const auto p = object(pipeline);
        required(count, "count");
        if (capacity > 0 && !timings)
            throw Error(Status::kInvalidArgument, "timings is NULL although capacity is not 0");
        const std::vector<StageTiming> stages = p->timings();
        for (std::size_t i = 0; i < stages.size() && i < capacity; ++i) {
            timings[i] = {};
            copy_text(timings[i].stage, stages[i].stage);
            timings[i].milliseconds = stages[i].milliseconds;
        }
        *count = static_cast<std::uint32_t>(stages.size());
    });
}

} // extern "C"
