/**
 * @file doe_files.hpp
 * @brief Files of diffractive elements: designs, lists of dots, and what is written of them.
 */
#ifndef CLSPECKLE_TOOLS_DOE_FILES_HPP
#define CLSPECKLE_TOOLS_DOE_FILES_HPP

#include "console.hpp"
#include "io/image_io.hpp"
#include "json.hpp"

#include <functional>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

namespace tools {

/** The first frame of an image file as one gray plane. */
image_io::Plane read_plane(const std::string &path, Console &console,
                           image_io::Encoding encoding = image_io::Encoding::as_stored);

/** Wanted dots: orders of a cell or direction cosines, two numbers each, and weights. */
struct DotList {
    bool orders = true;
    std::vector<std::int32_t> numbers; ///< m, n of each, of orders.
    std::vector<double> directions;    ///< u, v of each, of directions.
    std::vector<double> weights;
};

/** Reads one of the lists "orders" and "directions". @param file the parsed JSON. @param path names it in messages. */
DotList read_dot_list(const Json &file, const std::string &path, const char *key);

/** What a design's files hold. */
struct Design {
    image_io::Plane phase;
    double pixel_pitch_m = 0, wavelength_m = 0;
    bool periodic = true;
    std::uint32_t levels = 0;
    DotList dots; ///< Empty if the file has no list.
};

/** Reads NAME.npy and NAME.json beside it. @param path with or without .npy. */
Design read_design(const std::string &path, Console &console);

/** Direction cosines u, v of the dots of a layout, or of the orders of a design. */
std::vector<double> read_direction_cosines(const std::string &path);

/** The number that a JSON file holds. @param where names it in messages. */
double json_number(const Json &value, const std::string &where);

/** The path without .npy. */
std::string without_npy(const std::string &path);

/**
 * The name without .npy or .json, after a check that files of these extensions can be made there.
 * @param inputs files that must not be replaced.
 */
std::string checked_stem(std::string name, std::initializer_list<const char *> extensions, bool overwrite,
                         const std::vector<std::string> &inputs);

/** Writes NAME.npy and NAME.json; both are complete before either gets its name. */
void write_npy_with_json(const std::string &stem, std::uint32_t width, std::uint32_t height,
                         const std::vector<float> &values, const std::string &json);

/** Runs something whose errors name the library's parameters, and names the options instead. */
void with_option_names(const std::vector<std::pair<std::string, std::string>> &names,
                       const std::function<void()> &action);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DOE_FILES_HPP
