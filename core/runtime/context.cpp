#include "runtime/context.hpp"

#include "runtime/device.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cstdlib>
#include <fmt/core.h>
#include <vector>

namespace clsp {
namespace {

std::string environment(const char *name) {
    const char *value = std::getenv(name);
    return value ? value : "";
}

std::string default_cache_dir() {
    if (const std::string dir = environment("CLSPECKLE_CACHE_DIR"); !dir.empty())
        return dir;
    if (const std::string dir = environment("XDG_CACHE_HOME"); !dir.empty())
        return dir + "/clspeckle";
    if (const std::string dir = environment("HOME"); !dir.empty())
        return dir + "/.cache/clspeckle";
    return {};
}

DiskCache environment_disk_cache() {
    const std::string choice = environment("CLSPECKLE_DISK_CACHE");
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

constexpr const char *kNoRecords = "off"; // value of CLSPECKLE_TUNING

std::string tuning_file(const std::string &cache_dir) {
    const std::string variable = environment("CLSPECKLE_TUNING");
    if (variable == kNoRecords)
        return {};
    if (!variable.empty())
        return variable;
    const std::string folder = cache_dir.empty() ? default_cache_dir() : cache_dir;
    return folder.empty() ? folder : folder + "/tuning.json";
}

FftChoice environment_fft_choice() {
    const std::string choice = environment("CLSPECKLE_FFT");
    if (choice.empty() || choice == "auto")
        return FftChoice::kAuto;
    if (choice == "clfft")
        return FftChoice::kClfft;
    if (choice == "fused")
        return FftChoice::kFused;
    if (choice == "fused-lanes")
        return FftChoice::kFusedLanes;
    if (choice == "fused-groups")
        return FftChoice::kFusedGroups;
    throw Error(
        Status::kInvalidArgument,
        fmt::format("the environment variable CLSPECKLE_FFT is \"{}\"; set it to auto, clfft, fused, fused-lanes or "
                    "fused-groups, or unset it",
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
    context->fft_choice_ = environment_fft_choice();
    context->log_ = parameters.log ? parameters.log : environment_log();
    context->records_off_ = environment("CLSPECKLE_TUNING") == kNoRecords;
    context->tuning_path_ = tuning_file(parameters.cache_dir);
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
    cache.kernel_dir = parameters.kernel_dir.empty() ? environment("CLSPECKLE_KERNEL_DIR") : parameters.kernel_dir;
    // PoCL keeps compiled kernels on disk by itself, but goes through the source again at every start: 25 to 60 ms a
    // program. To hand out a program for our own cache it compiles all its kernels once more, which makes a first start
    // twice as long: the user's choice.
    const DiskCache disk_cache =
        parameters.disk_cache == DiskCache::kAuto ? environment_disk_cache() : parameters.disk_cache;
    if (disk_cache == DiskCache::kOn || (disk_cache == DiskCache::kAuto && !is_pocl))
        cache.cache_dir = parameters.cache_dir.empty() ? default_cache_dir() : parameters.cache_dir;
    context->programs_ = std::make_unique<ProgramCache>(context->context_, context->device_, cache);
    return context;
}

cl::Kernel Context::kernel(const std::string &file, const std::string &name, const std::string &defines,
                           const ProgramCache::GeneratedHeader *generated) {
    return cl::Kernel(programs_->get(file, defines, generated), name.c_str());
}

std::shared_ptr<Fft> Context::fft(std::uint32_t width, std::uint32_t height, bool only_clfft) {
    const std::lock_guard<std::mutex> lock(fft_mutex_);
    std::weak_ptr<Fft> &entry = ffts_[{width, height, only_clfft}];
    std::shared_ptr<Fft> plan = entry.lock();
    if (!plan) {
        if (!only_clfft)
            plan = make_fused_fft(*this, width, height);
        if (!plan)
            plan = make_clfft(context_, device_, width, height);
        entry = plan;
    }
    return plan;
}

void Context::log(LogLevel level, const std::string &message) const {
    if (log_)
        log_(level, message);
}

TunedDevice Context::tuned_device() const {
    return {trimmed(device_name_), trimmed(device_.getInfo<CL_DEVICE_VENDOR>()), trimmed(platform_name_),
            trimmed(device_.getInfo<CL_DRIVER_VERSION>()), device_.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>()};
}

void Context::read_tuning() {
    for (std::size_t i = 0; i < kShippedTuningCount; ++i)
        shipped_tuning_.emplace_back(kShippedTunings[i].name, parse_tuning(kShippedTunings[i].text));
    if (tuning_path_.empty())
        return;
    try {
        user_tuning_ = load_tuning(tuning_path_);
    } catch (const Error &error) {
        log(LogLevel::kWarning,
            fmt::format("the tuning record {} is ignored: {}; `clspeckle tune` renews it", tuning_path_, error.what()));
        return;
    }
    const TunedDevice device = tuned_device();
    for (const TuningRecord &record : user_tuning_.records)
        if (record.device.name == device.name && !(record.device == device))
            log(LogLevel::kInfo,
                fmt::format("the tuning record {} knows {} with driver {} and {} compute units, not with {} and {}: "
                            "`clspeckle tune` measures it anew",
                            tuning_path_, device.name, record.device.driver_version, record.device.compute_units,
                            device.driver_version, device.compute_units));
}

std::vector<EngineChoice> Context::engine_choices(std::uint32_t width, std::uint32_t height) {
    std::vector<EngineChoice> choices;
    const auto add = [&](Engine engine, const std::string &source) { choices.push_back({{engine, {}, {}}, source}); };
    switch (fft_choice_) {
    case FftChoice::kClfft:
        add(Engine::kClfft, "CLSPECKLE_FFT is clfft");
        return choices;
    case FftChoice::kFused:
        add(fused_engine_for(device_), "CLSPECKLE_FFT is fused");
        break;
    case FftChoice::kFusedLanes:
        add(Engine::kFusedLanes, "CLSPECKLE_FFT is fused-lanes");
        break;
    case FftChoice::kFusedGroups:
        add(Engine::kFusedGroups, "CLSPECKLE_FFT is fused-groups");
        break;
    case FftChoice::kAuto:
        if (!records_off_) {
            std::call_once(tuning_read_, [this] { read_tuning(); });
            const TunedDevice device = tuned_device();
            choices = tuned_choices(user_tuning_, device, false, width, height,
                                    fmt::format("the tuning record {}", tuning_path_));
            for (const auto &[name, file] : shipped_tuning_)
                for (const EngineChoice &choice : tuned_choices(file, device, true, width, height,
                                                                fmt::format("the shipped tuning record {}", name)))
                    choices.push_back(choice);
        }
        switch (default_engine(device_)) {
        case Engine::kFusedLanes:
            add(Engine::kFusedLanes, "the default for CPUs");
            break;
        case Engine::kFusedGroups:
            add(Engine::kFusedGroups, "the default for GPUs");
            break;
        case Engine::kClfft:
            add(Engine::kClfft, "the device is neither CPU nor GPU, and others keep clFFT until they are told; "
                                "CLSPECKLE_FFT=fused takes the fused engine");
            break;
        }
        break;
    }
    add(Engine::kClfft, "it takes every grid");
    return choices;
}

void Context::check_queue(cl_command_queue queue) const {
    if (!queue)
        throw Error(Status::kInvalidArgument,
                    "queue is NULL; make one with clspQueueCreate() or clCreateCommandQueue()");
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
