/**
 * @file read_request.hpp
 * @brief What is wanted of an image file.
 */
#ifndef CLSPECKLE_IO_READ_REQUEST_HPP
#define CLSPECKLE_IO_READ_REQUEST_HPP

#include "io/raw.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace image_io {

/** What a plane is: it tells which of a file's channels are meant where none is named. A map has a number for each
 * pixel of a sensor or an element, which is what it is. */
enum class Role { image, depth, position, normal, albedo, visibility, mask, material, map };

/** What is wanted of a file. */
struct ReadRequest {
    /** A channel, three with commas between them, or a layer; empty: what fits the role. */
    std::string channel;
    Role role = Role::image;
    /** One image of several, from 0; none: all that are frames. */
    std::optional<std::uint64_t> page = {};
    /** The number that means 1; none: as the samples' type says. */
    std::optional<double> full_scale = {};
    /** Of raw frames: how they lie in the file, whatever it looks like. */
    std::optional<RawLayout> raw = {};
};

} // namespace image_io

#endif // CLSPECKLE_IO_READ_REQUEST_HPP
