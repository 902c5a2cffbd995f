// Threads that stay, one for each core with the caller's: passes are too short to start threads for.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace native {

class ThreadPool {
  public:
    explicit ThreadPool(unsigned threads); // 0: one for each core
    ~ThreadPool();
    ThreadPool(const ThreadPool &) = delete;
    ThreadPool &operator=(const ThreadPool &) = delete;

    unsigned threads() const { return unsigned(workers_.size()) + 1; }
    // Calls work(thread) on all threads, thread = 0 on the caller's, and returns when all have.
    void run(const std::function<void(unsigned)> &work);
    // Within `work`, on every thread: none goes on before all have come. Others' streamed stores are there behind it.
    void barrier();

  private:
    void worker(unsigned thread);

    std::vector<std::thread> workers_;
    const std::function<void(unsigned)> *work_ = nullptr;
    std::mutex mutex_;
    std::condition_variable begin_;
    bool end_ = false;
    std::atomic<std::uint64_t> round_{0}, phase_{0};
    std::atomic<unsigned> arrived_{0};
};

} // namespace native
