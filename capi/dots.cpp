#include "clspeckle/dots.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "stages/dots.hpp"

#include <cstdint>
#include <limits>

using namespace clsp;
using namespace clsp::capi;

namespace {

static_assert(CLSP_MAX_DOTS == kMaxDots, "the engine's limit and the API's must agree");

constexpr auto kDotsFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.count, p.count);
    field(d.positions_px, p.positions_px);
    field(d.sigmas_px, p.sigmas_px);
    field(d.peaks, p.peaks);
    field(d.sigma_px, p.sigma_px);
    field(d.scale, p.scale);
    field(d.relative_wavelength_shift, p.relative_wavelength_shift);
    field(d.beam_skew, p.beam_skew);
    field(d.beam_skew_angle_rad, p.beam_skew_angle_rad);
    field(d.beam_flatness, p.beam_flatness);
    field(d.zero_order_relative_intensity, p.zero_order_relative_intensity);
    field(d.ghost_relative_intensity, p.ghost_relative_intensity);
    field(d.scatter_fraction, p.scatter_fraction);
};

ClspDotsDesc dots_defaults() {
    return to_c<ClspDotsDesc>(kDotsFields, DotsParameters());
}

// An optional point with the flag that says whether it is meant.
std::optional<Vector2> optional_point(std::uint32_t given, double x, double y, const char *name) {
    if (checked_flag(given, fmt::format("desc->{}_given", name).c_str()))
        return Vector2{x, y};
    if (x != 0.0 || y != 0.0) // also NaN
        throw Error(
            Status::kInvalidArgument,
            fmt::format("desc->{0} is ({1}, {2}), but desc->{0}_given is 0; set it to 1, or leave the point at 0", name,
                        x, y));
    return std::nullopt;
}

DotsParameters dots_parameters(const ClspDotsDesc *user) {
    const ClspDotsDesc d = read_struct(user, dots_defaults(), "desc");
    check_reserved(d.reserved, "desc->reserved");
    auto p = from_c<DotsParameters>(kDotsFields, d);
    p.principal_point_px =
        optional_point(d.principal_point_given, d.principal_point_x_px, d.principal_point_y_px, "principal_point");
    p.ghost_offset_px = optional_point(d.ghost_offset_given, d.ghost_offset_x_px, d.ghost_offset_y_px, "ghost_offset");
    return p;
}

} // namespace

extern "C" {

CLSP_INIT(DotsDesc, desc, dots_defaults())

CLSP_API ClspStatus clspDotsCreate(ClspContext context, const ClspDotsDesc *desc, ClspDots *dots) {
    return guarded("clspDotsCreate", [&] {
        const auto c = object(context);
        required(dots, "dots");
        give(dots, std::make_shared<Dots>(c, dots_parameters(desc)));
    });
}

CLSP_REFERENCES(Dots)

CLSP_API ClspStatus clspDotsConfigure(ClspDots dots, const ClspDotsDesc *desc) {
    return guarded("clspDotsConfigure", [&] {
        const auto d = object(dots);
        d->configure(dots_parameters(desc));
    });
}

CLSP_API ClspStatus clspDotsEnqueueRender(ClspDots dots, cl_command_queue queue, const ClspImage *irradiance,
                                          uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                          cl_event *event) {
    return guarded("clspDotsEnqueueRender", [&] {
        const auto d = object(dots);
        const Context &context = *d->context();
        const ImageView view = check_image(description(irradiance, "irradiance"), "irradiance", context.cl_context()(),
                                           {d->parameters().width, d->parameters().height}, {Format::kFloat32});
        enqueue(context, queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { d->enqueue_render(chain, view); });
    });
}

} // extern "C"
