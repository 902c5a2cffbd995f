/**
 * @file doe.hpp
 * @brief The commands `clspeckle doe ...`.
 */
#ifndef CLSPECKLE_TOOLS_DOE_HPP
#define CLSPECKLE_TOOLS_DOE_HPP

#include "doe_design.hpp"
#include "doe_pattern.hpp"

namespace tools {

/** What the commands of the group are given; lives as long as the parser. */
struct DoeCommands {
    DoeDesignCommands design;
    DoePatternCommands pattern;
};

/** Adds the group `doe` and its commands. */
void add_doe(CLI::App &app, DoeCommands &commands, bool &json, bool &quiet);
/** Runs the one that was parsed. @return false if none was. */
bool run_doe(const DoeCommands &commands, Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DOE_HPP
