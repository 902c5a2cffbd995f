#include "doe.hpp"

namespace tools {

namespace {

constexpr const char *examples =
    R"(Examples:
  clspeckle doe layout -o layout
  clspeckle doe design layout.json -o dots

Help on a command: clspeckle doe design --help
)";

} // namespace

void add_doe(CLI::App &app, DoeCommands &commands, bool &json, bool &quiet) {
    CLI::App &group = *app.add_subcommand("doe", "Diffractive elements: design, layouts of dots");
    group.footer(examples);
    group.require_subcommand(1);
    add_doe_design(group, commands.design, json, quiet);
}

bool run_doe(const DoeCommands &commands, Console &console) {
    return run_doe_design(commands.design, console);
}

} // namespace tools
