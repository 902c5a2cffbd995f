// Where the dots of a mean image lie, and what they look like on average.
#pragma once

#include "statistics/geometry.hpp"

#include <array>
#include <vector>

namespace clsp::statistics {

// Displacement of the dots from their nominal positions; all in pixels, the linear and cubic ones at the corner of the
// image.
enum DisplacementTerm : std::size_t {
    kShiftX,
    kShiftY,
    kRadial,
    kTurn,
    kAnisotropy,
    kShear,
    kCubic,
    kDisplacementTerms
};
// Fewer dots than this determine a translation only.
constexpr std::size_t kDotsForField = 8;

struct DotPositions {
    std::vector<std::array<double, 2>> modelled; // nominal positions moved by the fitted terms
    std::array<double, kDisplacementTerms> terms{};
    std::vector<double> flux;  // light under a Gaussian window
    double residual_rms = 0.0; // of the single dots, weighted by flux; px
};

// image: mean image above background.
DotPositions locate_dots(const Geometry &geometry, const std::vector<float> &image, double background);
// The same with that part of the displacement, 0 to 1: where hardly a spot is seen, hardly any place of it is known.
DotPositions pulled_back(const Geometry &geometry, const std::vector<float> &image, double background,
                         DotPositions positions, double part);

// Light under that window of a Gaussian dot as described with a peak of 1.
double gaussian_flux(const Geometry &geometry);

constexpr std::size_t kProfileRings = 8;
constexpr std::array<double, kProfileRings + 1> kProfileEdges{0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0}; // sigmas

// Standard deviation of the window under which a dot's shape is measured, over that of the dot as described.
constexpr double kShapeWindow = 2.0;

struct DotShape {
    double core = 0.0;                   // mean within one sigma, above background, or least_core
    double light_in_core = 0.0;          // the same, however little
    double width_x = 0.0, width_y = 0.0; // px, of the dot under a window of twice its width
    double covariance_xy = 0.0;          // over width_x width_y
    double skewness_x = 0.0, skewness_y = 0.0;
    double kurtosis = 0.0;                       // <r^4> / <r^2>^2
    std::array<double, kProfileRings> profile{}; // mean in rings over the core
    // cos and sin of 1, 2, 3, 4 theta in rings 0.7 to 2, 2 to 4 sigma, and out to half the spacing of the dots, over
    // the ring's mean light (the core's, in the third).
    std::array<std::array<double, 8>, 3> harmonics{};
    std::vector<double> dot_width; // of each dot, px; 0 of a dot that is not seen
};

// least_core: the core that the profile is told relative to is taken to be no less, as light beside the dots may leave
// it none.
DotShape measure_shape(const Geometry &geometry, const std::vector<float> &image, double background,
                       const DotPositions &positions, double least_core);

// Of what the core of a dot as described has. A lens far out of focus leaves less there, or nothing: by so little, or
// by its chance in one pattern of speckle, nothing is to be divided.
constexpr double kLeastCore = 0.2;
// Mean of a Gaussian over the disc of one sigma: 2 (1 - exp(-1/2)) of its peak.
constexpr double kCoreOfPeak = 0.78693868057473315;
// Light in the core (one sigma) of a Gaussian dot behind the lens over the mean light of the image, where all light is
// in such dots.
double expected_core(const Geometry &geometry);
// How far spots are seen, whose place and moments can be told: 1 from a core of least_core on, 0 below half of that.
double visibility(const DotShape &shape, double least_core);

// Mean of the image under a Gaussian window of that width about a point; 0 where everything is masked.
double window_mean(const Geometry &geometry, const std::vector<float> &image, const std::array<double, 2> &point,
                   double width);

} // namespace clsp::statistics
