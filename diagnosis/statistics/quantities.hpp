// What a data sheet and an optics bench have of a sequence, in their units: for people to read. No verdict goes by
// them; that is what the statistics are for, which are made to have narrow laws instead.
#pragma once

#include "statistics/sequence_statistics.hpp"

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace clsp {

inline constexpr double kNotTold = std::numeric_limits<double>::quiet_NaN(); // by the frames

struct Quantity {
    std::string name; // for example "temporal_noise"
    std::string unit; // "DN", "px", "%", "1"; of shares of a sequence's mean signal "%"
    double value = 0.0;
};

// The same names in the same order for any content of the frames; NaN is what the frames do not tell (no light). codes:
// frame_count * height * width. Throws kInvalidArgument as SequenceStatistics::compute does.
std::vector<Quantity> sequence_quantities(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                                          std::uint32_t frame_count, const Calibration &calibration, unsigned threads);
// Of the dark sequences and the flats of a capture, one after the other: what a fixed pattern shows in.
std::vector<Quantity> pattern_quantities(const Capture &capture, const Calibration &calibration, unsigned threads);

} // namespace clsp
