// What a comparison of two capture sets finds beside a diagnosis.
#pragma once

#include "capture/pairing.hpp"
#include "inference/closing.hpp"
#include "inference/levels.hpp"

#include <string>
#include <vector>

namespace clsp {

// An effect that was no candidate, and why.
struct RefusedEffect {
    std::string effect, stage, reason;
};

// What a comparison has beside a diagnosis.
struct Comparison {
    std::vector<SequencePair> pairs;
    std::vector<std::string> real_alone, sim_alone;
    ReadNoiseComparison read_noise;
    std::vector<RefusedEffect> refused; // in the catalogue's order
    std::vector<SurplusEffect> surplus; // largest first
};

} // namespace clsp
