// The caller's progress function as the engine calls it.
#pragma once

#include "clspeckle/types.h"
#include "runtime/progress.hpp"

namespace clsp::capi {

// Empty if `function` is NULL.
inline ProgressFunction progress_function(ClspProgressFunction function, void *user_data) {
    if (!function)
        return {};
    return [=](const std::string &what, double fraction) { return function(user_data, what.c_str(), fraction) != 0; };
}

} // namespace clsp::capi
