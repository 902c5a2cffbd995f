#include "stages/phase.hpp"

#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/philox.hpp"

#include <fmt/core.h>

namespace clsp {

Phase::Phase(std::shared_ptr<Context> context, const PhaseParameters &p)
    : context_(std::move(context)), grid_(make_field_grid(p.width, p.height, p.oversampling, p.guard_px)),
      field_(p.field), polarization_count_(p.polarization_count), seed_(p.seed) {
    if (field_ != FieldKind::kCircularGaussian && field_ != FieldKind::kUnitPhasor)
        throw Error(Status::kInvalidArgument,
                    fmt::format("field is {}, expected CLSP_FIELD_CIRCULAR_GAUSSIAN or CLSP_FIELD_UNIT_PHASOR",
                                static_cast<std::uint32_t>(field_)));
    if (polarization_count_ != 1 && polarization_count_ != 2)
        throw Error(Status::kInvalidArgument,
                    fmt::format("polarization_count is {}, it must be 1 or 2", polarization_count_));
    const std::uint64_t sample_bytes = field_ == FieldKind::kUnitPhasor ? sizeof(cl_uint) : sizeof(cl_float2);
    state_ = DeviceBuffer(context_, polarization_count_ * grid_.samples() * sample_bytes);
    const std::string options = fmt::format("-DFIELD_UNIT_PHASOR={}", field_ == FieldKind::kUnitPhasor ? 1 : 0);
    refresh_all_ = context_->kernel("phase.cl", "phase_refresh", options + " -DHAS_MASK=0");
    refresh_masked_ = context_->kernel("phase.cl", "phase_refresh", options + " -DHAS_MASK=1");
    export_ = context_->kernel("phase.cl", "phase_field", options + " -DHAS_MASK=0");
    illuminate_ = context_->kernel("phase.cl", "phase_illuminate", options + " -DHAS_MASK=0");
}

void Phase::check_refreshed() const {
    if (!refreshed_)
        throw Error(Status::kInvalidState,
                    "the phase holds no values yet; call clspPhaseEnqueueRefresh() or restore a state first");
}

void Phase::check_polarization(std::uint32_t polarization) const {
    if (polarization >= polarization_count_)
        throw Error(Status::kInvalidArgument, fmt::format("polarization is {}, but the phase has {} (numbered from 0)",
                                                          polarization, polarization_count_));
}

ImageView Phase::check_mask(const ImageDescription &mask, const char *name) const {
    return check_image(mask, name, context_->cl_context()(), {grid_.width, grid_.height}, {Format::kUint8});
}

void Phase::enqueue_refresh(CommandChain &chain, std::uint64_t frame_index, const ImageView &mask) {
    check_frame_index(frame_index);
    const bool masked = mask && refreshed_;
    const std::uint32_t quarter = quarter_rows(grid_.grid_height);
    cl::Kernel &kernel = masked ? refresh_masked_ : refresh_all_;
    KernelArguments arguments(kernel);
    arguments.add(state_.get())
        .add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(cl_uint{quarter})
        .add(philox_key(seed_))
        .add(frame_low(frame_index))
        .add(frame_high(frame_index));
    if (masked)
        arguments.add(mask).add(cl_uint{grid_.width}).add(cl_uint{grid_.height}).add(cl_uint{grid_.oversampling});
    chain.run("phase", kernel, grid_.grid_width, quarter, polarization_count_);
    refreshed_ = true;
}

void Phase::enqueue_field(CommandChain &chain, std::uint32_t polarization, const ImageDescription &field) {
    check_refreshed();
    check_polarization(polarization);
    const ImageView view = check_image(field, "field", context_->cl_context()(), {grid_.grid_width, grid_.grid_height},
                                       {Format::kFloat32x2});
    KernelArguments(export_)
        .add(state_.get())
        .add(cl_ulong{polarization * grid_.samples()})
        .add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(view);
    chain.run("phase", export_, grid_.grid_width, grid_.grid_height);
}

void Phase::enqueue_illuminate(CommandChain &chain, std::uint32_t polarization, const ImageView &irradiance,
                               const cl::Buffer &field, const cl::Buffer &bad_pixels) {
    check_refreshed();
    check_polarization(polarization);
    KernelArguments(illuminate_)
        .add(state_.get())
        .add(cl_ulong{polarization * grid_.samples()})
        .add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(irradiance)
        .add(cl_uint{grid_.width})
        .add(cl_uint{grid_.height})
        .add(cl_uint{grid_.oversampling})
        .add(field)
        .add(bad_pixels);
    chain.run("field", illuminate_, grid_.grid_width, grid_.grid_height);
}

void Phase::enqueue_save(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes) {
    check_refreshed();
    check_buffer(mem, "mem", context_->cl_context()(), offset_bytes, state_.bytes());
    chain.copy("phase", state_.get()(), 0, mem, offset_bytes, state_.bytes());
}

void Phase::enqueue_restore(CommandChain &chain, cl_mem mem, std::uint64_t offset_bytes) {
    check_buffer(mem, "mem", context_->cl_context()(), offset_bytes, state_.bytes());
    chain.copy("phase", mem, offset_bytes, state_.get()(), 0, state_.bytes());
    refreshed_ = true;
}

} // namespace clsp
