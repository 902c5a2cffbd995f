/**
 * @file ranges.hpp
 * @brief What the numbers of options can mean: the one table of their ranges, with units.
 *
 * A number beyond them is a slip of the unit or of the option, and would give frames that nobody meant.
 */
#ifndef CLSPECKLE_TOOLS_RANGES_HPP
#define CLSPECKLE_TOOLS_RANGES_HPP

#include <fmt/format.h>

#include <string>

namespace tools {

struct Range {
    double low = 0.0;
    double high = 0.0;
    const char *unit = "";

    /** For example "0.1 to 1000 um". */
    std::string text() const { return fmt::format("{:g} to {:g}{}{}", low, high, *unit ? " " : "", unit); }
};

namespace ranges {

inline constexpr Range f_number{0.1, 1000.0};
inline constexpr Range pixel_pitch_m{1e-8, 1e-3, "m"};
inline constexpr Range pixel_pitch_um{0.01, 1000.0, "um"};
inline constexpr Range wavelength_m{1e-7, 2e-5, "m"};
inline constexpr Range wavelength_nm{100.0, 20000.0, "nm"};
inline constexpr Range relative_diameter{0.0, 8.0, "cycles/px"}; // at most the oversampling
inline constexpr Range part{0.0, 1.0};

// The sensor: codes have at most 16 bits.
inline constexpr Range noise_dn{0.0, 65536.0, "dn"};
inline constexpr Range level_dn{-65536.0, 65536.0, "dn"};
inline constexpr Range saturation_dn{0.01, 1e6, "dn"};
inline constexpr Range time_s{0.0, 1e6, "s"};

// In the unit of the light, which may be any: what float32 holds.
inline constexpr Range scale{1e-38, 1e38};
inline constexpr Range gain{0.0, 1e38};

// Scenes.
inline constexpr Range half_extent{1e-6, 1000.0}; // a tangent: 1000 is 0.06 degrees from the plane
inline constexpr Range cosine{1e-6, 1.0};
inline constexpr Range focal_length_px{0.0, 1e6, "px"};
inline constexpr Range place_px{-1e6, 1e6, "px"};
inline constexpr Range pose_m{-1e6, 1e6, "m"};
inline constexpr Range depth_unit_m{1e-6, 1000.0, "m"};
inline constexpr Range depth_m{1e-4, 1e5, "m"};
inline constexpr Range way{0.0, 1e6};
inline constexpr Range spread_px{0.0, 16384.0, "px"};

// Elements and beams.
inline constexpr Range beam_um{0.1, 1e6, "um"};
inline constexpr Range beam_order{1.0, 50.0};
inline constexpr Range beam_skew{-100.0, 100.0};
inline constexpr Range beam_quality{1.0, 1000.0};
inline constexpr Range relative_depth_error{-1.0, 1.0};
inline constexpr Range rounding_um{0.0, 1000.0, "um"};
inline constexpr Range etch_noise_nm{0.0, 1e5, "nm"};
inline constexpr Range refractive_index{1.0, 10.0};
inline constexpr Range dispersion_per_um{-10.0, 10.0, "1/um"};
inline constexpr Range element_mm{0.001, 1000.0, "mm"};
inline constexpr Range power_w{1e-12, 1e6, "W"};
inline constexpr Range relative_power{0.0, 1e12};
inline constexpr Range period_um{0.01, 1e7, "um"};
inline constexpr Range angle_deg{0.001, 179.9, "degrees"};
inline constexpr Range distance_of_directions{0.0, 2.0}; // between direction cosines
inline constexpr Range feedback{0.0, 10.0};
inline constexpr Range sweeps{0.0, 1e6};
inline constexpr Range levels{0.0, 256.0};
inline constexpr Range dots{1.0, 100000.0};

// Depth of dots.
inline constexpr Range dot_sigma_px{0.5, 5.0, "px"};
inline constexpr Range dn_per_electron{0.0, 65536.0, "dn"};
inline constexpr Range sigmas{0.0, 1000.0};
inline constexpr Range tolerance_px{1e-3, 20.0, "px"};
inline constexpr Range confidence{0.5, 1.0};
inline constexpr Range detected_dots{1.0, 1e6};
inline constexpr Range samples{1.0, 8.0};

} // namespace ranges

} // namespace tools

#endif // CLSPECKLE_TOOLS_RANGES_HPP
