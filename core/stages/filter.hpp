// A linear filter of a FLOAT32 image with a real, symmetric point spread h of sum 1, by Fourier transforms:
//
//     out = (1 - f) in + f (h * in)            a fraction f of the light is spread by h
//     out = (1 - f(x)) in + h * (f in)         the same with a fraction for each pixel: what leaves a pixel is what the
//     others get
//
// Images are real: neighbours along a row are the two parts of one complex number, so that a transform of half the
// width does (the field is the padded image itself, row by row). Beyond its borders the image goes on with its edge
// pixels, as far as half the guard on each side; the transform is periodic beyond that. A flat image stays as it is.
// Pixels that are NaN, infinite or negative spread nothing and are passed on as they are.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "fft/fft.hpp"
#include "runtime/image_view.hpp"
#include "stages/field_grid.hpp"

#include <cstdint>
#include <functional>
#include <memory>

namespace clsp {

// A point spread: its value at (dx, dy) pixels from the point. Central symmetry is required, h(-dx, -dy) = h(dx, dy);
// the filter scales it to sum 1.
using PointSpread = std::function<double(double dx, double dy)>;
PointSpread exponential_spread(double scale_px); // exp(-r / scale_px)
PointSpread gaussian_spread(double sigma_px);    // exp(-r^2 / (2 sigma_px^2))
// Guards that keep what the other side's edge gives a pixel below 3e-4 of its value, as far as images of that size can
// show.
std::uint32_t exponential_guard_px(double scale_px, std::uint32_t width, std::uint32_t height);
std::uint32_t gaussian_guard_px(double sigma_px, std::uint32_t width, std::uint32_t height);

class FftFilter {
  public:
    // Samples the point spread on the grid's pixels (offsets up to half the grid) and transforms it; waits for the
    // device.
    FftFilter(std::shared_ptr<Context> context, std::uint32_t width, std::uint32_t height, std::uint32_t guard_px,
              const PointSpread &point_spread);

    const FieldGrid &grid() const { return grid_; } // of even width

    // The whole filter, every command under the name `stage` (a string literal). in and out may be the same pixels.
    // weight: FLOAT32, f(x) in 0 to 1 (clamped; NaN is 0); without one, f is `fraction`. All images are width x height.
    void enqueue(CommandChain &chain, const char *stage, const ImageView &in, const ImageView &out, double fraction,
                 const ImageView &weight = {});
    // Only h * in, or h * (f in): the result is in field(), rows of grid().grid_width floats, until the filter is used
    // again.
    void enqueue_convolve(CommandChain &chain, const char *stage, const ImageView &in, const ImageView &weight = {});
    const cl::Buffer &field() const { return field_.get(); }

  private:
    void make_transfer(const PointSpread &point_spread);
    std::uint32_t columns() const { return grid_.grid_width / 2; } // of the transform

    std::shared_ptr<Context> context_;
    FieldGrid grid_;
    std::shared_ptr<Fft> fft_;
    DeviceBuffer field_, scratch_; // work memory
    DeviceBuffer transfer_, roots_; // kernels/stages/filter.cl has them
    cl::Kernel load_, load_weighted_, multiply_, store_, store_weighted_;
};

} // namespace clsp
