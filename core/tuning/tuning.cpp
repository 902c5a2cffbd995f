#include "tuning/tuning.hpp"

#include "fft/engine_choices.hpp"
#include "fft/gpu/codelets.hpp"
#include "runtime/checks.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/error.hpp"
#include "stages/aperture.hpp"
#include "stages/phase.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fmt/core.h>
#include <fmt/format.h>
#include <numeric>

namespace clsp {
namespace {

using Clock = std::chrono::steady_clock;

// A sample is at least this long: the clock and the way to the device and back then count for little.
constexpr double kSampleMs = 2.0;
constexpr std::uint32_t kMostFramesInASample = 256;
constexpr double kWarmUpMs = 200.0;
// An engine whose picture differs by more from clFFT's is wrong, however fast; rounding makes less than 1e-6.
constexpr double kLargestDifference = 1e-5;
// Differences below this are no reason to leave what is preferred, however quiet the machine was.
constexpr double kLeastGain = 0.02;

double ms_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

std::string today() {
    const std::time_t now = std::time(nullptr);
    std::tm utc{};
    gmtime_r(&now, &utc);
    return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

double median_of(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    if (values.size() % 2 == 1)
        return *middle;
    return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

// What all candidates of a size work on.
struct Bench {
    Bench(const std::shared_ptr<Context> &of, const TuneSize &image, double diameter)
        : context(of), size(image), queue(of->cl_context(), of->device()), phase(of, phase_parameters(image)),
          irradiance_buffer(of, pixels() * sizeof(float)), intensity_buffer(of, pixels() * sizeof(float)) {
        const std::vector<float> light(pixels(), 1.0f);
        queue.enqueueWriteBuffer(irradiance_buffer.get(), CL_TRUE, 0, light.size() * sizeof(float), light.data());
        CommandChain chain(queue(), 0, nullptr);
        phase.enqueue_refresh(chain, 0, {});
        queue.finish();
        aperture.width = size.width;
        aperture.height = size.height;
        aperture.relative_diameter = diameter;
        aperture.workspace_from_host = true;
    }

    static PhaseParameters phase_parameters(const TuneSize &image) {
        PhaseParameters p;
        p.width = image.width;
        p.height = image.height;
        p.polarization_count = 1;
        return p;
    }
    std::size_t pixels() const { return std::size_t{size.width} * size.height; }
    ImageView view(const DeviceBuffer &buffer) const {
        return check_image({buffer.get()(), 0, 0, size.width, size.height, Format::kFloat32}, "image",
                           context->cl_context()(), {size.width, size.height}, {Format::kFloat32});
    }
    // Candidates never run at once: they share it.
    void give_workspace(Aperture &to) {
        if (workspace.bytes() < to.workspace_bytes())
            workspace = DeviceBuffer(context, to.workspace_bytes());
        to.set_workspace(workspace.get()(), 0, workspace.bytes());
    }
    std::vector<float> intensity() {
        std::vector<float> values(pixels());
        queue.enqueueReadBuffer(intensity_buffer.get(), CL_TRUE, 0, values.size() * sizeof(float), values.data());
        return values;
    }

    std::shared_ptr<Context> context;
    TuneSize size;
    cl::CommandQueue queue;
    Phase phase;
    DeviceBuffer irradiance_buffer, intensity_buffer, workspace;
    ApertureParameters aperture;
};

// An aperture with one engine, and its times.
class Runner {
  public:
    Runner(Bench &bench, const EngineSpec &spec) : bench_(bench) {
        ApertureParameters parameters = bench.aperture;
        parameters.engine = spec;
        aperture_ = std::make_unique<Aperture>(bench.context, parameters);
        if (spec.kind != EngineKind::kClfft && aperture_->engine().kind != spec.kind)
            throw Error(Status::kUnsupported, aperture_->clfft_reason());
        bench.give_workspace(*aperture_);
        aperture_->prepare(bench.phase, {});
    }

    const EngineSpec &engine() const { return aperture_->engine(); }

    // Of a frame, in ms.
    double sample(std::uint32_t frames) {
        const ImageView from = bench_.view(bench_.irradiance_buffer), to = bench_.view(bench_.intensity_buffer);
        const Clock::time_point start = Clock::now();
        for (std::uint32_t i = 0; i < frames; ++i) {
            CommandChain chain(bench_.queue(), 0, nullptr);
            aperture_->enqueue_intensity(chain, bench_.phase, from, to);
        }
        bench_.queue.finish();
        return ms_since(start) / frames;
    }

    // The first frame compiles what is compiled late; the second says how many make up a sample.
    void warm_up() {
        sample(1);
        frames_ = std::clamp(static_cast<std::uint32_t>(std::ceil(kSampleMs / std::max(sample(1), 1e-6))),
                             std::uint32_t{1}, kMostFramesInASample);
    }

    void measure() { ms_.push_back(sample(frames_)); }
    void forget() { ms_.clear(); }
    const std::vector<double> &ms() const { return ms_; }

  private:
    Bench &bench_;
    std::unique_ptr<Aperture> aperture_;
    std::uint32_t frames_ = 1;
    std::vector<double> ms_;
};

double relative_difference(const std::vector<float> &a, const std::vector<float> &b) {
    double difference = 0.0, norm = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        difference += (double{a[i]} - b[i]) * (double{a[i]} - b[i]);
        norm += double{b[i]} * b[i];
    }
    return std::sqrt(difference / norm);
}

// A candidate, and what measures it while it counts.
struct Entry {
    TunedCandidate candidate;
    std::unique_ptr<Runner> runner;
};

// One size: candidates are made, checked, and measured in turn.
class SizeTuning {
  public:
    SizeTuning(const std::shared_ptr<Context> &context, const TuneSize &size, const TuneParameters &parameters,
               const std::function<void(double, const std::string &)> &report)
        : context_(context), parameters_(parameters), report_(report),
          bench_(context, size, parameters.relative_diameter), grid_(make_field_grid(size.width, size.height, 1, 0)) {}

    TunedSize run() {
        // The reference of the pictures comes first; the order of preference is made at the end.
        const EngineKind preferred = default_engine(context_->device());
        std::vector<EngineSpec> specs = {{EngineKind::kClfft, {}, {}}, {EngineKind::kGpu, {}, {}}};
        // Lanes are work-groups of one work-item: on GPUs they would only take the time to compile them.
        if (preferred != EngineKind::kGpu)
            specs.insert(specs.begin() + 1, {EngineKind::kCpu, {}, {}});
        const bool shapes = parameters_.work_group_shapes.value_or(preferred != EngineKind::kCpu) &&
                            plan_exists(grid_.grid_width) && plan_exists(grid_.grid_height);
        const WorkGroupLimits limits = work_group_limits(*context_);
        if (shapes)
            for (const WorkGroup &pick : work_groups_to_try(make_gpu_plan(grid_.grid_height), limits, true))
                specs.push_back({EngineKind::kGpu, pick, {}});
        measure(specs, 0.0, shapes ? 0.5 : 1.0);
        if (shapes) {
            // The work-groups of the rows, with the best ones of the columns.
            specs.clear();
            if (const std::optional<WorkGroup> columns = best_columns())
                for (const WorkGroup &pick : work_groups_to_try(make_gpu_plan(grid_.grid_width), limits, false))
                    specs.push_back({EngineKind::kGpu, columns, pick});
            if (!specs.empty())
                measure(specs, 0.5, 1.0);
        }
        return result(preferred);
    }

  private:
    // Adds candidates and measures all that count, new ones and old ones, in one run.
    void measure(const std::vector<EngineSpec> &specs, double from, double to) {
        const double building = from + 0.5 * (to - from);
        std::size_t done = 0;
        for (const EngineSpec &spec : specs) {
            report_(from + (building - from) * static_cast<double>(done++) / static_cast<double>(specs.size()),
                    describe(spec));
            add(spec);
        }
        if (from > 0.0)
            drop_slow();
        std::vector<Runner *> runners;
        for (Entry &entry : entries_)
            if (entry.runner)
                runners.push_back(entry.runner.get());
        // A GPU that had nothing to do while kernels were compiled raises its clocks first.
        const Clock::time_point start = Clock::now();
        for (std::size_t k = 0; !runners.empty() && ms_since(start) < kWarmUpMs; ++k)
            runners[k % runners.size()]->measure();
        for (Runner *runner : runners)
            runner->forget();
        for (std::uint32_t i = 0; i < parameters_.frames; ++i) {
            report_(building + (to - building) * i / parameters_.frames, "measuring");
            // Each round begins with another one, so that nobody always follows the same neighbour.
            for (std::size_t k = 0; k < runners.size(); ++k)
                runners[(i + k) % runners.size()]->measure();
        }
        for (Entry &entry : entries_)
            if (entry.runner) {
                const Times times = times_of(entry.runner->ms());
                entry.candidate.median_ms = times.median;
                entry.candidate.spread_ms = times.spread;
            }
    }

    void add(const EngineSpec &spec) {
        Entry entry;
        entry.candidate.spec = spec;
        try {
            entry.runner = std::make_unique<Runner>(bench_, spec);
            for (const Entry &other : entries_)
                if (other.runner && other.runner->engine() == entry.runner->engine())
                    return; // the work-groups that the rule takes anyway, or the most that the driver gives
            if (spec.columns)
                entry.candidate.spec.columns = entry.runner->engine().columns;
            if (spec.rows)
                entry.candidate.spec.rows = entry.runner->engine().rows;
            entry.runner->warm_up();
            const std::vector<float> picture = bench_.intensity();
            if (reference_.empty()) {
                reference_ = picture;
                reference_name_ = describe(spec);
            }
            const double difference = relative_difference(picture, reference_);
            if (!(difference <= kLargestDifference))
                throw Error(Status::kInvalidData, fmt::format("its picture differs from {}'s by {:.2g} (relative L2)",
                                                              reference_name_, difference));
        } catch (const Error &error) {
            entry.runner.reset();
            entry.candidate.refusal = error.what();
        } catch (const cl::Error &error) {
            entry.runner.reset();
            entry.candidate.refusal = from_opencl(error.err(), error.what()).what();
        }
        if (entry.candidate.refusal.size() > kLongestRefusal)
            entry.candidate.refusal.resize(kLongestRefusal);
        entries_.push_back(std::move(entry));
    }

    // Of the first round only those that can still win are measured again; the others keep their times.
    void drop_slow() {
        double fastest = INFINITY;
        for (const Entry &entry : entries_)
            if (entry.runner && entry.candidate.median_ms > 0.0)
                fastest = std::min(fastest, entry.candidate.median_ms);
        for (Entry &entry : entries_)
            if (entry.candidate.median_ms > 1.5 * fastest && entry.candidate.spec.kind == EngineKind::kGpu)
                entry.runner.reset();
    }

    // Of the work-groups that the rule takes, too.
    std::optional<WorkGroup> best_columns() const {
        std::optional<WorkGroup> best;
        double least = INFINITY;
        for (const Entry &entry : entries_)
            if (entry.runner && entry.candidate.counts() && entry.runner->engine().columns &&
                entry.candidate.median_ms < least) {
                best = entry.runner->engine().columns;
                least = entry.candidate.median_ms;
            }
        return best;
    }

    TunedSize result(EngineKind preferred) {
        TunedSize size;
        size.width = grid_.grid_width;
        size.height = grid_.grid_height;
        size.frames = parameters_.frames;
        size.relative_diameter = parameters_.relative_diameter;
        size.date = today();
        size.version = CLSP_VERSION_TEXT;
        for (Entry &entry : entries_)
            size.candidates.push_back(std::move(entry.candidate));
        std::stable_partition(size.candidates.begin(), size.candidates.end(),
                              [&](const TunedCandidate &c) { return c.spec.kind == preferred; });
        const std::size_t chosen = choose_candidate(size.candidates, size.frames, size.reason);
        size.chosen = size.candidates[chosen].spec;
        return size;
    }

    static constexpr std::size_t kLongestRefusal = 500;

    std::shared_ptr<Context> context_;
    const TuneParameters &parameters_;
    const std::function<void(double, const std::string &)> &report_;
    Bench bench_;
    FieldGrid grid_;
    std::vector<float> reference_; // clFFT's picture, if it makes one
    std::string reference_name_;
    std::vector<Entry> entries_;
};

} // namespace

const std::vector<TuneSize> &default_tune_sizes() {
    static const std::vector<TuneSize> sizes = {{640, 480}, {512, 512}, {1024, 1024}, {1920, 1080}, {2048, 2048}};
    return sizes;
}

Times times_of(std::vector<double> ms) {
    Times times;
    times.count = static_cast<std::uint32_t>(ms.size());
    times.median = median_of(ms);
    for (double &value : ms)
        value = std::abs(value - times.median);
    times.spread = 1.4826 * median_of(ms);
    return times;
}

std::size_t choose_candidate(const std::vector<TunedCandidate> &candidates, std::uint32_t frames, std::string &reason) {
    std::size_t fastest = candidates.size();
    for (std::size_t i = 0; i < candidates.size(); ++i)
        if (candidates[i].counts() &&
            (fastest == candidates.size() || candidates[i].median_ms < candidates[fastest].median_ms))
            fastest = i;
    if (fastest == candidates.size())
        throw Error(Status::kUnsupported,
                    candidates.empty() ? std::string("there is no engine to measure")
                                       : fmt::format("no engine can be measured: {}: {}",
                                                     describe(candidates.front().spec), candidates.front().refusal));
    const TunedCandidate &best = candidates[fastest];
    for (std::size_t i = 0; i < candidates.size(); ++i) {
        const TunedCandidate &candidate = candidates[i];
        if (!candidate.counts())
            continue;
        // Standard error of a median of normal noise: 1.2533 sigma / sqrt(n).
        const double error = 1.2533 / std::sqrt(frames) * std::hypot(candidate.spread_ms, best.spread_ms);
        const double noise = std::max(2.0 * error, kLeastGain * candidate.median_ms);
        if (i != fastest && candidate.median_ms - best.median_ms > noise)
            continue;
        if (i == fastest)
            reason = "the fastest";
        else
            reason = fmt::format("{} is faster by {:.1f} %, which is within the noise", describe(best.spec),
                                 100.0 * (1.0 - best.median_ms / candidate.median_ms));
        return i;
    }
    return fastest;
}

Tuning tune(const std::shared_ptr<Context> &context, const TuneParameters &p) {
    if (p.frames < 1 || p.frames > kMostTunedFrames)
        throw Error(Status::kInvalidArgument,
                    fmt::format("frames is {}, it must be 1 to {}", p.frames, kMostTunedFrames));
    check_positive(p.relative_diameter, "relative_diameter");
    if (p.relative_diameter > 1.0)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("relative_diameter is {}, it must be at most 1: sizes are measured without oversampling",
                        p.relative_diameter));
    const std::vector<TuneSize> &sizes = p.sizes.empty() ? default_tune_sizes() : p.sizes;
    if (sizes.size() > kMostTunedSizes)
        throw Error(Status::kInvalidArgument,
                    fmt::format("size_count is {}, it must be at most {}", sizes.size(), kMostTunedSizes));
    for (const TuneSize &size : sizes)
        make_field_grid(size.width, size.height, 1, 0); // throws for those that no aperture takes

    Tuning tuning;
    TuningFile file;
    if (p.keep) {
        // What cannot be written is found before the measurement.
        tuning.path = p.path.empty() ? tuning_path(*context) : p.path;
        if (tuning.path.empty())
            throw Error(
                Status::kInvalidArgument,
                "there is no place for the tuning record: CLSPECKLE_TUNING is off, or there is no cache folder; "
                "name a file");
        try {
            file = load_tuning(tuning.path);
        } catch (const Error &error) {
            // A file that somebody names may be something else altogether.
            if (!p.path.empty() && error.status() == Status::kIo)
                throw Error(Status::kIo, fmt::format("{} cannot be read: {}", p.path, error.what()));
            if (!p.path.empty())
                throw Error(Status::kInvalidData,
                            fmt::format("{} exists and is no tuning record ({}); name another file, "
                                        "or remove it",
                                        p.path, error.what()));
            context->log(LogLevel::kWarning,
                         fmt::format("the tuning record {} is replaced: {}", tuning.path, error.what()));
        }
        check_tuning_place(tuning.path);
    }
    tuning.measured.device = tuned_device(*context);
    double done = 0.0, total = 0.0;
    const auto pixels = [](const TuneSize &size) { return double(size.width) * size.height; };
    for (const TuneSize &size : sizes)
        total += pixels(size);
    for (const TuneSize &size : sizes) {
        const std::function<void(double, const std::string &)> report = [&](double fraction, const std::string &what) {
            report_progress(p.progress, fmt::format("{} x {}: {}", size.width, size.height, what),
                            (done + fraction * pixels(size)) / total);
        };
        tuning.measured.sizes.push_back(SizeTuning(context, size, p, report).run());
        done += pixels(size);
    }
    report_progress(p.progress, "done", 1.0);
    if (p.keep) {
        file.merge(tuning.measured);
        save_tuning(tuning.path, file);
    }
    return tuning;
}

} // namespace clsp
