// Shares of a histogram above a level, by a step that is not sharp.
#pragma once

#include <cstdint>
#include <vector>

namespace clsp::statistics {

// Share of the counts above a level. Counts within a tenth of the level, or `reach` where that is less, count in part:
// by 3 t^2 - 2 t^3 with t from 0 to 1. Light that is cut at one level (a full well) would otherwise come or go at once,
// and no fit could follow it; the square of t keeps the root of a share even where it begins. A code's count is spread
// evenly over its width.
double share_above(const std::vector<std::uint64_t> &histogram, double total, double black_level_dn, double level,
                   double reach = 1e30);

} // namespace clsp::statistics
