// Pixels of a field's samples, or of their powers.
#pragma once

#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/image_view.hpp"
#include "stages/field_grid.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

class SamplePixels {
  public:
    // of_powers: samples are |V|^2, not V. taps: a pixel's weights along each axis (pixel_taps()); none: the mean of
    // its own samples. Builds the kernels.
    SamplePixels(const std::shared_ptr<Context> &context, const FieldGrid &grid, const std::vector<float> &taps,
                 bool of_powers);

    // weight times their pixels, added to `before` unless that is empty. before and intensity may be the same pixels.
    void enqueue(CommandChain &chain, const cl::Buffer &samples, cl_float weight, const ImageView &before,
                 const ImageView &intensity);

  private:
    FieldGrid grid_;
    DeviceBuffer taps_;
    std::uint64_t row_bytes_ = 0; // of local memory with which vectors make the pixels; 0: they do not
    cl::Kernel write_, add_;
};

} // namespace clsp
