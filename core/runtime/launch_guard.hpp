// A fault of PoCL before version 6 that ends the process, and how queues of our own keep clear of it.
//
// PoCL keeps what it has loaded of a kernel by the kernel, its work-group and the largest extent of a launch that it
// serves, and counts its uses. When a launch ends it looks for what to count down by kernel and work-group alone, and
// takes what was used last. A launch of larger extent than any before makes a new entry, used once and found first:
// launches of the same kernel that are still under way on other queues are counted down there, and the third ends the
// process ("pocl_release_dlhandle_cache: Assertion `found->ref_count > 0' failed"). It takes three queues or more. So a
// guarded queue's first launch of a kernel of an extent waits until the others are through, and they for it.
#pragma once

#include "runtime/context.hpp"
#include "runtime/opencl.hpp"

#include <array>
#include <atomic>
#include <cstddef>
#include <functional>
#include <string>

namespace clsp {

// Guards a queue for as long as this object lives; does nothing on devices without the fault. For queues whose commands
// wait for nothing that a host has yet to do, since one waits for another. Safe to use from any number of threads at
// once.
class LaunchGuard {
  public:
    LaunchGuard(const Context &context, const cl::CommandQueue &queue);
    ~LaunchGuard();
    LaunchGuard(const LaunchGuard &) = delete;
    LaunchGuard &operator=(const LaunchGuard &) = delete;

    // Calls enqueue(), which launches the kernel on the queue; extent: the global and the local work size. While no
    // queue is guarded this is the call alone: every frame's launches go through it.
    template <typename Function>
    static void launch(cl_command_queue queue, cl_kernel kernel, const std::array<std::size_t, 4> &extent,
                       const Function &enqueue) {
        if (guarded_queues_.load(std::memory_order_relaxed) == 0)
            enqueue();
        else
            launch_among_guarded(queue, kernel, extent, enqueue);
    }

  private:
    static void launch_among_guarded(cl_command_queue queue, cl_kernel kernel, const std::array<std::size_t, 4> &extent,
                                     const std::function<void()> &enqueue);
    static std::atomic<std::size_t> guarded_queues_;
    cl_command_queue queue_ = nullptr; // if it is guarded
};

// Whether the text that a platform gives as its version is that of a PoCL with the fault; also where no number is
// found.
bool pocl_miscounts_kernels(const std::string &platform_version);

} // namespace clsp
