#include "clspeckle/lens.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "stages/lens.hpp"

#include <cmath>
#include <fmt/core.h>
#include <limits>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(RadiusUnit, kFocalLength, CLSP_LENS_RADIUS_CORNER, CLSP_LENS_RADIUS_FOCAL_LENGTH)
CLSP_ENUM(Interpolation, kCubic, CLSP_INTERPOLATION_NEAREST, CLSP_INTERPOLATION_LINEAR, CLSP_INTERPOLATION_CUBIC)

} // namespace clsp::capi

namespace {

constexpr auto kLensFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.radius_unit, p.radius_unit, "desc->radius_unit");
    field(d.cos4_falloff, p.cos4_falloff, "desc->cos4_falloff");
    field(d.principal_point_given, p.principal_point_given, "desc->principal_point_given");
    field(d.principal_point_x_px, p.principal_point_x_px);
    field(d.principal_point_y_px, p.principal_point_y_px);
    field(d.focal_length_x_px, p.focal_length_x_px);
    field(d.focal_length_y_px, p.focal_length_y_px);
    field(d.k1, p.k1);
    field(d.k2, p.k2);
    field(d.k3, p.k3);
    field(d.p1, p.p1);
    field(d.p2, p.p2);
    field(d.vignetting_corner_loss, p.vignetting_corner_loss);
    field(d.glare_fraction, p.glare_fraction);
    field(d.glare_scale_px, p.glare_scale_px);
    field(d.ambient, p.ambient);
};

ClspLensDesc lens_defaults() {
    return to_c<ClspLensDesc>(kLensFields, LensParameters());
}

LensParameters lens_parameters(const ClspLensDesc *desc) {
    return from_c<LensParameters>(kLensFields, read_struct(desc, lens_defaults(), "desc"));
}

// All points are checked before the first one is written, as input and output may be the same.
template <typename Move>
void move_points(const double *from, const char *from_name, std::uint64_t count, double *to, const char *to_name,
                 Move move) {
    if (count == 0)
        return;
    required(from, from_name);
    required(to, to_name);
    constexpr std::uint64_t kMostPoints = std::uint64_t{1} << 40; // far above any memory, far below an overflow
    if (count > kMostPoints)
        throw Error(Status::kInvalidArgument, fmt::format("count is {}, it must be at most {}", count, kMostPoints));
    for (std::uint64_t i = 0; i < count; ++i)
        if (!std::isfinite(from[2 * i]) || !std::isfinite(from[2 * i + 1]))
            throw Error(Status::kInvalidData, fmt::format("{}: point {} is ({}, {}); it must be finite", from_name, i,
                                                          from[2 * i], from[2 * i + 1]));
    for (std::uint64_t i = 0; i < count; ++i) {
        const auto moved = move(Distortion::Point{from[2 * i], from[2 * i + 1]});
        constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();
        to[2 * i] = moved ? moved->x : kNowhere;
        to[2 * i + 1] = moved ? moved->y : kNowhere;
    }
}

} // namespace

extern "C" {

CLSP_INIT(LensDesc, desc, lens_defaults())

CLSP_API ClspStatus clspLensCreate(ClspContext context, const ClspLensDesc *desc, ClspLens *lens) {
    return guarded("clspLensCreate", [&] {
        const auto c = object(context);
        required(lens, "lens");
        give(lens, std::make_shared<Lens>(c, lens_parameters(desc)));
    });
}

CLSP_REFERENCES(Lens)

CLSP_API ClspStatus clspLensConfigure(ClspLens lens, const ClspLensDesc *desc) {
    return guarded("clspLensConfigure", [&] { object(lens)->configure(lens_parameters(desc)); });
}

CLSP_API ClspStatus clspLensEnqueueDistort(ClspLens lens, cl_command_queue queue, uint32_t interpolation,
                                           const ClspImage *ideal, const ClspImage *distorted,
                                           uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                           cl_event *event) {
    return guarded("clspLensEnqueueDistort", [&] {
        const auto l = object(lens);
        const ImageSize size{l->parameters().width, l->parameters().height};
        const ::cl_context context = l->context()->cl_context()();
        const auto formats = {Format::kFloat32,   Format::kUint8,     Format::kUint16,   Format::kUint32,
                              Format::kFloat32x2, Format::kFloat32x3, Format::kFloat32x4};
        const ImageView from = check_image(description(ideal, "ideal"), "ideal", context, size, formats);
        const ImageView to = check_image(description(distorted, "distorted"), "distorted", context, size, formats);
        const auto how = checked_enum<Interpolation>(interpolation, "interpolation");
        l->check_distort(from, to, how);
        enqueue(*l->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { l->enqueue_distort(chain, from, to, how); });
    });
}

CLSP_API ClspStatus clspLensEnqueueFinish(ClspLens lens, cl_command_queue queue, const ClspImage *light,
                                          uint32_t is_dark, const ClspImage *output, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspLensEnqueueFinish", [&] {
        const auto l = object(lens);
        const ImageSize size{l->parameters().width, l->parameters().height};
        const ::cl_context context = l->context()->cl_context()();
        const ImageView in = check_image(description(light, "light"), "light", context, size, {Format::kFloat32});
        const ImageView out = check_image(description(output, "output"), "output", context, size, {Format::kFloat32});
        const bool dark = checked_flag(is_dark, "is_dark");
        l->check_finish(in, out);
        enqueue(*l->context(), queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { l->enqueue_finish(chain, in, out, dark); });
    });
}

CLSP_API ClspStatus clspLensDistortPoints(ClspLens lens, const double *ideal_px, uint64_t count, double *distorted_px) {
    return guarded("clspLensDistortPoints", [&] {
        const auto l = object(lens);
        move_points(ideal_px, "ideal_px", count, distorted_px, "distorted_px",
                    [&](Distortion::Point p) { return l->distortion().distort(p); });
    });
}

CLSP_API ClspStatus clspLensUndistortPoints(ClspLens lens, const double *distorted_px, uint64_t count,
                                            double *ideal_px) {
    return guarded("clspLensUndistortPoints", [&] {
        const auto l = object(lens);
        move_points(distorted_px, "distorted_px", count, ideal_px, "ideal_px",
                    [&](Distortion::Point p) { return l->distortion().undistort(p); });
    });
}

} // extern "C"
