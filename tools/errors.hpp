/**
 * @file errors.hpp
 * @brief What can end the program, and with which exit code.
 */
#ifndef CLSPECKLE_TOOLS_ERRORS_HPP
#define CLSPECKLE_TOOLS_ERRORS_HPP

#include <stdexcept>
#include <string>

namespace tools {

constexpr int exit_ok = 0;
constexpr int exit_input = 1;         ///< Usage, configuration or input files.
constexpr int exit_device = 2;        ///< No OpenCL device, or the device, the library or the memory failed.
constexpr int exit_output = 3;        ///< A file, a folder or standard output cannot be written.
constexpr int exit_interrupted = 130; ///< Ctrl-C or SIGTERM; what was finished stays.

/** Wrong usage, configuration or input. */
class InputError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/** Something cannot be written. */
class OutputError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/** The user stopped the program. */
class Interrupted : public std::runtime_error {
  public:
    explicit Interrupted(const std::string &what = "interrupted") : std::runtime_error(what) {}
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_ERRORS_HPP
