#include "statistics/statistics.hpp"

#include "fft/fft.hpp"
#include "runtime/checks.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/field_grid.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <limits>

namespace clsp {
namespace {

// Enough work-items to fill a large GPU, few enough for the host to add their partial sums at once.
constexpr std::size_t kItems = 8192;

struct Inputs {
    ImageView image, mask;
    std::string options;
};

Inputs check_inputs(Context &context, cl_command_queue queue, const ImageDescription &image,
                    const ImageDescription &mask) {
    context.check_queue(queue);
    Inputs inputs;
    inputs.image = check_image(image, "image", context.cl_context()(), {0, 0},
                               {Format::kUint8, Format::kUint16, Format::kFloat32});
    if (mask)
        inputs.mask = check_image(mask, "mask", context.cl_context()(), {image.width, image.height}, {Format::kUint8});
    inputs.options =
        fmt::format("-DIMAGE_FORMAT={} -DHAS_MASK={}", static_cast<std::uint32_t>(image.format), mask ? 1 : 0);
    return inputs;
}

void add_inputs(KernelArguments &arguments, const Inputs &inputs) {
    arguments.add(inputs.image).add(cl_uint{inputs.image.width}).add(cl_uint{inputs.image.height}).add(inputs.mask);
}

template <typename T> std::vector<T> read(cl_command_queue queue, const DeviceBuffer &buffer) {
    std::vector<T> values(buffer.bytes() / sizeof(T));
    check_opencl(
        clEnqueueReadBuffer(queue, buffer.get()(), CL_TRUE, 0, buffer.bytes(), values.data(), 0, nullptr, nullptr),
        "clEnqueueReadBuffer");
    return values;
}

[[noreturn]] void refuse_not_finite(std::uint64_t count) {
    throw Error(Status::kInvalidData,
                fmt::format("{} pixels of the image are NaN or infinite; mask them or repair the image", count));
}

} // namespace

Moments compute_moments(const std::shared_ptr<Context> &context, cl_command_queue queue, const ImageDescription &image,
                        const ImageDescription &mask) {
    const Inputs inputs = check_inputs(*context, queue, image, mask);
    const std::size_t items = std::min<std::size_t>(kItems, std::size_t{image.width} * image.height);
    const DeviceBuffer partial(context, items * sizeof(cl_float8)), counted(context, items * sizeof(cl_uint2));

    cl::Kernel first = context->kernel("statistics/statistics.cl", "statistics_first_moment", inputs.options);
    KernelArguments arguments(first);
    add_inputs(arguments, inputs);
    arguments.add(partial.get()).add(counted.get());
    CommandChain chain(queue, 0, nullptr);
    chain.run("statistics", first, items);
    check_opencl(clFinish(queue), "clFinish");

    Moments moments;
    moments.minimum = std::numeric_limits<double>::infinity();
    moments.maximum = -moments.minimum;
    std::uint64_t not_finite = 0;
    double sum = 0;
    const std::vector<cl_float4> sums = read<cl_float4>(queue, partial);
    const std::vector<cl_uint2> counts = read<cl_uint2>(queue, counted);
    for (std::size_t i = 0; i < items; ++i) {
        sum += double(sums[i].s[0]) + double(sums[i].s[1]);
        moments.minimum = std::min(moments.minimum, double(sums[i].s[2]));
        moments.maximum = std::max(moments.maximum, double(sums[i].s[3]));
        moments.count += counts[i].s[0];
        not_finite += counts[i].s[1];
    }
    if (not_finite > 0)
        refuse_not_finite(not_finite);
    if (moments.count == 0)
        throw Error(Status::kInvalidArgument, "the mask is 0 everywhere; at least one pixel must count");
    const auto n = double(moments.count);
    moments.mean = sum / n;

    // Powers of deviations in units of the range stay within float's reach whatever the image's scale.
    const double range = moments.maximum - moments.minimum;
    const auto centre = static_cast<float>(moments.mean);
    const auto inverse_scale = static_cast<float>(range > 0.0 ? std::min(1.0 / range, 1e37) : 1.0);
    cl::Kernel second = context->kernel("statistics/statistics.cl", "statistics_central_moments", inputs.options);
    KernelArguments central(second);
    add_inputs(central, inputs);
    central.add(cl_float{centre}).add(cl_float{inverse_scale}).add(partial.get());
    CommandChain second_chain(queue, 0, nullptr);
    second_chain.run("statistics", second, items);
    check_opencl(clFinish(queue), "clFinish");
    double s[4] = {0, 0, 0, 0};
    for (const cl_float8 &p : read<cl_float8>(queue, partial))
        for (int k = 0; k < 4; ++k)
            s[k] += double(p.s[2 * k]) + double(p.s[2 * k + 1]);
    // From moments about `centre` (a float) to moments about the mean.
    const double d = s[0] / n, r2 = s[1] / n, r3 = s[2] / n, r4 = s[3] / n;
    const double m2 = r2 - d * d, m3 = r3 - 3 * d * r2 + 2 * d * d * d,
                 m4 = r4 - 4 * d * r3 + 6 * d * d * r2 - 3 * d * d * d * d;
    const double scale = 1.0 / double(inverse_scale);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const bool varies = range > 0.0 && m2 > 0.0;
    moments.standard_deviation = varies && n > 1 ? std::sqrt(m2 * n / (n - 1)) * scale : 0.0;
    moments.contrast = moments.mean != 0.0 ? moments.standard_deviation / moments.mean : nan;
    moments.skewness = varies ? m3 / std::pow(m2, 1.5) : nan;
    moments.excess_kurtosis = varies ? m4 / (m2 * m2) - 3.0 : nan;
    return moments;
}

std::vector<std::uint64_t> compute_histogram(const std::shared_ptr<Context> &context, cl_command_queue queue,
                                             const ImageDescription &image, const ImageDescription &mask, double low,
                                             double high, std::uint32_t bins) {
    constexpr std::uint32_t kMaxBins = 1u << 20;
    if (!(low < high && low >= -kLargestNumber && high <= kLargestNumber))
        throw Error(Status::kInvalidArgument,
                    fmt::format("low is {} and high is {}; they must be within +-{} with low < high", low, high,
                                kLargestNumber));
    if (bins == 0 || bins > kMaxBins)
        throw Error(Status::kInvalidArgument, fmt::format("bins is {}, it must be 1 to {}", bins, kMaxBins));
    const Inputs inputs = check_inputs(*context, queue, image, mask);
    const std::vector<cl_uint> zeros(bins + 3, 0);
    const DeviceBuffer histogram(context, zeros.size() * sizeof(cl_uint), zeros.data());
    cl::Kernel kernel = context->kernel("statistics/statistics.cl", "statistics_histogram", inputs.options);
    KernelArguments arguments(kernel);
    add_inputs(arguments, inputs);
    arguments.add(static_cast<cl_float>(low))
        .add(static_cast<cl_float>(high))
        .add(static_cast<cl_float>(bins / (high - low)))
        .add(cl_uint{bins})
        .add(histogram.get());
    CommandChain chain(queue, 0, nullptr);
    chain.run("statistics", kernel, image.width, image.height);
    check_opencl(clFinish(queue), "clFinish");
    const std::vector<cl_uint> counts = read<cl_uint>(queue, histogram);
    if (counts.back() > 0)
        refuse_not_finite(counts.back());
    return {counts.begin(), counts.end() - 1};
}

std::vector<float> compute_autocovariance(const std::shared_ptr<Context> &context, cl_command_queue queue,
                                          const ImageDescription &image, std::uint32_t max_lag) {
    const Inputs inputs = check_inputs(*context, queue, image, {});
    if (max_lag >= std::min(image.width, image.height))
        throw Error(Status::kInvalidArgument,
                    fmt::format("max_lag is {}, it must be below the smaller side of the image ({} x {})", max_lag,
                                image.width, image.height));
    const Moments moments = compute_moments(context, queue, image, {});
    const std::uint32_t side = 2 * max_lag + 1;
    std::vector<float> result(std::size_t{side} * side, std::numeric_limits<float>::quiet_NaN());
    if (moments.standard_deviation == 0.0)
        return result;

    const std::uint32_t width = fft_size_at_least(image.width + max_lag),
                        height = fft_size_at_least(image.height + max_lag);
    const std::size_t samples = std::size_t{width} * height;
    const std::shared_ptr<Fft> fft = fft_of(*context, width, height);
    const DeviceBuffer field(context, samples * sizeof(cl_float2));
    DeviceBuffer scratch;
    if (fft->scratch_bytes() > 0)
        scratch = DeviceBuffer(context, fft->scratch_bytes());

    cl::Kernel load = context->kernel("statistics/statistics.cl", "statistics_load", inputs.options);
    cl::Kernel power = context->kernel("statistics/statistics.cl", "statistics_power", inputs.options);
    KernelArguments(load)
        .add(inputs.image)
        .add(cl_uint{image.width})
        .add(cl_uint{image.height})
        .add(static_cast<cl_float>(moments.mean))
        .add(cl_uint{width})
        .add(cl_uint{height})
        .add(field.get());
    KernelArguments(power).add(field.get()).add(cl_ulong{samples});
    CommandChain chain(queue, 0, nullptr);
    chain.run("statistics", load, width, height);
    fft->enqueue(chain, FftDirection::kForward, "fft", field.get(), scratch.get());
    chain.run("statistics", power, samples);
    fft->enqueue(chain, FftDirection::kInverse, "inverse_fft", field.get(), scratch.get());
    check_opencl(clFinish(queue), "clFinish");

    const std::vector<cl_float2> sums = read<cl_float2>(queue, field);
    const double variance = double(sums[0].s[0]) / (double(image.width) * image.height);
    const auto lag = static_cast<std::int64_t>(max_lag);
    for (std::int64_t dy = -lag; dy <= lag; ++dy)
        for (std::int64_t dx = -lag; dx <= lag; ++dx) {
            const std::size_t x = std::size_t(dx < 0 ? dx + width : dx), y = std::size_t(dy < 0 ? dy + height : dy);
            const double pairs = double(image.width - std::abs(dx)) * double(image.height - std::abs(dy));
            result[std::size_t(dy + lag) * side + std::size_t(dx + lag)] =
                static_cast<float>(double(sums[y * width + x].s[0]) / pairs / variance);
        }
    return result;
}

} // namespace clsp
