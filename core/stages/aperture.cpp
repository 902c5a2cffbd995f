#include "stages/aperture.hpp"

#include "fft/engine_choices.hpp"
#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/pixel_taps.hpp"

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
    : context_(std::move(context)), parameters_(p),
      grid_(make_field_grid(p.width, p.height, p.oversampling, p.guard_px)), relative_diameter_(diameter_of(p)),
      degree_of_polarization_(check_fraction(p.degree_of_polarization, "degree_of_polarization")),
      bad_pixels_(context_), plain_field_(context_, grid_),
      incoherent_("stages/aperture.cl", "aperture_incoherent", "-DPIXEL_TAPS=0 -DSAMPLE_POWERS=0 -DACCUMULATE=0") {
    configure(p);
}

std::vector<EngineChoice> Aperture::choices(const ApertureParameters &p) const {
    if (p.engine)
        return {{*p.engine, "asked for"}, {{}, "it takes every grid"}};
    return engine_choices(*context_, grid_.grid_width, grid_.grid_height);
}

void Aperture::configure(const ApertureParameters &p) {
    const double diameter = diameter_of(p);
    check_fraction(p.degree_of_polarization, "degree_of_polarization");
    check_fraction(p.fill_factor, "fill_factor");
    if (diameter > grid_.oversampling)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the relative diameter D is {} cycles per pixel, but a grid with oversampling {} carries at "
                        "most {}; ",
                        diameter, grid_.oversampling, grid_.oversampling) +
                (diameter > kMaxOversampling
                     ? fmt::format("no grid carries more than {}: use a larger f_number, or a smaller pixel pitch",
                                   kMaxOversampling)
                     : fmt::format("set oversampling to {} or more (at most {}), or use a larger f_number",
                                   static_cast<std::uint32_t>(std::ceil(diameter)), kMaxOversampling)));
    const Pupil pupil = make_pupil(p.pupil, grid_, diameter);
    const bool is_complex = !pupil.phase_turns.empty();
    DeviceBuffer pupil_buffer;
    if (is_complex) {
        std::vector<cl_float2> amplitudes(pupil.transmission.size());
        for (std::size_t i = 0; i < amplitudes.size(); ++i) {
            if (pupil.transmission[i] == 0.0f)
                continue;
            const double t = pupil.transmission[i], angle = 2.0 * M_PI * pupil.phase_turns[i];
            amplitudes[i] = {{static_cast<float>(t * std::cos(angle)), static_cast<float>(t * std::sin(angle))}};
        }
        pupil_buffer = DeviceBuffer(context_, amplitudes.size() * sizeof(cl_float2), amplitudes.data());
    } else {
        pupil_buffer = DeviceBuffer(context_, pupil.transmission.size() * sizeof(float), pupil.transmission.data());
    }
    EngineRequest request{
        context_, grid_, pupil, pupil_buffer.get(), {}, p.degree_of_polarization, p.workspace_from_host};
    if (p.fill_factor > 0.0) {
        for (const double tap : pixel_taps(p.fill_factor, grid_.oversampling, diameter))
            request.pixel_taps.push_back(static_cast<float>(tap));
        const std::size_t tap_count = request.pixel_taps.size();
        // A kernel reaches around the periodic border once.
        if (grid_.grid_width < tap_count || grid_.grid_height < tap_count)
            throw Error(Status::kInvalidArgument,
                        fmt::format("fill_factor needs a field grid of at least {} x {} samples, this one has {} x {}",
                                    tap_count, tap_count, grid_.grid_width, grid_.grid_height));
    }
    EngineDecision decision = decide_engine(request, choices(p));
    const WorkBytes bytes = decision.engine->work_bytes();
    const std::uint64_t scratch_offset = aligned(bytes.field);
    const std::uint64_t partial_offset = scratch_offset + aligned(bytes.scratch);
    const std::uint64_t workspace_bytes = partial_offset + aligned(bytes.partial);
    DeviceBuffer workspace;
    if (p.workspace_from_host && memory_.field() &&
        (bytes.field > scratch_offset_ || bytes.scratch > partial_offset_ - scratch_offset_ ||
         bytes.partial > workspace_bytes_ - partial_offset_))
        throw Error(
            Status::kBufferTooSmall,
            fmt::format("degree_of_polarization {} and fill_factor {} need {} bytes of work memory; the host gave "
                        "{}, for other ones",
                        p.degree_of_polarization, p.fill_factor, workspace_bytes, workspace_bytes_));
    // Not only another size: the parts may have other places in it.
    const bool new_workspace =
        !p.workspace_from_host &&
        (workspace_bytes != workspace_bytes_ || scratch_offset != scratch_offset_ || partial_offset != partial_offset_);
    if (new_workspace)
        workspace = DeviceBuffer(context_, workspace_bytes);

    // Nothing throws from here on, but slicing new work memory, which comes first.
    if (!p.workspace_from_host || !memory_.field()) {
        scratch_offset_ = scratch_offset;
        partial_offset_ = partial_offset;
        workspace_bytes_ = workspace_bytes;
    }
    if (new_workspace) {
        slice_workspace(workspace.get(), 0);
        own_workspace_ = std::move(workspace);
    }
    // The caller's pupil image need not outlive the call.
    parameters_ = p;
    const auto keep = [&](const float *image, std::vector<float> &kept) -> const float * {
        if (!image || image == kept.data())
            return image;
        const std::uint64_t row = std::uint64_t{p.pupil.image_width} * sizeof(float);
        const std::uint64_t pitch = (p.pupil.image_pitch_bytes ? p.pupil.image_pitch_bytes : row) / sizeof(float);
        kept.clear();
        for (std::uint32_t y = 0; y < p.pupil.image_height; ++y)
            kept.insert(kept.end(), image + y * pitch, image + y * pitch + p.pupil.image_width);
        return kept.data();
    };
    parameters_.pupil.image = keep(p.pupil.image, pupil_image_);
    parameters_.pupil.image_imaginary = keep(p.pupil.image_imaginary, pupil_image_imaginary_);
    if (p.pupil.image)
        parameters_.pupil.image_pitch_bytes = 0;
    relative_diameter_ = diameter;
    degree_of_polarization_ = p.degree_of_polarization;
    mean_transmission_ = pupil.mean_transmission;
    normalized_mean_transmission_ = p.pupil.normalization == Normalization::kUnitMean ? 1.0 : pupil.mean_transmission;
    pupil_samples_ = pupil.samples;
    pupil_ = std::move(pupil_buffer);
    complex_pupil_ = is_complex;
    const EngineSpec &spec = decision.engine->spec();
    if (!engine_ || !(spec == engine_->spec()) || decision.source != engine_source_)
        context_->log(LogLevel::kInfo, fmt::format("{} is used for a field grid of {} x {}: {}", describe(spec),
                                                   grid_.grid_width, grid_.grid_height, decision.source));
    engine_ = std::move(decision.engine);
    engine_source_ = std::move(decision.source);
    clfft_reason_ = std::move(decision.refusal);
}

void Aperture::prepare(const Phase &phase, const Exposure &exposure) {
    engine_->prepare(phase, field_of(exposure), exposure);
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
    // All or nothing.
    memory_ = {slice(0, scratch_offset_), slice(scratch_offset_, partial_offset_),
               slice(partial_offset_, workspace_bytes_)};
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
                                       {complex_pupil_ ? Format::kFloat32x2 : Format::kFloat32});
    const std::size_t row = std::size_t{grid_.grid_width} * (complex_pupil_ ? sizeof(cl_float2) : sizeof(float));
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

void Aperture::check_phase(const Phase &phase, const Field *field) const {
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
    if ((degree_of_polarization_ < 1.0 || (field && field->weighs_polarizations())) && phase.polarization_count() < 2)
        throw Error(Status::kInvalidArgument,
                    degree_of_polarization_ < 1.0
                        ? fmt::format("degree_of_polarization is {}, which needs a phase with polarization_count 2",
                                      degree_of_polarization_)
                        : std::string("a material table needs a phase with polarization_count 2"));
}

void Aperture::check_workspace() const {
    if (!memory_.field())
        throw Error(Status::kInvalidState,
                    "the aperture was created with workspace_from_host = 1; give it work memory first");
}

void Aperture::enqueue_intensity(CommandChain &chain, const Phase &phase, const ImageView &irradiance,
                                 const ImageView &intensity, const Exposure &exposure) {
    Field &field = field_of(exposure);
    check_phase(phase, &field);
    if (!phase.refreshed())
        throw Error(Status::kInvalidState,
                    "the phase holds no values yet; refresh it or restore a state first");
    check_workspace();
    check_writable(intensity, "intensity");
    refuse_workspace(irradiance, "irradiance");
    refuse_workspace(intensity, "intensity");
    if (overlap(irradiance, intensity) && !same_pixels(irradiance, intensity))
        throw Error(
            Status::kOverlap,
            "irradiance and intensity overlap without being the same image; use one image for both, or two apart");

    engine_->enqueue(chain, phase, field, irradiance, intensity, exposure, memory_, bad_pixels_.buffer());
}

void Aperture::enqueue_incoherent(CommandChain &chain, const ImageView &irradiance, const ImageView &intensity) {
    cl::Kernel &kernel = incoherent_.get(*context_);
    KernelArguments(kernel)
        .add(irradiance)
        .add(static_cast<cl_float>(normalized_mean_transmission_))
        .add(intensity)
        .add(cl_uint{grid_.width})
        .add(cl_uint{grid_.height})
        .add(bad_pixels_.buffer());
    chain.run("intensity", kernel, grid_.width, grid_.height);
}

} // namespace clsp
