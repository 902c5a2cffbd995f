// Which effects explain a capture: forward selection with parameters fitted on common random numbers, judged on the
// other half of the frames.
#pragma once

#include "inference/candidate.hpp"
#include "inference/model_fit.hpp"

#include <string>
#include <vector>

namespace clsp {

// What an effect promises at the first screening of the baseline's gap.
struct ScreenedEffect {
    std::string effect;
    double share = 0.0;  // of the squared distance, that as much of its change as fits best takes away; or that a
                         // change along a line to the strong end does, held out (Search::screen_along_lines)
    bool fitted = false; // whether its parameters were fitted then; what promises little is put aside
};

// What a search begins with.
struct SearchStart {
    EffectModel model;           // effects that are there already
    std::vector<SearchStep> steps; // how each was found
    // By statistic: what is known to be no model's to explain, a standard deviation; empty: nothing is.
    Eigen::VectorXd unexplained;
    double work = 0.0; // what it took to find that, in captures of the search that begins with it
};

struct SearchResult {
    FittedModel baseline;
    std::vector<ScreenedEffect>
        screened; // at all candidates that can show; the most promising first; none without a gap
    std::vector<SearchStep> steps;
    std::vector<FittedModel> models; // after each step
    EffectModel model;               // of the last one
    double work = 0.0;               // what was asked for beside the baseline's (ReplicateRunner::work)
    bool ended_early = false;        // at the most work, with more to try
    double p_left = 1.0;             // of what is left by chance, beside what the search began with as unexplained

    const FittedModel &last() const { return models.empty() ? baseline : models.back(); }
};

// What a model leaves of each statistic, as a standard deviation; nothing of those that chance makes as large more
// often than `level`. Empty where all are explained.
Eigen::VectorXd left_by(const FittedModel &last, double level);

// A statistic that no effect explains pulls at all strengths, and lets in effects that only imitate what it shows. So
// where something is left beyond doubt, a second search begins like the first, but no fit goes by what was left; and a
// third goes on from there by all statistics, as an effect that the first one missed may be what was left. The third
// one's result if it explains all, else the second one's.
// candidates: outlive the result.
SearchResult search(ReplicateRunner &runner, const std::vector<const Candidate *> &candidates,
                    const SearchStart &start, const SearchOptions &options, const Progress &progress);

} // namespace clsp
