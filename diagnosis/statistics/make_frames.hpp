// Codes become signals.
#pragma once

#include "statistics/frame_sums.hpp"
#include "statistics/statistic.hpp"

#include <cstdint>

namespace clsp::statistics {

// sums: takes the sums over pixels, here and from here on.
Frames make_frames(const Geometry &geometry, const std::uint16_t *codes, const Calibration &calibration,
                   FrameSums &sums);

} // namespace clsp::statistics
