// What a search's outcome is called.
#pragma once

#include "attribution/diagnosis.hpp"
#include "attribution/effect_model.hpp"

#include <Eigen/Core>

#include <vector>

namespace clsp {

// The tails of Student's and of the Gamma law underflow; no probability is 0.
double reported_p_value(double p);

// Whether what an effect moves agrees with the model in the end. moved: by the effect, in standard deviations; z: what is left.
bool explained(const Eigen::VectorXd &moved, const Eigen::VectorXd &z);

// The effects of all steps, as the only explanation or as one of several.
void name_effects(const std::vector<SearchStep> &steps, DiagnosisResult &result);

} // namespace clsp
