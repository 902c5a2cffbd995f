// Commands that run one after the other on any queue, and the times they took.
#pragma once

#include "runtime/error.hpp"
#include "runtime/opencl.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

// The events of a chain's commands, kept to read their times later.
struct ChainProfile {
    struct Entry {
        const char *stage; // a string literal
        cl::Event event;
    };
    std::vector<Entry> entries;
};

// One Enqueue call of the API: takes the caller's wait list, runs commands in order, gives the caller an event. On an
// in-order queue no event is made for the steps between; on an out-of-order queue each command waits for the one
// before.
class CommandChain {
  public:
    // profile: where to keep events, if the queue has profiling on; may be nullptr.
    CommandChain(cl_command_queue queue, cl_uint num_waits, const cl_event *waits, ChainProfile *profile = nullptr);
    CommandChain(const CommandChain &) = delete;
    CommandChain &operator=(const CommandChain &) = delete;

    cl_command_queue queue() const { return queue_; }

    // A kernel over width x height x depth work-items (not rounded: the device chooses the work-group).
    void run(const char *stage, const cl::Kernel &kernel, std::size_t width, std::size_t height = 1,
             std::size_t depth = 1) {
        run(stage, kernel, width, height, depth, 0);
    }
    // The same with a work-group of local_width; width is rounded up to a multiple of it.
    void run(const char *stage, const cl::Kernel &kernel, std::size_t width, std::size_t height, std::size_t depth,
             std::size_t local_width);

    void copy(const char *stage, cl_mem from, std::size_t from_offset, cl_mem to, std::size_t to_offset,
              std::size_t bytes);

    // A command of another library: function(num_waits, waits, event or nullptr).
    template <typename Function> void run_foreign(const char *stage, Function function) {
        make_room();
        cl_event event = nullptr;
        function(num_waits_, waits_, wants_events_ ? &event : nullptr);
        took(stage, event);
    }

    // Ends the chain; gives the caller's event if `event` is not nullptr.
    void finish(cl_event *event);

  private:
    // Before a command, so that nothing can fail between it and its event's place.
    void make_room();
    void took(const char *stage, cl_event event);

    cl_command_queue queue_;
    bool out_of_order_ = false, wants_events_ = false;
    cl_uint num_waits_;
    const cl_event *waits_;
    cl_event last_raw_ = nullptr;
    cl::Event last_;
    ChainProfile *profile_;
};

// Throws kInvalidArgument if the list and its length contradict each other or an event is NULL, kWrongContext if an
// event belongs to another context.
void check_wait_list(::cl_context context, cl_uint num_waits, const cl_event *waits);

// Waits for all events. Throws kOpenCl if one of them ended with an error, also where the driver's clWaitForEvents()
// takes that for success, as NVIDIA's does.
void wait_for_events(cl_uint count, const cl_event *events);

} // namespace clsp
