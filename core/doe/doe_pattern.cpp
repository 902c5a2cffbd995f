#include "doe/doe_pattern.hpp"

#include "doe/doe_cache.hpp"
#include "doe/doe_element.hpp"
#include "doe/doe_field.hpp"
#include "doe/power_budget.hpp"
#include "runtime/checks.hpp"

#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

// A beam may lose this share of its power at the DOE's edge.
constexpr double kLargestLoss = 0.01;
// Parts of spots that are added to texels; minutes.
constexpr double kMostSums = 2e10;

void check_beam(const DoeElement &element, const BeamProfile &beam, const SpotShape &spot) {
    const DoePatternParameters &p = element.parameters;
    const double width = p.doe_width_m > 0 ? p.doe_width_m
                         : p.periodic      ? 2 * beam.half_width_x_m()
                                           : p.width * p.pixel_pitch_m;
    const double height = p.doe_height_m > 0 ? p.doe_height_m
                          : p.periodic       ? 2 * beam.half_width_y_m()
                                             : p.height * p.pixel_pitch_m;
    const double lost = beam.share_outside(width, height);
    if (lost > kLargestLoss)
        throw Error(Status::kInvalidArgument, fmt::format("the beam is larger than the DOE: {:.1f} % of its power "
                                                          "misses {:g} x {:g} m, at most {:g} % may; take a narrower "
                                                          "beam or a larger DOE",
                                                          100 * lost, width, height, 100 * kLargestLoss));
    if (!element.orders) {
        if (beam.m_squared() > 1)
            throw Error(Status::kInvalidArgument, "beam->m_squared is above 1, which evaluation APERTURE, a coherent "
                                                  "transform, cannot show; use evaluation ORDERS");
        return;
    }
    const double cell_x = p.width * p.pixel_pitch_m, cell_y = p.height * p.pixel_pitch_m;
    if (const double sums = spot_sums(element, spot); sums > kMostSums)
        throw Error(Status::kInvalidArgument,
                    fmt::format("a cell of {:g} x {:g} m has so many orders that {:.1e} spots would be summed, at most "
                                "{:.0e} are; take a smaller cell, a smaller extent, or evaluation APERTURE",
                                cell_x, cell_y, sums, kMostSums));
    // A cell of one pixel in a row does not split along that axis.
    if ((p.width > 1 && cell_x * 2 * spot.half_u_per_m > 1) || (p.height > 1 && cell_y * 2 * spot.half_v_per_m > 1))
        throw Error(Status::kInvalidArgument,
                    fmt::format("the orders lie closer than the diffraction limit: a cell of {:g} x {:g} m has orders "
                                "{:.3g} x {:.3g} apart in "
                                "direction cosines, but a spot of this beam is {:.3g} x {:.3g} wide; take a wider "
                                "beam, a smaller cell, or "
                                "evaluation APERTURE",
                                cell_x, cell_y, element.mean_wavelength_m / cell_x, element.mean_wavelength_m / cell_y,
                                2 * spot.half_u_per_m * element.mean_wavelength_m,
                                2 * spot.half_v_per_m * element.mean_wavelength_m));
}

} // namespace

std::shared_ptr<DoePattern> make_doe_pattern(const std::shared_ptr<Context> &context,
                                             const DoePatternParameters &parameters) {
    const DoeElement element = make_doe_element(parameters);
    const DoePatternParameters &p = element.parameters;
    const BeamProfile beam(p.beam);
    const std::string key = doe_pattern_key(element, beam, context->device_name());
    if (auto kept = context->results().find<DoePatternResult>(key))
        return std::make_shared<DoePattern>(std::move(kept), DoeSource::kMemory);
    const auto remember = [&](const std::shared_ptr<DoePatternResult> &result) {
        const std::uint64_t bytes = result->texels.size() * sizeof(float) + result->dot_shares.size() * sizeof(double);
        context->results().keep(key, result, bytes);
    };
    const CacheFolder folder(p.cache_dir,
                             [&](const std::string &message) { context->log(LogLevel::kWarning, message); });
    if (!p.cache_dir.empty())
        if (auto stored = load_doe_pattern(folder, key)) {
            remember(stored);
            return std::make_shared<DoePattern>(std::move(stored), DoeSource::kDisk);
        }
    const SpotShape spot = make_spot_shape(beam);
    check_beam(element, beam, spot);
    DoeField field(context, element, beam);
    DoeLight light = field.evaluate(spot);

    auto result = std::make_shared<DoePatternResult>();
    DoePowerBudget &budget = result->budget;
    const double half_u = spot.half_u_per_m * element.mean_wavelength_m,
                 half_v = spot.half_v_per_m * element.mean_wavelength_m;
    begin_power_budget(p, beam, half_u, half_v, budget);
    if (p.periodic) {
        budget.order_spacing_x = element.mean_wavelength_m / (p.width * p.pixel_pitch_m);
        budget.order_spacing_y = element.mean_wavelength_m / (p.height * p.pixel_pitch_m);
    }
    budget.device_memory_bytes = light.device_memory_bytes;
    if (element.orders) {
        balance_orders(element, light, *result);
        add_scatter(element, light.texel_shares);
    } else {
        balance_aperture(element, light.texel_shares, half_u, half_v, *result);
    }
    finish_texels(std::move(light.texel_shares), *result);
    remember(result);
    if (!p.cache_dir.empty())
        store_doe_pattern(folder, key, *result);
    return std::make_shared<DoePattern>(std::move(result), DoeSource::kComputed);
}

} // namespace clsp
