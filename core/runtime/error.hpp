// The one exception type of the engine. capi turns it into a status and the thread's last error.
#pragma once

#include "runtime/opencl.hpp"

#include <cstdint>
#include <exception>
#include <string>
#include <utility>

namespace clsp {

// The numbers are those of the C API (types.h); capi asserts that they agree.
enum class Status : std::int32_t {
    kSuccess = 0,
    kInvalidArgument = -1,
    kInvalidStructSize = -2,
    kInvalidHandle = -3,
    kBufferTooSmall = -4,
    kWrongContext = -5,
    kInvalidFormat = -6,
    kOverlap = -7,
    kInvalidData = -8,
    kNoDevice = -9,
    kOpenCl = -10,
    kBuild = -11,
    kOutOfMemory = -12,
    kUnsupported = -13,
    kIo = -14,
    kInvalidState = -15,
    kInternal = -16,
    kCancelled = -17,
};

class Error : public std::exception {
  public:
    Error(Status status, std::string message, std::int32_t opencl_code = 0, std::string build_log = {})
        : status_(status), message_(std::move(message)), opencl_code_(opencl_code), build_log_(std::move(build_log)) {}

    const char *what() const noexcept override { return message_.c_str(); }
    Status status() const noexcept { return status_; }
    std::int32_t opencl_code() const noexcept { return opencl_code_; }
    const std::string &build_log() const noexcept { return build_log_; }

  private:
    Status status_;
    std::string message_;
    std::int32_t opencl_code_;
    std::string build_log_;
};

// Name of an OpenCL error code, for example "CL_OUT_OF_RESOURCES"; "OpenCL error -9999" for unknown ones.
std::string opencl_code_name(std::int32_t code);

// What an OpenCL failure means for the caller: the status, and a message with the call and the code's name.
Error from_opencl(std::int32_t code, const char *call);

// Throws from_opencl() unless code is CL_SUCCESS.
inline void check_opencl(std::int32_t code, const char *call) {
    if (code != CL_SUCCESS)
        throw from_opencl(code, call);
}

} // namespace clsp
