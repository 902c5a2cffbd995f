// One device and what belongs to it: programs, the count of device memory, and what other folders keep of it.
#pragma once

#include "runtime/log.hpp"
#include "runtime/opencl.hpp"
#include "runtime/program_cache.hpp"
#include "runtime/result_cache.hpp"

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <typeindex>

namespace clsp {

enum class DiskCache : std::uint32_t { kAuto = 0, kOff = 1, kOn = 2 };

struct ContextParameters {
    cl_context host_context = nullptr; // nullptr: a context of our own
    cl_device_id host_device = nullptr;
    std::string device;     // selector, "" for the default
    std::string kernel_dir; // "" for CLSPECKLE_KERNEL_DIR or the built-in kernels
    std::string cache_dir;  // "" for the default place
    DiskCache disk_cache = DiskCache::kAuto;
    LogFunction log; // empty: what CLSPECKLE_LOG says
};

// Device memory that the library holds in a context.
struct MemoryUse {
    std::atomic<std::uint32_t> allocation_count{0};
    std::atomic<std::uint64_t> allocated_bytes{0};
};

// Safe to use from any number of threads at once.
class Context : public std::enable_shared_from_this<Context> {
  public:
    static std::shared_ptr<Context> create(const ContextParameters &parameters);

    const cl::Context &cl_context() const { return context_; }
    const cl::Device &device() const { return device_; }
    const std::string &device_name() const { return device_name_; }
    const std::string &platform_name() const { return platform_name_; }
    // A CPU that PoCL drives: buffers are memory of the process, and kernels are compiled by clang.
    bool is_pocl_cpu() const { return is_pocl_cpu_; }
    ProgramCache &programs() { return *programs_; }
    MemoryUse &memory_use() { return memory_use_; }
    // 0, 1, 2 .. with every call.
    std::uint32_t next_large_buffer() const { return large_buffers_++; }
    // Host memory, not the device's.
    ResultCache &results() { return results_; }

    // A kernel of its own for the caller (kernel arguments are state), from file `file` built with `defines`.
    cl::Kernel kernel(const std::string &file, const std::string &name, const std::string &defines = {},
                      const ProgramCache::GeneratedHeader *generated = nullptr);

    // What another folder keeps of a context: the one T, made from it when it is first asked for, under a lock. A T's
    // constructor asks for no other part.
    template <typename T> T &part() const {
        const std::lock_guard<std::mutex> lock(parts_mutex_);
        std::shared_ptr<void> &part = parts_[typeid(T)];
        if (!part)
            part = std::make_shared<T>(*this);
        return *static_cast<T *>(part.get());
    }

    // An environment variable CLSPECKLE_.. as it was when the context was made; "" if there was none.
    std::string environment(const std::string &name) const;
    // Where files are kept; "" if there is no such folder.
    const std::string &cache_dir() const { return cache_dir_; }

    void log(LogLevel level, const std::string &message) const;

    // Throws kWrongContext unless the queue belongs to this context and device.
    void check_queue(cl_command_queue queue) const;

    Context(const Context &) = delete;
    Context &operator=(const Context &) = delete;

  private:
    Context() = default;

    cl::Context context_;
    cl::Device device_;
    std::string device_name_, platform_name_;
    bool is_pocl_cpu_ = false;
    mutable std::atomic<std::uint32_t> large_buffers_{0};
    std::unique_ptr<ProgramCache> programs_;
    MemoryUse memory_use_;
    std::map<std::string, std::string> environment_;
    std::string cache_dir_;
    LogFunction log_;
    mutable std::mutex parts_mutex_;
    mutable std::map<std::type_index, std::shared_ptr<void>> parts_;
    ResultCache results_{std::uint64_t{256} << 20};
};

} // namespace clsp
