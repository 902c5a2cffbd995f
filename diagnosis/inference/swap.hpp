// What comes after effects were chosen one by one: an early choice may have been wrong, or needless.
#pragma once

#include "inference/search_state.hpp"

#include <vector>

namespace clsp {

// Where a residual is left, adds an effect; or swaps one for one that resembles it; or adds such a one that takes
// half of its strength. All strengths are fitted anew. `state` becomes the better model; false if nothing is better.
// at: the part of the search that is done.
bool swap(ModelFit &fits, SearchState &state, double at);
// Swaps an effect for one that hardly differs from it and does better beside all others: which of the two was added
// may have been decided by what was missing then, and a residual need not tell. False if none does better.
bool swap_confusable_effects(ModelFit &fits, SearchState &state, double at);
// Swaps effects' forms that fits tell apart (Candidate::form), one after the other, for another that is better beside
// all effects that are there. False if none is. candidates: with all forms.
bool swap_forms(ModelFit &fits, SearchState &state, const std::vector<const Candidate *> &candidates, double at);
// Leaves out effects that others have made needless: an effect is chosen without those that come after it.
void prune(ModelFit &fits, SearchState &state, double at);

} // namespace clsp
