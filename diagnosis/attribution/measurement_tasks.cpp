#include "attribution/measurement_tasks.hpp"

#include <algorithm>
#include <system_error>
#include <utility>

namespace clsp {
namespace {

// A task holds the residuals of its frames: with more than that many at once, large captures would need several times
// their size.
constexpr unsigned kMostTasks = 4;

} // namespace

MeasurementTasks::MeasurementTasks(unsigned threads) : beside_(threads > 1) {
    const unsigned tasks = std::clamp(threads, 1u, kMostTasks);
    most_ = tasks;
    threads_each_ = std::max(1u, threads / tasks);
}

MeasurementTasks::~MeasurementTasks() {
    for (const std::future<void> &task : running_)
        task.wait();
}

void MeasurementTasks::start(std::function<void()> task) {
    if (!beside_)
        return task();
    while (running_.size() >= most_) {
        std::future<void> oldest = std::move(running_.front());
        running_.pop_front();
        oldest.get();
    }
    try {
        running_.push_back(std::async(std::launch::async, task));
    } catch (const std::system_error &) {
        task(); // there is no further thread to be had
    }
}

void MeasurementTasks::finish() {
    while (!running_.empty()) {
        std::future<void> oldest = std::move(running_.front());
        running_.pop_front();
        oldest.get();
    }
}

} // namespace clsp
