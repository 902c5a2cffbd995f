// Where a laser's ray meets a camera's. The equations are in depth.h of the C API.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace clsp {

// As CLSP_PROJECTION_*; capi asserts that they agree.
enum class DirectionKind : std::uint32_t { kTangentPlane = 0, kDirectionCosines = 1 };

struct DepthGeometry {
    DirectionKind directions = DirectionKind::kTangentPlane;
    std::array<double, 12> laser_from_camera{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}; // [R|t]
    double fx_px = 0.0, fy_px = 0.0, cx_px = 0.0, cy_px = 0.0;
    double near_m = 0.2, far_m = 10.0;
};

// Throws kInvalidArgument for what cannot be a camera and a laser apart from each other.
void check(const DepthGeometry &geometry);

// The image of one of the laser's rays: with q the inverse of the depth, x = x0 + q ax, y = y0 + q ay. The ray's points
// are (mx z + bx, my z + by, z).
struct EpipolarLine {
    double x0 = 0.0, y0 = 0.0, ax = 0.0, ay = 0.0;
    double mx = 0.0, my = 0.0, bx = 0.0, by = 0.0;
    double q_low = 0.0, q_high = 0.0; // of the range of depth, in front of the laser; q_low > q_high: none
    double length() const;            // |(ax, ay)|: pixels per unit of q
    bool any() const { return q_low < q_high; }
    // The part of the range of q, low to high, that lies in an image widened by `margin` pixels; low > high: none.
    std::pair<double, double> within(std::uint32_t width, std::uint32_t height, double margin) const;
};

// directions: count times two numbers. Throws kInvalidData for those that are not directions.
std::vector<EpipolarLine> epipolar_lines(const DepthGeometry &geometry, const double *directions, std::uint64_t count);

// A centre's place relative to a line.
struct LinePlace {
    double q = 0.0;     // of the point of the line that is nearest in units of the centre's covariance
    double q_sd = 0.0;  // from the centre's covariance
    double error = 0.0; // px, signed distance from the line
    double error_sd = 0.0;
};

// covariance: of the centre, xx, xy, yy.
LinePlace place_on_line(const EpipolarLine &line, double x, double y, const std::array<double, 3> &covariance);

} // namespace clsp
