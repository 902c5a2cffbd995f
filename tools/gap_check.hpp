/**
 * @file gap_check.hpp
 * @brief `clspeckle gap check`: how often the diagnosis is right.
 */
#ifndef CLSPECKLE_TOOLS_GAP_CHECK_HPP
#define CLSPECKLE_TOOLS_GAP_CHECK_HPP

#include "console.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace tools {

struct GapCheckArguments {
    std::string folder;
    std::string plan = "small";
    std::string generator; ///< Folder of the Python package `withheld`; empty: where it lies beside this program.
    std::string python = "python3";
    std::string command; ///< The diagnosis; empty: this program's.
    std::string device;
    std::string json; ///< File for the score, "-" for standard output; empty: none beside OUT/score.
    std::uint32_t jobs = 1;
    std::optional<std::uint32_t> frames;
    std::optional<std::uint64_t> seed;
};

/** Generator, diagnosis without keys, scorer; prints the table. */
void run_gap_check(const GapCheckArguments &arguments, Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_GAP_CHECK_HPP
