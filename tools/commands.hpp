/**
 * @file commands.hpp
 * @brief The sub-commands.
 */
#ifndef CLSPECKLE_TOOLS_COMMANDS_HPP
#define CLSPECKLE_TOOLS_COMMANDS_HPP

#include "capture.hpp"
#include "console.hpp"
#include "dataset.hpp"
#include "depth.hpp"
#include "diagnose.hpp"
#include "gap_check.hpp"
#include "input.hpp"
#include "options.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace tools {

/** @return the exit code: exit_device if there is no device that can be used. */
int run_devices(const std::string &device, Console &console);

/** @param folder where the files go. */
void run_render(Config &config, Input &input, const std::string &folder, Console &console);

struct StatisticsArguments {
    std::vector<std::string> files;
    std::string device;
    std::string mask;
    std::vector<std::uint32_t> region;   ///< x, y, width, height; or empty.
    std::uint32_t bits = 0;              ///< 0: unknown.
    std::uint32_t histogram_bins = 0;    ///< 0: none.
    std::vector<double> histogram_range; ///< low, high; or empty.
    std::string channel;
    std::string raw;
    bool temporal = false;
};

void run_statistics(const StatisticsArguments &arguments, Console &console);

struct TuneArguments {
    std::string device;
    std::vector<std::string> sizes; ///< "1920x1080"; or empty.
    std::uint32_t frames = 0;       ///< 0: the library's default.
    std::string output;             ///< Empty: the record that contexts read.
    bool dry_run = false;
};

/** Measures the engines of a device and keeps the fastest. */
void run_tune(const TuneArguments &arguments, Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_COMMANDS_HPP
