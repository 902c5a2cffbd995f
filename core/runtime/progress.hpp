// How long work says how far it is, and hears that it is to stop.
#pragma once

#include "runtime/error.hpp"

#include <functional>
#include <string>

namespace clsp {

// Told what is being done and the fraction that is done; false: stop.
using ProgressFunction = std::function<bool(const std::string &what, double fraction)>;

// Throws kCancelled if the work is to stop.
inline void report_progress(const ProgressFunction &progress, const std::string &what, double fraction) {
    if (progress && !progress(what, fraction))
        throw Error(Status::kCancelled, "the progress function asked to stop");
}

} // namespace clsp
