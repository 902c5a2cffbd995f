#include "fft/engine_choices.hpp"

#include "runtime/device.hpp"
#include "runtime/error.hpp"

#include <fmt/core.h>
#include <mutex>
#include <utility>

namespace clsp {
namespace {

constexpr const char *kVariable = "CLSPECKLE_FFT", *kTuningVariable = "CLSPECKLE_TUNING";
constexpr const char *kNoRecords = "off"; // value of CLSPECKLE_TUNING

std::optional<EngineKind> read_forced(const Context &context) {
    const std::string choice = context.environment(kVariable);
    if (choice.empty() || choice == "auto")
        return {};
    const std::optional<EngineKind> kind = choice == "fused" ? own_engine(context.device()) : engine_of(choice);
    if (kind && (choice == "fused" || is_old_engine_name(choice)))
        context.log(LogLevel::kWarning, fmt::format("CLSPECKLE_FFT is {}, an old name; the engine is called {}", choice,
                                                    engine_name(*kind)));
    if (kind)
        return kind;
    throw Error(Status::kInvalidArgument,
                fmt::format("the environment variable CLSPECKLE_FFT is \"{}\"; set it to auto, cpu, gpu or clfft, or "
                            "unset it",
                            choice));
}

std::string read_path(const Context &context) {
    const std::string variable = context.environment(kTuningVariable);
    if (variable == kNoRecords)
        return {};
    if (!variable.empty())
        return variable;
    return context.cache_dir().empty() ? std::string() : context.cache_dir() + "/tuning.json";
}

// What a context keeps of all this.
class Choices {
  public:
    explicit Choices(const Context &context)
        : forced_(read_forced(context)), records_off_(context.environment(kTuningVariable) == kNoRecords),
          path_(read_path(context)) {}

    std::optional<EngineKind> forced() const { return forced_; }
    const std::string &path() const { return path_; }

    // What the records say of a grid.
    std::vector<EngineChoice> recorded(const Context &context, std::uint32_t width, std::uint32_t height) {
        if (records_off_)
            return {};
        std::call_once(read_, [&] { read(context); });
        const TunedDevice device = tuned_device(context);
        std::vector<EngineChoice> choices =
            tuned_choices(user_, device, false, width, height, fmt::format("the tuning record {}", path_));
        for (const auto &[name, file] : shipped_)
            for (const EngineChoice &choice :
                 tuned_choices(file, device, true, width, height, fmt::format("the shipped tuning record {}", name)))
                choices.push_back(choice);
        return choices;
    }

  private:
    void read(const Context &context) {
        for (std::size_t i = 0; i < kShippedTuningCount; ++i)
            shipped_.emplace_back(kShippedTunings[i].name, parse_tuning(kShippedTunings[i].text));
        if (path_.empty())
            return;
        try {
            user_ = load_tuning(path_);
        } catch (const Error &error) {
            context.log(
                LogLevel::kWarning,
                fmt::format("the tuning record {} is ignored: {}; `clspeckle tune` renews it", path_, error.what()));
            return;
        }
        if (user_.old_names)
            context.log(LogLevel::kWarning,
                        fmt::format("the tuning record {} has old names: fused-lanes is called cpu, fused-groups gpu; "
                                    "`clspeckle tune` writes them",
                                    path_));
        const TunedDevice device = tuned_device(context);
        for (const TuningRecord &record : user_.records)
            if (record.device.name == device.name && !(record.device == device))
                context.log(LogLevel::kInfo,
                            fmt::format("the tuning record {} knows {} with driver {} and {} compute units, not with "
                                        "{} and {}: `clspeckle tune` measures it anew",
                                        path_, device.name, record.device.driver_version, record.device.compute_units,
                                        device.driver_version, device.compute_units));
    }

    std::optional<EngineKind> forced_;
    bool records_off_;
    std::string path_;
    std::once_flag read_;
    TuningFile user_;
    std::vector<std::pair<std::string, TuningFile>> shipped_; // by the names of their files
};

const char *default_source(EngineKind kind) {
    switch (kind) {
    case EngineKind::kCpu:
        return "the default for CPUs with vectors";
    case EngineKind::kGpu:
        return "the default for GPUs";
    case EngineKind::kClfft:
        break;
    }
    return "the device is neither a CPU with vectors nor a GPU, and others keep clFFT until they are told; "
           "CLSPECKLE_FFT=gpu takes the engine for GPUs";
}

} // namespace

std::optional<EngineKind> forced_engine(const Context &context) {
    return context.part<Choices>().forced();
}

TunedDevice tuned_device(const Context &context) {
    const cl::Device &device = context.device();
    return {trimmed(context.device_name()), trimmed(device.getInfo<CL_DEVICE_VENDOR>()),
            trimmed(context.platform_name()), trimmed(device.getInfo<CL_DRIVER_VERSION>()),
            device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>()};
}

const std::string &tuning_path(const Context &context) {
    return context.part<Choices>().path();
}

std::vector<EngineChoice> engine_choices(const Context &context, std::uint32_t width, std::uint32_t height) {
    std::vector<EngineChoice> choices;
    if (const std::optional<EngineKind> forced = forced_engine(context)) {
        choices.push_back({{*forced, {}, {}}, fmt::format("CLSPECKLE_FFT is {}", context.environment(kVariable))});
        if (*forced == EngineKind::kClfft)
            return choices;
    } else {
        choices = context.part<Choices>().recorded(context, width, height);
        const EngineKind kind = default_engine(context.device());
        choices.push_back({{kind, {}, {}}, default_source(kind)});
    }
    choices.push_back({{EngineKind::kClfft, {}, {}}, "it takes every grid"});
    return choices;
}

} // namespace clsp
