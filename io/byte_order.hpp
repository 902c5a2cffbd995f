/**
 * @file byte_order.hpp
 * @brief Numbers whose bytes lie in the other order than they were read in, by what they would be in each.
 */
#ifndef CLSPECKLE_IO_BYTE_ORDER_HPP
#define CLSPECKLE_IO_BYTE_ORDER_HPP

#include <cstddef>
#include <cstdint>

namespace image_io::detail {

/** Of a camera: 10, 12, 14 or 16 that hold a code. */
unsigned enough_bits(std::uint64_t code);

/** Whole numbers: in the wrong order their high bytes vary, while the low ones stay small. */
class WholeNumbers {
  public:
    /** @param bytes of one number: 2, 4 or 8. */
    explicit WholeNumbers(std::size_t bytes) : bytes_(bytes) {}
    void add(std::uint64_t number);
    /** How many bits they need in the other order, where that is more likely what they are. 0: they are as they should
     * be. */
    unsigned bits_if_swapped() const;

  private:
    std::size_t bytes_;
    std::uint64_t count_ = 0, as_read_ = 0, as_swapped_ = 0;
};

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
