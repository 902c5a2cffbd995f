#include "doe/doe_device.hpp"

#include <cmath>
#include <fmt/core.h>
#include <utility>

namespace clsp {

std::complex<double> doe_level_phasor(std::uint32_t level, std::uint32_t levels) {
    const std::uint64_t quarter = std::uint64_t{4} * level;
    if (quarter % levels == 0)
        switch (quarter / levels % 4) {
        case 0:
            return {1.0, 0.0};
        case 1:
            return {0.0, 1.0};
        case 2:
            return {-1.0, 0.0};
        default:
            return {0.0, -1.0};
        }
    return std::polar(1.0, 2.0 * M_PI * level / levels);
}

DoeDevice::DoeDevice(std::shared_ptr<Context> context, std::uint32_t width, std::uint32_t height)
    : context_(std::move(context)), pixels_(std::size_t{width} * height) {
    const auto largest = context_->device().getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
    const std::uint64_t bytes = pixels_ * sizeof(cl_float2);
    if (bytes > largest)
        throw Error(
            Status::kOutOfMemory,
            fmt::format("a cell of {} x {} pixels needs {} MiB in one piece, {} gives at most {}; take a smaller "
                        "cell",
                        width, height, bytes >> 20, context_->device_name(), largest >> 20));
    queue_ = cl::CommandQueue(context_->cl_context(), context_->device());
    fft_ = fft_of(*context_, width, height);
    field_ = DeviceBuffer(context_, bytes);
    if (fft_->scratch_bytes() > 0)
        scratch_ = DeviceBuffer(context_, fft_->scratch_bytes());
}

void DoeDevice::transform(CommandChain &chain, const cl::Buffer &field, FftDirection direction) {
    fft_->enqueue(chain, direction, direction == FftDirection::kForward ? "fft" : "inverse_fft", field, scratch_.get());
}

} // namespace clsp
