/**
 * @file depth.hpp
 * @brief `clspeckle depth`.
 */
#ifndef CLSPECKLE_TOOLS_DEPTH_HPP
#define CLSPECKLE_TOOLS_DEPTH_HPP

#include "console.hpp"
#include "io/image_io.hpp"

#include <clspeckle/clspeckle.hpp>

#include <CLI/CLI.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tools {

struct DepthArguments {
    std::vector<std::string> files;
    std::string dots;     ///< List of the pattern's directions.
    std::string geometry; ///< JSON: camera and laser.
    std::string csv;      ///< File for all dots of all frames; empty: none.
    std::string npy;      ///< The same as a structured array; empty: none.
    std::string pictures; ///< Folder for overlays and depth maps; empty: none.
    std::string device;
    std::string channel;
    std::string raw;
    bool overwrite = false;
    ClspDepthDesc desc =
        clspeckle::make<ClspDepthDesc>(); ///< What the options say; sizes, dots and geometry come from files.
    std::optional<double> near_m;         ///< Over what the geometry file says.
    std::optional<double> far_m;
    std::optional<double> relative_diameter;
};

/** The options of the command. */
void add_depth(CLI::App &app, DepthArguments &arguments);

/** Depth of every dot of every frame; prints a table, writes the files that are asked for. */
void run_depth(DepthArguments &arguments, Console &console);

/** The dots of one frame, for the files. */
struct DepthFrame {
    std::string name;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    clspeckle::DepthResult result;
    std::vector<ClspDepthPatternDot> pattern;
};

/** Directions of the pattern's dots. */
struct DotDirections {
    std::vector<double> values;     ///< x, y of each.
    bool direction_cosines = false; ///< As layouts and designs have them, whatever the geometry's projection is.
};

/** Reads x and y of each dot: two numbers in a line, with a comma or a space between, # begins a comment; or an NPY
 * array; or the JSON of `doe layout` or `doe design`. */
DotDirections read_directions(const std::string &path);
/** The directions as the geometry's projection (CLSP_PROJECTION_*) has them. */
std::vector<double> projected(DotDirections directions, std::uint32_t projection, const std::string &path);
/** Reads camera, laser, projection and range of depth of a sequence.json, or of a file with the same members. @return
 * what the lens lacks that speckle's part of the deviations needs; empty: nothing, or there is no lens. */
std::string read_geometry(const std::string &path, ClspDepthDesc &desc);

void write_depth_csv(const std::string &path, const std::vector<DepthFrame> &frames);
/** A structured array with the columns of the CSV file; what is an index there is a number here. */
void write_depth_npy(const std::string &path, const std::vector<DepthFrame> &frames);
/** overlay_NNNNNN.png: the frame with a cross on dots with a depth and a ring around others; depth_NNNNNN.npy: the
 * depth at the pixel of each dot, NaN elsewhere. */
void write_depth_pictures(const std::string &folder, std::uint64_t number, const image_io::Plane &plane,
                          const DepthFrame &frame);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DEPTH_HPP
