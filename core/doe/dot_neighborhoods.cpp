#include "doe/dot_neighborhoods.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <numeric>

namespace clsp {
namespace {

// Squares of the grid along an axis; few dots do not need many.
constexpr double kMostSquares = 2048.0;
// Dots between two words to whoever waits.
constexpr std::size_t kDotsBetweenReports = 256;
// Neighbours of all dots that are kept at once: 800 MB.
constexpr double kMostNeighbors = 5e7;

// Sorted by u, so that partners are found by walking along both lists.
using Neighborhood = std::vector<Direction>;

std::size_t matches(const Neighborhood &a, const Neighborhood &b, double tolerance) {
    std::size_t count = 0, start = 0;
    const double limit = tolerance * tolerance;
    for (const Direction &p : a) {
        while (start < b.size() && b[start].u < p.u - tolerance)
            ++start;
        for (std::size_t k = start; k < b.size() && b[k].u <= p.u + tolerance; ++k) {
            const double du = b[k].u - p.u, dv = b[k].v - p.v;
            if (du * du + dv * dv <= limit) {
                ++count;
                break;
            }
        }
    }
    return count;
}

} // namespace

DirectionGrid::DirectionGrid(double half_u, double half_v, double side)
    : half_u_(half_u), half_v_(half_v), side_(std::max(side, 2.0 * std::max(half_u, half_v) / kMostSquares)),
      columns_(static_cast<std::int64_t>(2.0 * half_u / side_) + 1),
      rows_(static_cast<std::int64_t>(2.0 * half_v / side_) + 1), squares_(static_cast<std::size_t>(columns_ * rows_)) {
}

std::int64_t DirectionGrid::column(double u) const {
    return std::clamp(static_cast<std::int64_t>(std::floor((u + half_u_) / side_)), std::int64_t{0}, columns_ - 1);
}

std::int64_t DirectionGrid::row(double v) const {
    return std::clamp(static_cast<std::int64_t>(std::floor((v + half_v_) / side_)), std::int64_t{0}, rows_ - 1);
}

void DirectionGrid::add(std::vector<Direction> &dots, const Direction &dot) {
    squares_[static_cast<std::size_t>(row(dot.v) * columns_ + column(dot.u))].push_back(
        static_cast<std::uint32_t>(dots.size()));
    dots.push_back(dot);
}

bool DirectionGrid::free(const std::vector<Direction> &dots, const Direction &place, double distance) const {
    bool result = true;
    near(place, distance, [&](std::uint32_t i) {
        const double distance_i = std::hypot(dots[i].u - place.u, dots[i].v - place.v);
        if (distance_i < distance * (1 - 1e-12) || distance_i == 0.0)
            result = false;
    });
    return result;
}

NeighborhoodMeasure measure_neighborhoods(const std::vector<Direction> &dots, const NeighborhoodRules &rules,
                                          double wanted, const std::function<void(double)> &tell) {
    double half_u = 0.0, half_v = 0.0;
    for (const Direction &d : dots) {
        half_u = std::max(half_u, std::abs(d.u));
        half_v = std::max(half_v, std::abs(d.v));
    }
    const double count = double(dots.size()), area = std::max(4.0 * half_u * half_v, 1e-24);
    const double neighbors = count * std::min(count, count * M_PI * rules.radius * rules.radius / area);
    if (neighbors > kMostNeighbors)
        throw Error(Status::kInvalidArgument,
                    fmt::format("within neighborhood_radius {:g} {} dots have some {:.1e} neighbours together, at most "
                                "{:.0e} are compared; take a smaller radius, some three times the dots' spacing",
                                rules.radius, dots.size(), neighbors, kMostNeighbors));
    DirectionGrid grid(std::max(half_u, 1e-12), std::max(half_v, 1e-12), rules.radius);
    std::vector<Direction> placed;
    placed.reserve(dots.size());
    for (const Direction &d : dots)
        grid.add(placed, d);
    NeighborhoodMeasure measure;
    std::vector<Neighborhood> neighborhoods(dots.size());
    for (std::size_t i = 0; i < dots.size(); ++i) {
        grid.near(dots[i], rules.radius, [&](std::uint32_t j) {
            const Direction offset{dots[j].u - dots[i].u, dots[j].v - dots[i].v};
            if (j != i && std::hypot(offset.u, offset.v) <= rules.radius)
                neighborhoods[i].push_back(offset);
        });
        std::sort(neighborhoods[i].begin(), neighborhoods[i].end(),
                  [](const Direction &a, const Direction &b) { return a.u < b.u || (a.u == b.u && a.v < b.v); });
        measure.mean_neighbors += double(neighborhoods[i].size()) / double(dots.size());
    }
    std::vector<std::size_t> by_row(dots.size());
    std::iota(by_row.begin(), by_row.end(), std::size_t{0});
    std::sort(by_row.begin(), by_row.end(),
              [&](std::size_t a, std::size_t b) { return dots[a].v < dots[b].v || (dots[a].v == dots[b].v && a < b); });
    double sum = 0.0;
    for (std::size_t a = 0; a < by_row.size(); ++a) {
        if (a % kDotsBetweenReports == 0)
            tell(double(a) / double(by_row.size()));
        for (std::size_t b = a + 1; b < by_row.size(); ++b) {
            const std::size_t i = by_row[a], j = by_row[b];
            if (dots[j].v - dots[i].v > rules.row_half_height * (1 + 1e-9))
                break;
            const double both = double(neighborhoods[i].size() + neighborhoods[j].size());
            const double difference =
                both > 0.0 ? 1.0 - 2.0 * double(matches(neighborhoods[i], neighborhoods[j], rules.tolerance)) / both
                           : 0.0;
            sum += difference;
            ++measure.pairs;
            if (difference < wanted)
                measure.alike.emplace_back(i, j);
            if (difference < measure.least) {
                measure.least = difference;
                measure.first = i;
                measure.second = j;
            }
        }
    }
    if (measure.pairs > 0)
        measure.mean = sum / double(measure.pairs);
    return measure;
}

} // namespace clsp
