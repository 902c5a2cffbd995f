#include "status.hpp"

#include "structs.hpp"

#include <string>

namespace clsp::capi {
namespace {

static_assert(static_cast<int>(Status::kInternal) == CLSP_ERROR_INTERNAL, "Status and CLSP_ERROR_* must agree");
static_assert(static_cast<int>(Status::kNoDevice) == CLSP_ERROR_NO_DEVICE, "Status and CLSP_ERROR_* must agree");
static_assert(static_cast<int>(Status::kCancelled) == CLSP_ERROR_CANCELLED, "Status and CLSP_ERROR_* must agree");

struct LastError {
    std::int32_t status = CLSP_SUCCESS;
    std::int32_t opencl_code = 0;
    const char *function = "";
    std::string message, build_log;
};

LastError &last_error() {
    thread_local LastError error;
    return error;
}

} // namespace

ClspStatus record(const char *function, const Error &error) noexcept {
    LastError &last = last_error();
    last.status = static_cast<std::int32_t>(error.status());
    last.opencl_code = error.opencl_code();
    last.function = function;
    try {
        last.message = error.what();
        last.build_log = error.build_log();
    } catch (...) {
        last.message.clear(); // no memory for the words; status and function still tell
        last.build_log.clear();
    }
    return last.status;
}

} // namespace clsp::capi

using namespace clsp;
using namespace clsp::capi;

extern "C" {

CLSP_API ClspStatus clspGetLastError(ClspErrorInfo *info) {
    // Not guarded(): a failure here must not overwrite what is asked for.
    if (!info || info->struct_size < kFirstSize<ClspErrorInfo>)
        return info ? CLSP_ERROR_INVALID_STRUCT_SIZE : CLSP_ERROR_INVALID_ARGUMENT;
    const LastError &last = last_error();
    ClspErrorInfo result{};
    result.struct_size = info->struct_size;
    result.status = last.status;
    result.opencl_code = last.opencl_code;
    result.function = last.function;
    result.message = last.message.c_str();
    result.build_log = last.build_log.c_str();
    write_struct(*info, result, "info");
    return CLSP_SUCCESS;
}

CLSP_API const char *clspStatusString(ClspStatus status) {
    switch (status) {
#define CLSP_NAME(name)                                                                                                \
    case name:                                                                                                         \
        return #name
        CLSP_NAME(CLSP_SUCCESS);
        CLSP_NAME(CLSP_ERROR_INVALID_ARGUMENT);
        CLSP_NAME(CLSP_ERROR_INVALID_STRUCT_SIZE);
        CLSP_NAME(CLSP_ERROR_INVALID_HANDLE);
        CLSP_NAME(CLSP_ERROR_BUFFER_TOO_SMALL);
        CLSP_NAME(CLSP_ERROR_WRONG_CONTEXT);
        CLSP_NAME(CLSP_ERROR_INVALID_FORMAT);
        CLSP_NAME(CLSP_ERROR_OVERLAP);
        CLSP_NAME(CLSP_ERROR_INVALID_DATA);
        CLSP_NAME(CLSP_ERROR_NO_DEVICE);
        CLSP_NAME(CLSP_ERROR_OPENCL);
        CLSP_NAME(CLSP_ERROR_BUILD);
        CLSP_NAME(CLSP_ERROR_OUT_OF_MEMORY);
        CLSP_NAME(CLSP_ERROR_UNSUPPORTED);
        CLSP_NAME(CLSP_ERROR_IO);
        CLSP_NAME(CLSP_ERROR_INVALID_STATE);
        CLSP_NAME(CLSP_ERROR_INTERNAL);
        CLSP_NAME(CLSP_ERROR_CANCELLED);
#undef CLSP_NAME
    default:
        return "unknown status";
    }
}

CLSP_API ClspStatus clspGetVersion(uint32_t *major, uint32_t *minor, uint32_t *patch, uint32_t *abi) {
    if (major)
        *major = CLSP_VERSION_MAJOR;
    if (minor)
        *minor = CLSP_VERSION_MINOR;
    if (patch)
        *patch = CLSP_VERSION_PATCH;
    if (abi)
        *abi = CLSP_ABI_VERSION;
    return CLSP_SUCCESS;
}

} // extern "C"
