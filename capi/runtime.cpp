#include "clspeckle/runtime.h"

#include "convert.hpp"
#include "fft/engine_choices.hpp"
#include "handles.hpp"
#include "runtime/buffer_memory.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/device.hpp"
#include "texts.hpp"

#include <vector>

using namespace clsp;
using namespace clsp::capi;

namespace clsp::capi {

CLSP_ENUM(DiskCache, kOn, CLSP_DISK_CACHE_AUTO, CLSP_DISK_CACHE_OFF, CLSP_DISK_CACHE_ON)

} // namespace clsp::capi

namespace {

static_assert(static_cast<std::uint32_t>(LogLevel::kWarning) == CLSP_LOG_WARNING &&
                  static_cast<std::uint32_t>(LogLevel::kInfo) == CLSP_LOG_INFO,
              "the engine's levels are those of types.h");

std::string text_or_empty(const char *text) {
    return text ? text : "";
}

ClspDeviceInfo device_info(const DeviceRecord &record, std::uint32_t rank) {
    ClspDeviceInfo info{};
    info.struct_size = sizeof info;
    info.usable = record.usable ? 1 : 0;
    info.type = record.type;
    info.global_memory_bytes = record.global_memory_bytes;
    info.max_allocation_bytes = record.max_allocation_bytes;
    info.local_memory_bytes = record.local_memory_bytes;
    info.max_work_group_size = record.max_work_group_size;
    info.compute_units = record.compute_units;
    info.rank = rank;
    info.platform_id = record.platform();
    info.device_id = record.device();
    copy_text(info.selector, record.selector);
    copy_text(info.name, record.name);
    copy_text(info.vendor, record.vendor);
    copy_text(info.version, record.version);
    copy_text(info.driver_version, record.driver_version);
    copy_text(info.platform_name, record.platform_name);
    copy_text(info.reason, record.reason);
    return info;
}

ClspContextDesc context_defaults() {
    ClspContextDesc desc{};
    desc.struct_size = sizeof desc;
    desc.disk_cache = CLSP_DISK_CACHE_AUTO;
    return desc;
}

::cl_context context_of(cl_command_queue queue) {
    if (!queue)
        throw Error(Status::kInvalidArgument,
                    "queue is NULL; make one with clspQueueCreate() or clCreateCommandQueue()");
    refuse_fork();
    ::cl_context context = nullptr;
    check_opencl(clGetCommandQueueInfo(queue, CL_QUEUE_CONTEXT, sizeof context, &context, nullptr),
                 "clGetCommandQueueInfo");
    return context;
}

void check_transfer(cl_command_queue queue, const void *data, std::uint64_t size_bytes, cl_mem mem,
                    std::uint64_t offset_bytes) {
    const ::cl_context context = context_of(queue);
    if (!data)
        throw Error(Status::kInvalidArgument, "data is NULL");
    if (size_bytes == 0)
        throw Error(Status::kInvalidArgument, "size_bytes is 0; there is nothing to copy");
    check_buffer(mem, "mem", context, offset_bytes, size_bytes);
}

void write(cl_command_queue queue, const void *data, std::uint64_t size_bytes, cl_mem mem, std::uint64_t offset_bytes,
           cl_bool blocking, cl_uint num_waits, const cl_event *waits, cl_event *event) {
    check_transfer(queue, data, size_bytes, mem, offset_bytes);
    check_wait_list(context_of(queue), num_waits, waits);
    check_opencl(clEnqueueWriteBuffer(queue, mem, blocking, offset_bytes, size_bytes, data, num_waits, waits, event),
                 "clEnqueueWriteBuffer");
}

void read(cl_command_queue queue, cl_mem mem, std::uint64_t offset_bytes, std::uint64_t size_bytes, void *data,
          cl_bool blocking, cl_uint num_waits, const cl_event *waits, cl_event *event) {
    check_transfer(queue, data, size_bytes, mem, offset_bytes);
    check_wait_list(context_of(queue), num_waits, waits);
    check_opencl(clEnqueueReadBuffer(queue, mem, blocking, offset_bytes, size_bytes, data, num_waits, waits, event),
                 "clEnqueueReadBuffer");
}

// Intel's CPU runtime hangs where an out-of-order queue dies in its own worker, with the last command that refers to
// it.
void finish_last_use(cl_command_queue queue) {
    cl_uint references = 0;
    cl_command_queue_properties properties = 0;
    clGetCommandQueueInfo(queue, CL_QUEUE_REFERENCE_COUNT, sizeof references, &references, nullptr);
    clGetCommandQueueInfo(queue, CL_QUEUE_PROPERTIES, sizeof properties, &properties, nullptr);
    if (references == 1 && (properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) != 0)
        clFinish(queue);
}

} // namespace

extern "C" {

CLSP_API ClspStatus clspDeviceList(uint32_t capacity, ClspDeviceInfo *devices, uint32_t *count) {
    return guarded("clspDeviceList", [&] {
        required(count, "count");
        if (capacity > 0 && !devices)
            throw Error(Status::kInvalidArgument, "devices is NULL although capacity is not 0");
        if (capacity > 0)
            check_struct_size(devices->struct_size, kFirstSize<ClspDeviceInfo>, "devices");
        begin_opencl();
        const std::vector<DeviceRecord> records = list_devices();
        const std::uint32_t stride = capacity > 0 ? devices->struct_size : 0;
        for (std::uint32_t i = 0; i < capacity && i < records.size(); ++i) {
            auto *element =
                reinterpret_cast<ClspDeviceInfo *>(reinterpret_cast<char *>(devices) + std::size_t{i} * stride);
            element->struct_size = stride;
            write_struct(*element, device_info(records[i], i), "devices");
        }
        *count = static_cast<std::uint32_t>(records.size());
    });
}

CLSP_API ClspStatus clspDeviceExplain(const char *selector, uint64_t capacity, char *text, uint64_t *length) {
    return guarded("clspDeviceExplain", [&] {
        begin_opencl();
        give_text(explain_devices(text_or_empty(selector)), capacity, text, length, "text");
    });
}

CLSP_INIT(ContextDesc, desc, context_defaults())

CLSP_API ClspStatus clspContextCreate(const ClspContextDesc *desc, ClspContext *context) {
    return guarded("clspContextCreate", [&] {
        required(context, "context");
        begin_opencl();
        const ClspContextDesc d = desc ? read_struct(desc, context_defaults(), "desc") : context_defaults();
        ContextParameters parameters;
        parameters.host_context = d.cl_context_handle;
        parameters.host_device = d.cl_device;
        parameters.device = text_or_empty(d.device);
        parameters.kernel_dir = text_or_empty(d.kernel_dir);
        parameters.cache_dir = text_or_empty(d.cache_dir);
        parameters.disk_cache = checked_enum<DiskCache>(d.disk_cache, "desc->disk_cache");
        if (d.log)
            parameters.log = [log = d.log, data = d.log_data](LogLevel level, const std::string &message) {
                log(data, static_cast<std::uint32_t>(level), message.c_str());
            };
        const auto made = Context::create(parameters);
        forced_engine(*made); // other words are refused here, not at the first aperture
        give(context, made);
    });
}

CLSP_REFERENCES(Context)

CLSP_API ClspStatus clspContextGetInfo(ClspContext context, ClspContextInfo *info) {
    return guarded("clspContextGetInfo", [&] {
        const auto c = object(context);
        ClspContextInfo result{};
        result.programs_built = c->programs().built();
        result.programs_from_cache = c->programs().from_disk();
        result.allocation_count = c->memory_use().allocation_count;
        result.allocated_bytes = c->memory_use().allocated_bytes;
        result.cl_context_handle = c->cl_context()();
        result.cl_device = c->device()();
        copy_text(result.device_name, c->device_name());
        copy_text(result.platform_name, c->platform_name());
        write_struct(required(info, "info"), result, "info");
    });
}

CLSP_API ClspStatus clspQueueCreate(ClspContext context, uint32_t flags, cl_command_queue *queue) {
    return guarded("clspQueueCreate", [&] {
        const auto c = object(context);
        required(queue, "queue");
        if (flags & ~(CLSP_QUEUE_PROFILING | CLSP_QUEUE_OUT_OF_ORDER))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("flags is {:#x}, expected CLSP_QUEUE_PROFILING and CLSP_QUEUE_OUT_OF_ORDER or 0", flags));
        const cl_command_queue_properties properties =
            (flags & CLSP_QUEUE_PROFILING ? CL_QUEUE_PROFILING_ENABLE : 0) |
            (flags & CLSP_QUEUE_OUT_OF_ORDER ? CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE : 0);
        cl_int code = CL_SUCCESS;
        const cl_command_queue made = clCreateCommandQueue(c->cl_context()(), c->device()(), properties, &code);
        if (code == CL_INVALID_QUEUE_PROPERTIES)
            throw Error(Status::kUnsupported, "the device has no out-of-order queues; make an in-order one", code);
        check_opencl(code, "clCreateCommandQueue");
        *queue = made;
    });
}

CLSP_API ClspStatus clspQueueFinish(cl_command_queue queue) {
    return guarded("clspQueueFinish", [&] {
        context_of(queue);
        check_opencl(clFinish(queue), "clFinish");
    });
}

CLSP_API ClspStatus clspQueueRelease(cl_command_queue queue) {
    return guarded("clspQueueRelease", [&] {
        if (!queue || was_forked())
            return;
        finish_last_use(queue);
        check_opencl(clReleaseCommandQueue(queue), "clReleaseCommandQueue");
    });
}

CLSP_API ClspStatus clspBufferCreate(ClspContext context, uint64_t size_bytes, cl_mem *mem) {
    return guarded("clspBufferCreate", [&] {
        const auto c = object(context);
        required(mem, "mem");
        if (size_bytes == 0)
            throw Error(Status::kInvalidArgument, "size_bytes is 0");
        if (size_bytes > c->device().getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>())
            throw Error(Status::kOutOfMemory,
                        fmt::format("size_bytes is {}, but {} allocates at most {} bytes at once", size_bytes,
                                    c->device_name(), c->device().getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>()));
        cl::Buffer made = allocate_buffer(*c, size_bytes);
        *mem = made();
        made() = nullptr; // the caller's from here on
    });
}

CLSP_API ClspStatus clspBufferRelease(cl_mem mem) {
    return guarded("clspBufferRelease", [&] {
        if (mem && !was_forked())
            check_opencl(clReleaseMemObject(mem), "clReleaseMemObject");
    });
}

CLSP_API ClspStatus clspBufferEnqueueWrite(cl_command_queue queue, const void *data, uint64_t size_bytes, cl_mem mem,
                                           uint64_t offset_bytes, uint32_t num_events_in_wait_list,
                                           const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspBufferEnqueueWrite", [&] {
        write(queue, data, size_bytes, mem, offset_bytes, CL_FALSE, num_events_in_wait_list, event_wait_list, event);
    });
}

CLSP_API ClspStatus clspBufferEnqueueRead(cl_command_queue queue, cl_mem mem, uint64_t offset_bytes,
                                          uint64_t size_bytes, void *data, uint32_t num_events_in_wait_list,
                                          const cl_event *event_wait_list, cl_event *event) {
    return guarded("clspBufferEnqueueRead", [&] {
        read(queue, mem, offset_bytes, size_bytes, data, CL_FALSE, num_events_in_wait_list, event_wait_list, event);
    });
}

CLSP_API ClspStatus clspBufferWrite(cl_command_queue queue, const void *data, uint64_t size_bytes, cl_mem mem,
                                    uint64_t offset_bytes) {
    return guarded("clspBufferWrite", [&] {
        // CL_TRUE says that `data` may be used again. Intel's runtime for CPUs means no more by it: other queues see
        // the bytes later.
        cl::Event written;
        write(queue, data, size_bytes, mem, offset_bytes, CL_TRUE, 0, nullptr, &written());
        wait_for_events(1, &written());
    });
}

CLSP_API ClspStatus clspBufferRead(cl_command_queue queue, cl_mem mem, uint64_t offset_bytes, uint64_t size_bytes,
                                   void *data) {
    return guarded("clspBufferRead",
                   [&] { read(queue, mem, offset_bytes, size_bytes, data, CL_TRUE, 0, nullptr, nullptr); });
}

CLSP_API ClspStatus clspEventWait(uint32_t num_events, const cl_event *events) {
    return guarded("clspEventWait", [&] {
        if (num_events == 0 || !events)
            throw Error(Status::kInvalidArgument, "num_events is 0 or events is NULL; give at least one event");
        refuse_fork();
        for (std::uint32_t i = 0; i < num_events; ++i)
            if (!events[i])
                throw Error(Status::kInvalidArgument, fmt::format("events[{}] is NULL", i));
        wait_for_events(num_events, events);
    });
}

CLSP_API ClspStatus clspEventRelease(cl_event event) {
    return guarded("clspEventRelease", [&] {
        if (event && !was_forked())
            check_opencl(clReleaseEvent(event), "clReleaseEvent");
    });
}

} // extern "C"
