#include "clspeckle/motion.h"

#include "convert.hpp"
#include "handles.hpp"
#include "motion.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace {

ClspMotionDesc motion_defaults() {
    const MotionParameters p;
    ClspMotionDesc desc{};
    desc.struct_size = sizeof desc;
    desc.rule = static_cast<std::uint32_t>(p.rule);
    desc.translate = p.translate ? 1 : 0;
    desc.depth_kind = static_cast<std::uint32_t>(p.depth_kind);
    desc.fx_px = p.fx_px;
    desc.fy_px = p.fy_px;
    desc.cx_px = p.cx_px;
    desc.cy_px = p.cy_px;
    desc.replace_threshold = p.replace_threshold;
    desc.occlusion_tolerance = p.occlusion_tolerance;
    return desc;
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
    input.position = optional_description(&i.position);
    input.depth = optional_description(&i.depth);
    input.normal = optional_description(&i.normal);
    input.material = optional_description(&i.material);
    input.motion = optional_description(&i.motion);
    input.previous_position = optional_description(&i.previous_position);
    input.previous_depth = optional_description(&i.previous_depth);
    input.previous_normal = optional_description(&i.previous_normal);
    input.previous_material = optional_description(&i.previous_material);
    return input;
}

} // namespace clsp::capi

extern "C" {

CLSP_API ClspStatus clspMotionDescInit(ClspMotionDesc *desc, uint32_t struct_size) {
    return guarded("clspMotionDescInit", [&] { init_struct(desc, struct_size, motion_defaults(), "desc"); });
}

CLSP_API ClspStatus clspMotionInputInit(ClspMotionInput *input, uint32_t struct_size) {
    return guarded("clspMotionInputInit", [&] { init_struct(input, struct_size, input_defaults(), "input"); });
}

CLSP_API ClspStatus clspMotionOutputInit(ClspMotionOutput *output, uint32_t struct_size) {
    return guarded("clspMotionOutputInit", [&] { init_struct(output, struct_size, output_defaults(), "output"); });
}

CLSP_API ClspStatus clspMotionCreate(ClspContext context, const ClspMotionDesc *desc, ClspMotion *motion) {
    return guarded("clspMotionCreate", [&] {
        const auto c = object(context);
        required(motion, "motion");
        const ClspMotionDesc d = read_struct(desc, motion_defaults(), "desc");
        MotionParameters p;
        p.width = d.width;
        p.height = d.height;
        p.rule = static_cast<MotionRule>(d.rule);
        p.translate = checked_flag(d.translate, "desc->translate");
        p.depth_kind = static_cast<DepthKind>(d.depth_kind);
        if (d.materials)
            p.materials = object(d.materials);
        p.fx_px = d.fx_px;
        p.fy_px = d.fy_px;
        p.cx_px = d.cx_px;
        p.cy_px = d.cy_px;
        p.replace_threshold = d.replace_threshold;
        p.occlusion_tolerance = d.occlusion_tolerance;
        give(motion, std::make_shared<Motion>(c, p));
    });
}

CLSP_API ClspStatus clspMotionRetain(ClspMotion motion) {
    return guarded("clspMotionRetain", [&] { HandleTable<ClspMotion>::instance().retain(motion); });
}

CLSP_API ClspStatus clspMotionRelease(ClspMotion motion) {
    return guarded("clspMotionRelease", [&] { HandleTable<ClspMotion>::instance().release(motion); });
}

CLSP_API ClspStatus clspMotionEnqueueCompute(ClspMotion motion, cl_command_queue queue, const ClspMotionInput *input,
                                             const ClspMotionOutput *output, uint32_t num_events_in_wait_list,
                                             const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspMotionEnqueueCompute", [&] {
        const auto m = object(motion);
        const MotionInput in = motion_input(input);
        const ClspMotionOutput o = read_struct(output, output_defaults(), "output");
        check_reserved(o.reserved, "output->reserved");
        MotionOutput out;
        out.path = optional_description(&o.path);
        out.correlation = optional_description(&o.correlation);
        out.shift = optional_description(&o.shift);
        out.displacement = optional_description(&o.displacement);
        out.mask = optional_description(&o.mask);
        enqueue(*m->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { m->enqueue_compute(chain, in, out); });
    });
}

CLSP_API ClspStatus clspMotionCheck(ClspMotion motion, cl_command_queue queue) {
    return guarded("clspMotionCheck", [&] { object(motion)->check_bad_pixels(queue); });
}

} // extern "C"
