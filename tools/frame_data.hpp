/**
 * @file frame_data.hpp
 * @brief What the command line names as input, and what one frame of it holds.
 */
#ifndef CLSPECKLE_TOOLS_FRAME_DATA_HPP
#define CLSPECKLE_TOOLS_FRAME_DATA_HPP

#include "io/image_io.hpp"

#include <cstdint>
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
    std::string albedo_name, visibility_name; ///< Of the files that they are of, for messages.
    std::vector<std::uint8_t> refresh;        ///< 1: new speckle.
    std::vector<std::uint8_t> material;       ///< Ids.
    std::vector<float> motion; ///< (x, y) for each pixel: where its point was in the frame before, minus where it is.
    std::vector<double> previous_from_current; ///< [R|t] since the frame before, one for each entry of the materials.
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_FRAME_DATA_HPP
