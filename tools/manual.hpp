/**
 * @file manual.hpp
 * @brief The manual page.
 */
#ifndef CLSPECKLE_TOOLS_MANUAL_HPP
#define CLSPECKLE_TOOLS_MANUAL_HPP

#include <CLI/CLI.hpp>

#include <string>

namespace tools {

/** clspeckle(1) in roff: what --help of all commands says. */
std::string manual(const CLI::App &app, const std::string &version);

} // namespace tools

#endif // CLSPECKLE_TOOLS_MANUAL_HPP
