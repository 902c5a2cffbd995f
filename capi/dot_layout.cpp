#include "clspeckle/dot_layout.h"

#include "doe/dot_layout.hpp"
#include "fields.hpp"
#include "progress.hpp"
#include "status.hpp"
#include "structs.hpp"

#include <algorithm>

using namespace clsp;
using namespace clsp::capi;

namespace {

static_assert(kMostLayoutDots == CLSP_MAX_LAYOUT_DOTS, "the engine's limit is that of dot_layout.h");

constexpr auto kDotLayoutFields = [](auto field, auto &d, auto &p) {
    field(d.lattice, p.lattice, "desc->lattice");
    field(d.count, p.count);
    field(d.seed, p.seed);
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.pixel_pitch_m, p.pixel_pitch_m);
    field(d.wavelength_m, p.wavelength_m);
    field(d.half_angle_x_rad, p.half_angle_x_rad);
    field(d.half_angle_y_rad, p.half_angle_y_rad);
    field(d.min_distance, p.min_distance);
    field(d.beam_diameter_m, p.beam_diameter_m);
    field(d.row_half_height, p.row_half_height);
    field(d.neighborhood_radius, p.neighborhood_radius);
    field(d.tolerance, p.tolerance);
    field(d.min_difference, p.min_difference);
    field(d.point_symmetric, p.point_symmetric, "desc->point_symmetric");
    field(d.repair_rounds, p.repair_rounds);
};

ClspDotLayoutDesc layout_defaults() {
    return to_c<ClspDotLayoutDesc>(kDotLayoutFields, DotLayoutParameters());
}

} // namespace

extern "C" {

CLSP_INIT(DotLayoutDesc, desc, layout_defaults())

CLSP_API ClspStatus clspDotLayoutCreate(const ClspDotLayoutDesc *desc, double *directions, int32_t *orders,
                                        ClspDotLayoutInfo *info) {
    return guarded("clspDotLayoutCreate", [&] {
        const ClspDotLayoutDesc d = read_struct(desc, layout_defaults(), "desc");
        required(directions, "directions");
        if (info)
            check_struct_size(info->struct_size, kFirstSize<ClspDotLayoutInfo>, "info");
        auto p = from_c<DotLayoutParameters>(kDotLayoutFields, d);
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
