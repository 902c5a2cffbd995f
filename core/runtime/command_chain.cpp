#include "runtime/command_chain.hpp"

#include "runtime/launch_guard.hpp"

#include <fmt/core.h>

namespace clsp {

CommandChain::CommandChain(cl_command_queue queue, cl_uint num_waits, const cl_event *waits, ChainProfile *profile)
    : queue_(queue), num_waits_(num_waits), waits_(waits), profile_(profile) {
    cl_command_queue_properties properties = 0;
    check_opencl(clGetCommandQueueInfo(queue, CL_QUEUE_PROPERTIES, sizeof properties, &properties, nullptr),
                 "clGetCommandQueueInfo");
    out_of_order_ = (properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) != 0;
    if (!(properties & CL_QUEUE_PROFILING_ENABLE))
        profile_ = nullptr;
    wants_events_ = out_of_order_ || profile_;
}

void CommandChain::run(const char *stage, const cl::Kernel &kernel, std::size_t width, std::size_t height,
                       std::size_t depth, std::size_t local_width) {
    const std::size_t global[3] = {local_width ? (width + local_width - 1) / local_width * local_width : width, height,
                                   depth};
    const std::size_t local[3] = {local_width, 1, 1};
    const cl_uint dimensions = depth > 1 ? 3 : height > 1 ? 2 : 1;
    make_room();
    cl_event event = nullptr;
    LaunchGuard::launch(queue_, kernel(), {global[0], global[1], global[2], local_width}, [&] {
        check_opencl(clEnqueueNDRangeKernel(queue_, kernel(), dimensions, nullptr, global,
                                            local_width ? local : nullptr, num_waits_, waits_,
                                            wants_events_ ? &event : nullptr),
                     "clEnqueueNDRangeKernel");
    });
    took(stage, event);
}

void CommandChain::copy(const char *stage, cl_mem from, std::size_t from_offset, cl_mem to, std::size_t to_offset,
                        std::size_t bytes) {
    make_room();
    cl_event event = nullptr;
    check_opencl(clEnqueueCopyBuffer(queue_, from, to, from_offset, to_offset, bytes, num_waits_, waits_,
                                     wants_events_ ? &event : nullptr),
                 "clEnqueueCopyBuffer");
    took(stage, event);
}

void CommandChain::make_room() {
    if (profile_ && profile_->entries.size() == profile_->entries.capacity())
        profile_->entries.reserve(2 * profile_->entries.capacity() + 16);
}

void CommandChain::took(const char *stage, cl_event event) {
    last_ = cl::Event(event); // takes over the reference
    if (profile_)
        profile_->entries.push_back({stage, last_});
    if (out_of_order_) {
        last_raw_ = last_();
        num_waits_ = 1;
        waits_ = &last_raw_;
    } else {
        num_waits_ = 0; // the queue keeps the order; the caller's wait list was for the first command
        waits_ = nullptr;
    }
}

void CommandChain::finish(cl_event *event) {
    if (!event)
        return;
    if (last_()) {
        check_opencl(clRetainEvent(last_()), "clRetainEvent");
        *event = last_();
        return;
    }
    check_opencl(clEnqueueMarkerWithWaitList(queue_, num_waits_, waits_, event), "clEnqueueMarkerWithWaitList");
}

void check_wait_list(::cl_context context, cl_uint num_waits, const cl_event *waits) {
    if ((num_waits == 0) != (waits == nullptr))
        throw Error(Status::kInvalidArgument,
                    fmt::format("num_events_in_wait_list is {} but event_wait_list is {}; give both or neither",
                                num_waits, waits ? "not NULL" : "NULL"));
    for (cl_uint i = 0; i < num_waits; ++i) {
        if (!waits[i])
            throw Error(Status::kInvalidArgument, fmt::format("event_wait_list[{}] is NULL", i));
        ::cl_context event_context = nullptr;
        check_opencl(clGetEventInfo(waits[i], CL_EVENT_CONTEXT, sizeof event_context, &event_context, nullptr),
                     "clGetEventInfo");
        if (event_context != context)
            throw Error(Status::kWrongContext, fmt::format("event_wait_list[{}] belongs to another cl_context", i));
    }
}

void wait_for_events(cl_uint count, const cl_event *events) {
    check_opencl(clWaitForEvents(count, events), "clWaitForEvents");
    for (cl_uint i = 0; i < count; ++i) {
        cl_int status = CL_COMPLETE;
        check_opencl(clGetEventInfo(events[i], CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof status, &status, nullptr),
                     "clGetEventInfo");
        if (status < 0)
            throw from_opencl(CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST, "clWaitForEvents");
    }
}

} // namespace clsp
