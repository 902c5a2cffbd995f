// Whole images by stb_image, in a build that has only the formats that it reads safely.
#ifndef CLSPECKLE_IO_STB_IMAGE_HPP
#define CLSPECKLE_IO_STB_IMAGE_HPP

#include "io/image_io.hpp"

#include <memory>

namespace image_io {

/** Pixels of a decoded image. */
using StbPixels = std::unique_ptr<unsigned char, void (*)(void *)>;

/**
 * Decodes a file of 8-bit samples, top to bottom. Callers check before that what the header says fits the file, and
 * leave out what stb_image gets wrong.
 * @param info width, height and the number of channels that stb_image must find.
 * @throws ReadError if it cannot be decoded, or ends before its pixels do.
 */
StbPixels decode_by_stb(detail::InputFile &file, const Info &info);

} // namespace image_io

#endif // CLSPECKLE_IO_STB_IMAGE_HPP
