#include "io/byte_order.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace image_io::detail {

namespace {

constexpr std::uint64_t least_numbers = 16; // that tell anything
// By how much codes of any range are closer to each other in their own order: those of 14 bits by up to four.
constexpr double least_closer = 3;

/** From the first to the third quarter: what is far from the others does not count. Sorts. */
double middle_range(std::vector<std::uint64_t> &numbers) {
    std::sort(numbers.begin(), numbers.end());
    return static_cast<double>(numbers[3 * numbers.size() / 4] - numbers[numbers.size() / 4]);
}
// Codes of 10 to 14 bits have less than this in their upper bytes.
constexpr std::uint64_t most_upper = 64;
constexpr double least_half = 6.103515625e-5; // that is not subnormal

} // namespace

unsigned enough_bits(std::uint64_t code) {
    unsigned bits = 10;
    while (bits < 16 && code >> bits != 0)
        bits += 2;
    return bits;
}

std::string told_swapped(unsigned bits) {
    return fmt::format(
        "look as if their bytes were swapped: in the other order they lie close together, and none needs "
        "more than {} bits",
        bits);
}

std::uint64_t WholeNumbers::swapped(std::uint64_t number) const {
    std::uint64_t result = 0;
    for (std::size_t i = 0; i < bytes_; ++i)
        result |= (number >> 8 * i & 255) << 8 * (bytes_ - 1 - i);
    return result;
}

void WholeNumbers::add(std::uint64_t number) {
    if (!seen_.empty()) {
        if (seen_[number])
            return;
        seen_[number] = true;
    }
    numbers_.insert(number);
}

bool WholeNumbers::closer_if_swapped(std::size_t least) const {
    if (numbers_.size() < least)
        return false;
    std::vector<std::uint64_t> as_read(numbers_.begin(), numbers_.end()), other;
    for (const std::uint64_t number : as_read)
        other.push_back(swapped(number));
    return middle_range(as_read) >= least_closer * middle_range(other);
}

std::uint64_t WholeNumbers::largest(bool if_swapped) const {
    std::uint64_t largest = 0;
    for (const std::uint64_t number : numbers_)
        largest = std::max(largest, if_swapped ? swapped(number) : number);
    return largest;
}

bool WholeNumbers::is_shifted() const {
    if (bytes_ != 2 || numbers_.empty())
        return false;
    const std::uint64_t lower = *numbers_.begin() & 255;
    return lower >= most_upper && std::all_of(numbers_.begin(), numbers_.end(),
                                              [lower](std::uint64_t number) { return (number & 255) == lower; });
}

unsigned WholeNumbers::bits_if_swapped() const {
    const std::uint64_t most = closer_if_swapped() && !is_shifted() ? largest(true) : 0;
    return most > 255 && most <= 65535 ? enough_bits(most) : 0;
}

SwappedWords swapped_among(const std::vector<WholeNumbers> &lots) {
    constexpr std::size_t few = 3; // of a lot among others
    bool sure = false, some = false, all = true;
    for (const WholeNumbers &lot : lots) {
        sure = sure || lot.bits_if_swapped() > 0;
        some = some || lot.closer_if_swapped();
        all = all && lot.closer_if_swapped(few);
    }
    // Codes of 8 bits in the upper halves of their words look so, too; but a camera has them everywhere.
    if (!sure && (all || !some))
        return {};
    SwappedWords result;
    std::uint64_t largest = 0;
    for (std::size_t i = 0; i < lots.size(); ++i) {
        const bool swapped = lots[i].closer_if_swapped(few);
        if (swapped)
            result.which.push_back(i);
        largest = std::max(largest, lots[i].largest(swapped));
    }
    result.bits = enough_bits(largest);
    return result;
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
