#include "clspeckle/dot_layout.h"

#include "doe/dot_layout.hpp"
#include "progress.hpp"
#include "status.hpp"
#include "structs.hpp"

#include <algorithm>

using namespace clsp;
using namespace clsp::capi;

namespace {

static_assert(kMostLayoutDots == CLSP_MAX_LAYOUT_DOTS, "the engine's limit is that of dot_layout.h");

ClspDotLayoutDesc layout_defaults() {
    const DotLayoutParameters p;
    ClspDotLayoutDesc desc{};
    desc.struct_size = sizeof desc;
    desc.lattice = p.lattice ? 1 : 0;
    desc.count = p.count;
    desc.seed = p.seed;
    desc.width = p.width;
    desc.height = p.height;
    desc.pixel_pitch_m = p.pixel_pitch_m;
    desc.wavelength_m = p.wavelength_m;
    desc.half_angle_x_rad = p.half_angle_x_rad;
    desc.half_angle_y_rad = p.half_angle_y_rad;
    desc.min_difference = p.min_difference;
    desc.point_symmetric = p.point_symmetric ? 1 : 0;
    desc.repair_rounds = p.repair_rounds;
    return desc;
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspDotLayoutDescInit(ClspDotLayoutDesc *desc, uint32_t struct_size) {
    return guarded("clspDotLayoutDescInit", [&] { init_struct(desc, struct_size, layout_defaults(), "desc"); });
}

CLSP_API ClspStatus clspDotLayoutCreate(const ClspDotLayoutDesc *desc, double *directions, int32_t *orders,
                                        ClspDotLayoutInfo *info) {
    return guarded("clspDotLayoutCreate", [&] {
        const ClspDotLayoutDesc d = read_struct(desc, layout_defaults(), "desc");
        required(directions, "directions");
        if (info)
            check_struct_size(info->struct_size, kFirstSize<ClspDotLayoutInfo>, "info");
        DotLayoutParameters p;
        p.lattice = checked_flag(d.lattice, "desc->lattice");
        p.count = d.count;
        p.seed = d.seed;
        p.width = d.width;
        p.height = d.height;
        p.pixel_pitch_m = d.pixel_pitch_m;
        p.wavelength_m = d.wavelength_m;
        p.half_angle_x_rad = d.half_angle_x_rad;
        p.half_angle_y_rad = d.half_angle_y_rad;
        p.min_distance = d.min_distance;
        p.beam_diameter_m = d.beam_diameter_m;
        p.row_half_height = d.row_half_height;
        p.neighborhood_radius = d.neighborhood_radius;
        p.tolerance = d.tolerance;
        p.min_difference = d.min_difference;
        p.point_symmetric = checked_flag(d.point_symmetric, "desc->point_symmetric");
        p.repair_rounds = d.repair_rounds;
        p.progress = progress_function(d.progress, d.progress_data);
        if (!p.lattice && orders)
            throw Error(Status::kInvalidArgument,
                        "orders is given, but desc->lattice is 0: free directions are no orders; pass NULL");
        const DotLayout layout = make_dot_layout(p);
        std::copy(layout.directions.begin(), layout.directions.end(), directions);
        if (orders)
            std::copy(layout.orders.begin(), layout.orders.end(), orders);
        if (info) {
            ClspDotLayoutInfo result{};
            result.min_distance = layout.min_distance;
            result.mean_spacing = layout.mean_spacing;
            result.row_half_height = layout.row_half_height;
            result.neighborhood_radius = layout.neighborhood_radius;
            result.tolerance = layout.tolerance;
            result.mean_neighbors = layout.mean_neighbors;
            result.min_difference = layout.min_difference;
            result.mean_difference = layout.mean_difference;
            result.pair_count = layout.pairs;
            result.worst_first = layout.worst_first;
            result.worst_second = layout.worst_second;
            result.moved_count = layout.moved;
            write_struct(*info, result, "info");
        }
    });
}

} // extern "C"
