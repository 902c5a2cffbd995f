#include "stages/fused_engine.hpp"

#include "runtime/error.hpp"
#include "runtime/fused_device.hpp"
#include "runtime/fused_plan.hpp"

#include <fmt/core.h>

namespace clsp {

std::unique_ptr<FusedEngine> make_fused_engine(std::shared_ptr<Context> context, const FieldGrid &grid,
                                               const Pupil &pupil, const FusedRequest &request, std::string &refusal) {
    refusal.clear();
    const FusedShape shape = fused_shape(*context);
    if (shape == FusedShape::kNone) {
        refusal = fused_shape_refusal(*context);
        return nullptr;
    }
    for (const std::uint32_t side : {grid.grid_width, grid.grid_height})
        if (!fused_plan_exists(side)) {
            refusal = fmt::format("the field grid is {} x {}: the fused engine takes sides of 2 to {}", grid.grid_width,
                                  grid.grid_height, kLongestFusedLine);
            return nullptr;
        }
    try {
        return shape == FusedShape::kLanes ? make_fused_lanes(std::move(context), grid, pupil, request)
                                           : make_fused_groups(std::move(context), grid, pupil, request);
    } catch (const Error &error) {
        if (error.status() != Status::kUnsupported)
            throw;
        refusal = error.what();
        return nullptr;
    }
}

} // namespace clsp
