/**
 * @file diagnose.hpp
 * @brief `clspeckle diagnose`.
 */
#ifndef CLSPECKLE_TOOLS_DIAGNOSE_HPP
#define CLSPECKLE_TOOLS_DIAGNOSE_HPP

#include "console.hpp"

#include <clspeckle/clspeckle.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tools {

struct DiagnoseArguments {
    std::string folder;
    /** The set of another simulator that it is compared with (`gap compare`); empty: our own simulator. */
    std::string sim;
    std::string camera; ///< Profile of the camera that both sets are of (`gap compare`); empty: none.
    std::string json; ///< File for the report, "-" for standard output; empty: none.
    std::string profile; ///< File for the camera profile; empty: none.
    std::string emva; ///< File for EMVA 1288's numbers as XML; empty: none.
    std::string html; ///< File for the report for eyes; empty: none.
    std::string tolerances; ///< File with what is accepted of the simulator's error; empty: none.
    std::vector<std::string> without;
    std::vector<std::string> hypotheses; ///< Files that describe effects of the user's own.
    std::uint64_t seed = 0;
    double level = clspeckle::DiagnoseOptions().level;
    std::uint32_t replicates = clspeckle::DiagnoseOptions().null_replicates;
    std::uint32_t max_effects = clspeckle::DiagnoseOptions().max_effects;
    std::uint32_t threads = 0;
    std::string window;                  ///< "X,Y,WIDTH,HEIGHT" or "whole"; empty: the library's choice.
    std::optional<std::uint32_t> frames; ///< Of each sequence at most, 0: all; none: the library's choice.
    std::string device;
};

/** Diagnoses a capture set, or compares it with another, writes the reports that are asked for, prints a summary. */
void run_diagnose(const DiagnoseArguments &arguments, Console &console);

/** The summary for eyes. */
std::string diagnosis_summary(const clspeckle::Diagnosis &diagnosis);

} // namespace tools

#endif // CLSPECKLE_TOOLS_DIAGNOSE_HPP
