// An exposure during which the speckle changes, as the fewest independent patterns that give the same light.
#pragma once

#include <cstdint>
#include <vector>

namespace clsp {

// The field's correlation over a path l while the shutter is open: the field's own, or exp(-l^2), which is that of a
// Gaussian spot that is carried along.
enum class ExposureCorrelation : std::uint32_t { kField = 0, kGaussian = 1 };

// While the shutter is open the surface travels a path of L correlation lengths, the field's correlation over a part t
// of it is rho(t) = exp(-L t), or exp(-(L t)^2). The integrated intensity of such a circular Gaussian field is
// sum_k w_k |z_k|^2 of independent fields z_k, w_k the eigenvalues of rho(|t - t'|) on 0 <= t, t' <= 1 (Karhunen and
// Loeve; Goodman, Statistical Optics, 6.2), which add up to 1. The largest few are taken, and for the rest one and some
// equal ones, which have its sum and its variance. sum w_k^2, the squared contrast, is right but for the integral
// equation's midpoints, less than 0.2 % up to L = 8, which is far beyond any shutter that leaves speckle to be seen,
// and 3.2 % at 32; sum w_k^3 is off by less than 1.5 % and 7.5 %.
//
// Light that keeps its phase all the while has the part a_k = integral of the k-th eigenfunction in the k-th pattern,
// and a_k^2 add up to 1: the field of pattern k is sqrt(w_k) z_k beside it. Of the patterns after the largest, the
// first has as much of it as beats with what changes, sum_k w_k a_k^2, as all do.
struct ExposureMode {
    double weight;        // w_k
    double coherent_gain; // |a_k| / sqrt(w_k)
};

// The patterns, at most 64 of them: those of the largest weights first, the one after them to 2 %. path: 0 to 32.
// kField: of a field that is only drawn or lives, exp(-l).
std::vector<ExposureMode> exposure_modes(double path, ExposureCorrelation correlation);

} // namespace clsp
