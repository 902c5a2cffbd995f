#include "stages/aperture.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "fft/cpu/lanes.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/pixel_taps.hpp"

#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

// Host memory for sub-buffers must be aligned so on every device that we know (CL_DEVICE_MEM_BASE_ADDR_ALIGN is at most
// 4096 bits there; a page is generous).
constexpr std::uint64_t kWorkspaceAlignment = 4096;
constexpr double kPi = 3.14159265358979323846;

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
      bad_pixels_(context_), plain_field_(context_, grid_) {
    configure(p);
}

std::vector<EngineChoice> Aperture::engine_choices(const ApertureParameters &p) const {
    if (p.engine)
        return {{*p.engine, "asked for"}, {{}, "it takes every grid"}};
    return context_->engine_choices(grid_.grid_width, grid_.grid_height);
}

void Aperture::configure(const ApertureParameters &p) {
    const double diameter = diameter_of(p);
    check_fraction(p.degree_of_polarization, "degree_of_polarization");
    check_fraction(p.fill_factor, "fill_factor");
    if (diameter > grid_.oversampling)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the relative diameter D is {} cycles per pixel, but a grid with oversampling {} "
                                "carries at most {}; set "
                                "oversampling to {} or more (at most {}), or use a larger f_number",
                                diameter, grid_.oversampling, grid_.oversampling,
                                static_cast<std::uint64_t>(std::ceil(std::min(diameter, 1e9))), kMaxOversampling));
    const Pupil pupil = make_pupil(p.pupil, grid_, diameter);
    const bool is_complex = !pupil.phase_turns.empty();
    DeviceBuffer pupil_buffer;
    if (is_complex) {
        std::vector<cl_float2> amplitudes(pupil.transmission.size());
        for (std::size_t i = 0; i < amplitudes.size(); ++i) {
            const double t = pupil.transmission[i], angle = 2.0 * kPi * pupil.phase_turns[i];
            amplitudes[i] = {{static_cast<float>(t * std::cos(angle)), static_cast<float>(t * std::sin(angle))}};
        }
        pupil_buffer = DeviceBuffer(context_, amplitudes.size() * sizeof(cl_float2), amplitudes.data());
    } else {
        pupil_buffer = DeviceBuffer(context_, pupil.transmission.size() * sizeof(float), pupil.transmission.data());
    }
    DeviceBuffer taps_buffer;
    std::uint32_t tap_count = 0;
    if (p.fill_factor > 0.0) {
        std::vector<float> taps;
        for (const double tap : pixel_taps(p.fill_factor, grid_.oversampling, diameter))
            taps.push_back(static_cast<float>(tap));
        tap_count = static_cast<std::uint32_t>(taps.size());
        // A kernel reaches around the periodic border once.
        if (grid_.grid_width < tap_count || grid_.grid_height < tap_count)
            throw Error(Status::kInvalidArgument,
                        fmt::format("fill_factor needs a field grid of at least {} x {} samples, this one has {} x {}",
                                    tap_count, tap_count, grid_.grid_width, grid_.grid_height));
        taps_buffer = DeviceBuffer(context_, taps.size() * sizeof(float), taps.data());
    }
    FusedDecision decision =
        decide_engine(context_, grid_, pupil, {p.workspace_from_host, tap_count > 0, p.degree_of_polarization < 1.0},
                      engine_choices(p));
    const FusedEngine *fused = decision.engine.get();
    const bool sample_powers = fused && fused->leaves_sample_powers();
    if (!fused && !fft_)
        fft_ = context_->fft(grid_.grid_width, grid_.grid_height, true);

    // Work memory: the field (with the fused engine what the pupil leaves of it), the transform's scratch or the
    // samples' powers, and the first polarization's intensity, unless both are taken at once or add up in the powers.
    const std::uint64_t field_bytes = fused ? fused->lines_bytes() : grid_.samples() * sizeof(cl_float2);
    const std::uint64_t scratch_bytes = !fused          ? fft_->scratch_bytes()
                                        : sample_powers ? grid_.samples() * sizeof(float)
                                                        : 0;
    const std::uint64_t scratch_offset = aligned(field_bytes);
    const std::uint64_t partial_offset = scratch_offset + aligned(scratch_bytes);
    const std::uint64_t partial_bytes =
        p.degree_of_polarization < 1.0 && !sample_powers && !(fused && fused->polarizations() == 2)
            ? std::uint64_t{grid_.width} * grid_.height * sizeof(float)
            : 0;
    const std::uint64_t workspace_bytes = partial_offset + aligned(partial_bytes);
    DeviceBuffer workspace;
    if (p.workspace_from_host && field_() &&
        (field_bytes > scratch_offset_ || scratch_bytes > partial_offset_ - scratch_offset_ ||
         partial_bytes > workspace_bytes_ - partial_offset_))
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
    const std::string options = fmt::format("-DCOMPLEX_PUPIL={} -DSHIFT=0 -DPIXEL_TAPS={} -DSAMPLE_POWERS={}",
                                            is_complex ? 1 : 0, tap_count, sample_powers ? 1 : 0);
    // The pixels of powers in vectors, where a row's sums have room.
    std::uint64_t row_bytes = 0;
    if (sample_powers && tap_count > 0 && works_in_lanes(*context_))
        row_bytes = (std::uint64_t{grid_.grid_width} + tap_count + fused_lanes(*context_)) * sizeof(float);
    if (row_bytes > context_->device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>())
        row_bytes = 0;
    cl::Kernel apply, write, add;
    if (!fused)
        apply = context_->kernel("stages/aperture.cl", "aperture_pupil", options + " -DACCUMULATE=0");
    if (row_bytes > 0) {
        const std::string lanes = fmt::format("-DPIXEL_TAPS={} -DLANES={}", tap_count, fused_lanes(*context_));
        write = context_->kernel("stages/aperture_lanes.cl", "aperture_pixels_lanes", lanes + " -DACCUMULATE=0");
        add = context_->kernel("stages/aperture_lanes.cl", "aperture_pixels_lanes", lanes + " -DACCUMULATE=1");
    } else if (!fused || sample_powers) {
        write = context_->kernel("stages/aperture.cl", "aperture_intensity", options + " -DACCUMULATE=0");
        add = context_->kernel("stages/aperture.cl", "aperture_intensity", options + " -DACCUMULATE=1");
    }

    // Nothing throws from here on, but slicing new work memory, which comes first.
    if (!p.workspace_from_host || !field_()) {
        scratch_offset_ = scratch_offset;
        partial_offset_ = partial_offset;
        workspace_bytes_ = workspace_bytes;
    }
    if (new_workspace) {
        slice_workspace(workspace.get(), 0);
        own_workspace_ = std::move(workspace);
    }
    // The caller's pupil image need not outlive the call.
    if (p.pupil.image && p.pupil.image != pupil_image_.data()) {
        const std::uint64_t row = std::uint64_t{p.pupil.image_width} * sizeof(float);
        const std::uint64_t pitch = (p.pupil.image_pitch_bytes ? p.pupil.image_pitch_bytes : row) / sizeof(float);
        pupil_image_.clear();
        for (std::uint32_t y = 0; y < p.pupil.image_height; ++y)
            pupil_image_.insert(pupil_image_.end(), p.pupil.image + y * pitch,
                                p.pupil.image + y * pitch + p.pupil.image_width);
    }
    parameters_ = p;
    if (p.pupil.image) {
        parameters_.pupil.image = pupil_image_.data();
        parameters_.pupil.image_pitch_bytes = 0;
    }
    relative_diameter_ = diameter;
    degree_of_polarization_ = p.degree_of_polarization;
    mean_transmission_ = pupil.mean_transmission;
    normalized_mean_transmission_ = p.pupil.normalization == Normalization::kUnitMean ? 1.0 : pupil.mean_transmission;
    pupil_samples_ = pupil.samples;
    pupil_ = std::move(pupil_buffer);
    taps_ = std::move(taps_buffer);
    if (!(decision.spec == decision_.spec) || decision.source != decision_.source)
        context_->log(LogLevel::kInfo,
                      fmt::format("{} is used for a field grid of {} x {}: {}", describe(decision.spec),
                                  grid_.grid_width, grid_.grid_height, decision.source));
    decision_ = std::move(decision);
    sample_powers_ = sample_powers;
    row_bytes_ = row_bytes;
    complex_pupil_ = is_complex;
    tap_count_ = tap_count;
    apply_pupil_ = apply;
    write_intensity_ = write;
    add_intensity_ = add;
    incoherent_ = LazyKernel("stages/aperture.cl", "aperture_incoherent", options + " -DACCUMULATE=0");
    shift_pupil_ = {};
}

cl::Kernel &Aperture::pupil_kernel(bool shifted) {
    if (!shifted)
        return apply_pupil_;
    if (!shift_pupil_())
        shift_pupil_ =
            context_->kernel("stages/aperture.cl", "aperture_pupil",
                             fmt::format("-DCOMPLEX_PUPIL={} -DSHIFT=1 -DPIXEL_TAPS=0 -DSAMPLE_POWERS=0 -DACCUMULATE=0",
                                         complex_pupil_ ? 1 : 0));
    return shift_pupil_;
}

void Aperture::prepare(const Phase &phase, const Exposure &exposure) {
    Field &field = exposure.field ? *exposure.field : plain_field_;
    const std::vector<LaserLine> &lines = exposure.lines ? *exposure.lines : field.lines();
    if (decision_.engine) {
        const std::uint32_t polarizations = degree_of_polarization_ < 1.0 || field.weighs_polarizations() ? 2 : 1;
        const bool one_pass = !exposure.adds && lines.size() == 1 && polarizations <= decision_.engine->polarizations();
        decision_.engine->prepare(phase, field, lines, exposure.screen != nullptr, exposure.moves_image,
                                  exposure.exposed ? &*exposure.exposed : nullptr, !exposure.exposed || !one_pass);
        return;
    }
    field.prepare(phase, exposure.screen != nullptr);
    pupil_kernel(exposure.moves_image);
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
    if (!field_())
        throw Error(Status::kInvalidState,
                    "the aperture was created with workspace_from_host = 1; call clspApertureSetWorkspace() first");
}

void Aperture::enqueue_field(CommandChain &chain, const Phase &phase, Field &field, const ImageView &irradiance,
                             const Exposure &exposure, std::uint32_t polarization, const LaserLine &line) {
    const FieldInput input{irradiance, exposure.material, exposure.screen, exposure.coherent_gain};
    const double shift_x = exposure.shift_x_px * grid_.oversampling, shift_y = exposure.shift_y_px * grid_.oversampling;
    if (decision_.engine) {
        decision_.engine->enqueue_lines(chain, phase, field, input, polarization, line, field_, bad_pixels_.buffer());
        std::optional<std::array<double, 2>> shift;
        if (exposure.moves_image)
            shift = {shift_x, shift_y};
        decision_.engine->enqueue_pupil(chain, field_, shift);
        return;
    }
    field.enqueue_illuminate(chain, phase, input, polarization, line, field_, bad_pixels_.buffer());
    fft_->enqueue(chain, FftDirection::kForward, "fft", field_, scratch_);
    cl::Kernel &apply = pupil_kernel(exposure.moves_image);
    KernelArguments arguments(apply);
    arguments.add(field_).add(pupil_.get());
    if (exposure.moves_image)
        arguments.add(static_cast<cl_float>(shift_x)).add(static_cast<cl_float>(shift_y));
    if (complex_pupil_ || exposure.moves_image) {
        arguments.add(cl_uint{grid_.grid_width}).add(cl_uint{grid_.grid_height});
        chain.run("pupil", apply, grid_.grid_width, grid_.grid_height);
    } else {
        arguments.add(cl_ulong{grid_.samples()});
        chain.run("pupil", apply, grid_.samples());
    }
    fft_->enqueue(chain, FftDirection::kInverse, "inverse_fft", field_, scratch_);
}

void Aperture::enqueue_intensity(CommandChain &chain, const Phase &phase, const ImageView &irradiance,
                                 const ImageView &intensity, const Exposure &exposure) {
    Field &field = exposure.field ? *exposure.field : plain_field_;
    check_phase(phase, &field);
    if (!phase.refreshed())
        throw Error(Status::kInvalidState,
                    "the phase holds no values yet; call clspPhaseEnqueueRefresh() or restore a state first");
    check_workspace();
    check_writable(intensity, "intensity");
    refuse_workspace(irradiance, "irradiance");
    refuse_workspace(intensity, "intensity");
    const bool in_place = same_pixels(irradiance, intensity);
    if (overlap(irradiance, intensity) && !in_place)
        throw Error(
            Status::kOverlap,
            "irradiance and intensity overlap without being the same image; use one image for both, or two apart");

    const bool weighs = field.weighs_polarizations();
    const std::uint32_t polarizations = degree_of_polarization_ < 1.0 || weighs ? 2 : 1;
    const std::vector<LaserLine> &lines = exposure.lines ? *exposure.lines : field.lines();
    const std::uint32_t at_once = decision_.engine ? decision_.engine->polarizations() : 1;
    const std::size_t passes = lines.size() * (polarizations / at_once);
    if (in_place && (exposure.adds || (!sample_powers_ && passes > (partial_() ? 2 : 1))))
        throw Error(Status::kInternal, "several fields are added, but irradiance and intensity are the same image");
    prepare(phase, exposure); // a kernel that does not build leaves no frame half done
    field.enqueue_heights(chain, phase);
    std::size_t pass = 0;
    for (const LaserLine &line : lines)
        for (std::uint32_t k = 0; k < polarizations; k += at_once, ++pass) {
            enqueue_field(chain, phase, field, irradiance, exposure, k, line);

            // I = (1 + p)/2 |V_1|^2 + (1 - p)/2 |V_2|^2 (thesis eq. 40), for each line of the laser. With a material
            // table the field has these weights already. Where the output is the irradiance that the second field still
            // needs, the first sum waits in the work memory.
            const auto weight_of = [&](std::uint32_t polarization) {
                const double sign = polarization == 0 ? 1.0 : -1.0;
                const double share = weighs ? 1.0 : 0.5 * (1.0 + sign * degree_of_polarization_);
                return static_cast<cl_float>(share * line.weight * exposure.gain);
            };
            const cl_float weight = weight_of(k);
            const Weights weights{{weight, at_once == 2 ? weight_of(1) : 0.0f}};
            if (sample_powers_) {
                // Fields add up sample by sample; pixels are made of them once.
                ImageView powers;
                powers.mem = scratch_();
                powers.pitch = grid_.grid_width;
                decision_.engine->enqueue_intensity(chain, field_, weights, pass > 0 ? powers : ImageView{}, powers);
                if (pass + 1 == passes)
                    enqueue_pixels(chain, scratch_, 1.0f, exposure.adds ? intensity : ImageView{}, intensity);
                continue;
            }
            ImageView partial = intensity;
            if (in_place && passes > 1) {
                partial.mem = partial_();
                partial.offset = 0;
                partial.pitch = grid_.width;
            }
            const bool adds = pass > 0 || exposure.adds;
            const ImageView &out = pass + 1 == passes ? intensity : partial;
            const ImageView before = adds ? partial : ImageView{};
            if (decision_.engine) {
                if (exposure.exposed && pass + 1 == passes)
                    decision_.engine->enqueue_exposed(chain, field_, weights, before, *exposure.exposed);
                else
                    decision_.engine->enqueue_intensity(chain, field_, weights, before, out);
                continue;
            }
            enqueue_pixels(chain, field_, weight, before, out);
        }
}

void Aperture::enqueue_pixels(CommandChain &chain, const cl::Buffer &samples, cl_float weight, const ImageView &before,
                              const ImageView &intensity) {
    cl::Kernel &kernel = before ? add_intensity_ : write_intensity_;
    KernelArguments arguments(kernel);
    if (row_bytes_ > 0) {
        arguments.add(samples)
            .add(cl_uint{grid_.grid_width})
            .add(cl_uint{grid_.grid_height})
            .add(cl_uint{grid_.oversampling})
            .add(taps_.get());
        if (before)
            arguments.add(before);
        arguments.add(intensity).add(cl_uint{grid_.width}).add(cl_uint{grid_.height});
        arguments.add(cl::Local(row_bytes_));
        chain.run("intensity", kernel, grid_.height, 1, 1, 1);
        return;
    }
    arguments.add(samples).add(cl_uint{grid_.grid_width}).add(cl_uint{grid_.oversampling}).add(weight);
    if (tap_count_ > 0)
        arguments.add(cl_uint{grid_.grid_height}).add(taps_.get());
    if (before)
        arguments.add(before);
    arguments.add(intensity).add(cl_uint{grid_.width}).add(cl_uint{grid_.height});
    chain.run("intensity", kernel, grid_.width, grid_.height);
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
