/**
 * @file byte_order.hpp
 * @brief Numbers whose bytes lie in the other order than they were read in, by what they would be in each.
 */
#ifndef CLSPECKLE_IO_BYTE_ORDER_HPP
#define CLSPECKLE_IO_BYTE_ORDER_HPP

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace image_io::detail {

/** Of a camera: 10, 12, 14 or 16 that hold a code. */
unsigned enough_bits(std::uint64_t code);

/** What is said of whole numbers in the wrong order: "its words " this. @param bits of
 * WholeNumbers::bits_if_swapped(). */
std::string told_swapped(unsigned bits);

/** Whole numbers: those that an image holds lie close together, and in the wrong order far apart. */
class WholeNumbers {
  public:
    /** @param bytes of one number: 2, 4 or 8. */
    explicit WholeNumbers(std::size_t bytes) : bytes_(bytes), seen_(bytes == 2 ? 65536 : 0) {}
    void add(std::uint64_t number);
    /** True if in the other order they lie much closer together. @param least so many different ones tell anything. */
    bool closer_if_swapped(std::size_t least = 16) const;
    /** How many bits they need in the other order, where that is more likely what they are. 0: they are as they should
     * be, or they may be codes of 8 bits in the upper half of their words. */
    unsigned bits_if_swapped() const;
    /** The largest one. */
    std::uint64_t largest(bool if_swapped) const;

  private:
    std::uint64_t swapped(std::uint64_t number) const;
    /** True for codes of 8 bits in the upper halves of words whose lower halves are all the same. Swapped ones would
     * all be of one 256th of the range of 16 bits, with another number above. */
    bool is_shifted() const;

    std::size_t bytes_;
    std::vector<bool> seen_; // of 2 bytes, of which there may be many
    std::set<std::uint64_t> numbers_;
};

/** Several lots of words of a camera, such as its sequences. */
struct SwappedWords {
    std::vector<std::size_t> which; ///< Whose bytes look swapped; empty: of none.
    unsigned bits = 0;              ///< That all need once those are swapped back.
};
SwappedWords swapped_among(const std::vector<WholeNumbers> &lots);

/** Floating-point numbers: in the wrong order many are such as no image has, and in the right one hardly any. */
class RealNumbers {
  public:
    /** @param bytes of one number: 2, 4 or 8. */
    explicit RealNumbers(std::size_t bytes) : bytes_(bytes) {}
    void add(double as_read, double as_swapped);
    bool look_swapped() const;
    /** Of those that are not 0: the part that no image has. */
    double odd_share() const { return count_ > 0 ? static_cast<double>(odd_) / static_cast<double>(count_) : 0; }

  private:
    /** Not finite, closer to 0 than 1e-30 or beyond 1e30. Half precision has none but the first: there it is what no
     * light is, negative or subnormal. */
    bool none_has(double number) const;
    bool is_common(double number) const;

    std::size_t bytes_;
    std::uint64_t count_ = 0, odd_ = 0, common_if_swapped_ = 0;
};

} // namespace image_io::detail

#endif // CLSPECKLE_IO_BYTE_ORDER_HPP
