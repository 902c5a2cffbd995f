#include "stages/filter.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/half_width.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <utility>
#include <vector>

namespace clsp {
namespace {

// A width of two numbers that the transform takes.
FieldGrid filter_grid(std::uint32_t width, std::uint32_t height, std::uint32_t guard_px) {
    FieldGrid grid = make_field_grid(width, height, 1, guard_px);
    grid.grid_width = 2 * fft_size_at_least(std::max(2u, (width + guard_px + 1) / 2));
    return grid;
}

// A reach of `reach` pixels needs twice as much guard: each side has half of it. More than the image itself is of no
// use. Guards are 15, 20, 30, 40, 60, 80 .. pixels: lines of each length have programs of their own, and there must not
// be new ones for each scale that is drawn.
std::uint32_t guard_of(double reach, std::uint32_t width, std::uint32_t height) {
    const std::uint32_t most = 2 * std::max(width, height);
    const double needed = 2.0 * reach;
    for (std::uint32_t step = 5; step < most; step *= 2)
        for (const std::uint32_t guard : {3 * step, 4 * step})
            if (guard >= needed)
                return std::min(guard, most);
    return most;
}

} // namespace

PointSpread exponential_spread(double scale_px) {
    check_positive(scale_px, "the scale of an exponential point spread");
    return [=](double dx, double dy) { return std::exp(-std::hypot(dx, dy) / scale_px); };
}

PointSpread gaussian_spread(double sigma_px) {
    check_positive(sigma_px, "the standard deviation of a Gaussian point spread");
    return [=](double dx, double dy) { return std::exp(-(dx * dx + dy * dy) / (2.0 * sigma_px * sigma_px)); };
}

// Beyond a straight edge at distance R lies less than half of the light outside the circle of radius R, of which an
// exponential point spread has (1 + R/L) exp(-R/L) and a Gaussian one exp(-R^2 / (2 sigma^2)).
std::uint32_t exponential_guard_px(double scale_px, std::uint32_t width, std::uint32_t height) {
    return guard_of(10.0 * scale_px, width, height);
}

std::uint32_t gaussian_guard_px(double sigma_px, std::uint32_t width, std::uint32_t height) {
    return guard_of(4.0 * sigma_px, width, height);
}

FftFilter::FftFilter(std::shared_ptr<Context> context, std::uint32_t width, std::uint32_t height,
                     std::uint32_t guard_px, const PointSpread &point_spread)
    : context_(std::move(context)), grid_(filter_grid(width, height, guard_px)),
      fft_(fft_of(*context_, columns(), grid_.grid_height)),
      field_(context_, grid_.samples() * sizeof(cl_float)),
      transfer_(context_, grid_.samples() * sizeof(cl_float)),
      load_(context_->kernel("stages/filter.cl", "filter_load", "-DHAS_WEIGHT=0")),
      load_weighted_(context_->kernel("stages/filter.cl", "filter_load", "-DHAS_WEIGHT=1")),
      multiply_(context_->kernel("stages/filter.cl", "filter_multiply", "-DHAS_WEIGHT=0")),
      store_(context_->kernel("stages/filter.cl", "filter_store", "-DHAS_WEIGHT=0")),
      store_weighted_(context_->kernel("stages/filter.cl", "filter_store", "-DHAS_WEIGHT=1")) {
    if (fft_->scratch_bytes() > 0)
        scratch_ = DeviceBuffer(context_, fft_->scratch_bytes());
    make_transfer(point_spread);
}

void FftFilter::make_transfer(const PointSpread &point_spread) {
    const auto offset = [](std::uint32_t i, std::uint32_t n) { return i < (n + 1) / 2 ? double(i) : double(i) - n; };
    const std::uint32_t width = grid_.grid_width, height = grid_.grid_height;
    std::vector<double> values(grid_.samples());
    double sum = 0.0;
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::size_t i = std::size_t{y} * width + x,
                              opposite = std::size_t{(height - y) % height} * width + (width - x) % width;
            // Half of an even side is the only offset whose opposite the grid does not have.
            const bool is_known = opposite < i && 2 * x != width && 2 * y != height;
            values[i] = is_known ? values[opposite] : point_spread(offset(x, width), offset(y, height));
            sum += values[i];
        }
    if (!(sum > 0.0 && sum <= kLargestNumber))
        throw Error(Status::kInvalidArgument,
                    fmt::format("the sum of a point spread is {}, it must be finite and above 0", sum));
    std::vector<cl_float> samples(values.size());
    for (std::size_t i = 0; i < values.size(); ++i)
        samples[i] = static_cast<cl_float>(values[i] / sum);
    roots_ = half_roots(context_, grid_.grid_width);
    const DeviceBuffer spectrum(context_, samples.size() * sizeof(cl_float), samples.data());
    cl::CommandQueue queue(context_->cl_context(), context_->device());
    CommandChain chain(queue(), 0, nullptr);
    fft_->enqueue(chain, FftDirection::kForward, "filter", spectrum.get(), scratch_.get());
    cl::Kernel transfer = context_->kernel("stages/filter.cl", "filter_transfer", "-DHAS_WEIGHT=0");
    KernelArguments(transfer)
        .add(spectrum.get())
        .add(roots_.get())
        .add(transfer_.get())
        .add(cl_uint{columns()})
        .add(cl_uint{grid_.grid_height});
    chain.run("filter", transfer, columns(), grid_.grid_height);
    check_opencl(clFinish(queue()), "clFinish");
}

void FftFilter::enqueue_convolve(CommandChain &chain, const char *stage, const ImageView &in, const ImageView &weight) {
    cl::Kernel &load = weight ? load_weighted_ : load_;
    KernelArguments arguments(load);
    arguments.add(in).add(cl_uint{grid_.width}).add(cl_uint{grid_.height});
    if (weight)
        arguments.add(weight);
    arguments.add(field_.get()).add(cl_uint{grid_.grid_width}).add(cl_uint{grid_.grid_height});
    chain.run(stage, load, grid_.grid_width, grid_.grid_height);
    fft_->enqueue(chain, FftDirection::kForward, stage, field_.get(), scratch_.get());
    KernelArguments(multiply_)
        .add(field_.get())
        .add(roots_.get())
        .add(transfer_.get())
        .add(cl_uint{columns()})
        .add(cl_uint{grid_.grid_height});
    chain.run(stage, multiply_, columns(), grid_.grid_height / 2 + 1);
    fft_->enqueue(chain, FftDirection::kInverse, stage, field_.get(), scratch_.get());
}

void FftFilter::enqueue(CommandChain &chain, const char *stage, const ImageView &in, const ImageView &out,
                        double fraction, const ImageView &weight) {
    check_fraction(fraction, "the fraction that a filter spreads");
    enqueue_convolve(chain, stage, in, weight);
    cl::Kernel &store = weight ? store_weighted_ : store_;
    KernelArguments arguments(store);
    arguments.add(field_.get()).add(cl_uint{grid_.grid_width}).add(static_cast<cl_float>(fraction)).add(in);
    if (weight)
        arguments.add(weight);
    arguments.add(out).add(cl_uint{grid_.width}).add(cl_uint{grid_.height});
    chain.run(stage, store, grid_.width, grid_.height);
}

} // namespace clsp
