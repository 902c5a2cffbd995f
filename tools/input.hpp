/**
 * @file input.hpp
 * @brief What render reads: ideal images, or scenes as G-buffers, frame by frame.
 */
#ifndef CLSPECKLE_TOOLS_INPUT_HPP
#define CLSPECKLE_TOOLS_INPUT_HPP

#include "console.hpp"
#include "io/image_io.hpp"
#include "options.hpp"

#include <clspeckle/clspeckle.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace tools {

/** The files that the command line names. */
struct InputPaths {
    std::vector<std::string> inputs;
    std::string raw; ///< How the pixels of raw inputs lie; empty: they are no raw files.
    std::string depth;
    std::string position;
    std::string normal;
    std::string albedo;
    std::string visibility;
    std::string refresh_mask;
    std::string material;
    std::string materials; ///< JSON.

    bool any_plane() const { return !(depth + position + normal + albedo + visibility).empty(); }
};

/** One frame in host memory; what the input lacks is empty. */
struct FrameData {
    std::string name;           ///< For messages.
    image_io::Plane irradiance; ///< Ideal image, scaled.
    image_io::Plane depth;
    image_io::VectorPlane position;
    image_io::VectorPlane normal;
    image_io::Plane albedo;
    image_io::Plane visibility;
    std::vector<std::uint8_t> refresh;  ///< 1: new speckle.
    std::vector<std::uint8_t> material; ///< Ids.
    std::vector<float> motion; ///< (x, y) for each pixel: where its point was in the frame before, minus where it is.
    std::vector<double> previous_from_current; ///< [R|t] since the frame before, one for each entry of the materials.
};

/** A source of frames. Frames may be read from another thread, one at a time. */
class Input {
  public:
    virtual ~Input() = default;

    bool scene = false;
    std::string kind; ///< For eyes.
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint64_t frame_count = 1;
    std::string first_name;
    std::vector<std::string> files;      ///< All that are read, which no output may replace.
    std::vector<std::string> oddities;   ///< Of the files' names, before any is read.
    std::vector<ClspMaterial> materials; ///< Entry i is id i; empty: one of the defaults.
    bool moves = false;                  ///< Frames tell how the scene moved.
    /** Of a scene: how to name a channel of its file that may be the ideal image; empty: there is none. */
    std::string image_name;

    /**
     * Reads and checks a frame: NaN, infinite and negative values are refused with file and pixel.
     * @param warnings is appended to.
     */
    virtual FrameData read(std::uint64_t frame, std::vector<std::string> &warnings) = 0;
};

/**
 * Finds out what the input is. What a sequence.json says goes into the configuration.
 * @param paths as the command line gives them.
 */
std::unique_ptr<Input> open_input(const InputPaths &paths, Config &config);

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

} // namespace tools

#endif // CLSPECKLE_TOOLS_INPUT_HPP
