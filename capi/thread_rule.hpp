// One handle, one thread at a time: a second thread is answered by an error, not by a corrupted heap.
#pragma once

#include "runtime/error.hpp"

#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

namespace clsp::capi {

enum class ThreadRule {
    kAnyThread, // never changes, or locks by itself
    kOneWriter, // any number of threads may read it; object_to_change() is alone
    kOneThread,
};

// The calls that run on one object.
class CallsInside {
  public:
    explicit CallsInside(const char *name) : name_(name) {}

    // alone: beside no call but those of a thread that is alone already, which may call again from a callback.
    void enter(bool alone) {
        const std::lock_guard<std::mutex> lock(mutex_);
        const std::thread::id self = std::this_thread::get_id();
        const bool another_is_alone = alone_ != std::thread::id() && alone_ != self;
        const bool others = count_ > 0 && alone_ != self;
        if (another_is_alone || (alone && others))
            throw Error(Status::kInvalidState,
                        std::string(name_) + " is in use by another call at this moment; give each thread a handle of "
                                             "its own, or let one call wait for the other");
        if (alone)
            alone_ = self;
        ++count_;
    }

    void leave() noexcept {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (--count_ == 0)
            alone_ = {};
    }

  private:
    const char *name_;
    std::mutex mutex_;
    std::thread::id alone_; // none: only readers, if any
    std::uint32_t count_ = 0;
};

} // namespace clsp::capi
