/**
 * @file table_options.hpp
 * @brief The options of the table on the command line, and words for what is none of them.
 */
#ifndef CLSPECKLE_TOOLS_TABLE_OPTIONS_HPP
#define CLSPECKLE_TOOLS_TABLE_OPTIONS_HPP

#include <CLI/CLI.hpp>

#include <map>
#include <string>

namespace tools {

/** Refuses an empty name of a file. */
CLI::Validator has_name();

/** The options of the table on the command line; what was given is collected as text. */
void add_table(CLI::App &app, std::map<std::string, std::string> &given);

/** What CLI11 says, with the nearest known name for an unknown option or command. */
std::string usage_message(const CLI::App &app, const CLI::ParseError &error, int argc, char **argv);

} // namespace tools

#endif // CLSPECKLE_TOOLS_TABLE_OPTIONS_HPP
