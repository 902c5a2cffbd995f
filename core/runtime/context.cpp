#include "runtime/context.hpp"

#include "runtime/device.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cstdlib>
#include <fmt/core.h>
#include <sys/auxv.h>
#include <unistd.h>
#include <vector>

namespace clsp {
namespace {

constexpr const char kPrefix[] = "CLSPECKLE_";

// The library's variables.
std::map<std::string, std::string> read_environment() {
    std::map<std::string, std::string> variables;
    if (::getauxval(AT_SECURE)) // they are those of somebody with fewer rights, as secure_getenv() has it
        return variables;
    for (char **entry = environ; entry && *entry; ++entry) {
        const std::string text = *entry;
        const std::size_t name_end = text.find('=');
        if (text.rfind(kPrefix, 0) == 0 && name_end != std::string::npos)
            variables.emplace(text.substr(0, name_end), text.substr(name_end + 1));
    }
    return variables;
}

std::string default_cache_dir(const std::string &chosen) {
    if (!chosen.empty())
        return chosen;
    if (const char *dir = ::secure_getenv("XDG_CACHE_HOME"); dir && *dir)
        return std::string(dir) + "/clspeckle";
    if (const char *dir = ::secure_getenv("HOME"); dir && *dir)
        return std::string(dir) + "/.cache/clspeckle";
    return {};
}

DiskCache disk_cache_of(const std::string &choice) {
    if (choice.empty() || choice == "auto")
        return DiskCache::kAuto;
    if (choice == "off")
        return DiskCache::kOff;
    if (choice == "on")
        return DiskCache::kOn;
    throw Error(
        Status::kInvalidArgument,
        fmt::format("the environment variable CLSPECKLE_DISK_CACHE is \"{}\"; set it to auto, off or on, or unset it",
                    choice));
}

// clFFT keeps every program that it has compiled, and with it the cl_context, until the process ends; its only way to
// let go of them (clfftTeardown) would break a host that uses clFFT itself. Contexts of our own therefore share one
// cl_context for each device, so that making and releasing them over and over does not pile up. It is deliberately
// never released: OpenCL drivers may be gone before static destructors run.
cl::Context shared_cl_context(const cl::Device &device) {
    static std::mutex mutex;
    static auto *contexts = new std::map<cl_device_id, cl::Context>;
    const std::lock_guard<std::mutex> lock(mutex);
    auto found = contexts->find(device());
    if (found == contexts->end())
        found = contexts->emplace(device(), cl::Context(device)).first;
    return found->second;
}

} // namespace

std::shared_ptr<Context> Context::create(const ContextParameters &parameters) {
    std::shared_ptr<Context> context(new Context);
    context->environment_ = read_environment();
    context->log_ = parameters.log ? parameters.log : environment_log();
    context->cache_dir_ = parameters.cache_dir.empty() ? default_cache_dir(context->environment("CLSPECKLE_CACHE_DIR"))
                                                       : parameters.cache_dir;
    if (parameters.host_context) {
        if (!parameters.host_device)
            throw Error(Status::kInvalidArgument,
                        "cl_context_handle was given without cl_device: name the device of that "
                        "context which clSpeckle is to use");
        context->context_ = cl::Context(parameters.host_context, true);
        context->device_ = cl::Device(parameters.host_device, true);
        std::vector<cl::Device> devices;
        try {
            devices = context->context_.getInfo<CL_CONTEXT_DEVICES>();
        } catch (const cl::Error &error) {
            if (error.err() != CL_INVALID_CONTEXT)
                throw; // the device's fault
            throw Error(Status::kInvalidArgument, "cl_context_handle is not a valid cl_context", error.err());
        }
        const auto is_ours = [&](const cl::Device &device) { return device() == parameters.host_device; };
        if (std::none_of(devices.begin(), devices.end(), is_ours))
            throw Error(Status::kWrongContext, "cl_device is not a device of cl_context_handle");
        if (!parameters.device.empty())
            throw Error(Status::kInvalidArgument,
                        "device (a selector) and cl_context_handle were both given; with a context of "
                        "the host's, the device is cl_device");
    } else {
        if (parameters.host_device)
            throw Error(Status::kInvalidArgument,
                        "cl_device was given without cl_context_handle; to choose a device for a "
                        "context of clSpeckle's own, use the selector `device`");
        context->device_ = select_device(parameters.device).device;
        context->context_ = shared_cl_context(context->device_);
    }
    const cl::Platform platform(context->device_.getInfo<CL_DEVICE_PLATFORM>());
    context->device_name_ = context->device_.getInfo<CL_DEVICE_NAME>();
    context->platform_name_ = platform.getInfo<CL_PLATFORM_NAME>();
    const bool is_pocl = context->platform_name_.find("Portable Computing Language") != std::string::npos;
    context->is_pocl_cpu_ = is_pocl && (context->device_.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU) != 0;

    ProgramCache::Parameters cache;
    cache.kernel_dir =
        parameters.kernel_dir.empty() ? context->environment("CLSPECKLE_KERNEL_DIR") : parameters.kernel_dir;
    // PoCL keeps compiled kernels on disk by itself, but goes through the source again at every start: 25 to 60 ms a
    // program. To hand out a program for our own cache it compiles all its kernels once more, which makes a first start
    // twice as long: the user's choice.
    const DiskCache disk_cache = parameters.disk_cache == DiskCache::kAuto
                                     ? disk_cache_of(context->environment("CLSPECKLE_DISK_CACHE"))
                                     : parameters.disk_cache;
    if (disk_cache == DiskCache::kOn || (disk_cache == DiskCache::kAuto && !is_pocl))
        cache.cache_dir = context->cache_dir_;
    cache.warn = [c = context.get()](const std::string &message) { c->log(LogLevel::kWarning, message); };
    context->programs_ = std::make_unique<ProgramCache>(context->context_, context->device_, cache);
    return context;
}

cl::Kernel Context::kernel(const std::string &file, const std::string &name, const std::string &defines,
                           const ProgramCache::GeneratedHeader *generated) {
    return cl::Kernel(programs_->get(file, defines, generated), name.c_str());
}

std::string Context::environment(const std::string &name) const {
    const auto found = environment_.find(name);
    return found == environment_.end() ? std::string() : found->second;
}

void Context::log(LogLevel level, const std::string &message) const {
    if (log_)
        log_(level, message);
}

void Context::check_queue(cl_command_queue queue) const {
    if (!queue)
        throw Error(Status::kInvalidArgument,
                    "queue is NULL; make one with the clSpeckle context or clCreateCommandQueue()");
    ::cl_context queue_context = nullptr;
    cl_device_id queue_device = nullptr;
    check_opencl(clGetCommandQueueInfo(queue, CL_QUEUE_CONTEXT, sizeof queue_context, &queue_context, nullptr),
                 "clGetCommandQueueInfo");
    check_opencl(clGetCommandQueueInfo(queue, CL_QUEUE_DEVICE, sizeof queue_device, &queue_device, nullptr),
                 "clGetCommandQueueInfo");
    if (queue_context != context_())
        throw Error(Status::kWrongContext, "the queue belongs to another cl_context than the clSpeckle context");
    if (queue_device != device_())
        throw Error(
            Status::kWrongContext,
            fmt::format("the queue belongs to another device than the clSpeckle context, which uses {}", device_name_));
}

} // namespace clsp
