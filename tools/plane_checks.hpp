/**
 * @file plane_checks.hpp
 * @brief Whether the numbers of a plane can be what the plane is named for: refused, warned of, or brought to one form.
 */
#ifndef CLSPECKLE_TOOLS_PLANE_CHECKS_HPP
#define CLSPECKLE_TOOLS_PLANE_CHECKS_HPP

#include "frame_data.hpp"
#include "options.hpp"

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace tools {

constexpr double no_limit = std::numeric_limits<double>::infinity();

/** What becomes of numbers that are no light: they are refused with the option's name, or set to 0 and counted in a
 * warning. */
struct LightChoice {
    bool clip_negative = false;
    bool zero_nonfinite = false;
};
LightChoice light_choice(const Config &config);
void check_light(image_io::Plane &plane, const std::string &path, const char *what, LightChoice choice,
                 std::vector<std::string> &warnings);

/** Whole numbers whose top code is not what their type says, or that have none, in a plane of light or parts of it: a
 * warning with the number that fits.
 * @param file how the plane was named; empty: the ideal images, which have an option. @return the advice, which errors
 * about the values may repeat; empty: none. */
std::string check_full_scale(const image_io::Plane &plane, const std::string &name, const std::string &file,
                             std::vector<std::string> &warnings);

/** The first place where the values are not finite and >= 0 (and <= high), as an InputError naming file and pixel. */
void check_values(const image_io::Plane &plane, const std::string &path, const char *what, double high,
                  const std::string &advice = "");

/** Of whole numbers the unit must be told. @param automatic it is not. */
void check_unit(const std::string &sample, bool automatic, const char *what, const std::string &name);

/** @param file the plane's name, which an option may follow; empty: a file of several planes. */
void check_albedo(image_io::Plane &plane, const std::string &name, const std::string &file, LightChoice choice,
                  std::vector<std::string> &warnings);

/** @param file as check_albedo() takes it.
 * @param advice what gives whole numbers a full scale. */
void check_visibility(const image_io::Plane &plane, const std::string &name, const std::string &file,
                      const std::string &advice);

/** Depths in metres. What is no surface is infinitely far. */
void settle_depth(image_io::Plane &plane, const std::string &name, const Config &config,
                  std::vector<std::string> &warnings);

/** Positions in metres. */
void scale_position(image_io::VectorPlane &plane, const Config &config);

/** Unit normals matter where there is a surface: a longer one would brighten it. Those of what a camera sees face it;
 *  where positions are, the camera may be anywhere, and those that are lit face the laser. */
void check_normals(const FrameData &data, const std::string &name, const Config &config,
                   std::vector<std::string> &warnings);

std::vector<std::uint8_t> to_mask(const image_io::Plane &plane, const std::string &name,
                                  std::vector<std::string> &warnings);

/** Material ids are numbers, whatever type a file stores them in. */
std::vector<std::uint8_t> to_ids(const image_io::Plane &plane, const std::string &name);

} // namespace tools

#endif // CLSPECKLE_TOOLS_PLANE_CHECKS_HPP
