// Counting bad input pixels on the device (kernels/common/common.h) without stopping the frame.
#pragma once

#include "runtime/command_chain.hpp"
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
        // A blocking write says that its source may be used again. Intel's runtime for CPUs means no more by it: other
        // queues see the bytes once the command has ended.
        cl::Event reset;
        check_opencl(clEnqueueWriteBuffer(queue, buffer_.get()(), CL_FALSE, 0, sizeof kEmpty, kEmpty.data(), 0, nullptr,
                                          &reset()),
                     "clEnqueueWriteBuffer");
        wait_for_events(1, &reset());
        return {counts[0], counts[1], counts[2]};
    }

  private:
    static constexpr std::array<cl_uint, 3> kEmpty{0, 0, 0xffffffffu};
    DeviceBuffer buffer_;
};

} // namespace clsp
