#include "clspeckle/pattern.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "stages/pattern.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(Projection, kDirectionCosines, CLSP_PROJECTION_TANGENT_PLANE, CLSP_PROJECTION_DIRECTION_COSINES)
CLSP_ENUM(PatternQuantity, kPlaneIrradiance, CLSP_QUANTITY_RADIANT_INTENSITY, CLSP_QUANTITY_PLANE_IRRADIANCE)
CLSP_ENUM(PatternFilter, kArea, CLSP_FILTER_BILINEAR, CLSP_FILTER_AREA)

} // namespace clsp::capi

namespace {

constexpr auto kPatternFields = [](auto field, auto &d, auto &p) {
    field(d.projection, p.projection, "desc->projection");
    field(d.quantity, p.quantity, "desc->quantity");
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.texels, p.texels);
    field(d.texels_pitch_bytes, p.texels_pitch_bytes);
    field(d.half_extent_x, p.half_extent_x);
    field(d.half_extent_y, p.half_extent_y);
    field(d.power_scale, p.power_scale);
    field(d.laser_from_geometry, p.laser_from_geometry);
    field(d.filter, p.filter, "desc->filter");
    field(d.filter_taps, p.filter_taps);
};

ClspPatternDesc pattern_defaults() {
    return to_c<ClspPatternDesc>(kPatternFields, PatternParameters());
}

ClspGeometry geometry_defaults() {
    ClspGeometry g{};
    g.struct_size = sizeof g;
    g.depth_kind = CLSP_DEPTH_ALONG_AXIS;
    return g;
}

Pose pose(const double values[12]) {
    Pose result;
    std::copy(values, values + result.size(), result.begin());
    return result;
}

} // namespace

namespace clsp::capi {

Geometry geometry(const ClspGeometry *user) {
    const ClspGeometry g = read_struct(user, geometry_defaults(), "geometry");
    Geometry result;
    result.depth_kind = checked_enum<DepthKind>(g.depth_kind, "geometry.depth_kind");
    result.position = optional_description(g.position, "geometry.position");
    result.depth = optional_description(g.depth, "geometry.depth");
    result.normal = optional_description(g.normal, "geometry.normal");
    result.albedo = optional_description(g.albedo, "geometry.albedo");
    result.visibility = optional_description(g.visibility, "geometry.visibility");
    result.fx_px = g.fx_px;
    result.fy_px = g.fy_px;
    result.cx_px = g.cx_px;
    result.cy_px = g.cy_px;
    return result;
}

} // namespace clsp::capi

extern "C" {

CLSP_INIT(PatternDesc, desc, pattern_defaults())

CLSP_INIT(Geometry, geometry, geometry_defaults())

CLSP_API ClspStatus clspPatternCreate(ClspContext context, const ClspPatternDesc *desc, ClspPattern *pattern) {
    return guarded("clspPatternCreate", [&] {
        const auto c = object(context);
        required(pattern, "pattern");
        const ClspPatternDesc d = read_struct(desc, pattern_defaults(), "desc");
        check_reserved(d.reserved, "desc->reserved");
        give(pattern, std::make_shared<Pattern>(c, from_c<PatternParameters>(kPatternFields, d)));
    });
}

CLSP_REFERENCES(Pattern)

CLSP_API ClspStatus clspPatternSetPose(ClspPattern pattern, const double laser_from_geometry[12]) {
    return guarded("clspPatternSetPose", [&] {
        const auto p = object(pattern);
        if (!laser_from_geometry)
            throw Error(Status::kInvalidArgument, "laser_from_geometry is NULL; it is 12 doubles, [R|t] row-major");
        p->set_pose(pose(laser_from_geometry));
    });
}

CLSP_API ClspStatus clspPatternEnqueueLookup(ClspPattern pattern, cl_command_queue queue,
                                             const ClspGeometry *user_geometry, const ClspImage *irradiance,
                                             uint32_t num_events_in_wait_list, const cl_event *event_wait_list,
                                             cl_event *event) {
    return guarded("clspPatternEnqueueLookup", [&] {
        const auto p = object(pattern);
        const Context &context = *p->context();
        const Geometry g = geometry(user_geometry);
        const ImageView view = check_image(description(irradiance, "irradiance"), "irradiance", context.cl_context()(),
                                           {0, 0}, {Format::kFloat32});
        enqueue(context, queue, num_events_in_wait_list, event_wait_list, event,
                [&](CommandChain &chain) { p->enqueue_lookup(chain, g, view); });
    });
}

} // extern "C"
