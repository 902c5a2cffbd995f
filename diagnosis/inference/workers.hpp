// Independent work side by side, with one caller who alone may cancel it.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <list>
#include <mutex>

namespace clsp {

// Calls work(worker, checkpoint) for the workers 0 ... count - 1, the first on this thread, each other on one of its own,
// and returns when all have ended. Work is to call its checkpoint now and then: it ends the worker once another one has
// thrown, and in worker 0 it calls `checkpoint` (may be empty). Throws what the first worker that failed has thrown.
void run_workers(std::size_t count, const std::function<void()> &checkpoint,
               const std::function<void(std::size_t worker, const std::function<void()> &checkpoint)> &work);

// What workers that work side by side have laid open to each other: one that has nothing left of its own helps the others.
class OpenTasks {
  public:
    // Runs own(), which may call run(); then helps, until no worker is left in its own(). One that comes before any other
    // has begun its own does not wait for them: own() is to end only when all of the workers' work has been begun.
    void work(const std::function<void()> &checkpoint, const std::function<void()> &own);
    // Calls task(0) ... task(count - 1), which are to be independent of each other, on this thread or on those of workers
    // that help; returns when all have ended. Throws what the first of them that failed has thrown.
    void run(std::size_t count, const std::function<void(std::size_t)> &task);

  private:
    struct Batch {
        const std::function<void(std::size_t)> &task;
        std::size_t begin, end; // not begun: the owner takes the first of them, helpers the last
        std::size_t running = 0;
        std::size_t failed = 0; // the task of `failure`
        std::exception_ptr failure = nullptr;
    };
    void run_one(Batch &batch, std::size_t i, std::unique_lock<std::mutex> &lock);

    std::mutex mutex_;
    std::condition_variable changed_;
    std::list<Batch *> open_;
    std::size_t busy_ = 0; // workers with work of their own
};

} // namespace clsp
