// Points that dots define: neighbours, cell centres, half ways, mirrored positions.
#include "statistics/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace clsp::statistics {

namespace {

using Point = std::array<double, 2>;

bool is_inside(const Geometry &geometry, const Point &point, double margin) {
    return point[0] >= margin && point[1] >= margin && point[0] <= double(geometry.width - 1) - margin &&
           point[1] <= double(geometry.height - 1) - margin;
}

float distance_at(const Geometry &geometry, const DotGeometry &dots, const Point &point) {
    return dots.distance[std::size_t(std::lround(point[1])) * geometry.width + std::size_t(std::lround(point[0]))];
}

// Dots sorted by row band, so that neighbours are looked for nearby only.
std::vector<double> nearest_distances(const std::vector<Point> &positions, double limit,
                                      std::vector<std::array<std::size_t, 2>> *pairs) {
    std::vector<std::size_t> order(positions.size());
    for (std::size_t i = 0; i < order.size(); ++i)
        order[i] = i;
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return positions[a][1] != positions[b][1] ? positions[a][1] < positions[b][1] : a < b;
    });
    std::vector<double> nearest(positions.size(), limit);
    for (std::size_t i = 0; i < order.size(); ++i)
        for (std::size_t j = i + 1; j < order.size(); ++j) {
            const Point &a = positions[order[i]], &b = positions[order[j]];
            if (b[1] - a[1] > limit)
                break;
            const double distance = std::hypot(b[0] - a[0], b[1] - a[1]);
            if (distance > limit)
                continue;
            nearest[order[i]] = std::min(nearest[order[i]], distance);
            nearest[order[j]] = std::min(nearest[order[j]], distance);
            if (pairs)
                pairs->push_back({order[i], order[j]});
        }
    return nearest;
}

// Pixels whose distance from the nearest dot is a local maximum: the centres of the lattice's cells.
std::vector<Point> find_cell_centres(const Geometry &geometry, const DotGeometry &dots, double cap) {
    std::vector<Point> centres;
    const std::size_t margin = std::size_t(std::ceil(2.0 * dots.sigma));
    if (geometry.width <= 2 * margin + 2 || geometry.height <= 2 * margin + 2)
        return centres;
    const std::ptrdiff_t width = std::ptrdiff_t(geometry.width);
    for (std::size_t y = margin + 1; y + margin + 1 < geometry.height; ++y)
        for (std::size_t x = margin + 1; x + margin + 1 < geometry.width; ++x) {
            const std::size_t pixel = y * geometry.width + x;
            const float own = dots.distance[pixel];
            if (own < 2.5 * dots.sigma || double(own) >= cap)
                continue;
            bool is_maximum = true;
            for (std::ptrdiff_t dy = -1; dy <= 1 && is_maximum; ++dy)
                for (std::ptrdiff_t dx = -1; dx <= 1 && is_maximum; ++dx) {
                    const float other = dots.distance[std::size_t(std::ptrdiff_t(pixel) + dy * width + dx)];
                    const bool is_earlier = dy < 0 || (dy == 0 && dx < 0);
                    is_maximum = is_earlier ? own > other : own >= other;
                }
            if (is_maximum)
                centres.push_back({double(x), double(y)});
        }
    return centres;
}

} // namespace

DotGeometry make_dot_geometry(const Geometry &geometry, const CaptureDots &layout) {
    DotGeometry dots;
    dots.sigma = layout.sigma_px;
    dots.positions = layout.positions_px;

    const double area = double(geometry.pixels) / double(dots.positions.size());
    const double limit = 3.0 * std::sqrt(area);
    std::vector<std::array<std::size_t, 2>> pairs;
    const std::vector<double> nearest = nearest_distances(dots.positions, limit, &pairs);
    for (const double distance : nearest) {
        dots.spacing += distance / double(nearest.size());
        dots.cell_radius.push_back(std::clamp(0.5 * distance, dots.sigma, 5.0 * dots.sigma));
    }
    for (const auto &[i, j] : pairs) {
        const Point &a = dots.positions[i], &b = dots.positions[j];
        const double distance = std::hypot(b[0] - a[0], b[1] - a[1]);
        const Point middle{0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])};
        if (distance < 1.35 * std::min(nearest[i], nearest[j]) && distance > 4.0 * dots.sigma &&
            is_inside(geometry, middle, 2.0 * dots.sigma))
            dots.half_ways.push_back(middle);
    }

    const double cap = std::max(8.0 * dots.sigma, 1.5 * dots.spacing);
    dots.distance.assign(geometry.pixels, float(cap));
    for (const Point &dot : dots.positions) {
        const std::ptrdiff_t left = std::max<std::ptrdiff_t>(0, std::ptrdiff_t(std::ceil(dot[0] - cap)));
        const std::ptrdiff_t right =
            std::min<std::ptrdiff_t>(std::ptrdiff_t(geometry.width) - 1, std::ptrdiff_t(dot[0] + cap));
        const std::ptrdiff_t top = std::max<std::ptrdiff_t>(0, std::ptrdiff_t(std::ceil(dot[1] - cap)));
        const std::ptrdiff_t bottom =
            std::min<std::ptrdiff_t>(std::ptrdiff_t(geometry.height) - 1, std::ptrdiff_t(dot[1] + cap));
        for (std::ptrdiff_t y = top; y <= bottom; ++y)
            for (std::ptrdiff_t x = left; x <= right; ++x) {
                float &value = dots.distance[std::size_t(y) * geometry.width + std::size_t(x)];
                value = std::min(value, float(std::hypot(double(x) - dot[0], double(y) - dot[1])));
            }
    }

    // Far from every dot: four widths, or the farthest twelfth of the pixels of a dense lattice. Not where dots beyond
    // the border, which nobody knows, may shed light of their own.
    const auto margin =
        std::size_t(std::ceil(std::min(dots.spacing, 0.2 * double(std::min(geometry.width, geometry.height)))));
    const auto counts = [&](std::size_t i) {
        const std::size_t x = i % geometry.width, y = i / geometry.width;
        return geometry.is_used(i) && x >= margin && y >= margin && x + margin < geometry.width &&
               y + margin < geometry.height;
    };
    std::vector<float> sorted;
    for (std::size_t i = 0; i < geometry.pixels; ++i)
        if (counts(i))
            sorted.push_back(dots.distance[i]);
    if (!sorted.empty()) { // a mask may leave none
        const std::size_t rank = sorted.size() - 1 - sorted.size() / 12;
        std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(rank), sorted.end());
        const float threshold = std::min(sorted[rank], float(4.0 * dots.sigma));
        for (std::size_t i = 0; i < geometry.pixels; ++i)
            if (counts(i) && dots.distance[i] >= threshold)
                dots.between.push_back(std::uint32_t(i));
    }

    dots.cell_centres = find_cell_centres(geometry, dots, cap);
    for (const Point &dot : dots.positions) {
        const Point &axis = geometry.principal_point;
        const Point both{2.0 * axis[0] - dot[0], 2.0 * axis[1] - dot[1]};
        const auto keep = [&](const Point &point, std::vector<Point> &points) {
            if (is_inside(geometry, point, 2.0 * dots.sigma) && distance_at(geometry, dots, point) > 2.0 * dots.sigma)
                points.push_back(point);
        };
        keep(both, dots.mirrored_both);
        keep({both[0], dot[1]}, dots.mirrored_x);
        keep({dot[0], both[1]}, dots.mirrored_y);
    }
    return dots;
}

} // namespace clsp::statistics
