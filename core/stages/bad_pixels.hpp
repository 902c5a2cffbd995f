// Counting bad input pixels on the device (kernels/common/common.h) without stopping the frame.
#pragma once

#include "runtime/device_buffer.hpp"

#include <array>
#include <cstdint>
#include <memory>

namespace clsp {

struct BadPixels {
    std::uint32_t not_finite = 0, negative = 0;
    std::uint32_t first_index = 0; // y * width + x
};

class BadPixelCounter {
  public:
    explicit BadPixelCounter(const std::shared_ptr<Context> &context)
        : buffer_(context, sizeof kEmpty, kEmpty.data()) {}

    const cl::Buffer &buffer() const { return buffer_.get(); }

    // Reads and resets the counts. Blocks.
    BadPixels take(cl_command_queue queue) {
        std::array<cl_uint, 3> counts = kEmpty;
        check_opencl(
            clEnqueueReadBuffer(queue, buffer_.get()(), CL_TRUE, 0, sizeof counts, counts.data(), 0, nullptr, nullptr),
            "clEnqueueReadBuffer");
        check_opencl(
            clEnqueueWriteBuffer(queue, buffer_.get()(), CL_TRUE, 0, sizeof kEmpty, kEmpty.data(), 0, nullptr, nullptr),
            "clEnqueueWriteBuffer");
        return {counts[0], counts[1], counts[2]};
    }

  private:
    static constexpr std::array<cl_uint, 3> kEmpty{0, 0, 0xffffffffu};
    DeviceBuffer buffer_;
};

} // namespace clsp
