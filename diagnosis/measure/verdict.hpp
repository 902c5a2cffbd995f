// What a search's outcome is called.
#pragma once

#include "measure/diagnosis_result.hpp"
#include "inference/effect_model.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace clsp {

// The tails of Student's and of the Gamma law underflow; no probability is 0.
double reported_p_value(double p);

// Whether what an effect moves agrees with the model in the end. moved: by the effect, in standard deviations; z: what
// is left.
bool explained(const Eigen::VectorXd &moved, const Eigen::VectorXd &z);

// The most by which an effect moves one of some statistics; 0 where that is not significant. moved: as for explained();
// statistics: which of them count.
double most_moved(const Eigen::VectorXd &moved, const std::vector<bool> &statistics);

// Of each step's effect, whether it is far weaker than any of the catalogue's range, beside others that are not. What
// so little of an effect does, the simulator's own error in the others' changes does, too: it is fitted, but not named.
std::vector<bool> slight_effects(const std::vector<SearchStep> &steps, const std::vector<FittedParameter> &parameters,
                                 const std::vector<Candidate> &candidates);

// Of each step's effect, whether it moves no statistic of any scene significantly, beside others that do. It is fitted,
// but not named: what a model needs to leave nothing may be the simulator's error.
std::vector<bool> shows_nowhere(const std::vector<SearchStep> &steps, const std::vector<RungResult> &rungs);

// An effect's parameters rest on the others and on the model of each scene that it acts on.
bool is_conditional(const std::string &effect, const std::vector<RungResult> &rungs);

// The effects of the steps, each as the only one that does it or as one of several, and the verdict that follows.
// passed_over: steps that are not named; empty if none is.
void name_effects(const std::vector<SearchStep> &steps, const std::vector<bool> &passed_over, DiagnosisResult &result);

} // namespace clsp
