// The lines of a laser and what each carries.
#pragma once

#include <cstdint>
#include <vector>

namespace clsp {

// A line: its offset k in [-2, 2] and the share of the light that it carries.
struct LaserLine {
    double offset, weight;
};

// `count` lines at equal distances, weighed by exp(-k^2 / 2).
std::vector<LaserLine> equal_lines(std::uint32_t count);

// The fewest lines that give the light of `lines` on a surface that turns them by k s h, h standard normal: the Gauss
// quadrature of their shares, whose n lines have the first 2 n moments of all of them (Golub and Welsch, Math. Comp.
// 23, 221, 1969). error: what the squared contrast sum w_i w_j exp(-s^2 (k_i - k_j)^2) may be off, as a part of it; 0:
// the lines as they are.
std::vector<LaserLine> fewest_lines(const std::vector<LaserLine> &lines, double dephasing_rad, double error);

} // namespace clsp
