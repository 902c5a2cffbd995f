#include "doe/dot_layout.hpp"

#include "doe/dot_neighborhoods.hpp"
#include "runtime/checks.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <optional>

namespace clsp {
namespace {

constexpr double kQuarterTurn = 1.5707963267948966; // in radians
// The densest packing of discs, and how much of the least distance that just fits the automatic one takes.
constexpr double kHexagonal = 1.0745699318235418;
constexpr double kCloser = 0.95;
constexpr int kBisections = 12;
// Shares of the progress: finding places, comparing neighbourhoods for the first time.
constexpr double kPlacing = 0.3, kCompared = 0.5;
// Places that are tried between two words to whoever waits.
constexpr std::uint64_t kTellEvery = 1 << 16;
// Darts for each dot before a free layout counts as full.
constexpr std::uint64_t kDartsPerDot = 60;

struct Region {
    double u = 0, v = 0;           // half extents, in direction cosines
    double step_u = 0, step_v = 0; // of the lattice; 0: free
    std::int32_t m = 0, n = 0;     // largest orders

    double area() const { return 4.0 * u * v; }
};

// What is drawn: Philox blocks one after the other, their purpose in the second counter word.
class Source {
  public:
    Source(std::uint64_t seed, std::uint32_t purpose) : seed_(seed), purpose_(purpose) {}
    std::array<std::uint32_t, 4> next() {
        const auto block = host_block(seed_, {static_cast<std::uint32_t>(index_), purpose_,
                                              static_cast<std::uint32_t>(index_ >> 32), kStreamDotLayout});
        ++index_;
        return block;
    }
    // 0 ... below - 1; the remainder's bias is below 2^-40 for what is drawn here.
    std::uint64_t below(std::uint64_t limit) {
        const auto block = next();
        return (std::uint64_t{block[0]} << 32 | block[1]) % limit;
    }

  private:
    std::uint64_t seed_, index_ = 0;
    std::uint32_t purpose_;
};

Region checked_region(const DotLayoutParameters &p) {
    if (p.count == 0 || p.count > kMostLayoutDots)
        throw Error(Status::kInvalidArgument, fmt::format("count is {}, it must be 1 to {}", p.count, kMostLayoutDots));
    check_positive(p.wavelength_m, "wavelength_m");
    for (const auto &[angle, name] :
         {std::pair{p.half_angle_x_rad, "half_angle_x_rad"}, std::pair{p.half_angle_y_rad, "half_angle_y_rad"}})
        if (!(angle > 0.0 && angle < kQuarterTurn))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{} is {}, it must be above 0 and below 90 degrees (pi / 2)", name, angle));
    Region region;
    region.u = std::sin(p.half_angle_x_rad);
    region.v = std::sin(p.half_angle_y_rad);
    if (region.u * region.u + region.v * region.v >= 1.0)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the corners of the field of view, at direction cosines ({:.4g}, {:.4g}), lie beyond 90 "
                        "degrees; take smaller angles",
                        region.u, region.v));
    if (p.lattice) {
        if (p.width == 0 || p.height == 0 || p.width > 8192 || p.height > 8192)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the cell is {} x {} pixels, it must be 1 to 8192 along each axis", p.width, p.height));
        check_positive(p.pixel_pitch_m, "pixel_pitch_m");
        region.step_u = p.wavelength_m / (p.pixel_pitch_m * p.width);
        region.step_v = p.wavelength_m / (p.pixel_pitch_m * p.height);
        const double m = std::floor(region.u / region.step_u * (1 + 1e-12)),
                     n = std::floor(region.v / region.step_v * (1 + 1e-12));
        if (2 * m >= p.width || 2 * n >= p.height)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the field of view reaches direction cosines of ({:.4g}, {:.4g}), pixels of {} m only "
                            "{:.4g}; take smaller pixels or angles",
                            region.u, region.v, p.pixel_pitch_m, 0.5 * p.wavelength_m / p.pixel_pitch_m));
        region.m = static_cast<std::int32_t>(m);
        region.n = static_cast<std::int32_t>(n);
        const std::uint64_t places = (2 * std::uint64_t(region.m) + 1) * (2 * std::uint64_t(region.n) + 1);
        if (places < p.count)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("count is {}, but the cell has only {} orders within the field of view; take a cell "
                            "of more pixels",
                            p.count, places));
    }
    return region;
}

void check_measure(const DotLayoutParameters &p) {
    check_not_negative(p.min_distance, "min_distance");
    check_not_negative(p.beam_diameter_m, "beam_diameter_m");
    check_not_negative(p.row_half_height, "row_half_height");
    check_not_negative(p.neighborhood_radius, "neighborhood_radius");
    check_not_negative(p.tolerance, "tolerance");
    check_fraction(p.min_difference, "min_difference");
    if (p.min_distance > 0.0 && p.beam_diameter_m > 0.0 && p.min_distance < 1.22 * p.wavelength_m / p.beam_diameter_m)
        throw Error(Status::kInvalidArgument,
                    fmt::format("min_distance is {}, below the diffraction limit of a beam of {} m (1.22 wavelength / "
                                "diameter = {:.4g}): such dots are one; widen the beam or the distance",
                                p.min_distance, p.beam_diameter_m, 1.22 * p.wavelength_m / p.beam_diameter_m));
}

using Directions = std::vector<Direction>;

// Dots one after the other at random places, each kept if it is far enough from those before; random sequential
// adsorption. Fewer than wanted: no more were found. `tell` hears of it now and then.
Directions draw(const DotLayoutParameters &p, const Region &region, double distance,
                const std::function<void()> &tell) {
    Directions dots;
    DirectionGrid grid(region.u, region.v, distance);
    const auto put = [&](Direction d) {
        const bool is_centre = d.u == 0.0 && d.v == 0.0;
        if (!grid.free(dots, d, distance))
            return;
        if (p.point_symmetric && !is_centre) {
            if (dots.size() + 2 > p.count || 2.0 * std::hypot(d.u, d.v) < distance)
                return;
            grid.add(dots, d);
            d = {-d.u, -d.v};
        }
        grid.add(dots, d);
    };
    if (p.point_symmetric && p.count % 2 == 1)
        put({0.0, 0.0});
    Source source(p.seed, 0);
    if (region.step_u > 0.0) {
        const auto columns = 2 * std::uint64_t(region.m) + 1, rows = 2 * std::uint64_t(region.n) + 1;
        std::vector<std::uint32_t> places(columns * rows);
        for (std::size_t i = 0; i < places.size(); ++i)
            places[i] = static_cast<std::uint32_t>(i);
        for (std::size_t left = places.size(); left > 0 && dots.size() < p.count; --left) {
            if (left % kTellEvery == 0)
                tell();
            const std::size_t pick = source.below(left);
            const std::uint32_t place = places[pick];
            std::swap(places[pick], places[left - 1]);
            const auto m = std::int32_t(place % columns) - region.m, n = std::int32_t(place / columns) - region.n;
            if (!(p.point_symmetric && m == 0 && n == 0))
                put({m * region.step_u, n * region.step_v});
        }
    } else {
        for (std::uint64_t dart = 0; dart < kDartsPerDot * p.count && dots.size() < p.count; ++dart) {
            if (dart % kTellEvery == 0)
                tell();
            const auto block = source.next();
            put({region.u * ((block[0] + 0.5) * 0x1p-31 - 1.0), region.v * ((block[1] + 0.5) * 0x1p-31 - 1.0)});
        }
    }
    return dots;
}

Directions place(const DotLayoutParameters &p, const Region &region, double &distance);

// Nearly the largest distance at which all dots find a place, in four digits.
double possible_distance(DotLayoutParameters p, const Region &region) {
    p.min_distance = p.beam_diameter_m = 0.0;
    double distance = 0.0;
    place(p, region, distance);
    for (;; distance *= kCloser) {
        const double told = std::stod(fmt::format("{:.3e}", distance));
        if (draw(p, region, told, [] {}).size() == p.count)
            return told;
    }
}

// Dots at the distance asked for, or nearly at the largest that gives so many.
Directions place(const DotLayoutParameters &p, const Region &region, double &distance) {
    if (p.min_distance > 0.0) {
        distance = p.min_distance;
        Directions dots = draw(p, region, distance, [&] { report_progress(p.progress, "placing the dots", 0.0); });
        if (dots.size() < p.count)
            throw Error(
                Status::kInvalidArgument,
                fmt::format("only {} of {} dots find a place at a min_distance of {:.4g}; take {:.4g}, which is "
                            "possible here, or 0 to have it chosen",
                            dots.size(), p.count, p.min_distance, possible_distance(p, region)));
        return dots;
    }
    const double least = p.beam_diameter_m > 0.0 ? 1.22 * p.wavelength_m / p.beam_diameter_m : 0.0;
    double low = 0.0, high = kHexagonal * std::sqrt(region.area() / double(p.count));
    int step = 0;
    const auto tell = [&] {
        report_progress(p.progress, "looking for the largest distance", kPlacing * step / (kBisections + 1));
    };
    for (; step < kBisections; ++step) {
        tell();
        const double middle = 0.5 * (low + high);
        (draw(p, region, middle, tell).size() == p.count ? low : high) = middle;
    }
    distance = low * kCloser;
    if (distance < least)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("{} dots in this field of view are {:.4g} apart, below the diffraction limit {:.4g} of a "
                        "beam of {} m: widen the beam or the field of view",
                        p.count, distance, least, p.beam_diameter_m));
    Directions dots = draw(p, region, distance, tell);
    if (dots.size() < p.count) // where a smaller distance happens to hold fewer
        dots = draw(p, region, distance = low, tell);
    if (dots.size() < p.count)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} dots do not fit: {} found a place", p.count, dots.size()));
    return dots;
}

// Another place for a dot, near its own; the twin of a symmetric layout goes along. False: none was found.
bool move(const DotLayoutParameters &p, const Region &region, double distance, std::size_t i, Source &source,
          Directions &dots) {
    constexpr int kTries = 64;
    const auto twin = [&]() -> std::optional<std::size_t> {
        for (std::size_t j = 0; j < dots.size(); ++j)
            if (dots[j].u == -dots[i].u && dots[j].v == -dots[i].v)
                return j;
        return std::nullopt;
    };
    const std::optional<std::size_t> other = p.point_symmetric ? twin() : std::nullopt;
    if (other && *other == i)
        return false; // the centre stays
    const auto free = [&](const Direction &d) {
        for (std::size_t j = 0; j < dots.size(); ++j)
            if (j != i && !(other && j == *other) &&
                std::hypot(dots[j].u - d.u, dots[j].v - d.v) < distance * (1 - 1e-12))
                return false;
        return !other || 2.0 * std::hypot(d.u, d.v) >= distance;
    };
    for (int attempt = 0; attempt < kTries; ++attempt) {
        const auto block = source.next();
        const double reach = 3.0 * distance;
        Direction d{dots[i].u + reach * (block[0] * 0x1p-31 - 1.0), dots[i].v + reach * (block[1] * 0x1p-31 - 1.0)};
        if (region.step_u > 0.0)
            d = {std::nearbyint(d.u / region.step_u) * region.step_u,
                 std::nearbyint(d.v / region.step_v) * region.step_v};
        if (std::abs(d.u) > region.u || std::abs(d.v) > region.v || (d.u == dots[i].u && d.v == dots[i].v) || !free(d))
            continue;
        dots[i] = d;
        if (other)
            dots[*other] = {-d.u, -d.v};
        return true;
    }
    return false;
}

} // namespace

DotLayout make_dot_layout(const DotLayoutParameters &p) {
    const Region region = checked_region(p);
    check_measure(p);
    DotLayout layout;
    Directions dots = place(p, region, layout.min_distance);
    layout.mean_spacing = std::sqrt(region.area() / double(p.count));
    layout.row_half_height = p.row_half_height > 0.0 ? p.row_half_height : 0.5 * layout.min_distance;
    layout.neighborhood_radius = p.neighborhood_radius > 0.0 ? p.neighborhood_radius : 3.0 * layout.mean_spacing;
    layout.tolerance = p.tolerance > 0.0 ? p.tolerance : 0.25 * layout.min_distance;
    // A neighbour has at most one partner only if two partners would be closer than dots are.
    if (2.0 * layout.tolerance > layout.min_distance && p.count > 1)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("tolerance is {:.4g}, it must be at most half of the least distance between dots ({:.4g})",
                        layout.tolerance, layout.min_distance));
    const NeighborhoodRules rules{layout.row_half_height, layout.neighborhood_radius, layout.tolerance};
    Source source(p.seed, 1);
    NeighborhoodMeasure measure = measure_neighborhoods(dots, rules, p.min_difference, [&](double part) {
        report_progress(p.progress, "comparing neighbourhoods", kPlacing + (kCompared - kPlacing) * part);
    });
    for (std::uint32_t round = 0; round < p.repair_rounds && !measure.alike.empty(); ++round) {
        // Most layouts need few rounds.
        const auto tell = [&](double part) {
            report_progress(p.progress,
                            fmt::format("round {} of at most {}: moving {} pairs of alike dots", round + 1,
                                        p.repair_rounds, measure.alike.size()),
                            1.0 - (1.0 - kCompared) * std::pow(0.5, round + part));
        };
        tell(0.0);
        std::vector<bool> touched(dots.size());
        for (const auto &[i, j] : measure.alike) {
            if (touched[i] || touched[j])
                continue; // of the pairs that a dot is in, one is repaired in a round
            const std::size_t first = source.below(2) ? i : j, second = first == i ? j : i;
            if (move(p, region, layout.min_distance, first, source, dots) ||
                move(p, region, layout.min_distance, second, source, dots))
                ++layout.moved;
            touched[i] = touched[j] = true;
        }
        measure = measure_neighborhoods(dots, rules, p.min_difference, tell);
    }
    if (!measure.alike.empty())
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} pairs of dots in the same row still look alike (the least difference of their "
                                "neighbourhoods is {:.3g}, min_difference {:.3g}) after {} rounds of moving dots; take "
                                "a cell of more pixels, a "
                                "larger neighborhood_radius, a smaller min_difference or another seed",
                                measure.alike.size(), measure.least, p.min_difference, p.repair_rounds));
    layout.min_difference = measure.least;
    layout.mean_difference = measure.mean;
    layout.mean_neighbors = measure.mean_neighbors;
    layout.worst_first = measure.first;
    layout.worst_second = measure.second;
    layout.pairs = measure.pairs;
    for (const Direction &d : dots) {
        layout.directions.push_back(d.u);
        layout.directions.push_back(d.v);
        if (p.lattice) {
            layout.orders.push_back(static_cast<std::int32_t>(std::lround(d.u / region.step_u)));
            layout.orders.push_back(static_cast<std::int32_t>(std::lround(d.v / region.step_v)));
        }
    }
    return layout;
}

} // namespace clsp
