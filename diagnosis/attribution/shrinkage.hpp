// How far a gap shrinks once effects are in the simulator, on halves of the frames that the fit has not seen.
#pragma once

#include "attribution/search.hpp"

#include <array>
#include <vector>

namespace clsp {

struct Shrinkage {
    double before = 0.0; // distances beyond chance, in the baseline's standard deviations, root mean square over statistics
    double after = 0.0;
    double fraction = 0.0;
    std::array<double, 2> fraction_95{};
};

// Each half is compared with the model fitted to the other half. The interval comes from the model's replicates: new surfaces and new
// noise each, as a bootstrap over independent captures.
Shrinkage shrinkage(const Experiment &experiment, const FittedModel &baseline, const FittedModel &model);

} // namespace clsp
