// Pixels that are unlike themselves in one frame: cosmic rays, bit errors, lost data.
#pragma once

#include "capture/capture.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace clsp {

// Of each pixel the largest and the least code, each with the first frame that has it.
class PixelEnds {
  public:
    explicit PixelEnds(std::size_t pixels)
        : most_(pixels, -32768), least_(pixels, 32767), most_at_(pixels), least_at_(pixels) {}

    // codes: of pixels from first on, in one frame. Frames come in order.
    void add(std::uint32_t frame, std::size_t first, const std::uint16_t *codes, std::size_t count);

    struct End {
        std::uint16_t code = 0;
        std::uint32_t frame = 0;
    };
    End most(std::size_t i) const { return {std::uint16_t(most_[i] ^ kSign), most_at_[i]}; }
    End least(std::size_t i) const { return {std::uint16_t(least_[i] ^ kSign), least_at_[i]}; }

  private:
    static constexpr int kSign = 0x8000; // codes as signed numbers: any x86-64 compares vectors of these
    std::vector<std::int16_t> most_, least_;
    std::vector<std::uint16_t> most_at_, least_at_; // 65535 frames at most
};

struct Transient {
    std::uint32_t index = 0; // row * width + column
    std::uint32_t frame = 0;
    std::uint16_t code = 0;
    double usual_dn = 0.0; // its mean in the other frames
};

// Of scenes at rest, of four frames and more. A code counts where it lies 8 deviations (of fewer than 8 frames 24) from
// the mean of the pixel's other frames, and where the tail that the most deviant 1 % of pixels show (a normal law's)
// has one as far away in less than 1e-6 of sequences. Deviations are those of the pixel's other frames, but no less
// than those of other pixels at its level. Nothing where pixels that jump more than once may jump only once by chance
// (telegraph noise). mask: nullptr, or 0 where a pixel does not count; step_dn: that codes are apart at least.
std::vector<Transient> find_transients(const PixelEnds &ends, const std::vector<std::uint32_t> &sums,
                                       const std::vector<std::uint64_t> &squares, std::uint32_t frames,
                                       const std::uint8_t *mask, std::uint32_t step_dn);

} // namespace clsp
