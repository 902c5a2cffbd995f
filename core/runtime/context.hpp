// One device and what belongs to it: programs, FFT plans, the count of device memory.
#pragma once

#include "runtime/fft.hpp"
#include "runtime/opencl.hpp"
#include "runtime/program_cache.hpp"
#include "runtime/result_cache.hpp"

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace clsp {

enum class DiskCache : std::uint32_t { kAuto = 0, kOff = 1, kOn = 2 };

struct ContextParameters {
    cl_context host_context = nullptr; // nullptr: a context of our own
    cl_device_id host_device = nullptr;
    std::string device;     // selector, "" for the default
    std::string kernel_dir; // "" for CLSPECKLE_KERNEL_DIR or the built-in kernels
    std::string cache_dir;  // "" for the default place
    DiskCache disk_cache = DiskCache::kAuto;
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
    ProgramCache &programs() { return *programs_; }
    MemoryUse &memory_use() { return memory_use_; }
    // Host memory, not the device's.
    ResultCache &results() { return results_; }

    // A kernel of its own for the caller (kernel arguments are state), from file `file` built with `defines`.
    cl::Kernel kernel(const std::string &file, const std::string &name, const std::string &defines = {},
                      const ProgramCache::GeneratedHeader *generated = nullptr);

    // The plan of a 2-D complex transform; shared between all users of that size, made on first use.
    std::shared_ptr<Fft> fft(std::uint32_t width, std::uint32_t height);

    FftChoice fft_choice() const { return fft_choice_; }

    // Throws kWrongContext unless the queue belongs to this context and device.
    void check_queue(cl_command_queue queue) const;

    Context(const Context &) = delete;
    Context &operator=(const Context &) = delete;

  private:
    Context() = default;

    cl::Context context_;
    cl::Device device_;
    std::string device_name_, platform_name_;
    std::unique_ptr<ProgramCache> programs_;
    MemoryUse memory_use_;
    FftChoice fft_choice_ = FftChoice::kAuto;
    std::mutex fft_mutex_;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::weak_ptr<Fft>> ffts_;
    ResultCache results_{std::uint64_t{256} << 20};
};

} // namespace clsp
