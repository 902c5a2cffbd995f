// Kernels of growing extent on many queues at once, which end the process on PoCL before version 6
// (runtime/launch_guard.hpp).
#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/kernel_arguments.hpp"
#include "runtime/launch_guard.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>
#include <vector>

namespace clsp {
namespace {

TEST(LaunchGuard, KnowsTheVersions) {
    EXPECT_TRUE(pocl_miscounts_kernels("OpenCL 3.0 PoCL 3.1+debian  Linux, None+Asserts, RELOC, SPIR, LLVM 15.0.6"));
    EXPECT_TRUE(pocl_miscounts_kernels("OpenCL 2.0 pocl 1.8  Linux, None+Asserts, RELOC, LLVM 14.0.0"));
    EXPECT_TRUE(pocl_miscounts_kernels("OpenCL 3.0 PoCL 5.0  Linux"));
    EXPECT_FALSE(pocl_miscounts_kernels("OpenCL 3.0 PoCL 6.0  Linux, Release, RELOC"));
    EXPECT_FALSE(pocl_miscounts_kernels("OpenCL 3.0 PoCL 10.2-pre  Linux"));
    EXPECT_TRUE(pocl_miscounts_kernels("OpenCL 3.0 PoCL main-0-g12ab"));
    EXPECT_TRUE(pocl_miscounts_kernels(""));
}

// Without the guard, 40 rounds ended the process in 8 of 8 runs; with it, every launch has done its work.
TEST(LaunchGuard, ExtentsMayGrowOnManyQueues) {
    constexpr int kRounds = 40, kLaunches = 200, kAdds = 20000;
    constexpr std::size_t kQueues = 8;
    const auto context = Context::create({});
    for (int round = 0; round < kRounds; ++round) {
        // Each round's kernel is another one, of which nothing has been loaded.
        const ProgramCache::GeneratedHeader program{
            "launch_guard.cl", fmt::format("__kernel void grow(__global uint *sums, uint count) {{\n"
                                           "    uint sum = sums[get_global_id(0)];\n"
                                           "    for (uint i = 0; i < count; ++i)\n"
                                           "        sum = (sum ^ i) + {}u;\n"
                                           "    sums[get_global_id(0)] = sum | 1u;\n"
                                           "}}\n",
                                           round)};
        context->kernel(program.name, "grow", {}, &program);
        std::vector<std::thread> threads;
        std::vector<std::size_t> missing(kQueues, 1);
        for (std::size_t thread = 0; thread < kQueues; ++thread)
            threads.emplace_back([&, thread] {
                const cl::CommandQueue queue(context->cl_context(), context->device());
                const LaunchGuard guard(*context, queue);
                cl::Kernel kernel = context->kernel(program.name, "grow", {}, &program);
                const std::vector<cl_uint> zeros(64);
                const DeviceBuffer sums(context, zeros.size() * sizeof(cl_uint), zeros.data());
                KernelArguments(kernel).add(sums.get()()).add(cl_uint{kAdds});
                std::size_t largest = 0;
                for (int launch = 0; launch < kLaunches; ++launch) {
                    const std::size_t width =
                        1 + static_cast<std::size_t>(launch) / 20 * 2 + (thread + static_cast<std::size_t>(launch)) % 4;
                    largest = std::max(largest, width);
                    CommandChain(queue(), 0, nullptr).run("grow", kernel, width, 1, 1, 1);
                    if (launch % 8 == 7)
                        queue.finish();
                }
                std::vector<cl_uint> host(largest);
                queue.enqueueReadBuffer(sums.get(), CL_TRUE, 0, host.size() * sizeof(cl_uint), host.data());
                missing[thread] = std::count_if(host.begin(), host.end(), [](cl_uint sum) { return sum % 2 == 0; });
            });
        for (std::thread &thread : threads)
            thread.join();
        EXPECT_EQ(missing, std::vector<std::size_t>(kQueues, 0)) << round;
    }
}

} // namespace
} // namespace clsp
