#include "stages/field.hpp"

#include "runtime/checks.hpp"
#include "fft/cpu/lanes.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/philox.hpp"

#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

constexpr std::uint32_t kMaxLines = 63;

// Fraction of the light that keeps its phase on a surface of RMS height h at normal incidence.
double coherent_fraction(double roughness_rms_m, double wavelength_m) {
    const double spread = 4.0 * M_PI * roughness_rms_m / wavelength_m;
    return std::exp(-spread * spread);
}

} // namespace

Field::Field(std::shared_ptr<Context> context, const FieldGrid &grid)
    : context_(std::move(context)), grid_(grid), bad_materials_(context_) {
    configure({});
}

void Field::configure(const FieldParameters &p) {
    check_fraction(p.coherent_fraction, "coherent_fraction");
    if (p.line_count < 1 || p.line_count > kMaxLines)
        throw Error(Status::kInvalidArgument,
                    fmt::format("line_count is {}, a laser has 1 to {} lines", p.line_count, kMaxLines));
    check_not_negative(p.dephasing_rad, "dephasing_rad");
    if (p.dephasing_rad > 1000.0)
        throw Error(Status::kInvalidArgument,
                    fmt::format("dephasing_rad is {}, it must be at most 1000", p.dephasing_rad));
    DeviceBuffer table;
    if (p.materials) {
        if (p.materials->context()->cl_context()() != context_->cl_context()())
            throw Error(Status::kWrongContext, "the material table belongs to another context");
        check_positive(p.wavelength_m, "wavelength_m");
        std::vector<float> rows;
        for (const Material &m : p.materials->materials()) {
            const double c = coherent_fraction(m.roughness_rms_m, p.wavelength_m);
            const double q = m.degree_of_polarization < 0.0 ? p.degree_of_polarization : m.degree_of_polarization;
            for (const double value :
                 {std::sqrt(1.0 - c), coherent_amplitude(c), std::sqrt(0.5 * (1.0 + q)), std::sqrt(0.5 * (1.0 - q))})
                rows.push_back(static_cast<float>(value));
        }
        table = DeviceBuffer(context_, rows.size() * sizeof(float), rows.data());
    }
    std::vector<LaserLine> lines = equal_lines(p.line_count);
    const bool dephases = p.line_count > 1 && p.dephasing_rad > 0.0;
    if (dephases && !heights_) {
        draws_in_lanes_ = works_in_lanes(*context_);
        draw_heights_ = draws_in_lanes_ ? context_->kernel("stages/surface_heights_lanes.cl", "surface_heights_lanes",
                                                           fmt::format("-DLANES={}", simd_lanes(*context_)))
                                        : context_->kernel("stages/surface_heights.cl", "surface_heights", "");
        heights_ = DeviceBuffer(context_, grid_.samples() * sizeof(float));
    } else if (!dephases) {
        heights_ = {};
    }
    parameters_ = p;
    lines_ = std::move(lines);
    table_ = std::move(table);
    heights_epoch_.reset(); // the seed may be another one
    kernels_.clear();
}

double Field::coherent_amplitude(double fraction) const {
    return std::sqrt(fraction) / grid_.oversampling;
}

double Field::turns_per_height(const LaserLine &line) const {
    return line.offset * parameters_.dephasing_rad / (2.0 * M_PI);
}

std::string Field::state_options(const Phase &phase) const {
    const bool padded =
        grid_.samples() > std::uint64_t{grid_.width} * grid_.height * grid_.oversampling * grid_.oversampling;
    return fmt::format("{} -DPADDED={} -DMATERIALS={} -DCOHERENT={}", phase.state_options(), padded ? 1 : 0,
                       table_ ? 1 : 0, !table_ && parameters_.coherent_fraction > 0.0 ? 1 : 0);
}

std::string Field::options(const Phase &phase, const LaserLine &line, bool with_screen) const {
    return fmt::format("{} -DLINES={} -DSCREEN={}", state_options(phase), turns_per_height(line) != 0.0 ? 1 : 0,
                       with_screen ? 1 : 0);
}

cl::Kernel &Field::kernel_for(const Phase &phase, Variant variant) {
    const std::string options = state_options(phase);
    if (options != kernel_options_) {
        kernels_.clear();
        kernel_options_ = options;
    }
    const auto found = kernels_.find(variant);
    if (found != kernels_.end())
        return found->second;
    return kernels_
        .emplace(variant, context_->kernel("stages/field.cl", "field_illuminate",
                                           fmt::format("{} -DLINES={} -DSCREEN={}", options, variant[0] ? 1 : 0,
                                                       variant[1] ? 1 : 0)))
        .first->second;
}

void Field::prepare(const Phase &phase, bool with_screen) {
    kernel_for(phase, {false, with_screen});
    if (heights_)
        kernel_for(phase, {true, with_screen});
}

void Field::add_arguments(KernelArguments &arguments, const Phase &phase, const FieldInput &input,
                          std::uint32_t polarization, const LaserLine &line) const {
    const FieldParameters &p = parameters_;
    const double turns = turns_per_height(line);
    phase.add_state(arguments, polarization);
    arguments.add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(cl_uint{polarization})
        .add(input.irradiance)
        .add(cl_uint{grid_.width})
        .add(cl_uint{grid_.height})
        .add(cl_uint{grid_.oversampling});
    if (table_)
        arguments.add(input.material)
            .add(static_cast<cl_uint>(p.materials->materials().size()))
            .add(table_.get())
            .add(bad_materials_.buffer());
    else if (p.coherent_fraction > 0.0)
        arguments.add(static_cast<cl_float>(std::sqrt(1.0 - p.coherent_fraction)))
            .add(static_cast<cl_float>(input.coherent_gain * coherent_amplitude(p.coherent_fraction)));
    if (turns != 0.0)
        arguments.add(static_cast<cl_float>(turns)).add(heights_.get());
    if (input.screen)
        arguments.add(*input.screen);
}

void Field::enqueue_heights(CommandChain &chain, const Phase &phase) {
    if (!heights_ || heights_epoch_ == phase.origin().epoch)
        return;
    const std::uint32_t quarter = quarter_rows(grid_.grid_height);
    KernelArguments(draw_heights_)
        .add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(cl_uint{quarter})
        .add(philox_key(parameters_.seed))
        .add(frame_low(phase.origin().epoch))
        .add(frame_high(phase.origin().epoch))
        .add(heights_.get());
    if (draws_in_lanes_)
        chain.run("field", draw_heights_, quarter, 1, 1, 1);
    else
        chain.run("field", draw_heights_, grid_.grid_width, quarter);
    heights_epoch_ = phase.origin().epoch;
}

void Field::enqueue_illuminate(CommandChain &chain, const Phase &phase, const FieldInput &input,
                               std::uint32_t polarization, const LaserLine &line, const cl::Buffer &field,
                               const cl::Buffer &bad_pixels) {
    cl::Kernel &kernel = kernel_for(phase, {turns_per_height(line) != 0.0, input.screen != nullptr});
    KernelArguments arguments(kernel);
    add_arguments(arguments, phase, input, polarization, line);
    arguments.add(field).add(bad_pixels);
    chain.run("field", kernel, grid_.grid_width, grid_.grid_height);
}

} // namespace clsp
