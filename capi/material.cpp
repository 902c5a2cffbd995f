#include "clspeckle/material.h"

#include "convert.hpp"
#include "handles.hpp"
#include "stages/material.hpp"

#include <cstddef>

using namespace clsp;
using namespace clsp::capi;

namespace {

ClspMaterial material_defaults() {
    const Material m;
    ClspMaterial material{};
    material.struct_size = sizeof material;
    material.roughness_rms_m = m.roughness_rms_m;
    material.degree_of_polarization = m.degree_of_polarization;
    material.correlation_time_s = m.correlation_time_s;
    material.lateral_correlation_length_m = m.lateral_correlation_length_m;
    material.axial_correlation_length_m = m.axial_correlation_length_m;
    material.rotation_correlation_angle_rad = m.rotation_correlation_angle_rad;
    material.subsurface_fraction = m.subsurface_fraction;
    return material;
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspMaterialInit(ClspMaterial *material, uint32_t struct_size) {
    return guarded("clspMaterialInit", [&] { init_struct(material, struct_size, material_defaults(), "material"); });
}

CLSP_API ClspStatus clspMaterialTableCreate(ClspContext context, const ClspMaterial *materials, uint32_t count,
                                            ClspMaterialTable *table) {
    return guarded("clspMaterialTableCreate", [&] {
        const auto c = object(context);
        required(table, "table");
        required(materials, "materials");
        if (count == 0 || count > kMaxMaterials)
            throw Error(Status::kInvalidArgument,
                        fmt::format("count is {}, a table has 1 to {} materials", count, kMaxMaterials));
        // The caller's structs are as far apart as the caller's struct_size says.
        const std::uint32_t stride = materials->struct_size;
        std::vector<Material> list;
        list.reserve(count);
        for (std::uint32_t i = 0; i < count; ++i) {
            const auto *entry = reinterpret_cast<const ClspMaterial *>(reinterpret_cast<const unsigned char *>(materials) +
                                                                       std::size_t{i} * stride);
            if (entry->struct_size != stride)
                throw Error(Status::kInvalidStructSize,
                            fmt::format("materials[{}].struct_size is {}, but materials[0].struct_size is {}; fill every "
                                        "entry by clspMaterialInit()",
                                        i, entry->struct_size, stride));
            const ClspMaterial m = read_struct(entry, material_defaults(), "materials");
            check_reserved(m.reserved, "materials->reserved");
            Material material;
            material.roughness_rms_m = m.roughness_rms_m;
            material.degree_of_polarization = m.degree_of_polarization;
            material.correlation_time_s = m.correlation_time_s;
            material.lateral_correlation_length_m = m.lateral_correlation_length_m;
            material.axial_correlation_length_m = m.axial_correlation_length_m;
            material.rotation_correlation_angle_rad = m.rotation_correlation_angle_rad;
            material.subsurface_fraction = m.subsurface_fraction;
            list.push_back(material);
        }
        give(table, std::make_shared<MaterialTable>(c, std::move(list)));
    });
}

CLSP_API ClspStatus clspMaterialTableRetain(ClspMaterialTable table) {
    return guarded("clspMaterialTableRetain", [&] { HandleTable<ClspMaterialTable>::instance().retain(table); });
}

CLSP_API ClspStatus clspMaterialTableRelease(ClspMaterialTable table) {
    return guarded("clspMaterialTableRelease", [&] { HandleTable<ClspMaterialTable>::instance().release(table); });
}

} // extern "C"
