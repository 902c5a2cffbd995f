// The pattern of a diffractive optical element (DOE). The equations are in doe.h of the C API.
#pragma once

#include "doe/beam_profile.hpp"
#include "doe/pattern_image.hpp"
#include "runtime/context.hpp"
#include "runtime/progress.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

enum class DoeEvaluation : std::uint32_t { kAuto = 0, kOrders = 1, kAperture = 2 };
enum class DoeSource : std::uint32_t { kComputed = 0, kMemory = 1, kDisk = 2 };

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

// A finished pattern; immutable.
class DoePattern {
  public:
    DoePattern(std::shared_ptr<const DoePatternResult> result, DoeSource source)
        : result_(std::move(result)), source_(source) {}
    const DoePatternResult &result() const { return *result_; }
    DoeSource source() const { return source_; }

  private:
    std::shared_ptr<const DoePatternResult> result_;
    DoeSource source_;
};

// Computes a pattern, or finds it in the context's memory or in the cache folder. Blocks.
std::shared_ptr<DoePattern> make_doe_pattern(const std::shared_ptr<Context> &context,
                                             const DoePatternParameters &parameters);
// Ideal dots.
std::shared_ptr<DoePattern> make_spot_pattern(const SpotPatternParameters &parameters);

} // namespace clsp
