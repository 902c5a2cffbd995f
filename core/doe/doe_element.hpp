// A diffractive element that has been checked, with its laser: what the evaluations of its pattern work from.
#pragma once

#include "doe/doe_parameters.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace clsp {

struct SpectralLine {
    double wavelength_m, share; // shares sum to 1
};

struct DoeElement {
    DoePatternParameters parameters; // its pointers are not to be used any more
    std::vector<float> phase;
    std::vector<SpectralLine> lines;
    std::vector<std::array<double, 2>> dots; // wanted: orders m, n (periodic), or u, v
    std::vector<double> weights;             // of the dots
    bool orders = true;                      // the evaluation
    std::uint32_t samples = 1;               // of a pixel along each side
    double mean_wavelength_m = 0;

    std::uint32_t sampled_width() const { return parameters.width * samples; }
    std::uint32_t sampled_height() const { return parameters.height * samples; }
    double sample_pitch_m() const { return parameters.pixel_pitch_m / samples; }
    // The factor of the design's phase at a wavelength: depth error, wavelength, dispersion.
    double phase_scale(double wavelength_m) const;
    // RMS phase error of the etch noise.
    double phase_noise(double wavelength_m) const;
    // A wanted dot's direction.
    std::array<double, 2> direction(std::size_t dot, double wavelength_m) const;
};

// Checks everything that can be checked before the beam is known.
DoeElement make_doe_element(const DoePatternParameters &parameters);

} // namespace clsp
