// Work on the host beside the device's: frames are measured while the next ones are simulated.
#pragma once

#include <deque>
#include <functional>
#include <future>

namespace clsp {

// Up to four tasks run at once, on threads of their own, which share `threads` among them; with one thread tasks are
// the caller's. A task writes to places of its own, which outlive this object: its destructor waits for all. To be used
// from one thread.
class MeasurementTasks {
  public:
    explicit MeasurementTasks(unsigned threads);
    MeasurementTasks(const MeasurementTasks &) = delete;
    MeasurementTasks &operator=(const MeasurementTasks &) = delete;
    ~MeasurementTasks();

    // That a task may use.
    unsigned threads_each() const { return threads_each_; }
    // Waits while as many tasks run as may: what they hold is bounded. With one thread the task is done on return.
    // Throws what a task that ended has thrown.
    void start(std::function<void()> task);
    // Waits for all tasks, and throws what the first of them has thrown.
    void finish();

  private:
    unsigned threads_each_ = 1;
    std::size_t most_ = 1;
    bool beside_ = false;
    std::deque<std::future<void>> running_;
};

} // namespace clsp
