#include "clspeckle/motion.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "motion.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(MotionRule, kReplace, CLSP_MOTION_CORRELATE, CLSP_MOTION_REPLACE)

} // namespace clsp::capi

namespace {

constexpr auto kMotionFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.rule, p.rule, "desc->rule");
    field(d.translate, p.translate, "desc->translate");
    field(d.depth_kind, p.depth_kind, "desc->depth_kind");
    field(d.fx_px, p.fx_px);
    field(d.fy_px, p.fy_px);
    field(d.cx_px, p.cx_px);
    field(d.cy_px, p.cy_px);
    field(d.replace_threshold, p.replace_threshold);
    field(d.occlusion_tolerance, p.occlusion_tolerance);
};

ClspMotionDesc motion_defaults() {
    return to_c<ClspMotionDesc>(kMotionFields, MotionParameters());
}

ClspMotionInput input_defaults() {
    ClspMotionInput input{};
    input.struct_size = sizeof input;
    return input;
}

ClspMotionOutput output_defaults() {
    ClspMotionOutput output{};
    output.struct_size = sizeof output;
    return output;
}

} // namespace

namespace clsp::capi {

MotionInput motion_input(const ClspMotionInput *user) {
    const ClspMotionInput i = read_struct(user, input_defaults(), "input");
    check_reserved(i.reserved, "input->reserved");
    MotionInput input;
    input.frame_time_s = i.frame_time_s;
    input.previous_from_current = i.previous_from_current;
    input.transform_count = i.transform_count;
    input.roll_from_motion = checked_flag(i.roll_from_motion, "input->roll_from_motion");
    input.position = optional_description(i.position, "input->position");
    input.depth = optional_description(i.depth, "input->depth");
    input.normal = optional_description(i.normal, "input->normal");
    input.material = optional_description(i.material, "input->material");
    input.motion = optional_description(i.motion, "input->motion");
    input.previous_position = optional_description(i.previous_position, "input->previous_position");
    input.previous_depth = optional_description(i.previous_depth, "input->previous_depth");
    input.previous_normal = optional_description(i.previous_normal, "input->previous_normal");
    input.previous_material = optional_description(i.previous_material, "input->previous_material");
    return input;
}

} // namespace clsp::capi

extern "C" {

CLSP_INIT(MotionDesc, desc, motion_defaults())

CLSP_INIT(MotionInput, input, input_defaults())

CLSP_INIT(MotionOutput, output, output_defaults())

CLSP_API ClspStatus clspMotionCreate(ClspContext context, const ClspMotionDesc *desc, ClspMotion *motion) {
    return guarded("clspMotionCreate", [&] {
        const auto c = object(context);
        required(motion, "motion");
        const ClspMotionDesc d = read_struct(desc, motion_defaults(), "desc");
        auto p = from_c<MotionParameters>(kMotionFields, d);
        Parts parts;
        p.materials = optional_part(d.materials, parts);
        give(motion, std::make_shared<Motion>(c, p), parts);
    });
}

CLSP_REFERENCES(Motion)

CLSP_API ClspStatus clspMotionEnqueueCompute(ClspMotion motion, cl_command_queue queue, const ClspMotionInput *input,
                                             const ClspMotionOutput *output, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspMotionEnqueueCompute", [&] {
        const auto m = object(motion);
        const MotionInput in = motion_input(input);
        const ClspMotionOutput o = read_struct(output, output_defaults(), "output");
        check_reserved(o.reserved, "output->reserved");
        MotionOutput out;
        out.path = optional_description(o.path, "output->path");
        out.correlation = optional_description(o.correlation, "output->correlation");
        out.shift = optional_description(o.shift, "output->shift");
        out.displacement = optional_description(o.displacement, "output->displacement");
        out.mask = optional_description(o.mask, "output->mask");
        enqueue(*m->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { m->enqueue_compute(chain, in, out); });
    });
}

CLSP_API ClspStatus clspMotionCheck(ClspMotion motion, cl_command_queue queue) {
    return guarded("clspMotionCheck", [&] { object(motion)->check_bad_pixels(queue); });
}

} // extern "C"
