// One device and what belongs to it: programs, FFT plans, the count of device memory.
#pragma once

#include "fft/engine.hpp"
#include "fft/fft.hpp"
#include "runtime/log.hpp"
#include "runtime/opencl.hpp"
#include "runtime/program_cache.hpp"
#include "runtime/result_cache.hpp"
#include "fft/plan/tuning_record.hpp"

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

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

    // The plan of a 2-D complex transform; shared between all users of that size, made on first use. only_clfft: not
    // the fused engine's line transforms.
    std::shared_ptr<Fft> fft(std::uint32_t width, std::uint32_t height, bool only_clfft = false);

    FftChoice fft_choice() const { return fft_choice_; }

    void log(LogLevel level, const std::string &message) const;

    // The device as tuning records know it, and where the user's record lies: CLSPECKLE_TUNING, else tuning.json in the
    // cache folder; "" if records are off or there is no such folder.
    TunedDevice tuned_device() const;
    const std::string &tuning_path() const { return tuning_path_; }
    // The engines that an aperture with that grid is to try, best first: what CLSPECKLE_FFT forces, else by the user's
    // record, by a shipped one, by default; the last is clFFT, which takes every grid. Records are read once.
    std::vector<EngineChoice> engine_choices(std::uint32_t width, std::uint32_t height);

    // Throws kWrongContext unless the queue belongs to this context and device.
    void check_queue(cl_command_queue queue) const;

    Context(const Context &) = delete;
    Context &operator=(const Context &) = delete;

  private:
    Context() = default;
    void read_tuning();

    cl::Context context_;
    cl::Device device_;
    std::string device_name_, platform_name_;
    bool is_pocl_cpu_ = false;
    mutable std::atomic<std::uint32_t> large_buffers_{0};
    std::unique_ptr<ProgramCache> programs_;
    MemoryUse memory_use_;
    FftChoice fft_choice_ = FftChoice::kAuto;
    std::mutex fft_mutex_;
    std::map<std::tuple<std::uint32_t, std::uint32_t, bool>, std::weak_ptr<Fft>> ffts_;
    LogFunction log_;
    bool records_off_ = false;
    std::string tuning_path_;
    std::once_flag tuning_read_;
    TuningFile user_tuning_;
    std::vector<std::pair<std::string, TuningFile>> shipped_tuning_; // by the names of their files
    ResultCache results_{std::uint64_t{256} << 20};
};

} // namespace clsp
