#include "clspeckle/pattern.h"

#include "convert.hpp"
#include "handles.hpp"
#include "stages/pattern.hpp"

using namespace clsp;
using namespace clsp::capi;

namespace {

ClspPatternDesc pattern_defaults() {
    const PatternParameters p;
    ClspPatternDesc desc{};
    desc.struct_size = sizeof desc;
    desc.projection = static_cast<std::uint32_t>(p.projection);
    desc.quantity = static_cast<std::uint32_t>(p.quantity);
    desc.half_extent_x = p.half_extent_x;
    desc.half_extent_y = p.half_extent_y;
    desc.power_scale = p.power_scale;
    std::copy(p.laser_from_geometry.begin(), p.laser_from_geometry.end(), desc.laser_from_geometry);
    desc.filter = static_cast<std::uint32_t>(p.filter);
    desc.filter_taps = p.filter_taps;
    return desc;
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
    result.depth_kind = static_cast<DepthKind>(g.depth_kind);
    result.position = optional_description(&g.position);
    result.depth = optional_description(&g.depth);
    result.normal = optional_description(&g.normal);
    result.albedo = optional_description(&g.albedo);
    result.visibility = optional_description(&g.visibility);
    result.fx_px = g.fx_px;
    result.fy_px = g.fy_px;
    result.cx_px = g.cx_px;
    result.cy_px = g.cy_px;
    return result;
}

} // namespace clsp::capi

extern "C" {

CLSP_API ClspStatus clspPatternDescInit(ClspPatternDesc *desc, uint32_t struct_size) {
    return guarded("clspPatternDescInit", [&] { init_struct(desc, struct_size, pattern_defaults(), "desc"); });
}

CLSP_API ClspStatus clspGeometryInit(ClspGeometry *geometry, uint32_t struct_size) {
    return guarded("clspGeometryInit", [&] { init_struct(geometry, struct_size, geometry_defaults(), "geometry"); });
}

CLSP_API ClspStatus clspPatternCreate(ClspContext context, const ClspPatternDesc *desc, ClspPattern *pattern) {
    return guarded("clspPatternCreate", [&] {
        const auto c = object(context);
        required(pattern, "pattern");
        const ClspPatternDesc d = read_struct(desc, pattern_defaults(), "desc");
        check_reserved(d.reserved, "desc->reserved");
        PatternParameters p;
        p.projection = static_cast<Projection>(d.projection);
        p.quantity = static_cast<PatternQuantity>(d.quantity);
        p.width = d.width;
        p.height = d.height;
        p.texels = d.texels;
        p.texels_pitch_bytes = d.texels_pitch_bytes;
        p.half_extent_x = d.half_extent_x;
        p.half_extent_y = d.half_extent_y;
        p.power_scale = d.power_scale;
        p.laser_from_geometry = pose(d.laser_from_geometry);
        p.filter = static_cast<PatternFilter>(d.filter);
        p.filter_taps = d.filter_taps;
        give(pattern, std::make_shared<Pattern>(c, p));
    });
}

CLSP_API ClspStatus clspPatternRetain(ClspPattern pattern) {
    return guarded("clspPatternRetain", [&] { HandleTable<ClspPattern>::instance().retain(pattern); });
}

CLSP_API ClspStatus clspPatternRelease(ClspPattern pattern) {
    return guarded("clspPatternRelease", [&] { HandleTable<ClspPattern>::instance().release(pattern); });
}

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
