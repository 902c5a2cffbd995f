#include "doe/doe_field.hpp"

#include "runtime/checks.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/field_grid.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

constexpr const char *kFile = "doe/doe_pattern.cl", *kStage = "doe";
constexpr std::uint32_t kBeamTableSide = 513;
constexpr double kBlurReach = 5; // standard deviations
// Parts of spots that one kernel adds: about a second on a slow device, after which whoever waits may stop it.
constexpr double kSumsAtOnce = 5e8, kLeastSlices = 4;

std::string mebibytes(std::uint64_t bytes) {
    return fmt::format("{:.0f} MiB", std::ceil(double(bytes) / (1 << 20)));
}

// The size of the transform must have small prime factors only.
void check_fft_size(std::uint32_t length, const char *what, std::uint32_t samples) {
    if (fft_size_at_least(length) != length)
        throw Error(Status::kUnsupported,
                    fmt::format("a cell with {} {} of {} sample{} each cannot be transformed: the number must have no "
                                "prime factor above {}; "
                                "the next one that has none is {}. Use that, or evaluation APERTURE",
                                length / samples, what, samples, samples == 1 ? "" : "s", kLargestFftRadix,
                                fft_size_at_least(length)));
}

} // namespace

double spot_sums(const DoeElement &element, const SpotShape &spot) {
    const DoePatternParameters &p = element.parameters;
    // Orders that reach a texel, over all texels.
    const auto reaching = [&](double half_extent, std::uint32_t texels, double half_spot_per_m, double cell) {
        return (2 * half_extent / texels / element.mean_wavelength_m + 2 * half_spot_per_m) * cell + 1;
    };
    return double(p.image_width) * p.image_height *
           reaching(p.half_extent_x, p.image_width, spot.half_u_per_m, p.width * p.pixel_pitch_m) *
           reaching(p.half_extent_y, p.image_height, spot.half_v_per_m, p.height * p.pixel_pitch_m);
}

DoeField::DoeField(std::shared_ptr<Context> context, const DoeElement &element, const BeamProfile &beam)
    : context_(std::move(context)), element_(element), beam_(beam), queue_(context_->cl_context(), context_->device()) {
    const DoePatternParameters &p = element.parameters;
    if (element.orders) {
        columns_ = element.sampled_width();
        rows_ = element.sampled_height();
        check_fft_size(columns_, "columns", element.samples);
        check_fft_size(rows_, "rows", element.samples);
    } else {
        // A design that repeats is cut where the beam or the DOE ends.
        const auto cover = [&](std::uint32_t own, double doe_m, double half_beam_m, const char *what) {
            double needed = own;
            if (p.periodic) {
                const double extent = doe_m > 0 ? std::min(doe_m, 2 * half_beam_m) : 2 * half_beam_m;
                needed = std::ceil(extent / element.sample_pitch_m() - 1e-6);
            }
            if (!(needed <= kMaxDoeSide) || fft_size_at_least(static_cast<std::uint32_t>(needed)) > kMaxDoeSide)
                throw Error(Status::kInvalidArgument,
                            fmt::format("the aperture is {:.0f} samples {}, at most {} are taken: {:g} m of beam at "
                                        "{:g} m per sample. Use "
                                        "evaluation ORDERS, a smaller beam or fewer feature_samples",
                                        needed, what, kMaxDoeSide, 2 * half_beam_m, element.sample_pitch_m()));
            return fft_size_at_least(std::max(2u, static_cast<std::uint32_t>(needed)));
        };
        columns_ = cover(element.sampled_width(), p.doe_width_m, beam.half_width_x_m(), "wide");
        rows_ = cover(element.sampled_height(), p.doe_height_m, beam.half_width_y_m(), "high");
    }
    plan_memory();
}

void DoeField::plan_memory() {
    const DoePatternParameters &p = element_.parameters;
    const std::uint64_t design = std::uint64_t{element_.sampled_width()} * element_.sampled_height();
    const std::uint64_t grid = std::uint64_t{columns_} * rows_;
    const std::uint64_t texels = std::uint64_t{p.image_width} * p.image_height * sizeof(float);
    const bool rounded = p.defects.rounding_sigma_m > 0;
    const std::uint64_t making = element_.phase.size() * sizeof(float) + design * sizeof(float) * (rounded ? 2 : 1);
    const cl::Device &device = context_->device();
    const std::uint64_t largest = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
    const std::uint64_t available =
        p.max_memory_bytes ? p.max_memory_bytes : device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
    // The transform's scratch memory is known once its plan is made; a plan of this size is small itself.
    std::uint64_t need = std::max(making, design * sizeof(float) + grid * 2 * sizeof(float) +
                                              (element_.orders ? grid * sizeof(float) : 0) + texels);
    const auto refuse_above = [&] {
        if (need > available)
            throw Error(
                Status::kOutOfMemory,
                fmt::format(
                    "this pattern needs {} of device memory (a transform of {} x {} samples, a design of {} x {}, {} x "
                    "{} texels), "
                    "but {} may be taken ({}); lower feature_samples or the image's size, or take a smaller design",
                    mebibytes(need), columns_, rows_, element_.sampled_width(), element_.sampled_height(),
                    p.image_width, p.image_height, mebibytes(available),
                    p.max_memory_bytes ? "max_memory_bytes" : "what the device has"));
    };
    refuse_above();
    for (const std::uint64_t bytes : {grid * 2 * sizeof(float), design * sizeof(float), texels})
        if (bytes > largest)
            throw Error(Status::kOutOfMemory,
                        fmt::format("this pattern needs a buffer of {}, but the device's largest is {}",
                                    mebibytes(bytes), mebibytes(largest)));
    fft_ = fft_of(*context_, columns_, rows_);
    need += fft_->scratch_bytes();
    refuse_above();
    memory_bytes_ = need;
}

template <typename T> void DoeField::read(const DeviceBuffer &buffer, std::vector<T> &values) {
    values.resize(buffer.bytes() / sizeof(T));
    check_opencl(
        clEnqueueReadBuffer(queue_(), buffer.get()(), CL_TRUE, 0, buffer.bytes(), values.data(), 0, nullptr, nullptr),
        "clEnqueueReadBuffer");
}

// The design as manufactured.
void DoeField::make_design() {
    const DoePatternParameters &p = element_.parameters;
    const std::uint32_t width = element_.sampled_width(), height = element_.sampled_height();
    const std::size_t bytes = std::size_t{width} * height * sizeof(float);
    const DeviceBuffer phase(context_, element_.phase.size() * sizeof(float), element_.phase.data());
    design_ = DeviceBuffer(context_, bytes);
    CommandChain chain(queue_(), 0, nullptr);
    cl::Kernel make = context_->kernel(kFile, "doe_height", "-DHAS_BEAM=0");
    KernelArguments(make)
        .add(phase.get())
        .add(cl_uint{p.width})
        .add(cl_uint{p.height})
        .add(cl_uint{element_.samples})
        .add(cl_uint{p.defects.levels})
        .add(cl_float{*std::min_element(element_.phase.begin(), element_.phase.end())})
        .add(design_.get());
    chain.run(kStage, make, width, height);
    DeviceBuffer between, taps;
    if (p.defects.rounding_sigma_m > 0) {
        const double sigma = p.defects.rounding_sigma_m / element_.sample_pitch_m();
        const auto radius = static_cast<std::uint32_t>(std::ceil(kBlurReach * sigma));
        std::vector<double> weights(radius + 1);
        double sum = 0;
        for (std::uint32_t k = 0; k <= radius; ++k) {
            // A sample is an interval: the law's share of it, so that narrow laws are right too.
            weights[k] =
                std::erf((k + 0.5) / (sigma * std::sqrt(2.0))) - std::erf((double(k) - 0.5) / (sigma * std::sqrt(2.0)));
            sum += k == 0 ? weights[k] : 2 * weights[k];
        }
        std::vector<float> normalized(weights.size());
        std::transform(weights.begin(), weights.end(), normalized.begin(),
                       [&](double w) { return static_cast<float>(w / sum); });
        taps = DeviceBuffer(context_, normalized.size() * sizeof(float), normalized.data());
        between = DeviceBuffer(context_, bytes);
        cl::Kernel blur = context_->kernel(kFile, "doe_blur", "-DHAS_BEAM=0");
        for (const cl_uint along_y : {0u, 1u}) {
            KernelArguments(blur)
                .add(along_y ? between.get() : design_.get())
                .add(cl_uint{width})
                .add(cl_uint{height})
                .add(along_y)
                .add(cl_uint{p.periodic ? 1u : 0u})
                .add(taps.get())
                .add(cl_uint{radius})
                .add(along_y ? design_.get() : between.get());
            chain.run(kStage, blur, width, height);
        }
    }
    chain.finish(nullptr);
    check_opencl(clFinish(queue_()), "clFinish"); // before `phase` and `between` go
}

void DoeField::enqueue_field(CommandChain &chain, double wavelength_m, float shift_x, float shift_y) {
    const DoePatternParameters &p = element_.parameters;
    cl::Kernel make = context_->kernel(kFile, "doe_field", element_.orders ? "-DHAS_BEAM=0" : "-DHAS_BEAM=1");
    KernelArguments arguments(make);
    const bool centred = !element_.orders && !p.periodic; // a whole aperture stands in the middle of the grid
    arguments.add(design_.get())
        .add(cl_uint{element_.sampled_width()})
        .add(cl_uint{element_.sampled_height()})
        .add(cl_uint{element_.samples})
        .add(centred ? cl_int(element_.sampled_width() / 2) - cl_int(columns_ / 2) : cl_int{0})
        .add(centred ? cl_int(element_.sampled_height() / 2) - cl_int(rows_ / 2) : cl_int{0})
        .add(cl_uint{p.periodic ? 1u : 0u})
        .add(static_cast<cl_float>(element_.phase_scale(wavelength_m)));
    if (!element_.orders) {
        const double pitch = element_.sample_pitch_m();
        const auto limit = [&](double doe_m, std::uint32_t own) {
            return doe_m > 0 ? doe_m / pitch : p.periodic ? 1e9 : double(own) + 1;
        };
        arguments.add(beam_table_.get())
            .add(cl_uint{kBeamTableSide})
            .add(cl_float4{{static_cast<float>(2 * beam_.half_width_x_m() / pitch),
                            static_cast<float>(2 * beam_.half_width_y_m() / pitch),
                            static_cast<float>(limit(p.doe_width_m, element_.sampled_width())),
                            static_cast<float>(limit(p.doe_height_m, element_.sampled_height()))}})
            .add(static_cast<cl_float>(element_.phase_noise(wavelength_m)))
            .add(philox_key(p.defects.seed))
            .add(cl_float2{{shift_x, shift_y}});
    }
    arguments.add(cl_uint{columns_}).add(cl_uint{rows_}).add(field_.get());
    chain.run(kStage, make, columns_, rows_);
}

void DoeField::tell(std::size_t number, double part) const {
    const std::size_t lines = element_.lines.size();
    report_progress(element_.parameters.progress,
                    lines > 1 ? fmt::format("laser line {} of {}", number + 1, lines) : "spreading the light",
                    (double(number) + part) / double(lines));
}

void DoeField::add_line_orders(std::size_t number, const SpotShape &spot, DoeLight &light) {
    const DoePatternParameters &p = element_.parameters;
    const SpectralLine &line = element_.lines[number];
    tell(number, 0.0);
    CommandChain chain(queue_(), 0, nullptr);
    enqueue_field(chain, line.wavelength_m, 0, 0);
    fft_->enqueue(chain, FftDirection::kForward, kStage, field_.get(), scratch_.get());
    const double s = element_.phase_noise(line.wavelength_m), samples = double(columns_) * rows_;
    const double kept = std::exp(-s * s); // of the light that keeps its phase: |<exp(i phi)>|^2
    cl::Kernel measure = context_->kernel(kFile, "doe_order_power", "-DHAS_BEAM=0");
    KernelArguments(measure)
        .add(field_.get())
        .add(cl_uint{columns_})
        .add(cl_uint{rows_})
        .add(static_cast<cl_float>(1 / (samples * samples)))
        .add(power_.get());
    chain.run(kStage, measure, columns_, rows_);
    const double texel_u = 2 * p.half_extent_x / p.image_width, texel_v = 2 * p.half_extent_y / p.image_height;
    cl_float8 scale{};
    scale.s[0] = 0.5f * static_cast<float>(p.image_width);
    scale.s[1] = 0.5f * static_cast<float>(p.image_height);
    scale.s[2] = static_cast<float>(line.wavelength_m / (p.width * p.pixel_pitch_m) / texel_u);
    scale.s[3] = static_cast<float>(line.wavelength_m / (p.height * p.pixel_pitch_m) / texel_v);
    scale.s[4] = static_cast<float>(spot.step_u_per_m * line.wavelength_m / texel_u);
    scale.s[5] = static_cast<float>(spot.step_v_per_m * line.wavelength_m / texel_v);
    chain.finish(nullptr);
    cl::Kernel add = context_->kernel(kFile, "doe_add_orders", "-DHAS_BEAM=0");
    const auto slices = static_cast<std::uint32_t>(
        std::clamp(std::ceil(spot_sums(element_, spot) / kSumsAtOnce), std::min(kLeastSlices, double(p.image_height)),
                   double(p.image_height)));
    const std::uint32_t slice = (p.image_height + slices - 1) / slices;
    for (std::uint32_t first = 0; first < p.image_height; first += slice) {
        KernelArguments(add)
            .add(power_.get())
            .add(static_cast<cl_int>(columns_))
            .add(static_cast<cl_int>(rows_))
            .add(spot_table_.get())
            .add(static_cast<cl_int>(spot.nodes_x))
            .add(static_cast<cl_int>(spot.nodes_y))
            .add(scale)
            .add(static_cast<cl_float>(line.share * kept * spot.unit))
            .add(cl_uint{p.pixel_envelope ? 1u : 0u})
            .add(cl_uint{first})
            .add(cl_uint{p.image_width})
            .add(cl_uint{p.image_height})
            .add(texels_.get());
        CommandChain rows(queue_(), 0, nullptr);
        rows.run(kStage, add, p.image_width, std::min(slice, p.image_height - first));
        rows.finish(nullptr);
        check_opencl(clFinish(queue_()), "clFinish");
        tell(number, double(std::min(first + slice, p.image_height)) / p.image_height);
    }
    std::vector<float> power;
    read(power_, power);
    light.order_power.resize(power.size(), 0.0);
    for (std::size_t i = 0; i < power.size(); ++i)
        light.order_power[i] += line.share * kept * power[i];
}

void DoeField::add_line_aperture(std::size_t number) {
    const DoePatternParameters &p = element_.parameters;
    const SpectralLine &line = element_.lines[number];
    const std::uint32_t q = p.oversampling;
    const double texel_u = 2 * p.half_extent_x / p.image_width, texel_v = 2 * p.half_extent_y / p.image_height;
    const double bin_u = line.wavelength_m / (columns_ * element_.sample_pitch_m()),
                 bin_v = line.wavelength_m / (rows_ * element_.sample_pitch_m());
    cl::Kernel add = context_->kernel(kFile, "doe_add_samples", "-DHAS_BEAM=1");
    for (std::uint32_t b = 0; b < q; ++b)
        for (std::uint32_t a = 0; a < q; ++a) {
            tell(number, double(b * q + a) / (q * q));
            const float shift_x = static_cast<float>(a) / static_cast<float>(q),
                        shift_y = static_cast<float>(b) / static_cast<float>(q);
            CommandChain chain(queue_(), 0, nullptr);
            enqueue_field(chain, line.wavelength_m, shift_x, shift_y);
            fft_->enqueue(chain, FftDirection::kForward, kStage, field_.get(), scratch_.get());
            // Parseval: over all bins |FT|^2 sums to the number of samples times that of the field.
            const double weight = line.share / (double(columns_) * rows_ * beam_norm_ * q * q);
            KernelArguments(add)
                .add(field_.get())
                .add(static_cast<cl_int>(columns_))
                .add(static_cast<cl_int>(rows_))
                .add(cl_float2{{static_cast<float>(texel_u / bin_u), static_cast<float>(texel_v / bin_v)}})
                .add(cl_float2{{shift_x, shift_y}})
                .add(0.5f / static_cast<float>(q))
                .add(static_cast<cl_float>(weight))
                .add(cl_float2{{1.0f / static_cast<float>(columns_), 1.0f / static_cast<float>(rows_)}})
                .add(cl_uint{p.pixel_envelope ? 1u : 0u})
                .add(cl_uint{p.image_width})
                .add(cl_uint{p.image_height})
                .add(texels_.get());
            chain.run(kStage, add, p.image_width, p.image_height);
            chain.finish(nullptr);
            check_opencl(clFinish(queue_()), "clFinish");
        }
}

DoeLight DoeField::evaluate(const SpotShape &spot) {
    const DoePatternParameters &p = element_.parameters;
    make_design();
    const std::vector<float> zeros(std::size_t{p.image_width} * p.image_height, 0.0f);
    texels_ = DeviceBuffer(context_, zeros.size() * sizeof(float), zeros.data());
    field_ = DeviceBuffer(context_, std::size_t{columns_} * rows_ * 2 * sizeof(float));
    if (fft_->scratch_bytes())
        scratch_ = DeviceBuffer(context_, fft_->scratch_bytes());
    DoeLight light;
    light.device_memory_bytes = memory_bytes_;
    if (element_.orders) {
        power_ = DeviceBuffer(context_, std::size_t{columns_} * rows_ * sizeof(float));
        spot_table_ = DeviceBuffer(context_, spot.table.size() * sizeof(std::uint32_t), spot.table.data());
        for (std::size_t line = 0; line < element_.lines.size(); ++line)
            add_line_orders(line, spot, light);
    } else {
        const std::vector<float> table = beam_.amplitudes(kBeamTableSide);
        beam_table_ = DeviceBuffer(context_, table.size() * sizeof(float), table.data());
        // The field's own energy, before it is transformed.
        CommandChain chain(queue_(), 0, nullptr);
        enqueue_field(chain, element_.lines[0].wavelength_m, 0, 0);
        chain.finish(nullptr);
        std::vector<float> row(std::size_t{columns_} * 2);
        beam_norm_ = 0;
        for (std::uint32_t y = 0; y < rows_; ++y) {
            check_opencl(clEnqueueReadBuffer(queue_(), field_.get()(), CL_TRUE, y * row.size() * sizeof(float),
                                             row.size() * sizeof(float), row.data(), 0, nullptr, nullptr),
                         "clEnqueueReadBuffer");
            for (const float value : row)
                beam_norm_ += double(value) * value;
        }
        if (!(beam_norm_ > 0))
            throw Error(Status::kInvalidArgument,
                        "no light of the beam meets the design's samples; the beam is narrower than a pixel");
        for (std::size_t line = 0; line < element_.lines.size(); ++line)
            add_line_aperture(line);
    }
    read(texels_, light.texel_shares);
    return light;
}

} // namespace clsp
