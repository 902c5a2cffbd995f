#include "runtime/error.hpp"

#include <fmt/core.h>

namespace clsp {

std::string opencl_code_name(std::int32_t code) {
    switch (code) {
#define CLSP_NAME(name)                                                                                                \
    case name:                                                                                                         \
        return #name
        CLSP_NAME(CL_DEVICE_NOT_FOUND);
        CLSP_NAME(CL_DEVICE_NOT_AVAILABLE);
        CLSP_NAME(CL_COMPILER_NOT_AVAILABLE);
        CLSP_NAME(CL_MEM_OBJECT_ALLOCATION_FAILURE);
        CLSP_NAME(CL_OUT_OF_RESOURCES);
        CLSP_NAME(CL_OUT_OF_HOST_MEMORY);
        CLSP_NAME(CL_PROFILING_INFO_NOT_AVAILABLE);
        CLSP_NAME(CL_MEM_COPY_OVERLAP);
        CLSP_NAME(CL_BUILD_PROGRAM_FAILURE);
        CLSP_NAME(CL_MISALIGNED_SUB_BUFFER_OFFSET);
        CLSP_NAME(CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST);
        CLSP_NAME(CL_INVALID_VALUE);
        CLSP_NAME(CL_INVALID_DEVICE_TYPE);
        CLSP_NAME(CL_INVALID_PLATFORM);
        CLSP_NAME(CL_INVALID_DEVICE);
        CLSP_NAME(CL_INVALID_CONTEXT);
        CLSP_NAME(CL_INVALID_QUEUE_PROPERTIES);
        CLSP_NAME(CL_INVALID_COMMAND_QUEUE);
        CLSP_NAME(CL_INVALID_HOST_PTR);
        CLSP_NAME(CL_INVALID_MEM_OBJECT);
        CLSP_NAME(CL_INVALID_BINARY);
        CLSP_NAME(CL_INVALID_BUILD_OPTIONS);
        CLSP_NAME(CL_INVALID_PROGRAM);
        CLSP_NAME(CL_INVALID_PROGRAM_EXECUTABLE);
        CLSP_NAME(CL_INVALID_KERNEL_NAME);
        CLSP_NAME(CL_INVALID_KERNEL);
        CLSP_NAME(CL_INVALID_ARG_INDEX);
        CLSP_NAME(CL_INVALID_ARG_VALUE);
        CLSP_NAME(CL_INVALID_ARG_SIZE);
        CLSP_NAME(CL_INVALID_KERNEL_ARGS);
        CLSP_NAME(CL_INVALID_WORK_DIMENSION);
        CLSP_NAME(CL_INVALID_WORK_GROUP_SIZE);
        CLSP_NAME(CL_INVALID_WORK_ITEM_SIZE);
        CLSP_NAME(CL_INVALID_GLOBAL_OFFSET);
        CLSP_NAME(CL_INVALID_EVENT_WAIT_LIST);
        CLSP_NAME(CL_INVALID_EVENT);
        CLSP_NAME(CL_INVALID_OPERATION);
        CLSP_NAME(CL_INVALID_BUFFER_SIZE);
        CLSP_NAME(CL_INVALID_GLOBAL_WORK_SIZE);
        CLSP_NAME(CL_INVALID_PROPERTY);
#undef CLSP_NAME
    case -1001:
        return "CL_PLATFORM_NOT_FOUND_KHR";
    default:
        return fmt::format("OpenCL error {}", code);
    }
}

Error from_opencl(std::int32_t code, const char *call) {
    const std::string name = opencl_code_name(code);
    switch (code) {
    case CL_MEM_OBJECT_ALLOCATION_FAILURE:
    case CL_OUT_OF_HOST_MEMORY:
    case CL_INVALID_BUFFER_SIZE:
        return Error(Status::kOutOfMemory,
                     fmt::format("{} failed with {}: the device or host has not enough memory for it; use a smaller "
                                 "image or less oversampling, or release other buffers",
                                 call, name),
                     code);
    case CL_INVALID_EVENT_WAIT_LIST:
        return Error(
            Status::kInvalidArgument,
            fmt::format("{} failed with {}: num_events_in_wait_list and event_wait_list contradict each other, "
                        "or an event is not valid",
                        call, name),
            code);
    case CL_INVALID_CONTEXT:
        return Error(
            Status::kWrongContext,
            fmt::format("{} failed with {}: queue, buffers and events must belong to one cl_context", call, name),
            code);
    default:
        return Error(Status::kOpenCl, fmt::format("{} failed with {}", call, name), code);
    }
}

} // namespace clsp
