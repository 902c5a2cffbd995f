#include "statistics/workers.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <thread>
#include <vector>

namespace clsp {
namespace {

struct Stopped {};

// How soon a worker that waits learns that it is to stop.
constexpr std::chrono::milliseconds kPollPeriod{20};

} // namespace

void run_workers(std::size_t count, const std::function<void()> &checkpoint,
                 const std::function<void(const WorkerThread &self)> &work) {
    std::vector<std::exception_ptr> failures(count);
    std::atomic<bool> stopped{false};
    const std::function<void()> others = [&] {
        if (stopped)
            throw Stopped{};
    };
    const std::function<void()> callers = [&] {
        others();
        if (checkpoint)
            checkpoint();
    };
    const auto run = [&](std::size_t worker, const std::function<void()> &its_checkpoint) {
        try {
            work({worker, its_checkpoint});
        } catch (const Stopped &) {
            // another worker has thrown
        } catch (...) {
            failures[worker] = std::current_exception();
            stopped = true;
        }
    };
    std::vector<std::thread> threads;
    std::size_t started = 1;
    threads.reserve(count);
    try {
        for (; started < count; ++started)
            threads.emplace_back(run, started, others);
    } catch (...) {
        // No further thread to be had, or no memory for one: this one does the work.
    }
    if (count > 0)
        run(0, callers);
    for (std::size_t worker = started; worker < count && !stopped; ++worker)
        run(worker, callers);
    for (std::thread &thread : threads)
        thread.join();
    for (const std::exception_ptr &failure : failures)
        if (failure)
            std::rethrow_exception(failure);
}

void OpenTasks::run_one(Batch &batch, std::size_t i, const WorkerThread &by, std::unique_lock<std::mutex> &lock) {
    ++batch.running;
    lock.unlock();
    std::exception_ptr failure;
    try {
        batch.task(by, i);
    } catch (...) {
        failure = std::current_exception();
    }
    lock.lock();
    --batch.running;
    if (failure) {
        batch.end = batch.begin; // none more
        if (!batch.failure || i < batch.failed) {
            batch.failure = failure;
            batch.failed = i;
        }
    }
}

void OpenTasks::run(const WorkerThread &self, std::size_t count, const Task &task) {
    Batch batch{task, 0, count};
    std::unique_lock<std::mutex> lock(mutex_);
    const auto place = open_.insert(open_.end(), &batch);
    if (count > 1)
        changed_.notify_all();
    while (batch.begin < batch.end)
        run_one(batch, batch.begin++, self, lock);
    open_.erase(place);
    changed_.wait(lock, [&] { return batch.running == 0; });
    if (batch.failure)
        std::rethrow_exception(batch.failure);
}

void OpenTasks::work(const WorkerThread &self, const std::function<void()> &own) {
    std::unique_lock<std::mutex> lock(mutex_);
    ++busy_;
    lock.unlock();
    std::exception_ptr failure;
    try {
        own();
    } catch (...) {
        failure = std::current_exception();
    }
    lock.lock();
    --busy_;
    changed_.notify_all();
    if (failure)
        std::rethrow_exception(failure);
    while (busy_ > 0) {
        const auto batch = std::find_if(open_.begin(), open_.end(), [](const Batch *b) { return b->begin < b->end; });
        if (batch != open_.end()) {
            run_one(**batch, --(*batch)->end, self, lock);
            changed_.notify_all();
            continue;
        }
        changed_.wait_for(lock, kPollPeriod);
        lock.unlock();
        self.checkpoint();
        lock.lock();
    }
}

} // namespace clsp
