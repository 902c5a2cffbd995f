#include "report/advice.hpp"

#include "effects/effects.hpp"

#include <algorithm>

namespace clsp {

std::vector<Advice> advice_for(const std::vector<std::string> &equivalent) {
    const auto has = [&](const char *id) {
        return std::find(equivalent.begin(), equivalent.end(), id) != equivalent.end();
    };
    std::vector<Advice> result;
    for (const Effect &effect : effect_catalogue())
        for (const ConfusableEffect &other : effect.confusable_effects)
            if (has(effect.id) && has(other.id))
                result.push_back({{effect.id, other.id}, other.capture});
    return result;
}

} // namespace clsp
