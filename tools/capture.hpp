/**
 * @file capture.hpp
 * @brief Arguments of `clspeckle capture`.
 */
#ifndef CLSPECKLE_TOOLS_CAPTURE_HPP
#define CLSPECKLE_TOOLS_CAPTURE_HPP

#include "console.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tools {

struct CaptureCheckArguments {
    std::string folder;
    std::string json; ///< File for the summary, "-" for standard output; empty: none.
    std::string mask; ///< File for a mask of the pixels that are not like the others; empty: none.
};

struct CaptureEmvaArguments {
    std::string folder;
    std::string json; ///< File for the numbers, "-" for standard output; empty: none.
    std::string xml;  ///< File for them as the Python package emva1288 writes results; empty: none.
};

struct CaptureMakeArguments {
    std::string folder;
    std::uint32_t width = 192;
    std::uint32_t height = 160;
    std::uint32_t frames = 16;
    std::uint32_t bits = 10;
    double pixel_pitch_um = 2.9;
    double f_number = 5.6;
    double wavelength_nm = 940.0;
    double degree_of_polarization = 1.0;
    double black_level_dn = 64.0;
    double read_noise_dn = 4.0;
    std::string field = "circular_gaussian";
    std::vector<double> flat_levels = {400.0}; ///< DN above the black level; several: several sequences.
    std::vector<double> board_levels = {130.0};
    std::vector<double> dots_levels = {280.0}; ///< At the peak of a dot.
    std::vector<std::string> sequences = {"dark", "flat", "board_static", "board_moving", "dots_static", "dots_moving"};
    double dots_pitch_px = 15.0;
    double dots_jitter_px = 2.0; ///< Each way, along each axis.
    double dots_sigma_px = 2.2;
    std::uint32_t dots_count = 0; ///< 0: as many as the pitch gives.
    std::string dots_file;
    std::vector<std::string> effects;
    std::uint64_t seed = 0;
    std::string device;
    bool key = false;
    bool overwrite = false;
};

struct CaptureInitArguments {
    std::string folder;
    std::optional<double> pixel_pitch_um, f_number, wavelength_nm;
    std::optional<double> read_noise_dn; ///< None: that of the frames.
    std::uint32_t bits = 0;              ///< 0: as the codes say.
    std::string dots_file;               ///< Empty: dots are looked for in the frames.
    std::string raw;                     ///< How the pixels of .raw files lie.
    bool force = false;
};

struct DotPattern {
    double sigma_px = 0.0;
    std::vector<double> positions_px; ///< x, y, x, y ...
};

/** From a capture.json, or {"sigma_px": S, "positions_px": [[x, y], ...]}. @param sigma_px where the file has none. */
DotPattern read_dots(const std::string &file, double sigma_px);

/** Says what is in a capture set and what it can tell apart. */
void run_capture_check(const CaptureCheckArguments &arguments, Console &console);
/** Writes a first capture.json from the frames in a folder. */
void run_capture_init(const CaptureInitArguments &arguments, Console &console);
/** EMVA 1288's numbers of a capture set. */
void run_capture_emva(const CaptureEmvaArguments &arguments, Console &console);
/** Writes a capture set from the simulator. */
void run_capture_make(const CaptureMakeArguments &arguments, Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_CAPTURE_HPP
