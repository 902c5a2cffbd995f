/**
 * @file files.hpp
 * @brief Finding and reading of the files that are not images.
 */
#ifndef CLSPECKLE_TOOLS_FILES_HPP
#define CLSPECKLE_TOOLS_FILES_HPP

#include "options.hpp"

#include <string>
#include <vector>

namespace tools {

/** Reads a JSON file; throws InputError with the file's name and the place of the fault. */
Json read_json(const std::string &path);

/** What images are wanted for. */
enum class Purpose { ideal_images, measurement };

/**
 * The files that an argument of the command line means: itself, the images of a folder, or the matches of a glob
 * pattern, in the natural order of their names (frame_2 before frame_10). Of a folder, the previews that render wrote
 * are left out, and as ideal images also the frames of the run whose config.json lies there.
 */
std::vector<std::string> expand(const std::string &argument, Purpose purpose);

/** Makes the folder and checks that files can be made in it. @return the folders that did not exist before, outermost
 * first. */
std::vector<std::string> make_output_folder(const std::string &path);

} // namespace tools

#endif // CLSPECKLE_TOOLS_FILES_HPP
