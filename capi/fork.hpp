// The threads of an OpenCL runtime do not survive fork(): in the child a call would hang for ever.
#pragma once

#include "runtime/error.hpp"

#include <atomic>
#include <mutex>

#if defined(__unix__) || defined(__APPLE__)
#include <pthread.h>
#endif

namespace clsp::capi {

inline std::atomic<bool> &forked_flag() {
    static std::atomic<bool> flag{false};
    return flag;
}

// In a child of fork() whose parent had used OpenCL. Objects that it inherited are neither used nor released.
inline bool was_forked() {
    return forked_flag().load(std::memory_order_relaxed);
}

inline void refuse_fork() {
    if (was_forked())
        throw Error(Status::kInvalidState,
                    "this process was forked from one that had already used OpenCL, which does not survive a fork; use "
                    "clSpeckle in the children alone, or start them by exec");
}

// Before the first OpenCL call.
inline void begin_opencl() {
    refuse_fork();
#if defined(__unix__) || defined(__APPLE__)
    static std::once_flag once;
    std::call_once(once, [] { pthread_atfork(nullptr, nullptr, [] { forked_flag() = true; }); });
#endif
}

} // namespace clsp::capi
