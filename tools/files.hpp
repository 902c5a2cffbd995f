/**
 * @file files.hpp
 * @brief Finding and reading of the files that are not images.
 */
#ifndef CLSPECKLE_TOOLS_FILES_HPP
#define CLSPECKLE_TOOLS_FILES_HPP

#include "io/formats.hpp"

#include <string>
#include <vector>

namespace tools {

/** What is wanted of images. @param raw describes raw frames; empty: files tell what they are. */
image_io::ReadRequest request_of(const std::string &channel, const std::string &raw);

/** What images are wanted for. */
enum class Purpose { ideal_images, measurement };

/**
 * The files that an argument of the command line means: itself, the images of a folder, or the matches of a glob
 * pattern, in the natural order of their names (frame_2 before frame_10). Of a folder, the previews that render wrote
 * are left out, and as ideal images also the frames of the run whose config.json lies there.
 */
std::vector<std::string> expand(const std::string &argument, Purpose purpose);

/** True if both names mean one file, or would once it is made. */
bool same_file(const std::string &first, const std::string &second);

/** A file that a command is to write. */
struct OutputFile {
    std::string path;
    const char *option = "-o";             ///< That names it.
    std::vector<std::string> endings = {}; ///< Its name must have one of them; empty: any.
};

/** Refuses a name whose ending promises another kind of file than the one that is written. */
void check_ending(const OutputFile &file);

/**
 * Checks that a file can be made there, before the work that fills it.
 * @param overwrite a file that exists may be replaced.
 * @param inputs files, or images as split_name() takes them, that must not be replaced, whatever `overwrite` says.
 */
void check_output_file(const OutputFile &file, bool overwrite, const std::vector<std::string> &inputs);

/**
 * Refuses a report in place of a file of the capture set that it is of: capture.json, what that names, and other
 * frames.
 * @param set its folder or its capture.json.
 * @param path of the report; empty or "-": none.
 * @param own files that an earlier run wrote: they may look like frames.
 */
void check_report_file(const std::string &path, const std::string &set, const std::vector<std::string> &own = {});

/** Makes the folder and checks that files can be made in it. @param option that names it. @return the folders that did
 * not exist before, outermost first. */
std::vector<std::string> make_output_folder(const std::string &path, const char *option = "-o");

} // namespace tools

#endif // CLSPECKLE_TOOLS_FILES_HPP
