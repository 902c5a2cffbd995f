/**
 * @file hypothesis_file.hpp
 * @brief Effects of the user's own, as `clspeckle diagnose --hypothesis` reads them.
 */
#ifndef CLSPECKLE_TOOLS_HYPOTHESIS_FILE_HPP
#define CLSPECKLE_TOOLS_HYPOTHESIS_FILE_HPP

#include <clspeckle/clspeckle.hpp>

#include <string>

namespace tools {

/** Reads the description of an effect (docs/method/diagnosis.md) and the OpenCL source it names. Throws InputError. */
clspeckle::Hypothesis read_hypothesis(const std::string &path);

} // namespace tools

#endif // CLSPECKLE_TOOLS_HYPOTHESIS_FILE_HPP
