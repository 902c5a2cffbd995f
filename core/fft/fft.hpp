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

// A 2-D complex single-precision transform of one size: interleaved, tightly packed, in place. The inverse divides by
// the number of samples. Safe to enqueue from several threads.
class Fft {
  public:
    virtual ~Fft() = default;
    // Scratch memory that enqueue() needs, 0 for none.
    virtual std::size_t scratch_bytes() const = 0;
    virtual void enqueue(CommandChain &chain, FftDirection direction, const char *stage, const cl::Buffer &field,
                         const cl::Buffer &scratch) = 0;
};

// The context's transform of that size, shared between all its users and made on first use: in lanes where they are to
// be used, else clFFT's. Sizes with no prime factor above 13; throws kUnsupported if clFFT refuses.
std::shared_ptr<Fft> fft_of(Context &context, std::uint32_t width, std::uint32_t height);
// clFFT's, shared likewise.
std::shared_ptr<Fft> clfft_of(Context &context, std::uint32_t width, std::uint32_t height);

// Each makes one. In lanes: nullptr where they are not to be used for this size or device.
std::shared_ptr<Fft> make_clfft(Context &context, std::uint32_t width, std::uint32_t height);
std::shared_ptr<Fft> make_line_transforms(Context &context, std::uint32_t width, std::uint32_t height);

// The largest prime factor that every back-end takes.
constexpr std::uint32_t kLargestFftRadix = 13;

} // namespace clsp
