// Semi-random layouts of dots: a least distance, and neighbourhoods that tell a dot from the others of its row. The
// definitions are in dot_layout.h of the C API.
#pragma once

#include "runtime/progress.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

struct DotLayoutParameters {
    std::uint64_t count = 5303;
    bool lattice = true;                     // on the orders of a cell
    std::uint32_t width = 512, height = 512; // the cell
    double pixel_pitch_m = 0.4e-6, wavelength_m = 940e-9;
    double half_angle_x_rad = 0.5235987755982988, half_angle_y_rad = 0.39269908169872414; // 30 and 22.5 degrees
    double min_distance = 0.0;    // in direction cosines; 0: nearly as large as the count allows
    double beam_diameter_m = 0.0; // 0: not known
    bool point_symmetric = false;
    double row_half_height = 0.0, neighborhood_radius = 0.0, tolerance = 0.0; // 0: from min_distance and the spacing
    double min_difference = 0.25;
    std::uint32_t repair_rounds = 50;
    std::uint64_t seed = 0;
    ProgressFunction progress;
};

constexpr std::uint64_t kMostLayoutDots = 100000;

struct DotLayout {
    std::vector<double> directions;   // (u, v) of each dot
    std::vector<std::int32_t> orders; // (m, n) of each dot, empty without a lattice
    double min_distance = 0, mean_spacing = 0;
    double row_half_height = 0, neighborhood_radius = 0, tolerance = 0;
    double min_difference = 0, mean_difference = 0, mean_neighbors = 0;
    std::uint64_t worst_first = 0, worst_second = 0, pairs = 0, moved = 0;
};

DotLayout make_dot_layout(const DotLayoutParameters &parameters);

} // namespace clsp
