#include "runtime/launch_guard.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace clsp {

namespace {

using Extent = std::array<std::size_t, 4>;

// A context's guarded queues, and what has been launched on them. The context's programs live as long as its queues are
// guarded, so that a program's handle stands for no other.
struct Guarded {
    std::vector<cl_command_queue> queues;
    std::map<std::pair<cl_program, std::string>, std::set<Extent>> launched;
};

std::mutex mutex;
std::map<cl_context, Guarded> guarded; // under the mutex

template <typename Value> Value queue_info(cl_command_queue queue, cl_command_queue_info what) {
    Value value{};
    check_opencl(clGetCommandQueueInfo(queue, what, sizeof value, &value, nullptr), "clGetCommandQueueInfo");
    return value;
}

std::pair<cl_program, std::string> identity(cl_kernel kernel) {
    cl_program program = nullptr;
    check_opencl(clGetKernelInfo(kernel, CL_KERNEL_PROGRAM, sizeof program, &program, nullptr), "clGetKernelInfo");
    std::size_t size = 0;
    check_opencl(clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, 0, nullptr, &size), "clGetKernelInfo");
    std::string name(size, '\0');
    check_opencl(clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, size, name.data(), nullptr), "clGetKernelInfo");
    return {program, name};
}

void finish_all() {
    for (const auto &[context, of_context] : guarded)
        for (const cl_command_queue queue : of_context.queues)
            check_opencl(clFinish(queue), "clFinish");
}

} // namespace

bool pocl_miscounts_kernels(const std::string &platform_version) {
    for (const char *name : {"PoCL ", "pocl "})
        if (const std::size_t at = platform_version.find(name); at != std::string::npos) {
            const std::string number = platform_version.substr(at + 5);
            const std::size_t digits = number.find_first_not_of("0123456789");
            // Two digits at most: a date or a hash is no version.
            if (const std::string major = number.substr(0, digits); !major.empty() && major.size() <= 2)
                return std::stoi(major) < 6;
        }
    return true;
}

std::atomic<std::size_t> LaunchGuard::guarded_queues_{0};

LaunchGuard::LaunchGuard(const Context &context, const cl::CommandQueue &queue) {
    if (!context.is_pocl_cpu() ||
        !pocl_miscounts_kernels(
            cl::Platform(context.device().getInfo<CL_DEVICE_PLATFORM>()).getInfo<CL_PLATFORM_VERSION>()))
        return;
    const auto of = queue_info<cl_context>(queue(), CL_QUEUE_CONTEXT);
    const std::lock_guard<std::mutex> lock(mutex);
    guarded[of].queues.push_back(queue());
    queue_ = queue();
    ++guarded_queues_;
}

LaunchGuard::~LaunchGuard() {
    if (!queue_)
        return;
    const std::lock_guard<std::mutex> lock(mutex);
    for (auto of_context = guarded.begin(); of_context != guarded.end(); ++of_context) {
        auto &queues = of_context->second.queues;
        for (auto queue = queues.begin(); queue != queues.end(); ++queue)
            if (*queue == queue_) {
                clFinish(queue_); // what it has launched is no longer under way when it is forgotten
                queues.erase(queue);
                if (queues.empty())
                    guarded.erase(of_context);
                --guarded_queues_;
                return;
            }
    }
}

void LaunchGuard::launch_among_guarded(cl_command_queue queue, cl_kernel kernel, const Extent &extent,
                                       const std::function<void()> &enqueue) {
    const std::lock_guard<std::mutex> lock(mutex);
    const auto of_context = guarded.find(queue_info<cl_context>(queue, CL_QUEUE_CONTEXT));
    if (of_context == guarded.end() || std::find(of_context->second.queues.begin(), of_context->second.queues.end(),
                                                 queue) == of_context->second.queues.end())
        return enqueue();
    std::set<Extent> &launched = of_context->second.launched[identity(kernel)];
    if (launched.count(extent))
        return enqueue();
    // A kernel's very first launch has none of its own under way, unless another context has built the same program.
    const bool alone = launched.empty() && guarded.size() == 1;
    if (!alone)
        finish_all();
    enqueue();
    if (!alone)
        check_opencl(clFinish(queue), "clFinish");
    launched.insert(extent);
}

} // namespace clsp
