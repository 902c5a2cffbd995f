// Independent work side by side, with one caller who alone may cancel it.
#pragma once

#include <cstddef>
#include <functional>

namespace clsp {

// Calls work(lane, checkpoint) for the lanes 0 ... count - 1, the first on this thread, each other on one of its own,
// and returns when all have ended. Work is to call its checkpoint now and then: in lane 0 that is `checkpoint` (may be
// empty), in the others it ends the lane once lane 0 has thrown. Throws what the first lane that failed has thrown.
void run_lanes(std::size_t count, const std::function<void()> &checkpoint,
               const std::function<void(std::size_t lane, const std::function<void()> &checkpoint)> &work);

} // namespace clsp
