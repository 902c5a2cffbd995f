#include "inference/search_state.hpp"

namespace clsp {

void complete(ModelFit &fits, SearchState &state, const FittedModel &baseline) {
    for (std::size_t n = 0; n + 1 < state.models.size(); ++n) {
        if (!state.models[n].effects.empty())
            continue;
        // What cannot be simulated without those that come after it does nothing without them.
        if (!possible(
                [&] { state.models[n] = fits.part_of(state.models.back(), state.pool, state.model.first(n + 1)); }))
            state.models[n] = n ? state.models[n - 1] : baseline;
        state.steps[n].residual = state.models[n].residual;
    }
}

std::size_t most_effects(const ModelFit &fits, const SearchState &state) {
    return fits.options().max_effects + (state.models.empty() ? 0 : state.model.slight_count(state.models.back().step));
}

} // namespace clsp
