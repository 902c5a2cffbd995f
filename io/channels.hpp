/**
 * @file channels.hpp
 * @brief Which of a file's named channels make a plane: those that are asked for by name, or those whose names fit.
 */
#ifndef CLSPECKLE_IO_CHANNELS_HPP
#define CLSPECKLE_IO_CHANNELS_HPP

#include "io/image_io.hpp"
#include "io/read_request.hpp"

#include <memory>
#include <string>
#include <vector>

namespace image_io {

/**
 * One channel, or three: a picture's R, G, B or a vector's X, Y, Z. A name is split at its last dot into the layer and
 * what the channel is there. Throws ReadError with the list where none fits, or several do.
 * @param path for messages.
 * @param channels all of the file.
 * @param request channel: a channel, three with commas between them, or a layer; empty: what fits the role.
 */
std::vector<std::string> select_channels(const std::string &path, const std::vector<std::string> &channels,
                                         const ReadRequest &request);

/** True if some of the channels make a picture: Y, or R, G and B of one layer that is not named for another plane. */
bool has_picture(const std::vector<std::string> &channels);
/**
 * What a file's names say about a plane: the channels of each layer or channel that is named for it, one or three.
 * Empty: none is; then a lone channel may still be meant, which select_channels() takes.
 */
std::vector<std::vector<std::string>> named_channels(const std::vector<std::string> &channels, Role role);

/** The first channel that has no name of another plane, which may be this one; empty: all have. */
std::string unclaimed_channel(const std::vector<std::string> &channels, Role role);

/** A reader of some of the channels of another one; those without names go by R, G, B, A or their number from 0. */
std::unique_ptr<Reader> select_samples(std::unique_ptr<Reader> reader, const ReadRequest &request);

} // namespace image_io

#endif // CLSPECKLE_IO_CHANNELS_HPP
