#include "stages/aperture.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"

#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

// Host memory for sub-buffers must be aligned so on every device that we know (CL_DEVICE_MEM_BASE_ADDR_ALIGN is at most
// 4096 bits there; a page is generous).
constexpr std::uint64_t kWorkspaceAlignment = 4096;

std::uint64_t aligned(std::uint64_t bytes) {
    return (bytes + kWorkspaceAlignment - 1) / kWorkspaceAlignment * kWorkspaceAlignment;
}

double diameter_of(const ApertureParameters &p) {
    if (p.relative_diameter != 0.0)
        return check_positive(p.relative_diameter, "relative_diameter");
    return check_positive(check_positive(p.pixel_pitch_m, "pixel_pitch_m") /
                              (check_positive(p.wavelength_m, "wavelength_m") * check_positive(p.f_number, "f_number")),
                          "relative_diameter = pixel_pitch_m / (wavelength_m * f_number)");
}

} // namespace

Aperture::Aperture(std::shared_ptr<Context> context, const ApertureParameters &p)
    : context_(std::move(context)), grid_(make_field_grid(p.width, p.height, p.oversampling, p.guard_px)),
      relative_diameter_(diameter_of(p)), degree_of_polarization_(p.degree_of_polarization), bad_pixels_(context_) {
    check_fraction(p.degree_of_polarization, "degree_of_polarization");
    if (relative_diameter_ > grid_.oversampling)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the relative diameter D is {} cycles per pixel, but a grid with oversampling {} "
                                "carries at most {}; set "
                                "oversampling to {} or more (at most {}), or use a larger f_number",
                                relative_diameter_, grid_.oversampling, grid_.oversampling,
                                static_cast<std::uint64_t>(std::ceil(std::min(relative_diameter_, 1e9))),
                                kMaxOversampling));
    const Pupil pupil = make_pupil(p.pupil, grid_, relative_diameter_);
    mean_transmission_ = pupil.mean_transmission;
    pupil_samples_ = pupil.samples;
    pupil_ = DeviceBuffer(context_, pupil.transmission.size() * sizeof(float), pupil.transmission.data());
    fft_ = context_->fft(grid_.grid_width, grid_.grid_height);

    // Work memory: the field, the transform's scratch, and the first polarization's intensity.
    field_bytes_ = grid_.samples() * sizeof(cl_float2);
    scratch_offset_ = aligned(field_bytes_);
    partial_offset_ = scratch_offset_ + aligned(fft_->scratch_bytes());
    const std::uint64_t partial_bytes =
        degree_of_polarization_ < 1.0 ? std::uint64_t{grid_.width} * grid_.height * sizeof(float) : 0;
    workspace_bytes_ = partial_offset_ + aligned(partial_bytes);
    if (!p.workspace_from_host) {
        own_workspace_ = DeviceBuffer(context_, workspace_bytes_);
        slice_workspace(own_workspace_.get(), 0);
    }
    apply_pupil_ = context_->kernel("aperture.cl", "aperture_pupil", "-DACCUMULATE=0");
    write_intensity_ = context_->kernel("aperture.cl", "aperture_intensity", "-DACCUMULATE=0");
    add_intensity_ = context_->kernel("aperture.cl", "aperture_intensity", "-DACCUMULATE=1");
}

void Aperture::slice_workspace(const cl::Buffer &memory, std::uint64_t offset) {
    const auto slice = [&](std::uint64_t first, std::uint64_t end) -> cl::Buffer {
        if (first == end)
            return {};
        const cl_buffer_region region{offset + first, end - first};
        cl_int code = CL_SUCCESS;
        const cl_mem part =
            clCreateSubBuffer(memory(), CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region, &code);
        check_opencl(code, "clCreateSubBuffer");
        return cl::Buffer(part);
    };
    cl::Buffer field = slice(0, scratch_offset_), scratch = slice(scratch_offset_, partial_offset_),
               partial = slice(partial_offset_, workspace_bytes_);
    // All or nothing.
    field_ = field;
    scratch_ = scratch;
    partial_ = partial;
    workspace_ = {};
    workspace_.mem = workspace_.parent = memory();
    workspace_.first_byte = offset;
    workspace_.end_byte = offset + workspace_bytes_;
    workspace_.pitch = 1; // a run of bytes
    workspace_.format = Format::kUint8;
}

void Aperture::set_workspace(cl_mem mem, std::uint64_t offset_bytes, std::uint64_t size_bytes) {
    if (own_workspace_)
        throw Error(Status::kInvalidState,
                    "the aperture has work memory of its own; create it with workspace_from_host = 1 to give it yours");
    if (offset_bytes % kWorkspaceAlignment != 0)
        throw Error(Status::kInvalidArgument,
                    fmt::format("offset_bytes is {}, it must be a multiple of {}", offset_bytes, kWorkspaceAlignment));
    if (size_bytes < workspace_bytes_)
        throw Error(Status::kBufferTooSmall,
                    fmt::format("size_bytes is {}, but the aperture needs {} bytes of work memory", size_bytes,
                                workspace_bytes_));
    check_buffer(mem, "mem", context_->cl_context()(), offset_bytes, size_bytes);
    cl_mem parent = nullptr;
    check_opencl(clGetMemObjectInfo(mem, CL_MEM_ASSOCIATED_MEMOBJECT, sizeof parent, &parent, nullptr),
                 "clGetMemObjectInfo");
    if (parent)
        throw Error(Status::kInvalidArgument,
                    "mem is a sub-buffer, which cannot be divided again; give its parent and an offset");
    ImageView whole;
    whole.mem = mem;
    check_writable(whole, "mem");
    slice_workspace(cl::Buffer(mem, true), offset_bytes);
}

void Aperture::enqueue_pupil(CommandChain &chain, const ImageDescription &pupil) {
    const ImageView view = check_image(pupil, "pupil", context_->cl_context()(), {grid_.grid_width, grid_.grid_height},
                                       {Format::kFloat32});
    const std::size_t row = std::size_t{grid_.grid_width} * sizeof(float);
    const std::size_t origin_from[3] = {0, 0, 0};
    const std::size_t offset = view.offset * sizeof(float), pitch = std::size_t{view.pitch} * sizeof(float);
    const std::size_t origin_to[3] = {offset % pitch, offset / pitch, 0};
    const std::size_t region[3] = {row, grid_.grid_height, 1};
    // A rectangle copy wants its origin within a row; an offset that makes a row straddle two is copied row by row.
    if (origin_to[0] + row <= pitch) {
        chain.run_foreign("pupil", [&](cl_uint num_waits, const cl_event *waits, cl_event *event) {
            check_opencl(clEnqueueCopyBufferRect(chain.queue(), pupil_.get()(), view.mem, origin_from, origin_to,
                                                 region, row, 0, pitch, 0, num_waits, waits, event),
                         "clEnqueueCopyBufferRect");
        });
        return;
    }
    for (std::size_t y = 0; y < grid_.grid_height; ++y)
        chain.copy("pupil", pupil_.get()(), y * row, view.mem, offset + y * pitch, row);
}

void Aperture::check_phase(const Phase &phase) const {
    if (phase.context()->cl_context()() != context_->cl_context()())
        throw Error(Status::kWrongContext, "phase and aperture belong to different contexts");
    const FieldGrid &other = phase.grid();
    if (!grid_.same_as(other))
        throw Error(Status::kInvalidArgument,
                    fmt::format("phase and aperture differ: the phase is for {} x {} pixels, oversampling {}, guard "
                                "{}; the aperture for {} x {}, "
                                "oversampling {}, guard {}",
                                other.width, other.height, other.oversampling, other.guard_px, grid_.width,
                                grid_.height, grid_.oversampling, grid_.guard_px));
    if (degree_of_polarization_ < 1.0 && phase.polarization_count() < 2)
        throw Error(Status::kInvalidArgument,
                    fmt::format("degree_of_polarization is {}, which needs a phase with polarization_count 2",
                                degree_of_polarization_));
}

void Aperture::check_workspace() const {
    if (!field_())
        throw Error(Status::kInvalidState,
                    "the aperture was created with workspace_from_host = 1; call clspApertureSetWorkspace() first");
}

void Aperture::enqueue_intensity(CommandChain &chain, Phase &phase, const ImageView &irradiance,
                                 const ImageView &intensity) {
    check_phase(phase);
    check_workspace();
    check_writable(intensity, "intensity");
    refuse_workspace(irradiance, "irradiance");
    refuse_workspace(intensity, "intensity");
    if (overlap(irradiance, intensity) && !same_pixels(irradiance, intensity))
        throw Error(
            Status::kOverlap,
            "irradiance and intensity overlap without being the same image; use one image for both, or two apart");

    const std::uint32_t polarizations = degree_of_polarization_ < 1.0 ? 2 : 1;
    for (std::uint32_t k = 0; k < polarizations; ++k) {
        phase.enqueue_illuminate(chain, k, irradiance, field_, bad_pixels_.buffer());
        fft_->enqueue(chain, FftDirection::kForward, "fft", field_, scratch_);
        KernelArguments(apply_pupil_).add(field_).add(pupil_.get()).add(cl_ulong{grid_.samples()});
        chain.run("pupil", apply_pupil_, grid_.samples());
        fft_->enqueue(chain, FftDirection::kInverse, "inverse_fft", field_, scratch_);

        // I = (1 + p)/2 |V_1|^2 + (1 - p)/2 |V_2|^2 (thesis eq. 40). The first sum waits in the work memory, because
        // the output may be the irradiance that the second field still needs.
        const double sign = k == 0 ? 1.0 : -1.0;
        const auto weight = static_cast<cl_float>(0.5 * (1.0 + sign * degree_of_polarization_));
        ImageView partial = intensity;
        partial.mem = partial_();
        partial.offset = 0;
        partial.pitch = grid_.width;
        cl::Kernel &kernel = k == 0 ? write_intensity_ : add_intensity_;
        KernelArguments arguments(kernel);
        arguments.add(field_).add(cl_uint{grid_.grid_width}).add(cl_uint{grid_.oversampling}).add(weight);
        if (k == 1)
            arguments.add(partial);
        arguments.add(k + 1 == polarizations ? intensity : partial)
            .add(cl_uint{grid_.width})
            .add(cl_uint{grid_.height});
        chain.run("intensity", kernel, grid_.width, grid_.height);
    }
}

} // namespace clsp
