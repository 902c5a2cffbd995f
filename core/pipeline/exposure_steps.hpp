// An exposure during which the speckle changes, as a few sub-exposures.
#pragma once

#include "stages/phase.hpp"

#include <cstdint>

namespace clsp {

// The field's correlation over a path l while the shutter is open: the field's own, or exp(-l^2), which is that of a
// Gaussian spot that is carried along.
enum class ExposureCorrelation : std::uint32_t { kField = 0, kGaussian = 1 };

// While the shutter is open the surface travels a path of L correlation lengths. What the camera integrates has the
// contrast
//     C^2 = 2 / L^2 int_0^L (L - l) m(l) dl,   m = rho^2 the intensity's correlation
// (Goodman, Statistical Optics, 6.2). The field's own rho is R of phase.h for a continuous one, exp(-l) for one that is
// only drawn or lives, and the sub-exposures' steps always go by it: the mean of n of them a step s apart has C_n^2 =
// (1 / n^2) (n + 2 sum_k (n - k) m(k s)). The step is chosen such that C_n = C: few sub-exposures then have the
// contrast of infinitely many, whatever its rho.
struct ExposureSteps {
    std::uint32_t count = 1;
    double path = 0.0;        // between neighbours, for a continuous field
    double correlation = 1.0; // likewise, for the others
};

// sub_exposures 0: as many as it takes (at least 4, and twice the number of independent patterns). Throws if there are
// too few.
ExposureSteps exposure_steps(double exposure_path, std::uint32_t sub_exposures, Dynamics dynamics,
                             ExposureCorrelation correlation);

} // namespace clsp
