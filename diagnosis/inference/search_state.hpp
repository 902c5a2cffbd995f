// Where a search for effects stands.
#pragma once

#include "inference/model_fit.hpp"
#include "inference/thresholds.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace clsp {

// A model of effects, in the order in which they were found.
struct SearchState {
    EffectModel model;
    Pool pool; // of the whole model
    std::map<const Candidate *, Eigen::VectorXd>
        screened; // each other effect's change of the statistics when it was last screened
    std::size_t given = 0; // effects that it began with: a rung below has told them
    std::vector<SearchStep> steps;
    std::vector<FittedModel> models; // after each step; without effects where none was fitted but the last
    // Of effects whose form the capture does not tell (swap_forms): the values of the other ones.
    std::map<std::string, std::vector<std::vector<double>>> other_forms;
    double progress = 0.0, progress_end = 1.0; // where it is, and where it will be in the end
    double strongest = kStrengths.strongest;   // how far its strengths may go
};

// A model may have that many effects: slight ones, which are not named, take nobody's place.
std::size_t most_effects(const ModelFit &fits, const SearchState &state);

// Makes those of a state's models that are missing.
void complete(ModelFit &fits, SearchState &state, const FittedModel &baseline);

} // namespace clsp
