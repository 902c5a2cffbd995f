// The one interface behind which Fourier transforms live.
#pragma once

#include "runtime/opencl.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>

namespace clsp {

class CommandChain;
class Context;

enum class FftDirection { kForward, kInverse };

// Which engine transforms: the environment variable CLSPECKLE_FFT. kFused: the shape that is made for the device; the last two force one.
enum class FftChoice { kAuto, kClfft, kFused, kFusedLanes, kFusedGroups };

// A 2-D complex single-precision transform of one size: interleaved, tightly packed, in place. The inverse divides by
// the number of samples. Safe to enqueue from several threads.
class Fft {
  public:
    virtual ~Fft() = default;
    virtual const char *backend() const = 0;
    // Scratch memory that enqueue() needs, 0 for none.
    virtual std::size_t scratch_bytes() const = 0;
    virtual void enqueue(CommandChain &chain, FftDirection direction, const char *stage, const cl::Buffer &field,
                         const cl::Buffer &scratch) = 0;
};

// Sizes with no prime factor above 13. Throws kUnsupported if clFFT refuses.
std::shared_ptr<Fft> make_clfft(const cl::Context &context, const cl::Device &device, std::uint32_t width,
                                std::uint32_t height);

// The fused engine's transforms in lanes; nullptr where they are not to be used for this size or device.
std::shared_ptr<Fft> make_fused_fft(Context &context, std::uint32_t width, std::uint32_t height);

// The largest prime factor that every back-end takes.
constexpr std::uint32_t kLargestFftRadix = 13;

} // namespace clsp
