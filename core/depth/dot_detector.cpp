#include "depth/dot_detector.hpp"

#include "runtime/checks.hpp"
#include "runtime/kernel_arguments.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace clsp {
namespace {

// A dot's window is private: PoCL keeps those of a whole work-group on a thread's stack, and chooses large groups.
constexpr std::size_t kFitGroup = 32;
constexpr std::size_t kState = 8, kResult = 20; // STATE and RESULT of depth/dot_detector.cl
constexpr int kPasses = 12;                     // neighbours' light is taken off ever more exactly
constexpr int kMaxIterations = 20;              // of one fit in one pass
constexpr double kLeastDiameter = 1e-3;         // grains of 1000 px: no lens that makes dots
constexpr double kMostDiameter = 1e3;           // grains of 1/1000 px: no pixel is that large
constexpr double kMergedSigma = 1.6;            // wider than so many expected ones: two dots in one

void check(const DotDetectorParameters &p) {
    check_image_size(p.width, p.height, "the image of the dot detector");
    if (p.max_dots == 0 || p.max_dots > 1000000)
        throw Error(Status::kInvalidArgument, fmt::format("max_dots is {}, it must be 1 to 1000000", p.max_dots));
    if (!(p.dot_sigma_px >= 0.5 && p.dot_sigma_px <= 5.0))
        throw Error(Status::kInvalidArgument, fmt::format("dot_sigma_px is {}, it must be 0.5 to 5 px; scale the image "
                                                          "for other dots",
                                                          p.dot_sigma_px));
    const std::uint32_t side = 2 * DotDetector::window(p.dot_sigma_px) + 1;
    if (p.width < side || p.height < side)
        throw Error(Status::kInvalidArgument,
                    fmt::format("the image of the dot detector has {} x {} pixels (width x height), dots of sigma {} "
                                "px need at least {} x {}",
                                p.width, p.height, p.dot_sigma_px, side, side));
    check_not_negative(p.read_noise_dn, "read_noise_dn");
    check_not_negative(p.dn_per_electron, "dn_per_electron");
    if (!(std::abs(p.black_level_dn) <= kLargestNumber))
        throw Error(Status::kInvalidArgument, fmt::format("black_level_dn is {}, it must be finite", p.black_level_dn));
    check_not_negative(p.saturation_dn, "saturation_dn");
    check_not_negative(p.min_amplitude_dn, "min_amplitude_dn");
    check_not_negative(p.threshold_sigmas, "threshold_sigmas");
    if (!(p.min_correlation >= 0.0 && p.min_correlation < 1.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("min_correlation is {}, it must be 0 to below 1", p.min_correlation));
    if (!(p.relative_diameter == 0.0 ||
          (p.relative_diameter >= kLeastDiameter && p.relative_diameter <= kMostDiameter)))
        throw Error(Status::kInvalidArgument,
                    fmt::format("relative_diameter is {}, it must be 0 (not known) or {} to {} cycles per pixel: pixel "
                                "pitch / (wavelength * f-number), all lengths in m",
                                p.relative_diameter, kLeastDiameter, kMostDiameter));
    if (!(p.speckle_contrast >= 0.0 && p.speckle_contrast <= 1.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("speckle_contrast is {}, it must be 0 to 1", p.speckle_contrast));
}

// Squared contrast times correlation area, px^2: the integral of the covariance of speckle over its squared mean.
// Averaging over pixels leaves it as it is. The area is the inverse of the pupil's (Goodman, Speckle Phenomena in
// Optics, 2007, section 4.5).
double speckle_area(const DotDetectorParameters &p) {
    const double d = p.relative_diameter, c = p.speckle_contrast;
    return d > 0.0 ? 4.0 * c * c / (M_PI * d * d) : 0.0;
}

template <typename T>
std::vector<T> read_buffer(cl_command_queue queue, const DeviceBuffer &buffer, std::size_t count) {
    std::vector<T> values(count);
    if (count > 0)
        check_opencl(clEnqueueReadBuffer(queue, buffer.get()(), CL_TRUE, 0, count * sizeof(T), values.data(), 0,
                                         nullptr, nullptr),
                     "clEnqueueReadBuffer");
    return values;
}

} // namespace

std::uint32_t DotDetector::window(double dot_sigma_px) {
    return std::max(2u, static_cast<std::uint32_t>(std::ceil(3.0 * dot_sigma_px)));
}

DotDetector::DotDetector(std::shared_ptr<Context> context, const DotDetectorParameters &parameters)
    : context_(std::move(context)), parameters_(parameters) {
    const DotDetectorParameters &p = parameters_;
    check(p);
    radius_ = std::max(2, static_cast<int>(std::ceil(2.5 * p.dot_sigma_px)));
    std::vector<float> weights;
    double sum = 0.0, square = 0.0;
    for (int k = -radius_; k <= radius_; ++k) {
        const double w = std::exp(-0.5 * k * k / (p.dot_sigma_px * p.dot_sigma_px));
        weights.push_back(static_cast<float>(w));
        sum += w;
        square += w * w;
    }
    const double count = double(weights.size()) * double(weights.size());
    mean_weight_ = static_cast<float>(sum * sum / count);
    energy_ = static_cast<float>(square * square - sum * sum * sum * sum / count);

    const std::size_t pixels = std::size_t{p.width} * p.height;
    weights_ = DeviceBuffer(context_, weights.size() * sizeof(float), weights.data());
    counters_ = DeviceBuffer(context_, 4 * sizeof(cl_uint));
    for (DeviceBuffer *buffer : {&weighted_, &plain_, &response_, &map_})
        *buffer = DeviceBuffer(context_, pixels * sizeof(cl_float));
    places_ = DeviceBuffer(context_, std::size_t{p.max_dots} * 2 * sizeof(cl_int));
    for (DeviceBuffer &state : states_)
        state = DeviceBuffer(context_, std::size_t{p.max_dots} * kState * sizeof(cl_float));
    results_ = DeviceBuffer(context_, std::size_t{p.max_dots} * kResult * sizeof(cl_float));
    for (const Format format : {Format::kFloat32, Format::kUint16, Format::kUint8}) // none is built at a frame
        kernels(format);
}

DotDetector::Kernels &DotDetector::kernels(Format format) {
    auto &kept = kernels_.at(static_cast<std::size_t>(format));
    if (!kept) {
        const std::string defines =
            fmt::format("-DIMAGE_FORMAT={} -DWINDOW={} -DMAX_ITERATIONS={}", static_cast<std::uint32_t>(format),
                        window(parameters_.dot_sigma_px), kMaxIterations);
        auto made = std::make_unique<Kernels>();
        made->rows = context_->kernel("depth/dot_detector.cl", "dot_detector_rows", defines);
        made->maxima = context_->kernel("depth/dot_detector.cl", "dot_detector_maxima", defines);
        made->fit = context_->kernel("depth/dot_detector.cl", "dot_detector_fit", defines);
        if (!reset_()) {
            reset_ = context_->kernel("depth/dot_detector.cl", "dot_detector_reset", defines);
            columns_ = context_->kernel("depth/dot_detector.cl", "dot_detector_columns", defines);
        }
        kept = std::move(made);
    }
    return *kept;
}

void DotDetector::enqueue(CommandChain &chain, const ImageView &image) {
    const DotDetectorParameters &p = parameters_;
    Kernels &k = kernels(image.format);
    const auto width = static_cast<cl_int>(p.width), height = static_cast<cl_int>(p.height);
    const cl_int separation = std::max(1, static_cast<int>(std::floor(1.5 * p.dot_sigma_px)));
    const bool known = p.read_noise_dn > 0.0 || p.dn_per_electron > 0.0;
    // Rounding to codes adds the variance of a uniform law.
    const double rounding = image.format == Format::kFloat32 ? 0.0 : 1.0 / 12.0;
    // Shot noise alone would give dark pixels a weight without bound: one electron's worth stays.
    const double at_black = known ? p.read_noise_dn * p.read_noise_dn + rounding +
                                        (p.read_noise_dn > 0.0 ? 0.0 : p.dn_per_electron * p.dn_per_electron)
                                  : 0.0;
    const auto number = [](double value) { return static_cast<cl_float>(value); };
    const cl_float4 noise = {{number(at_black), number(known ? p.dn_per_electron : 0.0), number(p.black_level_dn),
                              number(p.threshold_sigmas)}};
    const cl_float4 fit_noise = {{noise.s[0], noise.s[1], noise.s[2], known ? 1.0f : 0.0f}};
    const cl_float4 shape = {{number(p.min_amplitude_dn), number(p.min_correlation), std::sqrt(energy_), mean_weight_}};
    const cl_float4 limits = {
        {number(p.dot_sigma_px),
         p.saturation_dn > 0.0 ? number(p.saturation_dn) : std::numeric_limits<cl_float>::infinity(),
         number(kMergedSigma), number(speckle_area(p))}};

    KernelArguments(reset_).add(counters_.get());
    chain.run("dot_detector", reset_, 4);
    KernelArguments(k.rows)
        .add(image)
        .add(width)
        .add(height)
        .add(weights_.get())
        .add(cl_int{radius_})
        .add(weighted_.get())
        .add(plain_.get())
        .add(counters_.get());
    chain.run("dot_detector", k.rows, p.width, p.height);
    KernelArguments(columns_)
        .add(weighted_.get())
        .add(plain_.get())
        .add(width)
        .add(height)
        .add(weights_.get())
        .add(cl_int{radius_})
        .add(mean_weight_)
        .add(1.0f / energy_)
        .add(response_.get());
    chain.run("dot_detector", columns_, p.width, p.height);
    KernelArguments(k.maxima)
        .add(image)
        .add(width)
        .add(height)
        .add(response_.get())
        .add(cl_int{radius_})
        .add(separation)
        .add(noise)
        .add(shape)
        .add(number(1.0 / (p.dot_sigma_px * p.dot_sigma_px)))
        .add(cl_uint{p.max_dots})
        .add(counters_.get())
        .add(map_.get())
        .add(places_.get())
        .add(states_[0].get())
        .add(results_.get());
    chain.run("dot_detector", k.maxima, p.width, p.height);
    for (int pass = 0; pass < kPasses; ++pass) {
        KernelArguments(k.fit)
            .add(image)
            .add(width)
            .add(height)
            .add(map_.get())
            .add(places_.get())
            .add(counters_.get())
            .add(cl_uint{p.max_dots})
            .add(fit_noise)
            .add(limits)
            .add(states_[pass % 2].get())
            .add(states_[1 - pass % 2].get())
            .add(results_.get())
            .add(cl_uint{pass == kPasses - 1 ? 1u : 0u});
        chain.run("dot_detector", k.fit, p.max_dots, 1, 1, kFitGroup);
    }
    enqueued_ = true;
}

std::vector<DetectedDot> DotDetector::read(cl_command_queue queue) const {
    if (!enqueued_)
        throw Error(Status::kInvalidState, "no frame has been enqueued yet; detect the dots of one first");
    check_opencl(clFinish(queue), "clFinish");
    const auto counters = read_buffer<cl_uint>(queue, counters_, 4);
    if (counters[1] + counters[2] > 0)
        throw Error(Status::kInvalidData,
                    fmt::format("{} pixels of the frame are NaN or infinite, the first at x = {}, y = {}; repair them",
                                counters[1] + counters[2], counters[3] % parameters_.width,
                                counters[3] / parameters_.width));
    if (counters[0] > parameters_.max_dots)
        throw Error(Status::kUnsupported,
                    fmt::format("the frame has {} dots, more than max_dots, {}; raise it, or min_amplitude_dn, or tell "
                                "the detector the noise (read_noise_dn)",
                                counters[0], parameters_.max_dots));
    const std::size_t count = counters[0];
    const auto places = read_buffer<cl_int>(queue, places_, 2 * count);
    const auto results = read_buffer<cl_float>(queue, results_, kResult * count);
    // The device counts dots in no order; rows are one.
    std::vector<std::size_t> order(count);
    for (std::size_t i = 0; i < count; ++i)
        order[i] = i;
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return std::pair(places[2 * a + 1], places[2 * a]) < std::pair(places[2 * b + 1], places[2 * b]);
    });
    std::vector<DetectedDot> dots;
    dots.reserve(count);
    for (const std::size_t i : order) {
        const cl_float *r = results.data() + kResult * i;
        DetectedDot dot;
        const double px = places[2 * i], py = places[2 * i + 1];
        dot.x = px + double(r[0]);
        dot.y = py + double(r[1]);
        dot.amplitude = double(r[2]);
        dot.background = double(r[3]);
        dot.shape = {double(r[4]), double(r[5]), double(r[6])};
        dot.covariance = {double(r[7]), double(r[8]), double(r[9])};
        dot.amplitude_sd = std::sqrt(double(r[10]));
        dot.misfit = double(r[11]);
        dot.centroid_x = px + double(r[12]);
        dot.centroid_y = py + double(r[13]);
        dot.iterations = static_cast<std::uint32_t>(r[14]);
        dot.correlation = double(r[15]);
        dot.flags = static_cast<std::uint32_t>(r[16]);
        dots.push_back(dot);
    }
    return dots;
}

} // namespace clsp
