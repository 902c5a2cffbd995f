/**
 * @file inside.hpp
 * @brief Names that files give of other files: they stay in the folder of the file that gives them.
 */
#ifndef CLSPECKLE_IO_INSIDE_HPP
#define CLSPECKLE_IO_INSIDE_HPP

#include <string>

namespace image_io {

/** Whether a name, or a glob pattern, may lead out of the folder that it is relative to: absolute names, drives, and
 * parts that are ".." however they are spelled. What links lie in the folder is up to its owner. */
bool leaves_folder(const std::string &name);

} // namespace image_io

#endif // CLSPECKLE_IO_INSIDE_HPP
