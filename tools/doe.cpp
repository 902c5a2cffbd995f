#include "doe.hpp"

namespace tools {

namespace {

constexpr const char *examples =
    R"(Examples:
  clspeckle doe layout -o layout
  clspeckle doe design -o cell --levels 8
  clspeckle doe pattern cell.npy -o pattern.npy
  clspeckle doe inspect cell.npy -o cell.png

Help on a command: clspeckle doe pattern --help
)";

} // namespace

void add_doe(CLI::App &app, DoeCommands &commands, bool &json, bool &quiet) {
    CLI::App &group = *app.add_subcommand("doe", "Diffractive elements: designs, layouts of dots, patterns");
    group.footer(examples);
    group.require_subcommand(1);
    add_doe_design(group, commands.design, json, quiet);
    add_doe_pattern(group, commands.pattern, json, quiet);
}

bool run_doe(const DoeCommands &commands, Console &console) {
    return run_doe_design(commands.design, console) || run_doe_pattern(commands.pattern, console);
}

} // namespace tools
