// What a diffractive element's pattern is made of and made from; what its evaluation, power budget and cache share. The
// equations are in doe.h of the C API.
#pragma once

#include "doe/beam_profile.hpp"
#include "doe/pattern_image.hpp"
#include "runtime/progress.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace clsp {

enum class DoeEvaluation : std::uint32_t { kAuto = 0, kOrders = 1, kAperture = 2 };

constexpr std::uint32_t kMaxDoeSide = 8192, kMaxDoeLines = 16;

struct DoeDefects {
    std::uint32_t levels = 0;
    double relative_depth_error = 0;
    double rounding_sigma_m = 0;
    double etch_noise_rms_m = 0;
    double refractive_index = 1.4507;
    double dispersion_per_m = 0;
    std::uint64_t seed = 0;
    std::uint32_t feature_samples = 4;
};

struct DoePatternParameters : PatternImage {
    std::uint32_t width = 0, height = 0;
    bool periodic = true;
    const float *phase = nullptr; // host memory, only read during construction; so are all pointers here
    std::uint64_t phase_pitch_bytes = 0;
    double pixel_pitch_m = 0, wavelength_m = 940e-9;
    std::uint64_t dot_count = 0;
    const std::int32_t *dot_orders = nullptr;
    const double *dot_directions = nullptr, *dot_weights = nullptr;
    BeamParameters beam;
    DoeDefects defects;
    std::uint32_t design_levels = 0;
    DoeEvaluation evaluation = DoeEvaluation::kAuto;
    std::uint32_t line_count = 0, oversampling = 2;
    const double *line_wavelengths_m = nullptr, *line_powers = nullptr;
    double doe_width_m = 0, doe_height_m = 0;
    bool pixel_envelope = true;
    std::uint64_t max_memory_bytes = 0;
    std::string cache_dir;
    ProgressFunction progress;
};

struct SpotPatternParameters : PatternImage {
    SpotPatternParameters() { half_extent_x = half_extent_y = 0.5; }
    std::uint64_t count = 0;
    const double *directions = nullptr, *powers = nullptr;
    BeamParameters beam;
    double wavelength_m = 940e-9;
};

// What doe.h calls ClspDoePatternInfo, and the texels.
struct DoePowerBudget : PatternImage {
    double dots = 0, zero_order = 0, ghosts = 0, scatter = 0, inside_image = 0, uniformity_rms = 0;
    double divergence_x_rad = 0, divergence_y_rad = 0, m_squared = 0, order_spacing_x = 0, order_spacing_y = 0;
    std::uint64_t device_memory_bytes = 0;
};

struct DoePatternResult {
    DoePowerBudget budget;
    std::vector<float> texels;      // W/sr, image_height x image_width
    std::vector<double> dot_shares; // of the wanted dots
};

} // namespace clsp
