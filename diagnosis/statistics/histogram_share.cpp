#include "statistics/histogram_share.hpp"

#include <algorithm>

namespace clsp::statistics {
namespace {

constexpr double kShareOfLevel = 0.1, kLeastReach = 0.5; // of a level; codes

// Integral of 3 t^2 - 2 t^3 from 0 to t, of 0 before and of 1 behind.
double integral_of_step(double t) {
    const double s = std::clamp(t, 0.0, 1.0);
    return s * s * s * (1.0 - 0.5 * s) + std::max(t - 1.0, 0.0);
}

} // namespace

double share_above(const std::vector<std::uint64_t> &histogram, double total, double black_level_dn, double level,
                   double reach) {
    reach = std::max(std::min(kShareOfLevel * level, reach), kLeastReach);
    const double begin = black_level_dn + level - reach, width = 2.0 * reach;
    double above = 0.0;
    for (std::size_t code = histogram.size(); code-- > 0 && double(code) + 0.5 > begin;) {
        const double t = (double(code) + 0.5 - begin) / width; // of the code's upper edge
        above += double(histogram[code]) * width * (integral_of_step(t) - integral_of_step(t - 1.0 / width));
    }
    return above / total;
}

} // namespace clsp::statistics
