// What surfaces are made of. material.h of the C API has the equations.
#pragma once

#include "runtime/context.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

namespace clsp {

constexpr std::uint32_t kMaxMaterials = 256;

struct Material {
    double roughness_rms_m = std::numeric_limits<double>::infinity();
    double degree_of_polarization = -1.0; // negative: that of the aperture
    double correlation_time_s = std::numeric_limits<double>::infinity();
    double lateral_correlation_length_m = 0.5e-3;
    double axial_correlation_length_m = 3e-3;
    double rotation_correlation_angle_rad = 0.25 * M_PI / 180.0;
    double subsurface_fraction = 0.0;
};

// Immutable: stages that use it keep their own device copy of what they need, and recompute it when the table changes.
class MaterialTable {
  public:
    MaterialTable(std::shared_ptr<Context> context, std::vector<Material> materials);

    const std::shared_ptr<Context> &context() const { return context_; }
    const std::vector<Material> &materials() const { return materials_; }

  private:
    std::shared_ptr<Context> context_;
    std::vector<Material> materials_;
};

} // namespace clsp
