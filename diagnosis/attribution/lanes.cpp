#include "attribution/lanes.hpp"

#include <atomic>
#include <exception>
#include <system_error>
#include <thread>
#include <vector>

namespace clsp {
namespace {

struct Stopped {};

} // namespace

void run_lanes(std::size_t count, const std::function<void()> &checkpoint,
               const std::function<void(std::size_t lane, const std::function<void()> &checkpoint)> &work) {
    std::vector<std::exception_ptr> failures(count);
    std::atomic<bool> stopped{false};
    const std::function<void()> callers = [&] {
        if (checkpoint)
            checkpoint();
    };
    const std::function<void()> others = [&] {
        if (stopped)
            throw Stopped{};
    };
    const auto run = [&](std::size_t lane, const std::function<void()> &its_checkpoint) {
        try {
            work(lane, its_checkpoint);
        } catch (const Stopped &) {
            // lane 0 has thrown
        } catch (...) {
            failures[lane] = std::current_exception();
        }
    };
    std::vector<std::thread> threads;
    std::size_t started = 1;
    threads.reserve(count);
    try {
        for (; started < count; ++started)
            threads.emplace_back(run, started, others);
    } catch (const std::system_error &) {
        // No further thread to be had: this one does the work.
    }
    if (count > 0)
        run(0, callers);
    for (std::size_t lane = started; lane < count && !failures[0]; ++lane)
        run(lane, callers);
    if (count > 0 && failures[0])
        stopped = true;
    for (std::thread &thread : threads)
        thread.join();
    for (const std::exception_ptr &failure : failures)
        if (failure)
            std::rethrow_exception(failure);
}

} // namespace clsp
