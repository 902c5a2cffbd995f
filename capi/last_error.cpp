#include "status.hpp"
#include "structs.hpp"

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
