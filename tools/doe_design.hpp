/**
 * @file doe_design.hpp
 * @brief `clspeckle doe design` and `clspeckle doe layout`.
 */
#ifndef CLSPECKLE_TOOLS_DOE_DESIGN_HPP
#define CLSPECKLE_TOOLS_DOE_DESIGN_HPP

#include "console.hpp"

#include <CLI/CLI.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace tools {

/** The unit cell, and the field of view of a layout on its orders. */
struct DoeCellArguments {
    std::vector<std::uint32_t> size; ///< Width, height; or one number; empty: not given.
    double pixel_pitch_um = 0.0;     ///< 0: not given.
    double wavelength_nm = 0.0;      ///< 0: not given.
    double beam_diameter_um = 0.0;   ///< 0: not known.
    std::vector<double> field_of_view_deg = {60.0, 45.0};
    std::uint64_t dots = 5303;
    double min_distance = 0.0; ///< In direction cosines; 0: chosen.
    double min_difference = 0.25;
    bool symmetric = false;
    std::uint64_t seed = 0;
    bool overwrite = false;
};

struct DoeDesignArguments {
    std::string output; ///< Without .npy.
    std::string orders; ///< File of the wanted orders or directions; empty: a layout is made.
    DoeCellArguments cell;
    double period_um = 0.0; ///< 0: what size and pitch say.
    std::uint32_t levels = 8;
    std::string rule = "gsw";
    double feedback = 0.0;
    std::uint32_t iterations = 100;
    std::uint32_t quantization_iterations = 60;
    std::uint32_t fix_phase_iteration = 12;
    std::uint32_t search_sweeps = 0;
    bool keep_envelope = false;
    bool mirror = false;
    std::string device;
};

struct DoeLayoutArguments {
    std::string output;
    DoeCellArguments cell;
    bool free = false;
    double row_half_height = 0.0, neighborhood_radius = 0.0, tolerance = 0.0;
    std::uint32_t repair_rounds = 50;
};

/** What both commands are given; lives as long as the parser. */
struct DoeDesignCommands {
    DoeDesignArguments design;
    DoeLayoutArguments layout;
    CLI::App *design_command = nullptr;
    CLI::App *layout_command = nullptr;
};

/** Adds the commands `design` and `layout` to the group `doe`. */
void add_doe_design(CLI::App &group, DoeDesignCommands &commands, bool &json, bool &quiet);
/** Runs the one that was parsed. @return false if neither was. */
bool run_doe_design(const DoeDesignCommands &commands, Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DOE_DESIGN_HPP
