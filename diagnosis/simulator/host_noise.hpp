// Random numbers for pixels of finished frames, on the host: Philox by counter, the same for any order of calls and on
// every system.
#pragma once

#include "stages/philox.hpp"

#include <array>
#include <cmath>
#include <cstdint>

namespace clsp {

// Quantization adds the variance of a uniform law of width 1.
constexpr double kQuantizationVariance = 1.0 / 12.0;

// Streams of their own (kernels/common/philox.h has the library's others).
enum class HostStream : std::uint32_t {
    kRounding = 0x40,
    kRestored = 0x41,
    kProbe = 0x42,
    kReal = 0x43,
    kSim = 0x44,
    kRealEnd = 0x45,
    kSimEnd = 0x46
};

// The numbers of one frame of a sequence, one after the other.
class HostNoise {
  public:
    HostNoise(std::uint64_t seed, std::uint64_t sequence, std::uint64_t frame, HostStream stream)
        : seed_(seed), counter_{0, static_cast<std::uint32_t>(sequence), static_cast<std::uint32_t>(frame),
                                static_cast<std::uint32_t>(stream)} {}

    double uniform() { // in (0, 1)
        if (used_ == words_.size()) {
            words_ = host_block(seed_, counter_);
            ++counter_[0];
            used_ = 0;
        }
        return (words_[used_++] + 0.5) * 0x1p-32;
    }
    // The sum of two uniform deviates of width 1: rounding what it is added to has an error of the same mean and
    // variance wherever between two codes the value lies (Lipshitz, Wannamaker and Vanderkooy, J. Audio Eng. Soc. 40
    // (1992) 355).
    double triangular() { return uniform() + uniform() - 1.0; }
    double normal() { // Box and Muller
        if (spare_) {
            spare_ = false;
            return other_;
        }
        const double radius = std::sqrt(-2.0 * std::log(uniform())), angle = 2.0 * M_PI * uniform();
        spare_ = true;
        other_ = radius * std::sin(angle);
        return radius * std::cos(angle);
    }

  private:
    std::uint64_t seed_;
    std::array<std::uint32_t, 4> counter_, words_{};
    std::size_t used_ = 4;
    bool spare_ = false;
    double other_ = 0.0;
};

} // namespace clsp
