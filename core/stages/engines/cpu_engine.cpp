// The engine for CPUs: a work-item is a work-group and works on `lanes` rows or lines at once,
// with explicit vectors (kernels/fft/cpu/rows_forward.cl, fft/cpu/columns.cl, fft/cpu/rows_inverse.cl).
#include "stages/engines/engine.hpp"

#include "fft/cpu/codelets.hpp"
#include "fft/cpu/lanes.hpp"
#include "fft/cpu/lines.hpp"
#include "stages/engines/pupil_tables.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "runtime/lazy_kernel.hpp"

#include <algorithm>
#include <fmt/core.h>
#include <map>
#include <optional>
#include <vector>

namespace clsp {
namespace {

// Of both rows' passes: a tile, and for both polarizations room for a number of each point, in whole squares of lanes:
// the amplitudes that they share, the powers of one.
std::uint64_t row_bytes(std::uint32_t length, std::uint32_t lanes, std::uint32_t polarizations) {
    const std::uint64_t points = (length + lanes - 1) / lanes * lanes;
    return cpu_tile_bytes(length, lanes) + (polarizations - 1) * points * lanes * sizeof(float);
}

// What rows_forward asks for ahead: how many samples of a row, four cache lines of numbers, and into which cache. The
// builtin of OpenCL does nothing on PoCL, its compiler's own does. Rows whose distance is a power of two share few sets
// of the first cache, so that samples wait in the second one. An AMD processor leaves what is read past the outer
// caches (0) there, too, but does not pass it on to the third one, which stays the pupil columns'; others have it in
// the first cache alone.
std::string prefetch_options(const Context &context) {
    if (!context.is_pocl_cpu())
        return "-DPREFETCH=0";
    return fmt::format("-DPREFETCH=64 -DPREFETCH_LOCALITY={}", tuned_device(context).vendor == "AuthenticAMD" ? 0 : 2);
}

// The only number besides 0, if there is just one.
std::optional<float> only_amplitude(const std::vector<float> &amplitudes) {
    const auto first = std::find_if(amplitudes.begin(), amplitudes.end(), [](float a) { return a != 0.0f; });
    if (first == amplitudes.end())
        return {};
    const bool others = std::any_of(first, amplitudes.end(), [&](float a) { return a != 0.0f && a != *first; });
    return others ? std::nullopt : std::optional<float>(*first);
}

// Of each vector of amplitudes, the lanes that are not 0.
std::vector<cl_uint> lane_bits(const std::vector<float> &amplitudes, std::uint32_t lanes) {
    std::vector<cl_uint> bits(amplitudes.size() / lanes, 0);
    for (std::size_t i = 0; i < amplitudes.size(); ++i)
        if (amplitudes[i] != 0.0f)
            bits[i / lanes] |= 1u << i % lanes;
    return bits;
}

std::size_t row_items(std::uint32_t rows, std::uint32_t of_each) {
    return (rows + of_each - 1) / of_each;
}

// How many times the device's last cache `bytes` fill; 0 where its compiler has no builtins for what would follow.
double caches_filled(const Context &context, std::uint64_t bytes) {
    const std::uint64_t cache = context.device().getInfo<CL_DEVICE_GLOBAL_MEM_CACHE_SIZE>();
    return context.is_pocl_cpu() && cache > 0 ? double(bytes) / double(cache) : 0.0;
}

// Images of this size and more go past the caches: what drives out the field costs more than what the next reader
// finds.
constexpr std::uint64_t kStreamedBytes = std::uint64_t{1} << 20;

class CpuEngine final : public Engine {
  public:
    explicit CpuEngine(const EngineRequest &request);

    bool exposes(const Sensor &sensor) const override {
        return draws_in_lanes(*context_) && pixel_samples() == 1 && !pixels_of_powers_ && sensor.exposes_pixels();
    }

  private:
    std::uint64_t field_bytes() const override { return bytes_of(capacity_blocks_); }
    void build_kernels(const Phase &phase, Field &field, const std::vector<LaserLine> &lines, const Exposure &exposure,
                       bool with_intensity) override;
    void enqueue_field(CommandChain &chain, const FieldPass &pass, const WorkMemory &memory) override;
    void enqueue_pixels(CommandChain &chain, const cl::Buffer &field, Weights weights, const ImageView &before,
                        const ImageView &intensity) override;
    void enqueue_codes(CommandChain &chain, const cl::Buffer &field, Weights weights, const ImageView &before,
                       const ExposedFrame &exposed) override;

    std::uint64_t local_bytes() const { return context_->device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>(); }
    std::string row_options() const { return fmt::format("-DLANES={} -DPOLARIZATIONS={}", lanes_, polarizations_); }
    // Whether images go past the caches, which needs the compiler's own builtin: large ones.
    bool streams(Format output) const {
        return context_->is_pocl_cpu() &&
               std::uint64_t{component_bytes(output)} * written().width * written().height >= kStreamedBytes;
    }
    std::uint64_t bytes_of(std::uint32_t column_blocks) const {
        return std::uint64_t{polarizations_} * column_blocks * grid_.grid_height * lanes_ * 2 * sizeof(float);
    }
    // Lines that the last cache does not hold from rows_forward to columns go past the caches, where they are at least
    // not read before they are written; only vectors that are cache lines, as halves do not come together there.
    bool streams_lines() const { return lanes_ == 16 && caches_filled(*context_, bytes_of(column_blocks_)) > 1.0; }
    // Beside images half of that cache is not always theirs either: rows_inverse asks for them ahead.
    bool prefetches_lines() const { return caches_filled(*context_, bytes_of(column_blocks_)) > 0.5; }
    std::string inverse_options() const {
        return fmt::format("{} -DPREFETCH_LINES={}", row_options(), prefetches_lines() ? 1 : 0);
    }
    cl::Kernel &field_kernel(const std::string &field_options);
    cl::Kernel &pupil_kernel(bool shifted);
    cl::Kernel &exposed_kernel(Format output);
    // Those of rows_inverse up to the image before it.
    KernelArguments inverse_arguments(cl::Kernel &kernel, const cl::Buffer &lines, Weights weights, bool adds,
                                      const ImageView &before);
    void enqueue_inverse(CommandChain &chain, cl::Kernel &kernel, KernelArguments &arguments, std::size_t items);
    void make_tables(const Pupil &pupil, bool any_pupil);

    std::uint32_t lanes_;
    std::shared_ptr<const CpuLines> row_lines_, column_lines_;
    const LinePlan &row_plan_, &column_plan_;
    const ProgramCache::GeneratedHeader &row_codelets_, &column_codelets_;
    std::uint32_t pupil_columns_ = 0, column_blocks_ = 0, capacity_blocks_ = 0;
    bool complex_pupil_ = false;
    std::optional<float> hard_amplitude_; // where the pupil is 0 or this: pupil_ has bits
    DeviceBuffer row_twiddles_, column_twiddles_;
    DeviceBuffer positions_, blocks_;
    DeviceBuffer column_ends_, row_ends_;
    DeviceBuffer pupil_;
    DeviceBuffer frequencies_, line_frequencies_;
    std::map<std::string, cl::Kernel> fields_; // by what the field is made of
    std::map<Format, cl::Kernel> exposed_;     // by output format
    cl::Kernel columns_, shifted_columns_;
    LazyKernel inverse_;
};

// A pixel's samples lie in one vector, or rows_inverse leaves them to another kernel.
bool sums_pixels(std::uint32_t lanes, std::uint32_t oversampling) {
    return oversampling <= lanes && lanes % oversampling == 0;
}

CpuEngine::CpuEngine(const EngineRequest &request)
    : Engine(request, {EngineKind::kCpu, {}, {}}), lanes_(simd_lanes(*context_)),
      row_lines_(cpu_lines(*context_, grid_.grid_width)), column_lines_(cpu_lines(*context_, grid_.grid_height)),
      row_plan_(row_lines_->plan), column_plan_(column_lines_->plan), row_codelets_(row_lines_->codelets),
      column_codelets_(column_lines_->codelets), complex_pupil_(!request.pupil.phase_turns.empty()) {
    const std::uint64_t needed = cpu_tile_bytes(grid_.grid_width, lanes_);
    const std::uint64_t local = local_bytes();
    if (needed > local)
        throw Error(Status::kUnsupported,
                    fmt::format("rows of {} points need {} bytes of local memory, the device has {}", grid_.grid_width,
                                needed, local));
    if (request.degree_of_polarization < 1.0 && row_bytes(grid_.grid_width, lanes_, 2) <= local)
        polarizations_ = 2;
    if (!request.pixel_taps.empty() || !sums_pixels(lanes_, grid_.oversampling))
        pixels_of_powers_.emplace(context_, grid_, request.pixel_taps, true);
    make_tables(request.pupil, request.any_pupil);
    inverse_ = LazyKernel("fft/cpu/rows_inverse.cl", "cpu_rows_inverse",
                          fmt::format("{} -DOVERSAMPLING={} -DSENSOR=0 -DSTREAM={}", inverse_options(), pixel_samples(),
                                      streams(Format::kFloat32) ? 1 : 0),
                          &row_codelets_);
    pupil_kernel(false);
}

void CpuEngine::make_tables(const Pupil &pupil, bool any_pupil) {
    const std::uint32_t width = grid_.grid_width, height = grid_.grid_height;
    // Lines that pass something, at the positions where the rows' transform leaves them.
    std::vector<cl_uint> positions, others;
    std::vector<cl_uint> blocks;
    const std::uint32_t block_length = row_plan_.block_length();
    const PassedLines passed(pupil, grid_);
    const auto passes = [&](std::uint32_t p) { return bool(passed.columns[row_plan_.frequencies[p]]); };
    const std::vector<std::uint8_t> row_ends = needed_ends(row_plan_, passes);
    for (std::uint32_t position = 0; position < width; ++position) {
        if (passes(position))
            positions.push_back(position);
        else if (within_ends(row_plan_, row_ends, position))
            others.push_back(position);
        if ((position + 1) % block_length == 0) {
            const auto count = static_cast<cl_uint>(positions.size());
            blocks.insert(blocks.end(),
                          {count / lanes_, (count + lanes_ - 1) / lanes_, static_cast<cl_uint>(others.size())});
        }
    }
    pupil_columns_ = static_cast<std::uint32_t>(positions.size());
    column_blocks_ = (pupil_columns_ + lanes_ - 1) / lanes_;
    capacity_blocks_ = any_pupil ? (width + lanes_ - 1) / lanes_ : column_blocks_;
    blocks[blocks.size() - 3] = column_blocks_; // the last one need not be full
    positions.resize(std::size_t{column_blocks_} * lanes_, width);

    const std::uint32_t parts = complex_pupil_ ? 2 : 1;
    std::vector<float> amplitudes(std::size_t{column_blocks_} * height * parts * lanes_, 0.0f);
    std::vector<float> line_frequencies(std::size_t{column_blocks_} * lanes_, 0.0f);
    std::vector<std::uint32_t> columns(pupil_columns_);
    for (std::uint32_t i = 0; i < pupil_columns_; ++i) {
        columns[i] = row_plan_.frequencies[positions[i]];
        line_frequencies[i] = signed_frequency(columns[i], width);
    }
    const double scale = 1.0 / double(grid_.samples());
    // Row by row, as the pupil lies in memory.
    for (std::uint32_t position = 0; position < height; ++position) {
        const std::uint32_t row = column_plan_.frequencies[position];
        if (!passed.rows[row])
            continue;
        for (std::uint32_t i = 0; i < pupil_columns_; ++i) {
            float *to = &amplitudes[(std::size_t{i / lanes_} * height + position) * parts * lanes_ + i % lanes_];
            const std::complex<float> t = scaled_amplitude(pupil, std::size_t{row} * width + columns[i], scale);
            to[0] = t.real();
            if (complex_pupil_)
                to[lanes_] = t.imag();
        }
    }
    std::vector<std::uint8_t> column_ends;
    for (std::uint32_t block = 0; block < column_blocks_; ++block) {
        const std::vector<std::uint8_t> ends = needed_ends(column_plan_, [&](std::uint32_t position) {
            const auto first = amplitudes.begin() + (std::ptrdiff_t{block} * height + position) * parts * lanes_;
            return std::any_of(first, first + parts * lanes_, [](float part) { return part != 0.0f; });
        });
        column_ends.insert(column_ends.end(), ends.begin(), ends.end());
    }
    std::vector<float> frequencies(height);
    for (std::uint32_t position = 0; position < height; ++position)
        frequencies[position] = signed_frequency(column_plan_.frequencies[position], height);
    positions.insert(positions.end(), others.begin(), others.end());
    positions_ = device_table(context_, positions);
    blocks_ = device_table(context_, blocks);
    row_ends_ = device_table(context_, row_ends);
    column_ends_ = device_table(context_, column_ends);
    hard_amplitude_ = complex_pupil_ ? std::nullopt : only_amplitude(amplitudes);
    pupil_ =
        hard_amplitude_ ? device_table(context_, lane_bits(amplitudes, lanes_)) : device_table(context_, amplitudes);
    column_twiddles_ = device_table(context_, column_plan_.twiddles);
    row_twiddles_ = device_table(context_, row_plan_.twiddles);
    frequencies_ = device_table(context_, frequencies);
    line_frequencies_ = device_table(context_, line_frequencies);
}

cl::Kernel &CpuEngine::field_kernel(const std::string &field_options) {
    const auto found = fields_.find(field_options);
    if (found != fields_.end())
        return found->second;
    return fields_
        .emplace(field_options, context_->kernel("fft/cpu/rows_forward.cl", "cpu_rows_forward",
                                                 fmt::format("{} {} {} -DOVERSAMPLING={} -DSTREAM_LINES={}",
                                                             field_options, row_options(), prefetch_options(*context_),
                                                             grid_.oversampling, streams_lines() ? 1 : 0),
                                                 &row_codelets_))
        .first->second;
}

cl::Kernel &CpuEngine::pupil_kernel(bool shifted) {
    cl::Kernel &kernel = shifted ? shifted_columns_ : columns_;
    if (!kernel())
        kernel = context_->kernel("fft/cpu/columns.cl", "cpu_columns",
                                  fmt::format("-DLANES={} -DCOMPLEX_PUPIL={} -DHARD_PUPIL={} -DSHIFT={}", lanes_,
                                              complex_pupil_ ? 1 : 0, hard_amplitude_ ? 1 : 0, shifted ? 1 : 0),
                                  &column_codelets_);
    return kernel;
}

cl::Kernel &CpuEngine::exposed_kernel(Format output) {
    const auto found = exposed_.find(output);
    if (found != exposed_.end())
        return found->second;
    return exposed_
        .emplace(output, context_->kernel("fft/cpu/rows_inverse.cl", "cpu_rows_inverse",
                                          fmt::format("{} -DOVERSAMPLING=1 -DSENSOR=1 -DSTREAM={} -DOUTPUT_FORMAT={}",
                                                      inverse_options(), streams(output) ? 1 : 0,
                                                      static_cast<std::uint32_t>(output)),
                                          &row_codelets_))
        .first->second;
}

void CpuEngine::build_kernels(const Phase &phase, Field &field, const std::vector<LaserLine> &lines,
                              const Exposure &exposure, bool with_intensity) {
    if (with_intensity)
        inverse_.get(*context_);
    if (exposure.exposed)
        exposed_kernel(exposure.exposed->output.format);
    for (const LaserLine &line : lines)
        field_kernel(field.options(phase, line, exposure.screen != nullptr));
    pupil_kernel(exposure.moves_image);
}

void CpuEngine::enqueue_field(CommandChain &chain, const FieldPass &pass, const WorkMemory &memory) {
    cl::Kernel &rows = field_kernel(pass.field.options(pass.phase, pass.line, pass.input.screen != nullptr));
    KernelArguments row_arguments(rows);
    pass.field.add_arguments(row_arguments, pass.phase, pass.input, pass.polarization, pass.line);
    row_arguments.add(memory.field)
        .add(pass.bad_pixels)
        .add(row_twiddles_.get())
        .add(positions_.get())
        .add(cl_uint{column_blocks_})
        .add(blocks_.get())
        .add(row_ends_.get())
        .add(cl::Local(row_bytes(grid_.grid_width, lanes_, polarizations_)));
    chain.run("fft", rows, row_items(grid_.grid_height, lanes_), 1, 1, 1);

    cl::Kernel &columns = pupil_kernel(pass.shift.has_value());
    KernelArguments column_arguments(columns);
    const std::uint32_t column_blocks = polarizations_ * column_blocks_;
    column_arguments.add(memory.field)
        .add(cl_uint{column_blocks})
        .add(cl_uint{column_blocks_})
        .add(column_twiddles_.get())
        .add(column_ends_.get())
        .add(pupil_.get());
    if (hard_amplitude_)
        column_arguments.add(cl_float{*hard_amplitude_});
    if (pass.shift)
        column_arguments.add(frequencies_.get())
            .add(line_frequencies_.get())
            .add(static_cast<cl_float>((*pass.shift)[0]))
            .add(static_cast<cl_float>((*pass.shift)[1]));
    chain.run("pupil", columns, column_blocks, 1, 1, 1);
}

KernelArguments CpuEngine::inverse_arguments(cl::Kernel &kernel, const cl::Buffer &lines, Weights weights, bool adds,
                                             const ImageView &before) {
    KernelArguments arguments(kernel);
    arguments.add(lines)
        .add(cl_uint{grid_.grid_height})
        .add(row_twiddles_.get())
        .add(positions_.get())
        .add(cl_uint{column_blocks_})
        .add(blocks_.get())
        .add(row_ends_.get())
        .add(static_cast<cl_float>(weights[0] / (pixel_samples() * pixel_samples())))
        .add(static_cast<cl_float>(weights[1] / (pixel_samples() * pixel_samples())))
        .add(cl_uint{adds ? 1u : 0u})
        .add(before);
    return arguments;
}

void CpuEngine::enqueue_inverse(CommandChain &chain, cl::Kernel &kernel, KernelArguments &arguments,
                                std::size_t items) {
    arguments.add(cl_uint{written().width})
        .add(cl_uint{written().height})
        .add(cl::Local(row_bytes(grid_.grid_width, lanes_, polarizations_)));
    chain.run("inverse_fft", kernel, items, 1, 1, 1);
}

void CpuEngine::enqueue_pixels(CommandChain &chain, const cl::Buffer &lines, Weights weights, const ImageView &before,
                               const ImageView &intensity) {
    cl::Kernel &kernel = inverse_.get(*context_);
    KernelArguments arguments = inverse_arguments(kernel, lines, weights, bool(before), before ? before : intensity);
    enqueue_inverse(chain, kernel, arguments.add(intensity), row_items(pixel_samples() * written().height, lanes_));
}

void CpuEngine::enqueue_codes(CommandChain &chain, const cl::Buffer &lines, Weights weights, const ImageView &before,
                              const ExposedFrame &exposed) {
    cl::Kernel &kernel = exposed_kernel(exposed.output.format);
    KernelArguments arguments =
        inverse_arguments(kernel, lines, weights, bool(before), before ? before : exposed.output);
    exposed.sensor->add_arguments(arguments, exposed.frame_index, exposed.output);
    // An item has a quarter of its rows in each quarter of the image: they share random numbers.
    enqueue_inverse(chain, kernel, arguments, row_items((grid_.height + 3) / 4, lanes_ / 4));
}

} // namespace

std::unique_ptr<Engine> make_cpu_engine(const EngineRequest &request) {
    return std::make_unique<CpuEngine>(request);
}

} // namespace clsp
