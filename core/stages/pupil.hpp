// The pupil on the frequency grid, computed once on the host in double precision: amplitude transmission and wavefront.
#pragma once

#include "runtime/fields.hpp"
#include "stages/field_grid.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace clsp {

enum class PupilShape : std::uint32_t { kCircle = 0, kImage = 1, kPolygon = 2, kRing = 3 };
enum class Normalization : std::uint32_t { kTransmission = 0, kUnitMean = 1 };

// Noll indices 4 (defocus) to 15; 1 to 3 (piston, tilts) change no intensity but by a shift.
constexpr std::uint32_t kFirstZernike = 4, kZernikeCount = 12;
constexpr std::uint32_t kMinBlades = 3, kMaxBlades = 32;
// The most waves of one term; a phase of so many turns is still good to 1e-12 in double precision.
constexpr double kLargestAberrationWaves = 1000.0;

// Pupil coordinates: u right, v down (as pixels), rho = sqrt(u^2 + v^2) = 1 at the rim of the full circle of diameter
// D, theta = atan2(v, u).
struct PupilParameters {
    PupilShape shape = PupilShape::kCircle;
    Normalization normalization = Normalization::kTransmission;
    // Over this part of the way from the axis to the boundary the transmission falls from 1 to 0 by a raised cosine;
    // likewise at the obstruction, over this part of its radius.
    double soft_rim = 0.0;
    // Host memory, read only while the pupil is made: amplitudes, or their real parts where there are imaginary ones.
    const float *image = nullptr, *image_imaginary = nullptr;
    std::uint32_t image_width = 0, image_height = 0;
    std::uint64_t image_pitch_bytes = 0;

    // Polygon: vertices on the rim, the first at theta = blade_rotation_rad; each blade an arc of curvature
    // blade_curvature / rim radius through two vertices: 0 is a straight edge, 1 the rim itself.
    std::uint32_t blade_count = 6;
    double blade_rotation_rad = 0.0;
    double blade_curvature = 0.0;
    // rho <= obstruction_ratio is blocked, whatever the shape; 0 to below 1. A ring needs it above 0.
    double obstruction_ratio = 0.0;

    // Wavefront error W in waves; the pupil is t exp(2 pi i W).
    double defocus_waves = 0.0;                        // times rho^2
    std::array<double, kZernikeCount> zernike_waves{}; // RMS over the full circle, times Noll's orthonormal polynomials
};
CLSP_EQUALITY(PupilParameters, shape, normalization, soft_rim, image, image_imaginary, image_width, image_height,
              image_pitch_bytes, blade_count, blade_rotation_rad, blade_curvature, obstruction_ratio, defocus_waves,
              zernike_waves)

struct Pupil {
    std::vector<float> transmission; // grid_height x grid_width, FFT order, normalized as asked
    // W in turns, reduced to [-1/2, 1/2], where something passes, 0 elsewhere; FFT order. Empty without aberrations and
    // with a real image.
    std::vector<float> phase_turns;
    std::uint32_t samples = 0;      // frequencies that pass
    double mean_transmission = 0.0; // mean of |P|^2 with Normalization::kTransmission
};

// Noll's orthonormal Zernike polynomial of index 4 to 15: mean square 1 over the unit disc (R. J. Noll, J. Opt. Soc.
// Am. 66 (1976) 207).
double zernike(std::uint32_t noll_index, double rho, double theta);

// diameter in cycles per pixel. Throws if nothing passes.
Pupil make_pupil(const PupilParameters &parameters, const FieldGrid &grid, double relative_diameter);

} // namespace clsp
