// What comes after effects were chosen one by one: an early choice may have been wrong, or needless.
#pragma once

#include "attribution/model_fit.hpp"

#include <vector>

namespace clsp {

// Where a residual is left, adds an effect; or exchanges one for one that resembles it; or adds such a one that takes
// half of its strength. All strengths are fitted anew. `path` becomes the better model; false if nothing is better. at:
// the part of the search that is done.
bool exchange(ModelFit &fits, Path &path, double at);
// Leaves out effects that others have made needless: an effect is chosen without those that come after it.
void prune(ModelFit &fits, Path &path, double at);

} // namespace clsp
