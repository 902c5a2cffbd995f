#include "stages/engines/engine.hpp"

#include "fft/plan/line_plan.hpp"
#include "runtime/error.hpp"

#include <fmt/core.h>

namespace clsp {
namespace {

const std::vector<LaserLine> &lines_of(const Exposure &exposure, const Field &field) {
    return exposure.lines ? *exposure.lines : field.lines();
}

void check_plans(const FieldGrid &grid) {
    for (const std::uint32_t side : {grid.grid_width, grid.grid_height})
        if (!plan_exists(side))
            throw Error(Status::kUnsupported,
                        fmt::format("the field grid is {} x {}: the engines cpu and gpu take sides of 2 to {}",
                                    grid.grid_width, grid.grid_height, kLongestLine));
}

std::unique_ptr<Engine> make_engine(const EngineRequest &request, const EngineSpec &spec) {
    if (spec.kind == EngineKind::kClfft)
        return make_clfft_engine(request);
    check_plans(request.grid);
    return spec.kind == EngineKind::kCpu ? make_cpu_engine(request) : make_gpu_engine(request, spec);
}

} // namespace

WorkBytes Engine::work_bytes() const {
    const bool adds_up = degree_of_polarization_ < 1.0 && !pixels_of_powers_ && polarizations_ == 1;
    return {field_bytes(), pixels_of_powers_ ? grid_.samples() * sizeof(float) : scratch_bytes(),
            adds_up ? std::uint64_t{grid_.width} * grid_.height * sizeof(float) : 0};
}

void Engine::prepare(const Phase &phase, Field &field, const Exposure &exposure) {
    const std::vector<LaserLine> &lines = lines_of(exposure, field);
    const bool one_pass = !exposure.adds && lines.size() == 1 && polarizations_of(field) <= polarizations_;
    build_kernels(phase, field, lines, exposure, !exposure.exposed || !one_pass);
}

void Engine::enqueue(CommandChain &chain, const Phase &phase, Field &field, const ImageView &irradiance,
                     const ImageView &intensity, const Exposure &exposure, const WorkMemory &memory,
                     const cl::Buffer &bad_pixels) {
    const bool weighs = field.weighs_polarizations(), in_place = same_pixels(irradiance, intensity);
    const std::uint32_t polarizations = polarizations_of(field);
    const std::vector<LaserLine> &lines = lines_of(exposure, field);
    const std::size_t passes = lines.size() * (polarizations / polarizations_);
    if (in_place && (exposure.adds || (!pixels_of_powers_ && passes > (memory.partial() ? 2 : 1))))
        throw Error(Status::kInternal, "several fields are added, but irradiance and intensity are the same image");
    prepare(phase, field, exposure); // a kernel that does not build leaves no frame half done
    field.enqueue_heights(chain, phase);

    const FieldInput input{irradiance, exposure.material, exposure.screen, exposure.coherent_gain};
    std::optional<std::array<double, 2>> shift;
    if (exposure.moves_image)
        shift = {{exposure.shift_x_px * grid_.oversampling, exposure.shift_y_px * grid_.oversampling}};
    // Where fields add up: sample by sample, or in the work memory while the output is the irradiance that the second
    // field still needs.
    ImageView sum = intensity;
    if (pixels_of_powers_) {
        sum = {};
        sum.mem = memory.scratch();
        sum.pitch = grid_.grid_width;
    } else if (in_place && passes > 1) {
        sum.mem = memory.partial();
        sum.offset = 0;
        sum.pitch = grid_.width;
    }
    std::size_t pass = 0;
    for (const LaserLine &line : lines)
        for (std::uint32_t k = 0; k < polarizations; k += polarizations_) {
            enqueue_field(chain, {phase, field, input, shift, bad_pixels, line, k}, memory);

            // I = (1 + p)/2 |V_1|^2 + (1 - p)/2 |V_2|^2 (thesis eq. 40), for each line of the laser. With a material
            // table the field has these weights already.
            const auto weight_of = [&](std::uint32_t polarization) {
                const double sign = polarization == 0 ? 1.0 : -1.0;
                const double share = weighs ? 1.0 : 0.5 * (1.0 + sign * degree_of_polarization_);
                return static_cast<cl_float>(share * line.weight * exposure.gain);
            };
            const Weights weights{{weight_of(k), polarizations_ == 2 ? weight_of(1) : 0.0f}};
            const bool adds = pass > 0 || (exposure.adds && !pixels_of_powers_);
            const ImageView before = adds ? sum : ImageView{};
            if (++pass < passes || pixels_of_powers_)
                enqueue_pixels(chain, memory.field, weights, before, sum);
            else if (exposure.exposed)
                enqueue_codes(chain, memory.field, weights, before, *exposure.exposed);
            else
                enqueue_pixels(chain, memory.field, weights, before, intensity);
        }
    if (pixels_of_powers_)
        pixels_of_powers_->enqueue(chain, memory.scratch, 1.0f, exposure.adds ? intensity : ImageView{}, intensity);
}

void Engine::enqueue_codes(CommandChain &, const cl::Buffer &, Weights, const ImageView &, const ExposedFrame &) {
    throw Error(Status::kInternal, "this engine exposes no sensor");
}

EngineDecision decide_engine(const EngineRequest &request, const std::vector<EngineChoice> &choices) {
    EngineDecision decision;
    for (const EngineChoice &choice : choices) {
        try {
            decision.engine = make_engine(request, choice.spec);
            decision.source = choice.source;
            if (choice.spec.kind != EngineKind::kClfft)
                decision.refusal.clear();
            else if (decision.refusal.empty())
                decision.refusal = choice.source;
            break;
        } catch (const Error &error) {
            if (error.status() != Status::kUnsupported || &choice == &choices.back())
                throw;
            request.context->log(LogLevel::kInfo, fmt::format("{} is not used for a field grid of {} x {} ({}): {}",
                                                              describe(choice.spec), request.grid.grid_width,
                                                              request.grid.grid_height, choice.source, error.what()));
            if (decision.refusal.empty())
                decision.refusal = error.what();
        }
    }
    return decision;
}

} // namespace clsp
