#include "statistics/parallel_for.hpp"

#include "statistics/workers.hpp"

#include <algorithm>
#include <atomic>

namespace clsp::statistics {

void parallel_for(std::size_t count, unsigned threads, const std::function<void(std::size_t)> &task) {
    std::atomic<std::size_t> next{0};
    run_workers(std::min<std::size_t>(std::max(threads, 1u), count), {}, [&](const WorkerThread &self) {
        for (std::size_t i = next++; i < count; i = next++) {
            self.checkpoint();
            task(i);
        }
    });
}

} // namespace clsp::statistics
