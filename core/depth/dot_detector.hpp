// Dots of a frame with sub-pixel centres, all at once on the device. The equations are in depth.h of the C API.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/image_view.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

struct DotDetectorParameters {
    std::uint32_t width = 0, height = 0;
    std::uint32_t max_dots = 65536;
    double dot_sigma_px = 1.5;
    double read_noise_dn = 0.0, dn_per_electron = 0.0; // both 0: the noise is unknown
    double black_level_dn = 0.0;
    double saturation_dn = 0.0; // 0: no pixel is saturated
    double min_amplitude_dn = 0.0;
    double threshold_sigmas = 5.0;
    double min_correlation = 0.6;
    double relative_diameter = 0.0; // of the lens, cycles per pixel; 0: speckle is unknown
    double speckle_contrast = 1.0;
};

// Bits of DetectedDot::flags; the numbers are those of CLSP_DOT_*, capi asserts that they agree.
constexpr std::uint32_t kDotSaturated = 1, kDotBorder = 2, kDotMerged = 4, kDotFitFailed = 8, kDotFixedShape = 16;

struct DetectedDot {
    double x = 0.0, y = 0.0;                   // px
    double centroid_x = 0.0, centroid_y = 0.0; // px
    double amplitude = 0.0, background = 0.0, amplitude_sd = 0.0;
    std::array<double, 3> shape{};      // covariance of the Gaussian, xx, xy, yy, px^2
    std::array<double, 3> covariance{}; // of the centre, xx, xy, yy, px^2
    double misfit = 0.0;                // chi^2 over its degrees of freedom
    double correlation = 0.0;           // with the expected dot
    std::uint32_t flags = 0, iterations = 0;
};

class DotDetector {
  public:
    DotDetector(std::shared_ptr<Context> context, const DotDetectorParameters &parameters);

    const std::shared_ptr<Context> &context() const { return context_; }
    const DotDetectorParameters &parameters() const { return parameters_; }
    // Half the side of the window that a dot is fitted in.
    static std::uint32_t window(double dot_sigma_px);

    void enqueue(CommandChain &chain, const ImageView &image);
    // Waits for the queue. In the order of the rows. Throws kInvalidState before the first enqueue(), kInvalidData for
    // pixels that are not numbers, kUnsupported for more dots than max_dots.
    std::vector<DetectedDot> read(cl_command_queue queue) const;

  private:
    struct Kernels {
        cl::Kernel rows, maxima, fit;
    };
    Kernels &kernels(Format format);

    std::shared_ptr<Context> context_;
    DotDetectorParameters parameters_;
    int radius_ = 0; // of the matched filter
    float mean_weight_ = 0.0f, energy_ = 0.0f;
    DeviceBuffer weights_, counters_, weighted_, plain_, response_, map_, places_, states_[2], results_;
    cl::Kernel reset_, columns_;
    std::array<std::unique_ptr<Kernels>, 5> kernels_; // by format
    bool enqueued_ = false;
};

} // namespace clsp
