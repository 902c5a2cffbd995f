/**
 * @file codes.hpp
 * @brief Why an image is no frame of a capture set, in words that name a way out.
 */
#ifndef CLSPECKLE_IO_CODES_HPP
#define CLSPECKLE_IO_CODES_HPP

#include "io/formats.hpp"

#include <string>

namespace image_io {

/** Of frames that are whole files: "PNG, TIFF or raw". */
std::string frame_formats(const char *word);

/** Why the images of a file are no codes of a camera, whatever its bits; empty where they may be. The text goes on
 * behind the file's name. @param file as capture.json would name it. */
std::string why_no_codes(const Info &info, const std::string &file);

/** Of a file whose ending is none of a frame: why what it holds is no frame, or what keeps it from being one; empty
 * where it holds neither images nor an array. */
std::string why_no_frame(const std::string &path);

/** What is said of a file whose photometric interpretation turns its numbers. */
std::string told_white(const Info &info);

} // namespace image_io

#endif // CLSPECKLE_IO_CODES_HPP
