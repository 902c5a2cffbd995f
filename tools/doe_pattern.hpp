/**
 * @file doe_pattern.hpp
 * @brief The commands `clspeckle doe pattern` and `clspeckle doe inspect`.
 */
#ifndef CLSPECKLE_TOOLS_DOE_PATTERN_HPP
#define CLSPECKLE_TOOLS_DOE_PATTERN_HPP

#include "console.hpp"

#include <CLI/CLI.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tools {

struct DoePatternArguments {
    std::string design; ///< NAME.npy, with NAME.json beside it.
    std::string output;
    bool figure = false; ///< Of inspect: output was given.
    bool overwrite = false;
    std::string beam = "gaussian";
    std::vector<double> beam_sigma_um; ///< Of the intensity: one, or x and y; empty: the library's default.
    std::vector<double> beam_width_um;
    double beam_order = 4;
    std::vector<double> beam_skew;
    double m_squared = 1;
    std::string beam_image;
    std::string transfer = "auto"; ///< Of its numbers.
    std::uint32_t levels = 0;
    double depth_error = 0;
    double rounding_um = 0;
    double etch_noise_nm = 0;
    std::optional<double> refractive_index;
    double dispersion_per_um = 0;
    std::uint64_t seed = 0;
    std::vector<double> wavelengths_nm, line_powers;
    std::vector<double> doe_size_mm;
    std::string evaluation = "auto";
    std::uint32_t oversampling = 2;
    double power_w = 1;
    std::vector<std::uint32_t> texels;
    std::vector<double> half_extent;
    bool smooth = false;
    std::string cache;
    std::vector<double> zoom; ///< u, v, half width.
    std::string device;
};

/** What both commands are given; lives as long as the parser. */
struct DoePatternCommands {
    DoePatternArguments arguments;
    CLI::App *pattern_command = nullptr;
    CLI::App *inspect_command = nullptr;
};

/** Adds the commands `pattern` and `inspect` to the group `doe`. @param json, quiet the flags that all commands share.
 */
void add_doe_pattern(CLI::App &group, DoePatternCommands &commands, bool &json, bool &quiet);
/** Runs the one that was parsed. @return false if neither was. */
bool run_doe_pattern(const DoePatternCommands &commands, Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DOE_PATTERN_HPP
