// The field of a unit cell in device memory, and its Fourier transforms; what design, search and evaluation share.
#pragma once

#include "doe/doe_orders.hpp"
#include "fft/fft.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/device_buffer.hpp"

#include <complex>
#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

class DoeDevice {
  public:
    // Throws kOutOfMemory if the device cannot hold the field.
    DoeDevice(std::shared_ptr<Context> context, std::uint32_t width, std::uint32_t height);

    Context &context() { return *context_; }
    const std::shared_ptr<Context> &shared_context() const { return context_; }
    cl_command_queue queue() const { return queue_(); }
    const cl::Buffer &field() const { return field_.get(); }
    std::size_t pixels() const { return pixels_; }
    void transform(CommandChain &chain, const cl::Buffer &field, FftDirection direction);

    template <typename T> void write(const cl::Buffer &buffer, const std::vector<T> &values) {
        check_opencl(clEnqueueWriteBuffer(queue(), buffer(), CL_TRUE, 0, values.size() * sizeof(T), values.data(), 0,
                                          nullptr, nullptr),
                     "clEnqueueWriteBuffer");
    }
    template <typename T> void read(const cl::Buffer &buffer, std::vector<T> &values) {
        check_opencl(clEnqueueReadBuffer(queue(), buffer(), CL_TRUE, 0, values.size() * sizeof(T), values.data(), 0,
                                         nullptr, nullptr),
                     "clEnqueueReadBuffer");
    }

  private:
    std::shared_ptr<Context> context_;
    std::size_t pixels_;
    cl::CommandQueue queue_;
    std::shared_ptr<Fft> fft_;
    DeviceBuffer field_, scratch_;
};

// Index of an order in the transform.
inline std::uint32_t doe_bin(const DoeOrder &order, std::uint32_t width, std::uint32_t height) {
    const std::uint32_t x =
        order.m < 0 ? width - static_cast<std::uint32_t>(-order.m) : static_cast<std::uint32_t>(order.m);
    const std::uint32_t y =
        order.n < 0 ? height - static_cast<std::uint32_t>(-order.n) : static_cast<std::uint32_t>(order.n);
    return y * width + x;
}

// exp(2 pi i level / levels), exact at multiples of a quarter turn.
std::complex<double> doe_level_phasor(std::uint32_t level, std::uint32_t levels);

// Weighted Gerchberg-Saxton. Leaves the element's field in device.field(); gives the convergence.
std::vector<DoeDesignStep> iterate_doe(DoeDevice &device, const DoeDesignParameters &parameters);

// Direct binary search over the levels of the pixels, in place.
struct DoeSearchResult {
    std::uint64_t changes = 0;
    std::uint32_t sweeps = 0;
};
DoeSearchResult search_doe(DoeDevice &device, const DoeDesignParameters &parameters, std::vector<std::uint8_t> &levels);

} // namespace clsp
