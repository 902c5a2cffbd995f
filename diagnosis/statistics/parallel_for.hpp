#pragma once

#include <cstddef>
#include <functional>

namespace clsp::statistics {

// Runs task(0) ... task(count - 1), each once, on up to `threads` threads. A task writes to its own slots only: the
// outcome is the same for any number of threads. What a task throws is thrown on.
void parallel_for(std::size_t count, unsigned threads, const std::function<void(std::size_t)> &task);

} // namespace clsp::statistics
