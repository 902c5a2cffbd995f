// Two capture sets of the same scenes: which sequence belongs to which.
#pragma once

#include "capture/judged_part.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace clsp {

struct SequencePair {
    std::string real, sim;                                     // names
    std::uint32_t real_frames = 0, sim_frames = 0, frames = 0; // as recorded, and as many of both as are compared
    // Mean light above the black level as recorded, and what the frames were multiplied by to bring both to the same
    // light; 0 and 1 in the dark.
    double real_signal_dn = 0.0, sim_signal_dn = 0.0, real_scale = 1.0, sim_scale = 1.0;
};

struct PairedCaptures {
    // Sequence for sequence the same layout (the real set's, with the pixels that neither mask leaves out) and number
    // of frames.
    Capture real, sim;
    JudgedPart part; // of the real set; the same window and numbers of frames of the simulated one
    std::vector<SequencePair> pairs, left_out;      // of those that are not compared, the names
    std::vector<std::string> real_alone, sim_alone; // names of sequences without a partner
    std::vector<std::string> notes;                 // what differs in the descriptions
    bool dots_apart = false;                        // the simulated set's dots are meant to be at other places
};

// Why two sequences, by their numbers, are not compared; empty: they are.
using WhyNotCompared = std::function<std::string(std::size_t real, std::size_t sim)>;

// By name where scene and motion agree, else by scene and motion, f-number before order. Throws kInvalidArgument where
// the frames cannot be compared at all: sizes or bits that differ, no pair. Pairs that are not compared have a note.
PairedCaptures pair_captures(const Capture &real, const Capture &sim, const PartChoice &choice = {},
                             const WhyNotCompared &why_not = {});

} // namespace clsp
