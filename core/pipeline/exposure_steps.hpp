// An exposure during which the speckle changes, as a few sub-exposures.
#pragma once

#include "stages/phase.hpp"

#include <cstdint>

namespace clsp {

// While the shutter is open the surface travels a path of L correlation lengths. What the camera integrates has the contrast
//     C^2 = 2 / L^2 int_0^L (L - l) m(l) dl,   m = rho^2 the intensity's correlation
// (Goodman, Statistical Optics, 6.2), rho = R of phase.h for a continuous field, exp(-l) for one that is only drawn or lives. The mean
// of n sub-exposures a step s apart has C_n^2 = (1 / n^2) (n + 2 sum_k (n - k) m(k s)). The step is chosen such that C_n = C: few
// sub-exposures then have the contrast of infinitely many.
struct ExposureSteps {
    std::uint32_t count = 1;
    double path = 0.0;        // between neighbours, for a continuous field
    double correlation = 1.0; // likewise, for the others
};

// sub_exposures 0: as many as it takes (at least 4, and twice the number of independent patterns). Throws if there are too few.
ExposureSteps exposure_steps(double exposure_path, std::uint32_t sub_exposures, Dynamics dynamics);

} // namespace clsp
