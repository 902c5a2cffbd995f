// Orders of a cell: what can be asked for, and where directions lie.
#include "doe/doe_orders.hpp"

#include "fft/fft.hpp"
#include "runtime/checks.hpp"
#include "stages/field_grid.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <unordered_map>

namespace clsp {
namespace {

constexpr double kLargestWeightRatio = 1e6;

std::uint64_t key_of(std::int32_t m, std::int32_t n) {
    return std::uint64_t{static_cast<std::uint32_t>(m)} << 32 | static_cast<std::uint32_t>(n);
}

using OrderIndex = std::unordered_map<std::uint64_t, std::size_t>;

void check_side(std::uint32_t side, const char *name) {
    if (side == 0 || side > kLargestDoeSide)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} is {}, a cell has 1 to {} pixels along each axis", name, side, kLargestDoeSide));
    std::uint32_t rest = side;
    for (std::uint32_t factor = 2; factor <= kLargestFftRadix; ++factor)
        while (rest % factor == 0)
            rest /= factor;
    if (rest != 1)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} is {}, which has a prime factor above {}; the next size that can be transformed is "
                                "{}",
                                name, side, kLargestFftRadix, fft_size_at_least(side)));
}

void check_cell(std::uint32_t width, std::uint32_t height, double pixel_pitch_m, double wavelength_m) {
    check_side(width, "width");
    check_side(height, "height");
    check_positive(pixel_pitch_m, "pixel_pitch_m");
    check_positive(wavelength_m, "wavelength_m");
}

OrderIndex check_orders(const DoeDesignParameters &p) {
    if (p.orders.empty())
        throw Error(Status::kInvalidArgument, "orders is empty; a design needs at least one order to send light to");
    if (p.orders.size() > kMostDoeOrders)
        throw Error(Status::kInvalidArgument,
                    fmt::format("there are {} orders, at most {} are taken", p.orders.size(), kMostDoeOrders));
    const double step_x = p.wavelength_m / (p.pixel_pitch_m * p.width),
                 step_y = p.wavelength_m / (p.pixel_pitch_m * p.height);
    double lightest = kLargestNumber, heaviest = 0.0;
    OrderIndex index;
    for (std::size_t k = 0; k < p.orders.size(); ++k) {
        const DoeOrder &order = p.orders[k];
        const std::string name = fmt::format("orders[{}] ({}, {})", k, order.m, order.n);
        if (!(order.weight > 0.0 && order.weight <= kLargestNumber))
            throw Error(Status::kInvalidArgument,
                        fmt::format("the weight of {} is {}, it must be above 0 and at most {}; leave out orders that "
                                    "are not wanted",
                                    name, order.weight, kLargestNumber));
        lightest = std::min(lightest, order.weight);
        heaviest = std::max(heaviest, order.weight);
        const auto outside = [](std::int32_t value, std::uint32_t side) {
            return 2 * std::abs(std::int64_t{value}) >= std::int64_t{side} && value != 0;
        };
        if (outside(order.m, p.width) || outside(order.n, p.height))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} lies outside of what {} x {} pixels can tell apart: |m| must be below {} and "
                                    "|n| below {}; take smaller pixels or a smaller field of view",
                                    name, p.width, p.height, (p.width + 1) / 2, (p.height + 1) / 2));
        const double u = order.m * step_x, v = order.n * step_y;
        if (u * u + v * v >= 1.0)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} would leave at direction cosines ({:.4g}, {:.4g}), beyond 90 degrees: such an "
                                    "order does not propagate at this pitch and wavelength",
                                    name, u, v));
        const auto [found, added] = index.emplace(key_of(order.m, order.n), k);
        if (!added)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} is in the list twice, also as orders[{}]: two dots in one order are closer "
                                    "than the diffraction limit; add their weights, or take a larger cell",
                                    name, found->second));
    }
    if (heaviest > kLargestWeightRatio * lightest)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the weights go from {:.3g} to {:.3g}; the largest may be {:g} times the smallest, or the "
                        "weak orders drown in the light that goes elsewhere",
                        lightest, heaviest, kLargestWeightRatio));
    return index;
}

// Two dots of a beam of diameter D are apart (Rayleigh) from 1.22 wavelength / D on.
void check_beam(const DoeDesignParameters &p, const OrderIndex &index) {
    check_not_negative(p.beam_diameter_m, "beam_diameter_m");
    if (p.beam_diameter_m == 0.0)
        return;
    const double period = p.pixel_pitch_m * std::max(p.width, p.height);
    if (period > p.beam_diameter_m)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the cell is {:.4g} m long, longer than the beam (beam_diameter_m is {:.4g}): its orders "
                        "would not be separate dots; widen the beam or take a smaller cell",
                        period, p.beam_diameter_m));
    const double limit = 1.22 * p.wavelength_m / p.beam_diameter_m;
    const double step_x = p.wavelength_m / (p.pixel_pitch_m * p.width),
                 step_y = p.wavelength_m / (p.pixel_pitch_m * p.height);
    const auto reach_x = static_cast<std::int64_t>(std::min(limit / step_x, double(p.width))),
               reach_y = static_cast<std::int64_t>(std::min(limit / step_y, double(p.height)));
    for (std::size_t k = 0; k < p.orders.size(); ++k)
        for (std::int64_t dy = -reach_y; dy <= reach_y; ++dy)
            for (std::int64_t dx = -reach_x; dx <= reach_x; ++dx) {
                const double distance = std::hypot(double(dx) * step_x, double(dy) * step_y);
                if ((dx == 0 && dy == 0) || distance >= limit * (1.0 - 1e-9))
                    continue;
                const auto found = index.find(key_of(static_cast<std::int32_t>(p.orders[k].m + dx),
                                                     static_cast<std::int32_t>(p.orders[k].n + dy)));
                if (found != index.end())
                    throw Error(Status::kInvalidArgument,
                                fmt::format("orders[{}] ({}, {}) and orders[{}] are {:.4g} apart in direction cosines, "
                                            "closer than the diffraction limit of a beam of {} m (1.22 wavelength / "
                                            "beam_diameter_m = {:.4g}); widen the beam or the spacing",
                                            k, p.orders[k].m, p.orders[k].n, found->second, distance, p.beam_diameter_m,
                                            limit));
            }
}

// A real transmission has |A(-m, -n)| = |A(m, n)|.
void check_mirror(DoeDesignParameters &p, OrderIndex index) {
    const std::size_t count = p.orders.size();
    for (std::size_t k = 0; k < count; ++k) {
        const DoeOrder order = p.orders[k];
        const auto found = index.find(key_of(-order.m, -order.n));
        if (found != index.end()) {
            if (p.orders[found->second].weight != order.weight)
                throw Error(
                    Status::kInvalidArgument,
                    fmt::format("orders[{}] ({}, {}) has the weight {}, its mirror image {}: with 2 levels both "
                                "get the same power; give them the same weight, or take more levels",
                                k, order.m, order.n, order.weight, p.orders[found->second].weight));
            continue;
        }
        if (!p.mirror_orders)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("orders[{}] ({}, {}) has no mirror image ({}, {}) in the list: with 2 levels the "
                            "transmission is real, and every order has a twin of the same power at the opposite "
                            "side; set mirror_orders to add the twins, or take more than 2 levels",
                            k, order.m, order.n, -order.m, -order.n));
        index.emplace(key_of(-order.m, -order.n), p.orders.size());
        p.orders.push_back({-order.m, -order.n, order.weight});
    }
    if (p.orders.size() > kMostDoeOrders)
        throw Error(Status::kInvalidArgument,
                    fmt::format("with mirror images there are {} orders, at most {} are taken", p.orders.size(),
                                kMostDoeOrders));
}

} // namespace

double doe_envelope(std::int32_t m, std::int32_t n, std::uint32_t width, std::uint32_t height) {
    const auto sinc = [](double x) { return x == 0.0 ? 1.0 : std::sin(M_PI * x) / (M_PI * x); };
    return sinc(double(m) / width) * sinc(double(n) / height);
}

DoeDesignParameters checked_doe_parameters(DoeDesignParameters p) {
    check_cell(p.width, p.height, p.pixel_pitch_m, p.wavelength_m);
    if (p.levels == 1 || p.levels > kLargestDoeLevels)
        throw Error(Status::kInvalidArgument,
                    fmt::format("levels is {}, it must be 0 (continuous) or 2 to {}", p.levels, kLargestDoeLevels));
    const double most_feedback = p.rule == DoeRule::kAdaptive ? 0.99 : 2.0;
    if (!(p.feedback >= 0.0 && p.feedback <= most_feedback))
        throw Error(
            Status::kInvalidArgument,
            fmt::format("feedback is {}, with this rule it must be 0 (its default) to {}", p.feedback, most_feedback));
    const auto iterations = [](std::uint32_t value, std::uint32_t least, const char *name) {
        if (value < least || value > kLargestDoeIterations)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} is {}, it must be {} to {}", name, value, least, kLargestDoeIterations));
    };
    iterations(p.iterations, 1, "iterations");
    iterations(p.quantization_iterations, p.levels == 0 ? 0 : 1, "quantization_iterations");
    iterations(p.fix_phase_iteration, 1, "fix_phase_iteration");
    iterations(p.search_sweeps, 0, "search_sweeps");
    if (p.levels == 0 && p.search_sweeps > 0)
        throw Error(Status::kInvalidArgument,
                    fmt::format("search_sweeps is {}, but levels is 0: a search goes through levels; set levels to 2 "
                                "or more, or search_sweeps to 0",
                                p.search_sweeps));
    const OrderIndex index = check_orders(p);
    if (p.levels == 2)
        check_mirror(p, index);
    else if (p.mirror_orders)
        throw Error(Status::kInvalidArgument,
                    fmt::format("mirror_orders is set, but levels is {}: only 2 levels have twin orders; list the "
                                "mirrored orders if you want them",
                                p.levels));
    OrderIndex complete;
    for (std::size_t k = 0; k < p.orders.size(); ++k)
        complete.emplace(key_of(p.orders[k].m, p.orders[k].n), k);
    check_beam(p, complete);
    return p;
}

SnappedOrders snap_directions(const std::vector<double> &directions, std::uint32_t width, std::uint32_t height,
                              double pixel_pitch_m, double wavelength_m) {
    check_cell(width, height, pixel_pitch_m, wavelength_m);
    const double step_x = wavelength_m / (pixel_pitch_m * width), step_y = wavelength_m / (pixel_pitch_m * height);
    SnappedOrders snapped;
    OrderIndex index;
    for (std::size_t k = 0; k < directions.size() / 2; ++k) {
        const double u = directions[2 * k], v = directions[2 * k + 1];
        if (!(u * u + v * v < 1.0)) // also NaN
            throw Error(Status::kInvalidArgument,
                        fmt::format("directions[{}] is ({}, {}): direction cosines of a beam have u^2 + v^2 below 1 "
                                    "(beyond 90 degrees nothing propagates)",
                                    k, u, v));
        const double m = std::nearbyint(u / step_x), n = std::nearbyint(v / step_y);
        if ((2 * std::abs(m) >= width && m != 0) || (2 * std::abs(n) >= height && n != 0))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("directions[{}], ({:.6g}, {:.6g}), is order ({}, {}), outside of what {} x {} "
                            "pixels of {} m can do: they reach direction cosines of {:.4g}; take smaller pixels",
                            k, u, v, m, n, width, height, pixel_pitch_m, 0.5 * wavelength_m / pixel_pitch_m));
        const auto order_m = static_cast<std::int32_t>(m), order_n = static_cast<std::int32_t>(n);
        const auto [found, added] = index.emplace(key_of(order_m, order_n), k);
        if (!added)
            throw Error(Status::kInvalidArgument,
                        fmt::format("directions[{}] and directions[{}] are both nearest to order ({}, {}): they are "
                                    "closer than the cell's orders are ({:.4g} x {:.4g}); take a cell of more pixels",
                                    found->second, k, order_m, order_n, step_x, step_y));
        snapped.orders.push_back({order_m, order_n, 1.0});
        snapped.errors.push_back(std::hypot(u - m * step_x, v - n * step_y));
    }
    return snapped;
}

} // namespace clsp
