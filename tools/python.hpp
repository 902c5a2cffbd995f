/**
 * @file python.hpp
 * @brief Commands that are written in Python: where this program is, whether that Python will do, how another program
 * runs.
 */
#ifndef CLSPECKLE_TOOLS_PYTHON_HPP
#define CLSPECKLE_TOOLS_PYTHON_HPP

#include <filesystem>
#include <string>
#include <vector>

namespace tools {

/** This program's file; empty if the system does not tell. */
std::filesystem::path this_program();

/** The folder that holds `part`, this one or one above it, as those of a checkout are; empty if there is none. */
std::filesystem::path folder_above(std::filesystem::path folder, const std::filesystem::path &part);

/** Exit code of run_program() where there is no such program. */
constexpr int no_program = 127;

/**
 * Runs a program to its end, and passes on what is to stop this one.
 * @param output file for its standard output.
 * @return its exit code, no_program if there is none.
 */
int run_program(const std::vector<std::string> &words, const std::string &output, bool silent);

/** Goes on as another program, and returns only if there is none. */
void become_program(const std::vector<std::string> &words);

/** Throws InputError with `needs` unless this is Python 3.9 or newer that has the modules; Python says what it
 *  lacks. */
void need_modules(const std::string &python, const std::string &modules, const std::string &needs);

/** Puts a folder before those in which Python looks for modules. */
void prepend_python_path(const std::filesystem::path &folder);

} // namespace tools

#endif // CLSPECKLE_TOOLS_PYTHON_HPP
