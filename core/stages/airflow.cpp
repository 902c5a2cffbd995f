#include "stages/airflow.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/kernel_arguments.hpp"
#include "stages/half_width.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <utility>
#include <vector>

namespace clsp {
namespace {

// G falls to 2e-8 at (pi f L)^2 / 2 = 17.7.
constexpr double kSmallestExponent = 17.7;

// One axis of G from the lowest kept frequency to the highest, its peak 1.
std::vector<double> axis_filter(std::uint32_t samples, std::uint32_t oversampling, double scale_px) {
    // Frequency bin k is k * oversampling / samples cycles per pixel.
    const double per_bin = M_PI * scale_px * oversampling / samples;
    const double last = std::sqrt(2.0 * kSmallestExponent) / per_bin;
    // Never the highest frequency of an even grid: it has no partner of the other sign.
    const auto half = static_cast<int>(std::min(last, double((samples - 1) / 2)));
    std::vector<double> filter;
    for (int k = -half; k <= half; ++k)
        filter.push_back(std::exp(-0.5 * (per_bin * k) * (per_bin * k)));
    return filter;
}

double power(const std::vector<double> &filter) {
    double sum = 0.0;
    for (const double g : filter)
        sum += g * g;
    return sum;
}

DeviceBuffer upload(const std::shared_ptr<Context> &context, const std::vector<double> &values, double factor) {
    std::vector<float> floats;
    for (const double value : values)
        floats.push_back(static_cast<float>(factor * value));
    return DeviceBuffer(context, floats.size() * sizeof(float), floats.data());
}

} // namespace

void check_airflow(const AirflowParameters &p) {
    check_not_negative(p.rms_rad, "airflow rms_rad");
    constexpr double kLargestScale = 1e6;
    if (!(p.scale_px > 0.0 && p.scale_px <= kLargestScale))
        throw Error(Status::kInvalidArgument, fmt::format("airflow scale_px is {}, it must be above 0 and at most {}",
                                                          p.scale_px, kLargestScale));
    if (!(p.correlation_frames > 0.0))
        throw Error(
            Status::kInvalidArgument,
            fmt::format("airflow correlation_frames is {}, it must be above 0 (infinity for a screen that stays)",
                        p.correlation_frames));
    if (!(std::abs(p.wind_px) <= kLargestScale))
        throw Error(Status::kInvalidArgument, fmt::format("airflow wind_px is {}, it must be {} to {}", p.wind_px,
                                                          -kLargestScale, kLargestScale));
}

Airflow::Airflow(std::shared_ptr<Context> context, const FieldGrid &grid, const AirflowParameters &p)
    : context_(std::move(context)), grid_(grid), parameters_(p), halves_(can_be_halved(grid.grid_width)) {
    check_airflow(p);
    check_positive(p.rms_rad, "airflow rms_rad");
    const std::vector<double> x = axis_filter(grid_.grid_width, grid_.oversampling, p.scale_px),
                              y = axis_filter(grid_.grid_height, grid_.oversampling, p.scale_px);
    box_width_ = static_cast<std::uint32_t>(x.size());
    box_height_ = static_cast<std::uint32_t>(y.size());
    // The inverse transform divides by the number of samples N, so each sample of its real part has the variance
    // sum(G^2) / N^2: at each frequency the two parts of W, weighted by a cosine and a sine, add to 1.
    const double turns = p.rms_rad / (2.0 * M_PI);
    const double gain = turns * double(grid_.samples()) / std::sqrt(power(x) * power(y));
    // Half of the gain on each axis: both stay within a float's range.
    filter_x_ = upload(context_, x, std::sqrt(gain));
    filter_y_ = upload(context_, y, std::sqrt(gain));
    fft_ = fft_of(*context_, halves_ ? grid_.grid_width / 2 : grid_.grid_width, grid_.grid_height);
    state_ = DeviceBuffer(context_, std::size_t{box_width_} * box_height_ * sizeof(cl_float2));
    if (halves_)
        roots_ = half_roots(context_, grid_.grid_width);
    else
        field_ = DeviceBuffer(context_, grid_.samples() * sizeof(cl_float2));
    if (fft_->scratch_bytes() > 0)
        scratch_ = DeviceBuffer(context_, fft_->scratch_bytes());
    screen_ = DeviceBuffer(context_, grid_.samples() * sizeof(cl_float));
    const char *options = halves_ ? "-DHALVES=1" : "-DHALVES=0";
    advance_ = context_->kernel("stages/airflow.cl", "airflow_advance", options);
    spectrum_ = context_->kernel("stages/airflow.cl", "airflow_spectrum", options);
    if (!halves_)
        write_screen_ = context_->kernel("stages/airflow.cl", "airflow_screen", options);
}

void Airflow::enqueue_advance(CommandChain &chain, std::uint64_t frame_index, double frames, std::uint32_t substep) {
    check_frame_index(frame_index);
    check_not_negative(frames, "the time of an airflow's advance in frames");
    constexpr std::uint32_t kMostSubsteps = 256;
    if (substep >= kMostSubsteps)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the airflow's substep is {}, it must be below {}", substep, kMostSubsteps));
    const double time = frames / parameters_.correlation_frames;
    // A whole width of the grid brings the screen back.
    const double wind =
        drawn_ ? std::fmod(parameters_.wind_px * frames * grid_.oversampling / grid_.grid_width, 1.0) : 0.0;
    if (drawn_ && time == 0.0 && wind == 0.0)
        return;
    // sqrt(1 - r^2) without cancellation where r is near 1.
    const double keep = drawn_ ? std::exp(-time) : 0.0, draw = drawn_ ? std::sqrt(-std::expm1(-2.0 * time)) : 1.0;
    const std::uint32_t quarter = quarter_rows(box_height_);
    KernelArguments(advance_)
        .add(state_.get())
        .add(cl_uint{box_width_})
        .add(cl_uint{box_height_})
        .add(cl_uint{quarter})
        .add(philox_key(parameters_.seed))
        .add(frame_low(frame_index))
        .add(frame_high(frame_index))
        .add(cl_uint{substep})
        .add(static_cast<cl_float>(keep))
        .add(static_cast<cl_float>(draw))
        .add(static_cast<cl_float>(wind));
    chain.run("airflow", advance_, box_width_, quarter);
    const cl::Buffer &field = halves_ ? screen_.get() : field_.get();
    KernelArguments arguments(spectrum_);
    arguments.add(state_.get())
        .add(cl_uint{box_width_})
        .add(cl_uint{box_height_})
        .add(filter_x_.get())
        .add(filter_y_.get());
    if (halves_)
        arguments.add(roots_.get());
    arguments.add(field).add(cl_uint{grid_.grid_width}).add(cl_uint{grid_.grid_height});
    chain.run("airflow", spectrum_, halves_ ? grid_.grid_width / 2 : grid_.grid_width, grid_.grid_height);
    fft_->enqueue(chain, FftDirection::kInverse, "airflow", field, scratch_.get());
    if (!halves_) {
        KernelArguments(write_screen_).add(field_.get()).add(screen_.get()).add(cl_ulong{grid_.samples()});
        chain.run("airflow", write_screen_, grid_.samples());
    }
    drawn_ = true;
}

} // namespace clsp
