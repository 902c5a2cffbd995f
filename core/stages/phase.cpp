#include "stages/phase.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "fft/cpu/lanes.hpp"
#include "stages/philox.hpp"

#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

void check_parameters(const PhaseParameters &p) {
    if (p.polarization_count != 1 && p.polarization_count != 2)
        throw Error(Status::kInvalidArgument,
                    fmt::format("polarization_count is {}, it must be 1 or 2", p.polarization_count));
    if (p.dynamics == Dynamics::kContinuous && p.field == FieldKind::kUnitPhasor)
        throw Error(
            Status::kInvalidArgument,
            "dynamics is continuous, which needs a circular Gaussian field: a sum of two unit phasors is not one");
}

// What of the state's layout the parameters decide, beside the number of polarizations.
bool same_samples(const PhaseParameters &a, const PhaseParameters &b) {
    return a.field == b.field && a.dynamics == b.dynamics && a.translate == b.translate;
}

// Words of a sample, see kernels/stages/phase_state.h.
std::uint64_t words_of(const PhaseParameters &p) {
    const bool continuous = p.dynamics == Dynamics::kContinuous;
    const std::uint64_t field_words = p.field == FieldKind::kUnitPhasor ? 1 : continuous ? 4 : 2;
    return p.polarization_count * field_words + (continuous ? 1 : 0);
}

} // namespace

Phase::Phase(std::shared_ptr<Context> context, const PhaseParameters &p)
    : context_(std::move(context)), grid_(make_field_grid(p.width, p.height, p.oversampling, p.guard_px)),
      bad_pixels_(context_) {
    configure(p);
}

void Phase::configure(const PhaseParameters &p) {
    check_parameters(p);
    if (!grid_.same_as({p.width, p.height, p.oversampling, p.guard_px, 0, 0}))
        throw Error(
            Status::kInvalidArgument,
            fmt::format(
                "the phase is for {} x {} pixels (width x height), oversampling {}, guard {}; these stay as they "
                "are, make another phase for {} x {}, oversampling {}, guard {}",
                grid_.width, grid_.height, grid_.oversampling, grid_.guard_px, p.width, p.height, p.oversampling,
                p.guard_px));
    const bool restored = refreshed_ && origin_.restored;
    if (restored && p.polarization_count > origin_.held)
        throw Error(Status::kInvalidArgument,
                    fmt::format("{} polarizations are needed, and the phase holds a field that was restored, of {}; "
                                "make the phase with polarization_count {} and restore a field of so many, or refresh "
                                "the phase for a random one",
                                p.polarization_count, origin_.held, p.polarization_count));
    // The first polarizations of a state are the state of fewer.
    if (state_ && same_samples(p, parameters_) &&
        (restored || p.polarization_count == parameters_.polarization_count)) {
        parameters_ = p;
        planes_ = words_of(p);
        return;
    }
    const std::uint64_t words = words_of(p);
    const std::uint64_t bytes = (words + (p.translate ? 2 : 0)) * grid_.samples() * sizeof(cl_uint);
    const PhaseParameters old = std::exchange(parameters_, p);
    try {
        DeviceBuffer state(context_, bytes);
        DeviceBuffer next_state, owner;
        if (p.translate) {
            next_state = DeviceBuffer(context_, bytes);
            owner = DeviceBuffer(context_, grid_.samples() * sizeof(cl_uint));
        }
        const std::string options = kernel_options() + " -DADVANCE=0 -DHAS_SHIFT=0";
        const bool in_lanes = works_in_lanes(*context_);
        cl::Kernel refresh_all =
            in_lanes ? context_->kernel("stages/phase_refresh_lanes.cl", "phase_refresh_lanes",
                                        fmt::format("{} -DLANES={}", kernel_options(), simd_lanes(*context_)))
                     : context_->kernel("stages/phase.cl", "phase_refresh", options + " -DHAS_MASK=0");
        refresh_all_ = std::move(refresh_all);
        refreshes_in_lanes_ = in_lanes;
        refresh_masked_ = LazyKernel("stages/phase.cl", "phase_refresh", options + " -DHAS_MASK=1");
        export_ = LazyKernel("stages/phase.cl", "phase_field", options + " -DHAS_MASK=0");
        state_ = std::move(state);
        next_state_ = std::move(next_state);
        owner_ = std::move(owner);
    } catch (...) {
        parameters_ = old;
        throw;
    }
    planes_ = words;
    rest_offset_ = words * grid_.samples();
    advance_.clear();
    refreshed_ = false;
}

std::string Phase::state_options() const {
    return fmt::format("-DFIELD_UNIT_PHASOR={} -DPHASE_CONTINUOUS={}",
                       parameters_.field == FieldKind::kUnitPhasor ? 1 : 0,
                       parameters_.dynamics == Dynamics::kContinuous ? 1 : 0);
}

std::string Phase::kernel_options() const {
    return fmt::format("{} -DPHASE_TRANSLATE={}", state_options(), parameters_.translate ? 1 : 0);
}

void Phase::add_state(KernelArguments &arguments, std::uint32_t polarization) const {
    arguments.add(state_.get()).add(cl_ulong{grid_.samples()}).add(cl_ulong{polarization * grid_.samples()});
}

void Phase::check_refreshed() const {
    if (!refreshed_)
        throw Error(Status::kInvalidState,
                    "the phase holds no values yet; refresh it or restore a state first");
}

void Phase::check_polarization(std::uint32_t polarization) const {
    if (polarization >= parameters_.polarization_count)
        throw Error(Status::kInvalidArgument, fmt::format("polarization is {}, but the phase has {} (numbered from 0)",
                                                          polarization, parameters_.polarization_count));
}

ImageView Phase::check_mask(const ImageDescription &mask, const char *name) const {
    return check_image(mask, name, context_->cl_context()(), {grid_.width, grid_.height}, {Format::kUint8});
}

void Phase::enqueue_refresh(CommandChain &chain, std::uint64_t frame_index, const ImageView &mask) {
    check_frame_index(frame_index);
    const bool masked = mask && refreshed_;
    const std::uint32_t quarter = quarter_rows(grid_.grid_height);
    cl::Kernel &kernel = masked ? refresh_masked_.get(*context_) : refresh_all_;
    KernelArguments arguments(kernel);
    arguments.add(state_.get())
        .add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(cl_uint{quarter})
        .add(philox_key(parameters_.seed))
        .add(frame_low(frame_index))
        .add(frame_high(frame_index))
        .add(cl_ulong{rest_offset_});
    if (masked)
        arguments.add(mask).add(cl_uint{grid_.width}).add(cl_uint{grid_.height}).add(cl_uint{grid_.oversampling});
    if (!masked && refreshes_in_lanes_)
        chain.run("phase", kernel, quarter, 1, parameters_.polarization_count, 1);
    else
        chain.run("phase", kernel, grid_.grid_width, quarter, parameters_.polarization_count);
    refreshed_ = true;
    origin_.held = parameters_.polarization_count;
    if (!masked)
        origin_ = {frame_index, false, parameters_.polarization_count};
}

Phase::AdvanceKernels &Phase::advance_kernels(const PhaseAdvance &advance) {
    const AdvanceVariant variant{static_cast<bool>(advance.path), static_cast<bool>(advance.correlation),
                                 static_cast<bool>(advance.shift), static_cast<bool>(advance.mask),
                                 advance.uniform_correlation < 1.0};
    const auto found = advance_.find(variant);
    if (found != advance_.end())
        return found->second;
    const std::string options =
        fmt::format("{} -DADVANCE=1 -DHAS_PATH={} -DHAS_CORRELATION={} -DHAS_SHIFT={} -DHAS_MASK={} -DBOILS={}",
                    kernel_options(), variant[0] ? 1 : 0, variant[1] ? 1 : 0, variant[2] ? 1 : 0, variant[3] ? 1 : 0,
                    variant[1] || variant[4] ? 1 : 0);
    AdvanceKernels kernels;
    kernels.in_lanes =
        works_in_lanes(*context_) && !variant[2] && parameters_.field == FieldKind::kCircularGaussian;
    kernels.advance = kernels.in_lanes
                          ? context_->kernel("stages/phase_advance_lanes.cl", "phase_advance_lanes",
                                             fmt::format("{} -DLANES={}", options, simd_lanes(*context_)))
                          : context_->kernel("stages/phase.cl", "phase_advance", options);
    if (variant[2])
        kernels.claim = context_->kernel("stages/phase.cl", "phase_claim", options);
    return advance_.emplace(variant, std::move(kernels)).first->second;
}

void Phase::check_advance(const PhaseAdvance &advance) {
    if (!(advance.uniform_path >= 0.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("uniform_path is {}, it must be 0 or more (infinity: everything is new)",
                                advance.uniform_path));
    check_fraction(advance.uniform_correlation, "uniform_correlation");
    if (advance.substep > kMaxSubstep)
        throw Error(Status::kInvalidArgument,
                    fmt::format("substep is {}, it must be 0 to {}", advance.substep, kMaxSubstep));
    if (parameters_.dynamics != Dynamics::kContinuous && (advance.path || advance.uniform_path > 0.0))
        throw Error(
            Status::kInvalidArgument,
            "a path was given to a phase with dynamics replace, which is kept or replaced; make it with dynamics "
            "continuous, or give a mask (a motion with the rule replace makes one)");
    if (parameters_.field == FieldKind::kUnitPhasor && (advance.correlation || advance.uniform_correlation < 1.0))
        throw Error(Status::kInvalidArgument,
                    "a correlation was given to a phase with a unit phasor field, which is kept or replaced; make it "
                    "with a circular Gaussian field, or give a mask");
    if (advance.shift && !parameters_.translate)
        throw Error(Status::kInvalidArgument,
                    "a shift was given to a phase that does not move; make it with translate = 1, or give no shift");
    check_not_negative(advance.path_scale, "path_scale");
    if (advance.path && advance.uniform_path > 0.0)
        throw Error(Status::kInvalidArgument, "both path and uniform_path were given; give one of them");
    if (advance.correlation && advance.uniform_correlation < 1.0)
        throw Error(Status::kInvalidArgument, "both correlation and uniform_correlation were given; give one of them");
    advance_kernels(advance);
}

void Phase::enqueue_advance(CommandChain &chain, std::uint64_t frame_index, const PhaseAdvance &advance) {
    check_refreshed();
    check_frame_index(frame_index);
    check_advance(advance);
    if (!advance.path && !advance.correlation && !advance.shift && !advance.mask && advance.uniform_path == 0.0 &&
        advance.uniform_correlation == 1.0)
        return; // nothing happened
    AdvanceKernels &kernels = advance_kernels(advance);
    const auto knots_per_path = static_cast<cl_float>(kKnotsPerPath * (advance.path ? advance.path_scale : 1.0));
    if (advance.shift) {
        chain.run_foreign("phase", [&](cl_uint num_waits, const cl_event *waits, cl_event *event) {
            const cl_uint nobody = 0xffffffffu;
            check_opencl(clEnqueueFillBuffer(chain.queue(), owner_.get()(), &nobody, sizeof nobody, 0, owner_.bytes(),
                                             num_waits, waits, event),
                         "clEnqueueFillBuffer");
        });
        KernelArguments claim(kernels.claim);
        claim.add(owner_.get())
            .add(cl_uint{grid_.grid_width})
            .add(cl_uint{grid_.grid_height})
            .add(cl_uint{grid_.width})
            .add(cl_uint{grid_.height})
            .add(cl_uint{grid_.oversampling})
            .add(knots_per_path)
            .add(state_.get())
            .add(cl_ulong{rest_offset_});
        for (const ImageView *image : {&advance.path, &advance.correlation, &advance.mask})
            if (*image)
                claim.add(*image);
        claim.add(advance.shift);
        chain.run("phase", kernels.claim, grid_.grid_width, grid_.grid_height);
    }
    const std::uint32_t quarter = quarter_rows(grid_.grid_height);
    KernelArguments arguments(kernels.advance);
    // Negative: paths beyond any number stay.
    const cl_float knots = advance.continues ? -knots_per_path : knots_per_path;
    arguments.add(advance.shift ? next_state_.get() : state_.get())
        .add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(cl_uint{quarter})
        .add(cl_uint{parameters_.polarization_count})
        .add(philox_key(parameters_.seed))
        .add(frame_low(frame_index))
        .add(frame_high(frame_index))
        .add(cl_uint{advance.substep})
        .add(cl_uint{grid_.width})
        .add(cl_uint{grid_.height})
        .add(cl_uint{grid_.oversampling})
        .add(knots)
        .add(static_cast<cl_float>(advance.uniform_path))
        .add(static_cast<cl_float>(advance.uniform_correlation))
        .add(cl_ulong{rest_offset_});
    if (advance.path)
        arguments.add(advance.path);
    if (advance.correlation)
        arguments.add(advance.correlation);
    if (advance.shift)
        arguments.add(state_.get()).add(owner_.get()).add(advance.shift);
    if (advance.mask)
        arguments.add(advance.mask);
    arguments.add(bad_pixels_.buffer());
    if (kernels.in_lanes)
        chain.run("phase", kernels.advance, quarter, 1, 1, 1);
    else
        chain.run("phase", kernels.advance, grid_.grid_width, quarter);
    if (advance.shift)
        std::swap(state_, next_state_);
    origin_.held = parameters_.polarization_count;
}

void Phase::enqueue_field(CommandChain &chain, std::uint32_t polarization, const ImageDescription &field) {
    check_refreshed();
    check_polarization(polarization);
    const ImageView view = check_image(field, "field", context_->cl_context()(), {grid_.grid_width, grid_.grid_height},
                                       {Format::kFloat32x2});
    cl::Kernel &kernel = export_.get(*context_);
    KernelArguments arguments(kernel);
    add_state(arguments, polarization);
    arguments.add(cl_uint{grid_.grid_width}).add(cl_uint{grid_.grid_height}).add(view);
    chain.run("phase", kernel, grid_.grid_width, grid_.grid_height);
}

void Phase::enqueue_save(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes) {
    check_refreshed();
    enqueue_copy(chain, mem, offset_bytes, false);
}

void Phase::enqueue_restore(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes) {
    enqueue_copy(chain, mem, offset_bytes, true);
    refreshed_ = true;
    origin_.held = parameters_.polarization_count;
    origin_.restored = true;
}

void Phase::enqueue_copy(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes, bool to_state) {
    check_buffer(mem, "mem", context_->cl_context()(), offset_bytes, state_bytes());
    const std::uint64_t plane = grid_.samples() * sizeof(cl_uint);
    const auto copy = [&](std::uint64_t state_offset, std::uint64_t mem_offset, std::uint64_t bytes) {
        if (to_state)
            chain.copy("phase", mem, offset_bytes + mem_offset, state_.get()(), state_offset, bytes);
        else
            chain.copy("phase", state_.get()(), state_offset, mem, offset_bytes + mem_offset, bytes);
    };
    copy(0, 0, planes_ * plane);
    if (parameters_.translate)
        copy(rest_offset_ * sizeof(cl_uint), planes_ * plane, rest_planes() * plane);
}

} // namespace clsp
