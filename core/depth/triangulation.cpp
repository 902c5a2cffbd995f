#include "depth/triangulation.hpp"

#include "runtime/checks.hpp"
#include "stages/pose.hpp"

#include <algorithm>
#include <cmath>

namespace clsp {
namespace {

// Centres are never known better than this: the rounding of single precision, and singular covariances.
constexpr double kLeastVariance = 1e-10; // px^2

// The laser in the camera's frame: -R^T t.
std::array<double, 3> laser_position(const std::array<double, 12> &pose) {
    std::array<double, 3> position{};
    for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t i = 0; i < 3; ++i)
            position[k] -= pose[4 * i + k] * pose[4 * i + 3];
    return position;
}

} // namespace

void check(const DepthGeometry &g) {
    check_pose(g.laser_from_camera.data(), "laser_from_camera");
    check_positive(g.fx_px, "fx_px");
    check_positive(g.fy_px, "fy_px");
    for (const auto &[value, name] : {std::pair(g.cx_px, "cx_px"), std::pair(g.cy_px, "cy_px")})
        if (!(std::abs(value) <= kLargestNumber))
            throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be finite", name, value));
    check_positive(g.near_m, "near_m");
    check_positive(g.far_m, "far_m");
    if (!(g.near_m < g.far_m))
        throw Error(Status::kInvalidArgument,
                    fmt::format("near_m is {} and far_m is {}; near_m must be below far_m", g.near_m, g.far_m));
    const auto laser = laser_position(g.laser_from_camera);
    const double baseline = std::sqrt(laser[0] * laser[0] + laser[1] * laser[1] + laser[2] * laser[2]);
    if (!(baseline * std::max(g.fx_px, g.fy_px) / g.near_m > 0.1))
        throw Error(Status::kInvalidArgument,
                    fmt::format("the laser lies {} m from the camera: from near_m to far_m its dots move by less than "
                                "a tenth of a pixel, which tells no depth; check the translation of laser_from_camera "
                                "(metres)",
                                baseline));
}

double EpipolarLine::length() const {
    return std::hypot(ax, ay);
}

std::pair<double, double> EpipolarLine::within(std::uint32_t width, std::uint32_t height, double margin) const {
    double low = q_low, high = q_high;
    const auto clip = [&](double from, double slope, double largest) {
        if (slope == 0.0) {
            if (from < -margin || from > largest + margin)
                high = low - 1.0;
            return;
        }
        const double first = (-margin - from) / slope, second = (largest + margin - from) / slope;
        low = std::max(low, std::min(first, second));
        high = std::min(high, std::max(first, second));
    };
    clip(x0, ax, width - 1.0);
    clip(y0, ay, height - 1.0);
    return {low, high};
}

std::vector<EpipolarLine> epipolar_lines(const DepthGeometry &g, const double *directions, std::uint64_t count) {
    const auto &pose = g.laser_from_camera;
    const auto laser = laser_position(pose);
    std::vector<EpipolarLine> lines(count);
    for (std::uint64_t j = 0; j < count; ++j) {
        const double u = directions[2 * j], v = directions[2 * j + 1];
        const bool cosines = g.directions == DirectionKind::kDirectionCosines;
        const bool good =
            cosines ? u * u + v * v < 1.0 : std::abs(u) <= kLargestNumber && std::abs(v) <= kLargestNumber;
        if (!good)
            throw Error(Status::kInvalidData,
                        fmt::format("directions: that of dot {} is ({}, {}), it must be {}", j, u, v,
                                    cosines ? "direction cosines, with x^2 + y^2 below 1" : "two finite numbers"));
        const std::array<double, 3> d{u, v, cosines ? std::sqrt(1.0 - u * u - v * v) : 1.0};
        std::array<double, 3> w{}; // in the camera's frame: R^T d
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t i = 0; i < 3; ++i)
                w[k] += pose[4 * i + k] * d[i];
        EpipolarLine &line = lines[j];
        line.q_low = 1.0;
        if (!(w[2] > 1e-6 * std::hypot(d[0], d[1], d[2])))
            continue; // never farther from the camera: no depth in its range
        line.mx = w[0] / w[2];
        line.my = w[1] / w[2];
        line.bx = laser[0] - laser[2] * line.mx;
        line.by = laser[1] - laser[2] * line.my;
        line.x0 = g.fx_px * line.mx + g.cx_px;
        line.y0 = g.fy_px * line.my + g.cy_px;
        line.ax = g.fx_px * line.bx;
        line.ay = g.fy_px * line.by;
        const double nearest = std::max(g.near_m, laser[2] * (1.0 + 1e-9));
        if (nearest < g.far_m && line.length() > 0.0) {
            line.q_low = 1.0 / g.far_m;
            line.q_high = 1.0 / nearest;
        }
    }
    return lines;
}

LinePlace place_on_line(const EpipolarLine &line, double x, double y, const std::array<double, 3> &covariance) {
    const double xx = covariance[0] + kLeastVariance, xy = covariance[1], yy = covariance[2] + kLeastVariance;
    const double determinant = xx * yy - xy * xy;
    const double dx = x - line.x0, dy = y - line.y0, ax = line.ax, ay = line.ay, length = line.length();
    // a^T C^-1, up to the determinant.
    const double wx = yy * ax - xy * ay, wy = xx * ay - xy * ax, information = wx * ax + wy * ay;
    const double nx = -ay / length, ny = ax / length;
    LinePlace place;
    place.q = (wx * dx + wy * dy) / information;
    place.q_sd = std::sqrt(determinant / information);
    place.error = nx * dx + ny * dy;
    place.error_sd = std::sqrt(nx * nx * xx + 2.0 * nx * ny * xy + ny * ny * yy);
    return place;
}

} // namespace clsp
