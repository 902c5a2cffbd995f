#include "clspeckle/doe_design.h"

#include "doe/doe_design.hpp"
#include "fields.hpp"
#include "handles.hpp"
#include "progress.hpp"
#include "runtime/checks.hpp"
#include "status.hpp"
#include "structs.hpp"

#include <algorithm>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_HANDLE(ClspDoeDesign, const DoeDesign, "design", kAnyThread)
CLSP_ENUM(DoeRule, kPhaseFixed, CLSP_DOE_RULE_GS, CLSP_DOE_RULE_GSW, CLSP_DOE_RULE_NOGRETTE, CLSP_DOE_RULE_KIM)

} // namespace clsp::capi

namespace {

static_assert(kLargestDoeSide == CLSP_MAX_DOE_SIDE && kLargestDoeLevels == CLSP_MAX_DOE_LEVELS &&
                  kMostDoeOrders == CLSP_MAX_DOE_ORDERS,
              "the engine's limits are those of doe_design.h");

constexpr auto kDoeDesignFields = [](auto field, auto &d, auto &p) {
    field(d.width, p.width);
    field(d.height, p.height);
    field(d.levels, p.levels);
    field(d.pixel_pitch_m, p.pixel_pitch_m);
    field(d.wavelength_m, p.wavelength_m);
    field(d.beam_diameter_m, p.beam_diameter_m);
    field(d.seed, p.seed);
    field(d.feedback, p.feedback);
    field(d.rule, p.rule, "desc->rule");
    field(d.iterations, p.iterations);
    field(d.quantization_iterations, p.quantization_iterations);
    field(d.fix_phase_iteration, p.fix_phase_iteration);
    field(d.search_sweeps, p.search_sweeps);
    field(d.compensate_envelope, p.compensate_envelope, "desc->compensate_envelope");
    field(d.mirror_orders, p.mirror_orders, "desc->mirror_orders");
};

ClspDoeDesignDesc design_defaults() {
    return to_c<ClspDoeDesignDesc>(kDoeDesignFields, DoeDesignParameters());
}

DoeDesignParameters design_parameters(const ClspDoeDesignDesc *user) {
    const ClspDoeDesignDesc d = read_struct(user, design_defaults(), "desc");
    check_reserved(d.reserved, "desc->reserved");
    auto p = from_c<DoeDesignParameters>(kDoeDesignFields, d);
    if (d.order_count > kMostDoeOrders)
        throw Error(Status::kInvalidArgument,
                    fmt::format("desc->order_count is {}, at most {} are taken", d.order_count, kMostDoeOrders));
    if (d.order_count > 0)
        required(d.orders, "desc->orders");
    for (std::uint64_t k = 0; k < d.order_count; ++k)
        p.orders.push_back({d.orders[k].m, d.orders[k].n, d.orders[k].weight});
    p.progress = progress_function(d.progress, d.progress_data);
    return p;
}

void check_count(std::uint64_t given, std::size_t expected, const char *of) {
    if (given != expected)
        throw Error(Status::kInvalidArgument, fmt::format("count is {}, the design has {} {}", given, expected, of));
}

} // namespace

extern "C" {

CLSP_INIT(DoeDesignDesc, desc, design_defaults())

CLSP_API ClspStatus clspDoeDesignCreate(ClspContext context, const ClspDoeDesignDesc *desc, ClspDoeDesign *design) {
    return guarded("clspDoeDesignCreate", [&] {
        const auto device = object(context);
        required(design, "design");
        give(design, design_doe(device, design_parameters(desc)));
    });
}

CLSP_API ClspStatus clspDoeDesignEvaluate(ClspContext context, const ClspDoeDesignDesc *desc, const float *phase,
                                          uint64_t phase_pitch_bytes, ClspDoeDesign *design) {
    return guarded("clspDoeDesignEvaluate", [&] {
        const auto device = object(context);
        required(design, "design");
        DoeDesignParameters p = checked_doe_parameters(design_parameters(desc));
        const auto any = [](float) { return true; }; // evaluate_doe() looks at the values
        std::vector<float> copy =
            copy_host_image({phase, p.width, p.height, phase_pitch_bytes, "phase", "phase_pitch_bytes"}, any, "");
        give(design, evaluate_doe(device, std::move(p), std::move(copy)));
    });
}

CLSP_REFERENCES(DoeDesign)

CLSP_API ClspStatus clspDoeDesignGetReport(ClspDoeDesign design, ClspDoeDesignReport *report) {
    return guarded("clspDoeDesignGetReport", [&] {
        const auto d = object(design);
        const DoeDesignReport &from = d->report;
        ClspDoeDesignReport result{};
        result.zero_order_wanted = std::any_of(d->parameters.orders.begin(), d->parameters.orders.end(),
                                               [](const DoeOrder &order) { return order.m == 0 && order.n == 0; });
        result.order_count = d->parameters.orders.size();
        result.step_count = d->history.size();
        result.efficiency = from.efficiency;
        result.grid_efficiency = from.grid_efficiency;
        result.uniformity_rms = from.uniformity_rms;
        result.uniformity_peak_to_peak = from.uniformity_peak_to_peak;
        result.weakest = from.weakest;
        result.strongest = from.strongest;
        result.zero_order = from.zero_order;
        result.zero_order_relative = from.zero_order_relative;
        result.largest_ghost = from.largest_ghost;
        result.largest_ghost_relative = from.largest_ghost_relative;
        result.ghost_m = from.ghost_m;
        result.ghost_n = from.ghost_n;
        result.other_orders = from.other_orders;
        result.beyond = from.beyond;
        result.search_changes = from.search_changes;
        result.search_sweeps = from.search_sweeps;
        result.seconds = from.seconds;
        write_struct(required(report, "report"), result, "report");
    });
}

CLSP_API ClspStatus clspDoeDesignGetPhase(ClspDoeDesign design, uint64_t count, float *phase) {
    return guarded("clspDoeDesignGetPhase", [&] {
        const auto d = object(design);
        required(phase, "phase");
        check_count(count, d->phase.size(), "pixels");
        std::copy(d->phase.begin(), d->phase.end(), phase);
    });
}

CLSP_API ClspStatus clspDoeDesignGetOrders(ClspDoeDesign design, uint64_t count, ClspDoeDesignOrder *orders,
                                           double *powers) {
    return guarded("clspDoeDesignGetOrders", [&] {
        const auto d = object(design);
        check_count(count, d->powers.size(), "orders");
        for (std::size_t k = 0; k < d->powers.size(); ++k) {
            const DoeOrder &order = d->parameters.orders[k];
            if (orders)
                orders[k] = {order.m, order.n, order.weight};
            if (powers)
                powers[k] = d->powers[k];
        }
    });
}

CLSP_API ClspStatus clspDoeDesignGetHistory(ClspDoeDesign design, uint64_t count, double *efficiency,
                                            double *uniformity_rms) {
    return guarded("clspDoeDesignGetHistory", [&] {
        const auto d = object(design);
        check_count(count, d->history.size(), "steps");
        for (std::size_t i = 0; i < d->history.size(); ++i) {
            if (efficiency)
                efficiency[i] = d->history[i].efficiency;
            if (uniformity_rms)
                uniformity_rms[i] = d->history[i].uniformity_rms;
        }
    });
}

CLSP_API ClspStatus clspDoeDesignSnapDirections(uint32_t width, uint32_t height, double pixel_pitch_m,
                                                double wavelength_m, uint64_t count, const double *directions,
                                                ClspDoeDesignOrder *orders, double *errors) {
    return guarded("clspDoeDesignSnapDirections", [&] {
        if (count == 0 || count > kMostDoeOrders)
            throw Error(Status::kInvalidArgument,
                        fmt::format("count is {}, it must be 1 to {}", count, kMostDoeOrders));
        required(directions, "directions");
        required(orders, "orders");
        const SnappedOrders snapped =
            snap_directions({directions, directions + 2 * count}, width, height, pixel_pitch_m, wavelength_m);
        for (std::size_t k = 0; k < snapped.orders.size(); ++k) {
            orders[k] = {snapped.orders[k].m, snapped.orders[k].n, snapped.orders[k].weight};
            if (errors)
                errors[k] = snapped.errors[k];
        }
    });
}

} // extern "C"
