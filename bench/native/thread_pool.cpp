#include "native/thread_pool.hpp"

#include "native/lanes.hpp"

#include <algorithm>
#if defined(__linux__)
#include <pthread.h>
#include <sched.h>
#endif

namespace native {
namespace {

// Waits for a short time without a system call, as the next pass comes soon; then leaves the core to others.
template <class Condition> bool spins_until(Condition condition, int spins) {
    for (int i = 0; i < spins; ++i) {
        if (condition())
            return true;
#if defined(__AVX__)
        _mm_pause();
#endif
    }
    return condition();
}

constexpr int kSpins = 20000;

} // namespace

ThreadPool::ThreadPool(unsigned threads) {
    const unsigned cores = std::max(1u, std::thread::hardware_concurrency()), count = threads ? threads : cores;
    for (unsigned thread = 1; thread < count; ++thread) {
        workers_.emplace_back(&ThreadPool::worker, this, thread);
#if defined(__linux__)
        // Each on a core of its own, or the system leaves two on one for a while.
        cpu_set_t core;
        CPU_ZERO(&core);
        CPU_SET(thread % cores, &core);
        pthread_setaffinity_np(workers_.back().native_handle(), sizeof core, &core);
#endif
    }
}

ThreadPool::~ThreadPool() {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        end_ = true;
        ++round_;
    }
    begin_.notify_all();
    for (std::thread &worker : workers_)
        worker.join();
}

void ThreadPool::run(const std::function<void(unsigned)> &work) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        work_ = &work;
        ++round_;
    }
    begin_.notify_all();
    work(0);
    barrier();
}

void ThreadPool::worker(unsigned thread) {
    for (std::uint64_t round = 1;; ++round) {
        const auto begun = [&] { return round_.load(std::memory_order_acquire) >= round; };
        if (!spins_until(begun, kSpins)) {
            std::unique_lock<std::mutex> lock(mutex_);
            begin_.wait(lock, begun);
        }
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            if (end_)
                return;
        }
        (*work_)(thread);
        barrier();
    }
}

void ThreadPool::barrier() {
    finish_streams();
    const std::uint64_t phase = phase_.load(std::memory_order_acquire);
    if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == threads()) {
        arrived_.store(0, std::memory_order_relaxed);
        phase_.store(phase + 1, std::memory_order_release);
        return;
    }
    const auto passed = [&] { return phase_.load(std::memory_order_acquire) != phase; };
    while (!spins_until(passed, kSpins))
        std::this_thread::yield();
}

} // namespace native
