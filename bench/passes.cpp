// Device times of the three passes of the engine for CPUs, or of that for GPUs by the work-groups that they have:
// what a whole frame's time (clspeckle tune) does not show. Medians over frames, by the events of a profiling queue.
#include "stages/engines/engine.hpp"
#include "fft/gpu/codelets.hpp"
#include "fft/plan/line_plan.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "stages/aperture.hpp"
#include "stages/phase.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <fmt/core.h>
#include <map>
#include <string>
#include <vector>

namespace {

struct Arguments {
    std::uint32_t width = 2048, height = 2048, frames = 50;
    double diameter = 0.5, degree_of_polarization = 1.0;
    bool gaussian = false;
};

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(values.size() / 2), values.end());
    return values[values.size() / 2];
}

class Passes {
  public:
    explicit Passes(const Arguments &a)
        : arguments_(a), context_(clsp::Context::create({})), grid_(clsp::make_field_grid(a.width, a.height, 1, 0)),
          profiling_(context_->cl_context(), context_->device(), CL_QUEUE_PROFILING_ENABLE),
          plain_(context_->cl_context(), context_->device()), phase_(context_, phase_parameters(a)),
          ideal_(context_, pixels() * sizeof(float)), intensity_(context_, pixels() * sizeof(float)) {
        const std::vector<float> light(pixels(), 1.0f);
        plain_.enqueueWriteBuffer(ideal_.get(), CL_TRUE, 0, light.size() * sizeof(float), light.data());
        clsp::CommandChain chain(plain_(), 0, nullptr);
        phase_.enqueue_refresh(chain, 0, {});
        plain_.finish();
    }

    void run() {
        fmt::print("{}: {} x {}, D = {}, p = {}\n", context_->device().getInfo<CL_DEVICE_NAME>(), arguments_.width,
                   arguments_.height, arguments_.diameter, arguments_.degree_of_polarization);
        if (clsp::default_engine(context_->device()) == clsp::EngineKind::kCpu) {
            heading();
            row({clsp::EngineKind::kCpu, {}, {}});
            return;
        }
        const clsp::WorkGroupLimits limits = clsp::work_group_limits(*context_);
        fmt::print("largest work-group {}, local memory {}\n", limits.work_items, limits.local_bytes);
        heading();
        row({clsp::EngineKind::kGpu, {}, {}});
        for (const clsp::WorkGroup &pick :
             clsp::work_groups_to_try(clsp::make_gpu_plan(grid_.grid_height), limits, true))
            row({clsp::EngineKind::kGpu, pick, {}});
        for (const clsp::WorkGroup &pick :
             clsp::work_groups_to_try(clsp::make_gpu_plan(grid_.grid_width), limits, false))
            row({clsp::EngineKind::kGpu, {}, pick});
        row({clsp::EngineKind::kClfft, {}, {}}); // takes the longest to start; of its kernels the last ones are seen
    }

  private:
    static void heading() {
        fmt::print("{:<52} {:>12} {:>7} {:>12} {:>9} {:>9}\n", "us", "rows_forward", "columns", "rows_inverse",
                   "all three", "a frame");
    }
    static clsp::PhaseParameters phase_parameters(const Arguments &a) {
        clsp::PhaseParameters p;
        p.width = a.width;
        p.height = a.height;
        p.polarization_count = a.degree_of_polarization < 1.0 ? 2 : 1;
        p.field = a.gaussian ? clsp::FieldKind::kCircularGaussian : clsp::FieldKind::kUnitPhasor;
        return p;
    }
    std::size_t pixels() const { return std::size_t{arguments_.width} * arguments_.height; }
    clsp::ImageView view(const clsp::DeviceBuffer &buffer) const {
        return clsp::check_image({buffer.get()(), 0, 0, arguments_.width, arguments_.height, clsp::Format::kFloat32},
                                 "image", context_->cl_context()(), {arguments_.width, arguments_.height},
                                 {clsp::Format::kFloat32});
    }

    void row(const clsp::EngineSpec &spec) {
        clsp::ApertureParameters parameters;
        parameters.width = arguments_.width;
        parameters.height = arguments_.height;
        parameters.relative_diameter = arguments_.diameter;
        parameters.degree_of_polarization = arguments_.degree_of_polarization;
        parameters.engine = spec;
        clsp::Aperture aperture(context_, parameters);
        const clsp::ImageView from = view(ideal_), to = view(intensity_);
        std::map<std::string, std::vector<double>> us;
        std::vector<double> sums;
        for (std::uint32_t i = 0; i < arguments_.frames + 3; ++i) {
            clsp::ChainProfile profile;
            clsp::CommandChain chain(profiling_(), 0, nullptr, &profile);
            aperture.enqueue_intensity(chain, phase_, from, to);
            profiling_.finish();
            if (i < 3)
                continue;
            std::map<std::string, double> frame;
            for (const clsp::ChainProfile::Entry &entry : profile.entries)
                frame[entry.stage] += 1e-3 * double(entry.event.getProfilingInfo<CL_PROFILING_COMMAND_END>() -
                                                    entry.event.getProfilingInfo<CL_PROFILING_COMMAND_START>());
            double sum = 0.0;
            for (const auto &[stage, time] : frame) {
                us[stage].push_back(time);
                sum += time;
            }
            sums.push_back(sum);
        }
        // Frames that follow each other without a wait.
        std::vector<double> whole;
        for (int round = 0; round < 5; ++round) {
            const auto start = std::chrono::steady_clock::now();
            for (std::uint32_t i = 0; i < arguments_.frames; ++i) {
                clsp::CommandChain chain(plain_(), 0, nullptr);
                aperture.enqueue_intensity(chain, phase_, from, to);
            }
            plain_.finish();
            whole.push_back(
                std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count() /
                arguments_.frames);
        }
        const auto stage = [&](const char *name) {
            const auto found = us.find(name);
            return found == us.end() ? 0.0 : median(found->second);
        };
        fmt::print("{:<52} {:>12.1f} {:>7.1f} {:>12.1f} {:>9.1f} {:>9.1f}\n", clsp::describe(aperture.engine()),
                   stage("fft"), stage("pupil"), stage("inverse_fft"), median(sums), median(whole));
        std::fflush(stdout);
    }

    Arguments arguments_;
    std::shared_ptr<clsp::Context> context_;
    clsp::FieldGrid grid_;
    cl::CommandQueue profiling_, plain_;
    clsp::Phase phase_;
    clsp::DeviceBuffer ideal_, intensity_;
};

} // namespace

int main(int argc, char **argv) {
    Arguments arguments;
    CLI::App app{"Device times of the device's engine's passes, by their work-groups where it has such"};
    app.add_option("--width", arguments.width, "of the image, in pixels")->capture_default_str();
    app.add_option("--height", arguments.height, "of the image, in pixels")->capture_default_str();
    app.add_option("--diameter", arguments.diameter, "D, relative to the sampling frequency")->capture_default_str();
    app.add_option("--degree-of-polarization", arguments.degree_of_polarization, "0 to 1; below 1 two fields are made")
        ->capture_default_str();
    app.add_option("--frames", arguments.frames, "of which medians are taken")
        ->capture_default_str()
        ->check(CLI::Range(1, 100000));
    app.add_flag("--gaussian", arguments.gaussian, "a circular Gaussian field instead of unit phasors");
    CLI11_PARSE(app, argc, argv);
    try {
        Passes(arguments).run();
    } catch (const std::exception &error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
    return 0;
}
