// A real capture set against one of any simulator: where they differ, and which effects, put on the simulated frames,
// would close how much.
#pragma once

#include "run/diagnose.hpp"
#include "statistics/levels.hpp"
#include "capture/pairing.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

// An effect that was no candidate, and why.
struct RefusedEffect {
    std::string effect, stage, reason;
};

// An effect of which the simulated frames seem to have more than the camera's: what is there cannot be taken out of
// finished frames.
struct SurplusEffect {
    std::string effect;
    double gain =
        0.0; // by which its removal would lower the squared distance, by a straight line through its own answer
};

// What a comparison has beside a diagnosis.
struct Comparison {
    std::vector<SequencePair> pairs;
    std::vector<std::string> real_alone, sim_alone;
    ReadNoiseComparison read_noise;
    std::vector<RefusedEffect> refused; // in the catalogue's order
    std::vector<SurplusEffect> surplus; // largest first
};

// The options' hypotheses must be empty. `sim` of the result's places is the simulated set. Throws as diagnose(), and
// kInvalidArgument for sets that cannot be compared.
DiagnosisResult compare(std::shared_ptr<Context> context, const Capture &real, const Capture &sim,
                        const DiagnosisOptions &options);

} // namespace clsp
