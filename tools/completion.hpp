/**
 * @file completion.hpp
 * @brief What shells complete behind the program's name.
 */
#ifndef CLSPECKLE_TOOLS_COMPLETION_HPP
#define CLSPECKLE_TOOLS_COMPLETION_HPP

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace tools {

/** The shells that there are scripts for. */
std::vector<std::string> completion_shells();

/** Throws std::out_of_range for another shell. */
std::string completion_script(const std::string &shell);

/**
 * What fits the last word, which may be empty or only begun, behind the others. With a tab and a description, where it
 * has one. ":files" and ":folders" ask the shell for such.
 */
std::vector<std::string> completions(const CLI::App &app, std::vector<std::string> words);

} // namespace tools

#endif // CLSPECKLE_TOOLS_COMPLETION_HPP
