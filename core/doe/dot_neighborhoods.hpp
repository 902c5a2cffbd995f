// Dots by place, and how much their neighbourhoods differ.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

namespace clsp {

struct Direction {
    double u, v;
};

// Dots in squares, to find those near a place.
class DirectionGrid {
  public:
    // half_u, half_v: where dots are; side: of a square.
    DirectionGrid(double half_u, double half_v, double side);
    void add(std::vector<Direction> &dots, const Direction &dot);
    // No dot is nearer than `distance`.
    bool free(const std::vector<Direction> &dots, const Direction &place, double distance) const;
    // Calls visit(index) for every dot of the squares within reach.
    template <typename Visit> void near(const Direction &place, double reach, Visit visit) const {
        const std::int64_t x0 = column(place.u - reach), x1 = column(place.u + reach), y0 = row(place.v - reach),
                           y1 = row(place.v + reach);
        for (std::int64_t y = y0; y <= y1; ++y)
            for (std::int64_t x = x0; x <= x1; ++x)
                for (const std::uint32_t i : squares_[static_cast<std::size_t>(y * columns_ + x)])
                    visit(i);
    }

  private:
    std::int64_t column(double u) const;
    std::int64_t row(double v) const;

    double half_u_, half_v_, side_;
    std::int64_t columns_, rows_;
    std::vector<std::vector<std::uint32_t>> squares_;
};

struct NeighborhoodRules {
    double row_half_height; // dots of a pair: at most so far apart in v
    double radius;          // of a neighbourhood
    double tolerance;       // neighbours within this are the same
};

struct NeighborhoodMeasure {
    double least = 1.0, mean = 1.0, mean_neighbors = 0.0;
    std::size_t first = 0, second = 0; // the pair of the least difference
    std::uint64_t pairs = 0;
    std::vector<std::pair<std::size_t, std::size_t>> alike; // pairs whose difference is below the wanted one
};

// difference(i, j) = 1 - 2 matches / (neighbours of i + neighbours of j), over all pairs of a row band. `tell` hears
// now and then which part of the dots is done.
NeighborhoodMeasure measure_neighborhoods(const std::vector<Direction> &dots, const NeighborhoodRules &rules,
                                          double wanted, const std::function<void(double)> &tell);

} // namespace clsp
