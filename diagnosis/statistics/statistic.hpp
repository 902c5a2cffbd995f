// A statistic's name, and what every statistic is measured by.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

// The stages of the report: laser, doe, surface, motion, optics, sensor. A statistic belongs to the stage whose effects
// it shows first.
struct StatisticInfo {
    std::string stage;
    std::string sequence; // the sequence's name
    std::string name;     // for example "dot_width_x"
    std::string region;   // "all", "r0c2" (of 3 x 3), "ring1" ...
    std::string unit;     // "DN", "px", "1" ...
    // Its standard deviation is never taken as less: replicates without any of a rare thing say little of how often one
    // comes.
    double least_deviation = 0.0;
};

// Of fewer frames, squares over frames (of a frame's shift, of its mean's deviation) are far from Gaussian in their
// logarithm, and so is much else; sequences of more are measured and tested without regard to it.
constexpr std::uint32_t kFewFrames = 8;

// What was calibrated before any statistic is spoken of.
struct Calibration {
    double black_level_dn = 0.0;
    double read_noise_dn = 0.0;
    // Mean image of dark frames, of which flats' fixed patterns are free, so that they are those of the gains. Null:
    // there are none.
    std::shared_ptr<const std::vector<float>> dark_frame = {};
};

} // namespace clsp
