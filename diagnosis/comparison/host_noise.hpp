// Random numbers on the host by counter: the same for any order of calls and on every system.
#pragma once

#include <cmath>
#include <cstdint>

namespace clsp {

class HostNoise {
  public:
    // One stream for each seed, sequence, frame and purpose.
    HostNoise(std::uint64_t seed, std::uint64_t sequence, std::uint64_t frame, std::uint64_t purpose)
        : state_(mixed(mixed(mixed(mixed(seed) ^ sequence) ^ frame) ^ purpose)) {}

    double uniform() { return (static_cast<double>(next() >> 11) + 0.5) * 0x1p-53; } // in (0, 1)
    // The sum of two uniform deviates of width 1: rounding what it is added to has an error of the same mean and
    // variance wherever between two codes the value lies (Lipshitz, Wannamaker and Vanderkooy, J. Audio Eng. Soc. 40
    // (1992) 355).
    double triangular() { return uniform() + uniform() - 1.0; }
    double normal() { // Box and Muller
        if (spare_) {
            spare_ = false;
            return other_;
        }
        const double radius = std::sqrt(-2.0 * std::log(uniform())), angle = 2.0 * 3.14159265358979323846 * uniform();
        spare_ = true;
        other_ = radius * std::sin(angle);
        return radius * std::cos(angle);
    }

  private:
    // SplitMix64 (Steele, Lea and Flood 2014).
    static std::uint64_t mixed(std::uint64_t z) {
        z += 0x9e3779b97f4a7c15u;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }
    std::uint64_t next() {
        const std::uint64_t value = mixed(state_);
        state_ += 0x9e3779b97f4a7c15u;
        return value;
    }

    std::uint64_t state_;
    bool spare_ = false;
    double other_ = 0.0;
};

} // namespace clsp
