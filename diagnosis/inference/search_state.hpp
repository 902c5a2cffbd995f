// Where a search for effects stands.
#pragma once

#include "inference/model_fit.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace clsp {

// Effects in the order in which they were found.
struct Path {
    EffectModel model;
    Pool pool; // of the whole model
    std::map<const Candidate *, Eigen::VectorXd>
        looks; // each other effect's change of the statistics when it was last looked at
    std::vector<SearchStep> steps;
    std::vector<FittedModel> models; // after each step; without effects where none was fitted but the last
    // Of effects whose form the capture does not tell (swap_forms): the values of the other one.
    std::map<std::string, std::vector<double>> other_forms;
    double progress = 0.0, progress_end = 1.0; // where it is, and where it will be in the end
    double strongest = kStrongest;             // how far its strengths may go
};

// A path may have that many effects: slight ones, which are not named, take nobody's place.
std::size_t most_effects(const ModelFit &fits, const Path &path);

// Fits what a path has without a model (see Path).
void complete(ModelFit &fits, Path &path, const FittedModel &baseline, double at);

} // namespace clsp
