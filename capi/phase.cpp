#include "clspeckle/phase.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "stages/phase.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(Dynamics, kContinuous, CLSP_DYNAMICS_REPLACE, CLSP_DYNAMICS_CONTINUOUS)

} // namespace clsp::capi

namespace {

constexpr auto kPhaseFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.oversampling, p.oversampling);
    field(d.guard_px, p.guard_px);
    field(d.field, p.field, "desc->field");
    field(d.polarization_count, p.polarization_count);
    field(d.seed, p.seed);
    field(d.dynamics, p.dynamics, "desc->dynamics");
    field(d.translate, p.translate, "desc->translate");
};

ClspPhaseDesc phase_defaults() {
    return to_c<ClspPhaseDesc>(kPhaseFields, PhaseParameters());
}

constexpr auto kAdvanceFields = [](auto field, auto &d, auto &p) {
    field(d.substep, p.substep);
    field(d.uniform_path, p.uniform_path);
    field(d.uniform_correlation, p.uniform_correlation);
};

ClspPhaseAdvance advance_defaults() {
    return to_c<ClspPhaseAdvance>(kAdvanceFields, PhaseAdvance());
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspFieldGridCompute(ClspFieldGrid *grid) {
    return guarded("clspFieldGridCompute", [&] {
        ClspFieldGrid &g = required(grid, "grid");
        const FieldGrid made = make_field_grid(g.width, g.height, g.oversampling, g.guard_px);
        g.grid_width = made.grid_width;
        g.grid_height = made.grid_height;
    });
}

CLSP_INIT(PhaseDesc, desc, phase_defaults())

CLSP_API ClspStatus clspPhaseCreate(ClspContext context, const ClspPhaseDesc *desc, ClspPhase *phase) {
    return guarded("clspPhaseCreate", [&] {
        const auto c = object(context);
        required(phase, "phase");
        const ClspPhaseDesc d = read_struct(desc, phase_defaults(), "desc");
        check_reserved(d.reserved, "desc->reserved");
        give(phase, std::make_shared<Phase>(c, from_c<PhaseParameters>(kPhaseFields, d)));
    });
}

CLSP_REFERENCES(Phase)

CLSP_API ClspStatus clspPhaseEnqueueRefresh(ClspPhase phase, cl_command_queue queue, uint64_t frame_index,
                                            const ClspImage *mask, uint32_t num_events_in_wait_list,
                                            const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspPhaseEnqueueRefresh", [&] {
        const auto p = object(phase);
        const ImageView view = mask && mask->mem ? p->check_mask(description(*mask, "mask"), "mask") : ImageView{};
        enqueue(*p->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { p->enqueue_refresh(chain, frame_index, view); });
    });
}

CLSP_INIT(PhaseAdvance, advance, advance_defaults())

CLSP_API ClspStatus clspPhaseEnqueueAdvance(ClspPhase phase, cl_command_queue queue, uint64_t frame_index,
                                            const ClspPhaseAdvance *advance, uint32_t num_events_in_wait_list,
                                            const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspPhaseEnqueueAdvance", [&] {
        const auto p = object(phase);
        const ClspPhaseAdvance a = read_struct(advance, advance_defaults(), "advance");
        const auto view = [&](const ClspImage &image, const char *name, Format format) {
            return image.mem ? check_image(description(image, name), name, p->context()->cl_context()(),
                                           {p->grid().width, p->grid().height}, {format})
                             : ImageView{};
        };
        auto given = from_c<PhaseAdvance>(kAdvanceFields, a);
        given.path = view(a.path, "advance->path", Format::kFloat32);
        given.correlation = view(a.correlation, "advance->correlation", Format::kFloat32);
        given.shift = view(a.shift, "advance->shift", Format::kFloat32x2);
        given.mask = view(a.mask, "advance->mask", Format::kUint8);
        enqueue(*p->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { p->enqueue_advance(chain, frame_index, given); });
    });
}

CLSP_API ClspStatus clspPhaseCheck(ClspPhase phase, cl_command_queue queue) {
    return guarded("clspPhaseCheck", [&] {
        const auto p = object(phase);
        p->context()->check_queue(queue);
        check_opencl(clFinish(queue), "clFinish");
        const BadPixels bad = p->bad_pixels().take(queue);
        if (bad.not_finite + bad.negative > 0)
            throw Error(
                Status::kInvalidData,
                fmt::format(
                    "{} pixels with a path, correlation or shift that is NaN or infinite and {} with one out of "
                    "range since the last check, the first at x = {}, y = {}; they were replaced",
                    bad.not_finite, bad.negative, bad.first_index % p->grid().width,
                    bad.first_index / p->grid().width));
    });
}

CLSP_API ClspStatus clspPhaseEnqueueField(ClspPhase phase, cl_command_queue queue, uint32_t polarization,
                                          const ClspImage *field, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspPhaseEnqueueField", [&] {
        const auto p = object(phase);
        enqueue(*p->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { p->enqueue_field(chain, polarization, description(field, "field")); });
    });
}

CLSP_API ClspStatus clspPhaseGetStateSize(ClspPhase phase, uint64_t *size_bytes) {
    return guarded("clspPhaseGetStateSize", [&] { required(size_bytes, "size_bytes") = object(phase)->state_bytes(); });
}

CLSP_API ClspStatus clspPhaseEnqueueSave(ClspPhase phase, cl_command_queue queue, cl_mem mem, uint64_t offset_bytes,
                                         uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                         cl_event *event) {
    return guarded("clspPhaseEnqueueSave", [&] {
        const auto p = object(phase);
        enqueue(*p->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { p->enqueue_save(chain, mem, offset_bytes); });
    });
}

CLSP_API ClspStatus clspPhaseEnqueueRestore(ClspPhase phase, cl_command_queue queue, cl_mem mem, uint64_t offset_bytes,
                                            uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                            cl_event *event) {
    return guarded("clspPhaseEnqueueRestore", [&] {
        const auto p = object(phase);
        enqueue(*p->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { p->enqueue_restore(chain, mem, offset_bytes); });
    });
}

} // extern "C"
