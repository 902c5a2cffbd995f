// Ideal dots: the beam's far field at given directions. On the host: a few thousand spots of a few texels each.
#include "doe/doe_pattern.hpp"
#include "doe/power_budget.hpp"
#include "runtime/checks.hpp"
#include "stages/dots.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {


// The table at fractional node (x, y); constant beyond its edges.
double spot_sum(const SpotShape &spot, double x, double y) {
    const double cx = std::clamp(x, 0.0, spot.nodes_x - 1.0), cy = std::clamp(y, 0.0, spot.nodes_y - 1.0);
    const auto ix = std::min(static_cast<std::uint32_t>(cx), spot.nodes_x - 2),
               iy = std::min(static_cast<std::uint32_t>(cy), spot.nodes_y - 2);
    const double ax = cx - ix, ay = cy - iy;
    const std::uint32_t *row = &spot.table[std::size_t{iy} * spot.nodes_x + ix];
    return spot.unit * ((row[0] * (1 - ax) + row[1] * ax) * (1 - ay) +
                        (row[spot.nodes_x] * (1 - ax) + row[spot.nodes_x + 1] * ax) * ay);
}

void check_spots(const SpotPatternParameters &p) {
    if (p.count < 1 || p.count > kMaxDots)
        throw Error(Status::kInvalidArgument,
                    fmt::format("count is {}, a pattern has 1 to {} dots", p.count, kMaxDots));
    if (!p.directions)
        throw Error(Status::kInvalidArgument,
                    fmt::format("directions is NULL; it must point to {} times u, v", p.count));
    check_positive(p.wavelength_m, "wavelength_m");
    check_pattern_image(p, false);
    for (std::uint64_t i = 0; i < p.count; ++i) {
        const double u = p.directions[2 * i], v = p.directions[2 * i + 1];
        if (!(u * u + v * v < 1))
            throw Error(Status::kInvalidArgument, fmt::format("directions[{}] = ({:g}, {:g}) are no direction cosines "
                                                              "within 90 degrees: u^2 + v^2 must be below 1",
                                                              i, u, v));
        if (p.powers)
            check_not_negative(p.powers[i], fmt::format("powers[{}]", i).c_str());
    }
}

} // namespace

std::shared_ptr<DoePattern> make_spot_pattern(const SpotPatternParameters &p) {
    check_spots(p);
    double total = 0;
    for (std::uint64_t i = 0; i < p.count; ++i)
        total += p.powers ? p.powers[i] : 1.0;
    if (!(total > 0))
        throw Error(Status::kInvalidArgument, "powers are all 0; at least one dot must have light");
    const BeamProfile beam(p.beam);
    const SpotShape spot = make_spot_shape(beam);
    auto result = std::make_shared<DoePatternResult>();
    DoePowerBudget &budget = result->budget;
    begin_power_budget(p, beam, spot.half_u_per_m * p.wavelength_m, spot.half_v_per_m * p.wavelength_m, budget);
    budget.dots = 1;

    const double texel_u = 2 * p.half_extent_x / p.image_width, texel_v = 2 * p.half_extent_y / p.image_height;
    const double node_x = spot.step_u_per_m * p.wavelength_m / texel_u,
                 node_y = spot.step_v_per_m * p.wavelength_m / texel_v;
    const double middle_x = 0.5 * (spot.nodes_x - 1), middle_y = 0.5 * (spot.nodes_y - 1);
    std::vector<float> shares(std::size_t{p.image_width} * p.image_height, 0.0f);
    std::vector<double> lower, upper;
    for (std::uint64_t i = 0; i < p.count; ++i) {
        const double share = (p.powers ? p.powers[i] : 1.0) / total;
        result->dot_shares.push_back(share);
        const double cx = p.directions[2 * i] / texel_u + 0.5 * p.image_width,
                     cy = p.directions[2 * i + 1] / texel_v + 0.5 * p.image_height;
        const auto first = [](double edge) { return static_cast<std::int64_t>(std::max(0.0, std::floor(edge))); };
        const auto end = [](double edge, std::uint32_t size) {
            return static_cast<std::int64_t>(std::min(double(size), std::ceil(edge)));
        };
        const std::int64_t x0 = first(cx - middle_x * node_x), x1 = end(cx + middle_x * node_x, p.image_width);
        const std::int64_t y0 = first(cy - middle_y * node_y), y1 = end(cy + middle_y * node_y, p.image_height);
        if (x1 <= x0 || y1 <= y0)
            continue;
        const auto row_of = [&](std::int64_t y, std::vector<double> &row) {
            row.clear();
            for (std::int64_t x = x0; x <= x1; ++x)
                row.push_back(
                    spot_sum(spot, (double(x) - cx) / node_x + middle_x, (double(y) - cy) / node_y + middle_y));
        };
        row_of(y0, lower);
        for (std::int64_t y = y0; y < y1; ++y) {
            row_of(y + 1, upper);
            for (std::size_t k = 0; k + 1 < upper.size(); ++k)
                shares[std::size_t(y) * p.image_width + std::size_t(x0) + k] +=
                    static_cast<float>(share * ((upper[k + 1] - upper[k]) - (lower[k + 1] - lower[k])));
            lower.swap(upper);
        }
    }
    finish_texels(std::move(shares), *result);
    return std::make_shared<DoePattern>(std::move(result), DoeSource::kComputed);
}

} // namespace clsp
