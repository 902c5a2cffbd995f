#include "io/byte_order.hpp"

#include <cmath>

namespace image_io::detail {

namespace {

constexpr std::uint64_t least_numbers = 16;   // that tell anything
constexpr double least_half = 6.103515625e-5; // that is not subnormal

std::uint64_t swapped(std::uint64_t number, std::size_t bytes) {
    std::uint64_t result = 0;
    for (std::size_t i = 0; i < bytes; ++i)
        result |= (number >> 8 * i & 255) << 8 * (bytes - 1 - i);
    return result;
}

} // namespace

unsigned enough_bits(std::uint64_t code) {
    unsigned bits = 10;
    while (bits < 16 && code >> bits != 0)
        bits += 2;
    return bits;
}

void WholeNumbers::add(std::uint64_t number) {
    ++count_;
    as_read_ |= number;
    as_swapped_ |= swapped(number, bytes_);
}

unsigned WholeNumbers::bits_if_swapped() const {
    const std::uint64_t high = std::uint64_t{1} << (8 * bytes_ - 2);
    const bool likely = count_ >= 64 && as_swapped_ > 255 && as_swapped_ < 16384 && as_read_ >= high;
    return likely ? enough_bits(as_swapped_) : 0;
}

bool RealNumbers::none_has(double number) const {
    return !std::isfinite(number) ||
           (bytes_ == 2 ? number < least_half : std::abs(number) < 1e-30 || std::abs(number) > 1e30);
}

bool RealNumbers::is_common(double number) const {
    return bytes_ == 2 ? number >= least_half : std::abs(number) >= 1e-12 && std::abs(number) <= 1e12;
}

void RealNumbers::add(double as_read, double as_swapped) {
    // Backgrounds are 0 and infinite, NaN marks what is missing.
    if (as_read == 0 || !std::isfinite(as_swapped))
        return;
    ++count_;
    odd_ += none_has(as_read) ? 1 : 0;
    common_if_swapped_ += is_common(as_swapped) ? 1 : 0;
}

bool RealNumbers::look_swapped() const {
    // Of bytes by chance a fifth of the numbers of 32 bits are odd, a third is common.
    return count_ >= least_numbers && 10 * odd_ >= count_ && 4 * common_if_swapped_ >= 3 * count_;
}

} // namespace image_io::detail
