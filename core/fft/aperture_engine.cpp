#include "fft/aperture_engine.hpp"

#include "runtime/error.hpp"
#include "fft/plan/line_plan.hpp"

#include <fmt/core.h>

namespace clsp {
namespace {

void check_plans(const FieldGrid &grid) {
    for (const std::uint32_t side : {grid.grid_width, grid.grid_height})
        if (!fused_plan_exists(side))
            throw Error(Status::kUnsupported,
                        fmt::format("the field grid is {} x {}: the fused engine takes sides of 2 to {}",
                                    grid.grid_width, grid.grid_height, kLongestFusedLine));
}

} // namespace

FusedDecision decide_engine(const std::shared_ptr<Context> &context, const FieldGrid &grid, const Pupil &pupil,
                            const FusedRequest &request, const std::vector<EngineChoice> &choices) {
    FusedDecision decision;
    for (const EngineChoice &choice : choices) {
        decision.spec = choice.spec;
        decision.source = choice.source;
        try {
            if (choice.spec.engine != Engine::kClfft) {
                check_plans(grid);
                decision.engine = choice.spec.engine == Engine::kFusedLanes
                                      ? make_fused_lanes(context, grid, pupil, request)
                                      : make_fused_groups(context, grid, pupil, request, decision.spec);
                decision.refusal.clear();
            } else if (decision.refusal.empty()) {
                decision.refusal = choice.source;
            }
            break;
        } catch (const Error &error) {
            if (error.status() != Status::kUnsupported)
                throw;
            context->log(LogLevel::kInfo,
                         fmt::format("{} is not used for a field grid of {} x {} ({}): {}", describe(choice.spec),
                                     grid.grid_width, grid.grid_height, choice.source, error.what()));
            if (decision.refusal.empty())
                decision.refusal = error.what();
        }
    }
    return decision;
}

} // namespace clsp
