#include "clspeckle/material.h"

#include "convert.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "stages/material.hpp"

#include <cstddef>

using namespace clsp;
using namespace clsp::capi;

namespace {

constexpr auto kMaterialFields = [](auto field, auto &d, auto &p) {
    field(d.roughness_rms_m, p.roughness_rms_m);
    field(d.degree_of_polarization, p.degree_of_polarization);
    field(d.correlation_time_s, p.correlation_time_s);
    field(d.lateral_correlation_length_m, p.lateral_correlation_length_m);
    field(d.axial_correlation_length_m, p.axial_correlation_length_m);
    field(d.rotation_correlation_angle_rad, p.rotation_correlation_angle_rad);
    field(d.subsurface_fraction, p.subsurface_fraction);
};

ClspMaterial material_defaults() {
    return to_c<ClspMaterial>(kMaterialFields, Material());
}

} // namespace

extern "C" {

CLSP_INIT(Material, material, material_defaults())

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
            const auto *entry = reinterpret_cast<const ClspMaterial *>(
                reinterpret_cast<const unsigned char *>(materials) + std::size_t{i} * stride);
            if (entry->struct_size != stride)
                throw Error(
                    Status::kInvalidStructSize,
                    fmt::format("materials[{}].struct_size is {}, but materials[0].struct_size is {}; fill every "
                                "entry by clspMaterialInit()",
                                i, entry->struct_size, stride));
            const ClspMaterial m = read_struct(entry, material_defaults(), "materials");
            check_reserved(m.reserved, "materials->reserved");
            list.push_back(from_c<Material>(kMaterialFields, m));
        }
        give(table, std::make_shared<MaterialTable>(c, std::move(list)));
    });
}

CLSP_REFERENCES(MaterialTable)

} // extern "C"
