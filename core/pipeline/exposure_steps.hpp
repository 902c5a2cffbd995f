// An exposure during which the speckle changes, as a few sub-exposures.
#pragma once

#include "stages/exposure_modes.hpp"
#include "runtime/fields.hpp"
#include "stages/laser_lines.hpp"
#include "stages/phase.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

// While the shutter is open the surface travels a path of L correlation lengths. What the camera integrates has the
// contrast
//     C^2 = 2 / L^2 int_0^L (L - l) m(l) dl,   m = rho^2 the intensity's correlation
// (Goodman, Statistical Optics, 6.2). The field's own rho is R of phase.h for a continuous one, exp(-l) for one that is
// only drawn or lives: the mean of n sub-exposures a step s apart has C_n^2 = (1 / n^2) (n + 2 sum_k (n - k) m(k s)).
// The step is chosen such that C_n = C: few sub-exposures then have the contrast of infinitely many. Steps of such
// fields have no other rho, so a Gaussian one is made of independent patterns (exposure_modes.hpp), each a new field.
struct ExposureSteps {
    std::uint32_t count = 1;
    double path = 0.0;               // between neighbours, for a continuous field
    double correlation = 1.0;        // likewise, for the others
    std::vector<ExposureMode> modes; // what each sub-exposure counts; empty: all alike
    // Each sub-exposure is a pattern of its own, drawn by pattern_number(), and has its own lines of the laser.
    bool independent = false;
    std::vector<std::vector<LaserLine>> lines;
};

struct ExposureParameters {
    double path = 0.0; // of the surface, in correlation lengths
    std::uint32_t sub_exposures = 0;
    ExposureCorrelation correlation = ExposureCorrelation::kField;
    Dynamics dynamics = Dynamics::kReplace;
    std::uint32_t line_count = 1;
    double dephasing_rad = 0.0;
};
CLSP_EQUALITY(ExposureParameters, path, sub_exposures, correlation, dynamics, line_count, dephasing_rad)

// sub_exposures 0: as many as it takes (at least 4, and twice the number of independent patterns; as many as there are
// modes). Throws if there are too few, or if they are given with a Gaussian correlation.
ExposureSteps exposure_steps(const ExposureParameters &parameters);

// The fewest independent patterns, whatever the correlation, each with the fewest lines of the laser: together they
// change the squared contrast by 1e-3 at most. For frames that are drawn anew, one by one.
ExposureSteps independent_exposures(const ExposureParameters &parameters);

// The number of an exposure's k-th independent pattern. Numbers of frames have 48 bits, of which these frames use 42.
constexpr unsigned kPatternShift = 42;
inline std::uint64_t pattern_number(std::uint64_t frame_index, std::uint32_t k) {
    return frame_index | (std::uint64_t{k} << kPatternShift);
}

} // namespace clsp
