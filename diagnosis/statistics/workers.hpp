// Independent work side by side, with one caller who alone may cancel it.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <list>
#include <mutex>

namespace clsp {

struct WorkerThread {
    std::size_t number;
    // To be called now and then: ends the worker once another one has thrown.
    const std::function<void()> &checkpoint;
};

// Calls work(self) for the workers 0 ... count - 1, the first on this thread, each other on one of its own, and returns
// when all have ended. In worker 0 its checkpoint also calls `checkpoint` (may be empty). Throws what the first worker
// that failed has thrown.
void run_workers(std::size_t count, const std::function<void()> &checkpoint,
                 const std::function<void(const WorkerThread &self)> &work);

// What workers that work side by side have laid open to each other: one that has nothing left of its own helps the
// others.
class OpenTasks {
  public:
    // Runs own(), which may call run(); then helps, until no worker is left in its own(). One that comes before any
    // other has begun its own does not wait for them: own() is to end only when all of the workers' work has been
    // begun.
    void work(const WorkerThread &self, const std::function<void()> &own);
    // Calls task(by, 0) ... task(by, count - 1), which are to be independent of each other, on this thread or on those
    // of workers that help, by: self or the helper; returns when all have ended. Throws what the first of them that
    // failed has thrown.
    using Task = std::function<void(const WorkerThread &by, std::size_t i)>;
    void run(const WorkerThread &self, std::size_t count, const Task &task);

  private:
    struct Batch {
        const Task &task;
        std::size_t begin, end; // not begun: the owner takes the first of them, helpers the last
        std::size_t running = 0;
        std::size_t failed = 0; // the task of `failure`
        std::exception_ptr failure = nullptr;
    };
    void run_one(Batch &batch, std::size_t i, const WorkerThread &by, std::unique_lock<std::mutex> &lock);

    std::mutex mutex_;
    std::condition_variable changed_;
    std::list<Batch *> open_;
    std::size_t busy_ = 0; // workers with work of their own
};

} // namespace clsp
