/**
 * @file gap_check.hpp
 * @brief `clspeckle gap check` and `gap power`: how often the diagnosis is right, and what it can see.
 */
#ifndef CLSPECKLE_TOOLS_GAP_CHECK_HPP
#define CLSPECKLE_TOOLS_GAP_CHECK_HPP

#include "console.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tools {

/** Of both: who draws, who diagnoses, where to. */
struct GeneratorArguments {
    std::string folder;
    std::string generator; ///< Folder of the Python package `gap_check`; empty: where it lies beside this program.
    std::string python = "python3";
    std::string command; ///< The diagnosis; empty: this program's.
    std::string device;
    std::string json; ///< File for the result, "-" for standard output; empty: none beside that in the folder.
    std::uint32_t jobs = 1;
    std::optional<std::uint64_t> seed;
};

struct GapCheckArguments : GeneratorArguments {
    std::string plan = "small";
    std::optional<std::uint32_t> frames;
};

struct GapPowerArguments : GeneratorArguments {
    std::vector<std::uint32_t> frames;  ///< Numbers of frames; empty: the generator's.
    std::vector<std::string> effects;   ///< Empty: the generator's.
    std::optional<std::uint32_t> repeats;
};

/** Generator, diagnosis without keys, scorer; prints the table. */
void run_gap_check(const GapCheckArguments &arguments, Console &console);

/** The same for effects below their weakest strength, by the number of frames; prints the table. */
void run_gap_power(const GapPowerArguments &arguments, Console &console);

} // namespace tools

#endif // CLSPECKLE_TOOLS_GAP_CHECK_HPP
