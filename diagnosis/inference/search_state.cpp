#include "inference/search_state.hpp"

namespace clsp {

void complete(ModelFit &fits, Path &path, const FittedModel &baseline, double at) {
    const Eigen::MatrixXd &jacobian = path.models.back().jacobian;
    for (std::size_t n = 0; n + 1 < path.models.size(); ++n) {
        if (!path.models[n].effects.empty())
            continue;
        EffectModel part = path.model.first(n + 1);
        Pool pool;
        FitOptions options;
        options.replicates = fits.few_replicates();
        options.from = options.to = at;
        options.known = jacobian.leftCols(static_cast<Eigen::Index>(part.strengths.size()));
        options.near = true; // to show how the gap shrinks; nothing is chosen by it
        // What cannot be simulated without those that come after it does nothing without them.
        if (!possible([&] { path.models[n] = fits.fit(part, pool, options); }))
            path.models[n] = n ? path.models[n - 1] : baseline;
        path.steps[n].residual = path.models[n].residual;
    }
}

std::size_t most_effects(const ModelFit &fits, const Path &path) {
    return fits.options().max_effects + (path.models.empty() ? 0 : path.model.slight_count(path.models.back().step));
}

} // namespace clsp
