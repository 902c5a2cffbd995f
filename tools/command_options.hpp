/**
 * @file command_options.hpp
 * @brief The options of one command each, with its examples; quiet: its flag that prints warnings and errors alone.
 */
#ifndef CLSPECKLE_TOOLS_COMMAND_OPTIONS_HPP
#define CLSPECKLE_TOOLS_COMMAND_OPTIONS_HPP

#include "commands.hpp"

#include <CLI/CLI.hpp>

namespace tools {

void add_capture_check(CLI::App &app, CaptureCheckArguments &a, bool &quiet);
void add_capture_init(CLI::App &app, CaptureInitArguments &a, bool &quiet);
void add_capture_emva(CLI::App &app, CaptureEmvaArguments &a, bool &quiet);
void add_capture_make(CLI::App &app, CaptureMakeArguments &a, bool &quiet);
void add_diagnose(CLI::App &app, DiagnoseArguments &a, bool &quiet);
void add_gap_compare(CLI::App &app, DiagnoseArguments &a, bool &quiet);
void add_gap_check(CLI::App &app, GapCheckArguments &a, bool &quiet);
void add_gap_power(CLI::App &app, GapPowerArguments &a, bool &quiet);
void add_dataset(CLI::App &app, DatasetArguments &a, bool &quiet);
void add_tune(CLI::App &app, TuneArguments &a, bool &quiet);

} // namespace tools

#endif // CLSPECKLE_TOOLS_COMMAND_OPTIONS_HPP
