/**
 * @file transfer.hpp
 * @brief How a file's numbers stand for light: most files say nothing and are linear, pictures for screens are not.
 */
#ifndef CLSPECKLE_IO_TRANSFER_HPP
#define CLSPECKLE_IO_TRANSFER_HPP

#include <cstddef>
#include <string>

namespace image_io {

/** From a number of 0 to 1 to linear light. */
struct Transfer {
    enum class Curve { linear, srgb, power, unknown };
    Curve curve = Curve::linear;
    double exponent = 1; ///< Of Curve::power: light is the number to it.
    std::string said_by; ///< For messages; empty: the file says nothing.

    double to_light(double value) const;
    /** For messages: "sRGB", "the power 2.2". */
    std::string name() const;
};

Transfer srgb(const std::string &said_by);
/** @param exponent close to 1 it is linear. */
Transfer power(double exponent, const std::string &said_by);
/** Of an ICC profile, by its tone curve; one that is a table is known by the profile's name only. */
Transfer transfer_of_icc(const unsigned char *data, std::size_t size_bytes);

} // namespace image_io

#endif // CLSPECKLE_IO_TRANSFER_HPP
