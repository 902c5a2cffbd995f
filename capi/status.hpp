// The wall between the engine and C: exceptions become a status and the thread's last error.
#pragma once

#include "clspeckle/types.h"
#include "runtime/error.hpp"

#include <cstdint>
#include <new>
#include <string>
#include <utility>

namespace clsp::capi {

// What went wrong last in this thread.
struct LastError {
    std::int32_t status = CLSP_SUCCESS;
    std::int32_t opencl_code = 0;
    const char *function = "";
    std::string message, build_log;
};
LastError &last_error() noexcept;

// Notes a failure for clspGetLastError() of this thread; returns the status.
ClspStatus record(const char *function, const Error &error) noexcept;

// Runs the body of a public function. Nothing escapes.
template <typename Body> ClspStatus guarded(const char *function, Body &&body) noexcept {
    try {
        try {
            std::forward<Body>(body)();
            return CLSP_SUCCESS;
        } catch (const Error &error) {
            return record(function, error);
        } catch (const cl::Error &error) {
            return record(function, from_opencl(error.err(), error.what()));
        } catch (const std::bad_alloc &) {
            return record(function, Error(Status::kOutOfMemory, "the host has not enough memory"));
        } catch (const std::exception &error) {
            return record(function, Error(Status::kInternal, error.what()));
        }
    } catch (...) {
        // Even the message did not fit in memory.
        return CLSP_ERROR_INTERNAL;
    }
}

// An output pointer that must not be NULL.
template <typename T> T &required(T *pointer, const char *name) {
    if (!pointer)
        throw Error(Status::kInvalidArgument, std::string(name) + " is NULL");
    return *pointer;
}

} // namespace clsp::capi
