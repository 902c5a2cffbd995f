/**
 * @file help.hpp
 * @brief How --help looks.
 */
#ifndef CLSPECKLE_TOOLS_HELP_HPP
#define CLSPECKLE_TOOLS_HELP_HPP

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

namespace tools {

/**
 * CLI11's help within 80 columns, and without its notes on flags and checks, which the descriptions hold. Footers are
 * reflowed, but for lines that begin with a space: examples and lists stay as they are, so keep them within 80 columns.
 */
class Formatter final : public CLI::Formatter {
  public:
    std::string make_option(const CLI::Option *option, bool is_positional) const override;
    std::string make_subcommand(const CLI::App *command) const override;
    std::string make_description(const CLI::App *command) const override;
    std::string make_footer(const CLI::App *command) const override;
};

/** An option's names and what it takes: "-o, --output FOLDER". An argument's name: "FRAMES...". */
std::string names_of(const CLI::Option &option);

/** The commands that help lists. */
std::vector<const CLI::App *> shown_commands(const CLI::App &app);

/** Paragraphs wrapped; lines that begin with a space, and empty ones, as they are. */
std::string reflowed(const std::string &text, std::size_t width);

} // namespace tools

#endif // CLSPECKLE_TOOLS_HELP_HPP
