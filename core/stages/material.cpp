#include "stages/material.hpp"

#include "runtime/checks.hpp"

#include <utility>

namespace clsp {
namespace {

// Above 0; infinity is allowed.
void check_length(double value, const char *name, std::size_t id) {
    if (!(value > 0.0))
        throw Error(
            Status::kInvalidArgument,
            fmt::format("material {}: {} is {}, it must be above 0 (infinity: never decorrelates)", id, name, value));
}

} // namespace

MaterialTable::MaterialTable(std::shared_ptr<Context> context, std::vector<Material> materials)
    : context_(std::move(context)), materials_(std::move(materials)) {
    if (materials_.empty() || materials_.size() > kMaxMaterials)
        throw Error(Status::kInvalidArgument,
                    fmt::format("count is {}, a table has 1 to {} materials", materials_.size(), kMaxMaterials));
    for (std::size_t id = 0; id < materials_.size(); ++id) {
        const Material &m = materials_[id];
        if (!(m.roughness_rms_m >= 0.0))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("material {}: roughness_rms_m is {}, it must be 0 or more (infinity: fully developed)", id,
                            m.roughness_rms_m));
        if (!(m.degree_of_polarization <= 1.0))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("material {}: degree_of_polarization is {}, it must be 0 to 1 (negative: the aperture's)",
                            id, m.degree_of_polarization));
        if (!(m.correlation_time_s >= 0.0))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("material {}: correlation_time_s is {}, it must be 0 or more (infinity: never changes)", id,
                            m.correlation_time_s));
        check_length(m.lateral_correlation_length_m, "lateral_correlation_length_m", id);
        check_length(m.axial_correlation_length_m, "axial_correlation_length_m", id);
        check_length(m.rotation_correlation_angle_rad, "rotation_correlation_angle_rad", id);
        if (!(m.subsurface_fraction >= 0.0 && m.subsurface_fraction <= 1.0))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("material {}: subsurface_fraction is {}, it must be 0 to 1", id, m.subsurface_fraction));
    }
}

} // namespace clsp
