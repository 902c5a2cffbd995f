// The engine for GPUs: a work-group has some rows or neighbouring pupil columns in local
// memory and shares out their butterflies (kernels/fft/gpu/rows_forward.cl, fft/gpu/columns.cl,
// fft/gpu/rows_inverse.cl).
#include "stages/engines/engine.hpp"

#include "fft/gpu/codelets.hpp"
#include "stages/engines/pupil_tables.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"

#include <algorithm>
#include <fmt/core.h>
#include <map>
#include <vector>

namespace clsp {
namespace {

constexpr cl_uint kNoSlot = 0xffffffffu; // NO_SLOT of kernels/fft/gpu/work_groups.h
// Rows of pupil columns begin at whole cache lines, or neighbouring lines' points would straddle what a GPU fetches,
// and have room for a line more, which is nobody's.
constexpr std::uint32_t kPitch = 16;
// Points that a work-item may hold for rows to share random numbers, which is worth going over budget.
constexpr std::uint32_t kMostQuarterPoints = 64;

std::uint32_t pitch_for(std::uint32_t lines) {
    return (lines / kPitch + 1) * kPitch;
}

[[noreturn]] void throw_no_room(std::uint32_t length, std::uint64_t needed, std::uint64_t local) {
    throw Error(Status::kUnsupported, fmt::format("lines of {} points need {} bytes of local memory, the device has {}",
                                                  length, needed, local));
}

// `pick` says what it is to be; what the rule takes goes there if it is none.
WorkGroupShape shape_for(const Context &context, const LinePlan &plan, bool across, std::optional<WorkGroup> &pick) {
    const WorkGroupLimits limits = work_group_limits(context);
    const std::optional<WorkGroupShape> shape =
        pick ? picked_shape(plan, limits, across, *pick) : choose_shape(plan, limits, across);
    if (!shape && pick)
        throw Error(
            Status::kUnsupported,
            fmt::format("lines of {} points do not go in work-groups of {} lines x {} work-items: the device takes "
                        "{} work-items and {} bytes of local memory",
                        plan.length, pick->lines, pick->items, limits.work_items, limits.local_bytes));
    if (!shape)
        throw_no_room(plan.length, gpu_tile_bytes(plan, {1, 1, true, across}), limits.local_bytes);
    pick = WorkGroup{shape->lines, shape->items};
    return *shape;
}

// A kernel and the work-groups that it was built for.
struct GpuKernel {
    cl::Kernel kernel;
    WorkGroupShape shape;
    std::uint64_t tile_bytes = 0;

    void enqueue(CommandChain &chain, const char *stage, std::uint32_t lines) const {
        const std::size_t groups = (lines + shape.lines - 1) / shape.lines;
        chain.run(stage, kernel, groups * shape.work_items(), 1, 1, shape.work_items());
    }
};

// A kernel may need more registers or local memory than its work-groups leave it; then these become smaller. Lines stay
// a multiple of `lines_of`.
GpuKernel build(Context &context, const LinePlan &plan, WorkGroupShape shape, const PassBand &band, const char *pass,
                const std::string &options, std::uint32_t lines_of = 1) {
    const std::string name = fmt::format("gpu_{}", pass);
    for (;;) {
        const ProgramCache::GeneratedHeader codelets{kGpuCodeletsName, gpu_codelets(plan, shape, band)};
        // Denormal numbers mean nothing here, and cost GPUs a test at each root.
        const cl::Kernel kernel =
            context.kernel(fmt::format("fft/gpu/{}.cl", pass), name, "-cl-denorms-are-zero " + options, &codelets);
        const std::uint64_t own_bytes = kernel.getWorkGroupInfo<CL_KERNEL_LOCAL_MEM_SIZE>(context.device()),
                            tile_bytes = gpu_tile_bytes(plan, shape),
                            local = context.device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
        const auto most = static_cast<std::uint32_t>(
            std::min<std::size_t>(kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(context.device()), 1u << 16));
        if (tile_bytes + own_bytes <= local && shape.work_items() <= most)
            return {kernel, shape, tile_bytes};
        const std::optional<WorkGroupShape> smaller =
            smaller_shape(plan, shape, {most, local - std::min(local, own_bytes)}, lines_of);
        if (!smaller)
            throw Error(
                Status::kUnsupported,
                fmt::format("the kernel {} takes work-groups of at most {} work-items and has {} bytes of local "
                            "memory left; {} lines of {} points need at least {} and {}",
                            name, most, local - std::min(local, own_bytes), lines_of, plan.length, lines_of,
                            gpu_tile_bytes(plan, {lines_of, 1, true, shape.across})));
        context.log(LogLevel::kInfo,
                    fmt::format("{}: work-groups of {} x {} instead of {} x {}: the driver gives it {} work-items and "
                                "{} bytes of local memory",
                                name, smaller->lines, smaller->items, shape.lines, shape.items, most,
                                local - std::min(local, own_bytes)));
        shape = *smaller;
    }
}

class GpuEngine final : public Engine {
  public:
    GpuEngine(const EngineRequest &request, const EngineSpec &spec);

    bool exposes(const Sensor &sensor) const override { return !pixels_of_powers_ && sensor.exposes_pixels(); }

  private:
    std::uint64_t field_bytes() const override {
        return std::uint64_t{capacity_columns_} * grid_.grid_height * sizeof(cl_float2);
    }
    void build_kernels(const Phase &phase, Field &field, const std::vector<LaserLine> &lines, const Exposure &exposure,
                       bool with_intensity) override;
    void enqueue_field(CommandChain &chain, const FieldPass &pass, const WorkMemory &memory) override;
    void enqueue_pixels(CommandChain &chain, const cl::Buffer &field, Weights weights, const ImageView &before,
                        const ImageView &intensity) override;
    void enqueue_codes(CommandChain &chain, const cl::Buffer &field, Weights weights, const ImageView &before,
                       const ExposedFrame &exposed) override;
    GpuKernel &field_kernel(const std::string &field_options);
    GpuKernel &columns_kernel(bool shifted);
    GpuKernel &exposed_kernel(const ExposedFrame &exposed);
    // Rows of the image in a work-group of `lines` lines; none if they do not fit.
    std::optional<WorkGroupShape> row_shape(std::uint32_t lines) const;
    GpuKernel build_inverse(const WorkGroupShape &shape, const std::string &options, std::uint32_t lines_of) const;
    // Those of rows_inverse up to the image before it, and the last ones.
    KernelArguments inverse_arguments(GpuKernel &inverse, const cl::Buffer &lines, Weights weights, bool adds,
                                      const ImageView &before) const;
    void enqueue_inverse(CommandChain &chain, GpuKernel &inverse, KernelArguments &arguments) const;
    void make_tables(const Pupil &pupil, bool any_pupil);

    LinePlan row_plan_, column_plan_;
    WorkGroupShape row_shape_, column_shape_;
    std::optional<WorkGroupShape> inverse_shape_; // a pixel's samples lie in one work-group; or pixels_of_powers_
    bool complex_pupil_;
    PassBand row_band_, column_band_;
    std::uint32_t pupil_columns_ = 0, pitch_ = 0, capacity_columns_ = 0; // lines
    DeviceBuffer row_twiddles_, column_twiddles_;
    DeviceBuffer slots_;
    DeviceBuffer pupil_;
    DeviceBuffer frequencies_, line_frequencies_;
    std::map<std::string, GpuKernel> fields_, exposed_; // by their options
    GpuKernel columns_, shifted_columns_, inverse_;
};

GpuEngine::GpuEngine(const EngineRequest &request, const EngineSpec &spec)
    : Engine(request, spec), row_plan_(make_gpu_plan(grid_.grid_width)), column_plan_(make_gpu_plan(grid_.grid_height)),
      row_shape_(shape_for(*context_, row_plan_, false, spec_.rows)),
      column_shape_(shape_for(*context_, column_plan_, true, spec_.columns)),
      inverse_shape_(row_shape_.lines % grid_.oversampling == 0 ? row_shape_ : row_shape(grid_.oversampling)),
      complex_pupil_(!request.pupil.phase_turns.empty()) {
    if (!request.pixel_taps.empty() || !inverse_shape_)
        pixels_of_powers_.emplace(context_, grid_, request.pixel_taps, true);
    make_tables(request.pupil, request.any_pupil);
    inverse_ =
        build_inverse(pixels_of_powers_ ? row_shape_ : *inverse_shape_, "-DSENSOR=0 -DQUARTERS=0", pixel_samples());
    columns_kernel(false);
    // As they were built: the driver may have given them less.
    const auto pick_of = [](const WorkGroupShape &shape) { return WorkGroup{shape.lines, shape.items}; };
    spec_.columns = pick_of(columns_.shape);
    if (pixels_of_powers_ || pick_of(*inverse_shape_) == pick_of(row_shape_)) {
        row_shape_ = inverse_.shape;
        spec_.rows = pick_of(row_shape_);
    }
}

std::optional<WorkGroupShape> GpuEngine::row_shape(std::uint32_t lines) const {
    const WorkGroupLimits limits = work_group_limits(*context_);
    const auto same_items = picked_shape(row_plan_, limits, false, {lines, row_shape_.items});
    if (same_items && same_items->work_items() <= kMostWorkItems)
        return same_items;
    return picked_shape(row_plan_, limits, false, {lines, 0});
}

GpuKernel GpuEngine::build_inverse(const WorkGroupShape &shape, const std::string &options,
                                   std::uint32_t lines_of) const {
    return build(*context_, row_plan_, shape, row_band_, "rows_inverse",
                 fmt::format("-DOVERSAMPLING={} -DPADDED={} {}", pixel_samples(),
                             written().width * pixel_samples() < grid_.grid_width ? 1 : 0, options),
                 lines_of);
}

void GpuEngine::make_tables(const Pupil &pupil, bool any_pupil) {
    const std::uint32_t width = grid_.grid_width, height = grid_.grid_height;
    const PassedLines passed(pupil, grid_);
    row_band_ = pass_band(row_plan_, passed.columns);
    column_band_ = pass_band(column_plan_, passed.rows);
    // Tables over the positions are in the order in which neighbouring work-items read them (last_entry() of
    // kernels/fft/gpu/work_groups.h).
    const auto entry = [](const LinePlan &plan, std::uint32_t position) {
        const std::uint32_t radix = plan.radices.back();
        return position % radix * (plan.length / radix) + position / radix;
    };
    // Slots run by run, those first that pass whole (last_slot() there).
    const std::uint32_t radix = row_plan_.radices.back();
    std::vector<cl_uint> slots(width, kNoSlot), columns;
    for (const bool whole : {true, false})
        for (std::uint32_t q = 0; q < radix; ++q)
            for (std::uint32_t position = q; position < width; position += radix) {
                const std::uint32_t column = row_plan_.frequencies[position];
                if (((row_band_.always >> q & 1u) != 0) != whole || !passed.columns[column])
                    continue;
                slots[entry(row_plan_, position)] = static_cast<cl_uint>(columns.size());
                columns.push_back(column);
            }
    pupil_columns_ = static_cast<std::uint32_t>(columns.size());
    pitch_ = pitch_for(pupil_columns_);
    capacity_columns_ = any_pupil ? pitch_for(width) : pitch_;

    const std::size_t parts = complex_pupil_ ? 2 : 1;
    const double scale = 1.0 / double(grid_.samples());
    std::vector<float> amplitudes(parts * pitch_ * height), line_frequencies, frequencies(height);
    for (std::uint32_t position = 0; position < height; ++position) {
        const std::uint32_t row = column_plan_.frequencies[position];
        frequencies[entry(column_plan_, position)] = signed_frequency(row, height);
        for (std::uint32_t k = 0; k < pupil_columns_; ++k) {
            float *to = &amplitudes[parts * (std::size_t{entry(column_plan_, position)} * pitch_ + k)];
            const std::complex<float> t = scaled_amplitude(pupil, std::size_t{row} * width + columns[k], scale);
            to[0] = t.real();
            if (complex_pupil_)
                to[1] = t.imag();
        }
    }
    for (const std::uint32_t column : columns)
        line_frequencies.push_back(signed_frequency(column, width));
    line_frequencies.resize(pitch_); // work-items beyond the last line read what lies behind it
    slots_ = device_table(context_, slots);
    pupil_ = device_table(context_, amplitudes);
    row_twiddles_ = device_table(context_, gpu_twiddles(row_plan_));
    column_twiddles_ = device_table(context_, gpu_twiddles(column_plan_));
    frequencies_ = device_table(context_, frequencies);
    line_frequencies_ = device_table(context_, line_frequencies);
}

GpuKernel &GpuEngine::field_kernel(const std::string &field_options) {
    const auto found = fields_.find(field_options);
    if (found != fields_.end())
        return found->second;
    return fields_
        .emplace(field_options, build(*context_, row_plan_, row_shape_, row_band_, "rows_forward",
                                      fmt::format("{} -DOVERSAMPLING={}", field_options, grid_.oversampling)))
        .first->second;
}

GpuKernel &GpuEngine::columns_kernel(bool shifted) {
    GpuKernel &columns = shifted ? shifted_columns_ : columns_;
    if (!columns.kernel())
        columns = build(*context_, column_plan_, column_shape_, column_band_, "columns",
                        fmt::format("-DCOMPLEX_PUPIL={} -DSHIFT={}", complex_pupil_ ? 1 : 0, shifted ? 1 : 0));
    return columns;
}

// With a row in each quarter of the image, which share blocks of random numbers, if they fit: on an NVIDIA H200 a
// sensor's pixel costs three times as much where they do not.
GpuKernel &GpuEngine::exposed_kernel(const ExposedFrame &exposed) {
    const std::string options = exposed.sensor->pixel_options(exposed.output.format);
    const auto found = exposed_.find(options);
    if (found != exposed_.end())
        return found->second;
    const std::uint32_t lines = 4 * pixel_samples();
    const auto is_good = [&](const WorkGroupShape &shape) {
        return points_per_item(row_plan_, shape.items) <= kMostQuarterPoints;
    };
    if (const std::optional<WorkGroupShape> shape = row_shape(lines); shape && is_good(*shape)) {
        try {
            GpuKernel kernel = build_inverse(*shape, "-DSENSOR=1 -DQUARTERS=1 " + options, lines);
            if (is_good(kernel.shape))
                return exposed_.emplace(options, std::move(kernel)).first->second;
        } catch (const Error &error) {
            if (error.status() != Status::kUnsupported)
                throw;
        }
    }
    return exposed_
        .emplace(options, build_inverse(*inverse_shape_, "-DSENSOR=1 -DQUARTERS=0 " + options, pixel_samples()))
        .first->second;
}

void GpuEngine::build_kernels(const Phase &phase, Field &field, const std::vector<LaserLine> &lines,
                              const Exposure &exposure, bool) {
    if (exposure.exposed)
        exposed_kernel(*exposure.exposed);
    for (const LaserLine &line : lines)
        field_kernel(field.options(phase, line, exposure.screen != nullptr));
    columns_kernel(exposure.moves_image);
}

void GpuEngine::enqueue_field(CommandChain &chain, const FieldPass &pass, const WorkMemory &memory) {
    GpuKernel &rows = field_kernel(pass.field.options(pass.phase, pass.line, pass.input.screen != nullptr));
    KernelArguments row_arguments(rows.kernel);
    pass.field.add_arguments(row_arguments, pass.phase, pass.input, pass.polarization, pass.line);
    row_arguments.add(memory.field)
        .add(cl_uint{pitch_})
        .add(pass.bad_pixels)
        .add(row_twiddles_.get())
        .add(slots_.get())
        .add(cl::Local(rows.tile_bytes));
    rows.enqueue(chain, "fft", grid_.grid_height);

    GpuKernel &columns = columns_kernel(pass.shift.has_value());
    KernelArguments column_arguments(columns.kernel);
    column_arguments.add(memory.field)
        .add(memory.field)
        .add(cl_uint{pupil_columns_})
        .add(cl_uint{pitch_})
        .add(cl_uint{pitch_})
        .add(column_twiddles_.get())
        .add(column_twiddles_.get())
        .add(pupil_.get());
    if (pass.shift)
        column_arguments.add(frequencies_.get())
            .add(line_frequencies_.get())
            .add(static_cast<cl_float>((*pass.shift)[0]))
            .add(static_cast<cl_float>((*pass.shift)[1]));
    column_arguments.add(cl::Local(columns.tile_bytes));
    columns.enqueue(chain, "pupil", pupil_columns_);
}

KernelArguments GpuEngine::inverse_arguments(GpuKernel &inverse, const cl::Buffer &lines, Weights weights, bool adds,
                                             const ImageView &before) const {
    KernelArguments arguments(inverse.kernel);
    arguments.add(lines)
        .add(cl_uint{pitch_})
        .add(cl_uint{grid_.grid_height})
        .add(row_twiddles_.get())
        .add(slots_.get())
        .add(static_cast<cl_float>(weights[0] / (pixel_samples() * pixel_samples())))
        .add(cl_uint{adds ? 1u : 0u})
        .add(before);
    return arguments;
}

void GpuEngine::enqueue_inverse(CommandChain &chain, GpuKernel &inverse, KernelArguments &arguments) const {
    arguments.add(cl_uint{written().width}).add(cl_uint{written().height}).add(cl::Local(inverse.tile_bytes));
    inverse.enqueue(chain, "inverse_fft", written().height * pixel_samples());
}

void GpuEngine::enqueue_pixels(CommandChain &chain, const cl::Buffer &lines, Weights weights, const ImageView &before,
                               const ImageView &intensity) {
    KernelArguments arguments = inverse_arguments(inverse_, lines, weights, bool(before), before ? before : intensity);
    enqueue_inverse(chain, inverse_, arguments.add(intensity));
}

void GpuEngine::enqueue_codes(CommandChain &chain, const cl::Buffer &lines, Weights weights, const ImageView &before,
                              const ExposedFrame &exposed) {
    GpuKernel &inverse = exposed_kernel(exposed);
    KernelArguments arguments =
        inverse_arguments(inverse, lines, weights, bool(before), before ? before : exposed.output);
    exposed.sensor->add_arguments(arguments, exposed.frame_index, exposed.output);
    enqueue_inverse(chain, inverse, arguments);
}

} // namespace

WorkGroupLimits work_group_limits(const Context &context) {
    const auto largest = std::min(context.device().getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>(),
                                  context.device().getInfo<CL_DEVICE_MAX_WORK_ITEM_SIZES>()[0]);
    return {static_cast<std::uint32_t>(std::min<std::size_t>(largest, 1u << 16)),
            context.device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>()};
}

std::unique_ptr<Engine> make_gpu_engine(const EngineRequest &request, const EngineSpec &spec) {
    return std::make_unique<GpuEngine>(request, spec);
}

} // namespace clsp
