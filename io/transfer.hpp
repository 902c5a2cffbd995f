/**
 * @file transfer.hpp
 * @brief How a file's numbers stand for light: most files say nothing and are linear, pictures for screens are not.
 */
#ifndef CLSPECKLE_IO_TRANSFER_HPP
#define CLSPECKLE_IO_TRANSFER_HPP

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace image_io {

/** From a number of 0 to 1 to linear light. */
struct Transfer {
    enum class Curve { linear, srgb, power, bt709, pq, hlg, parametric, table, unknown };
    Curve curve = Curve::linear;
    double exponent = 1;                   ///< Of Curve::power: light is the number to it.
    std::string said_by;                   ///< For messages; empty: the file says nothing.
    std::array<double, 7> parameters = {}; ///< Of Curve::parametric: g, a, b, c, d, e, f of its ICC type 4.
    std::vector<float> entries;            ///< Of Curve::table: light at numbers from 0 to 1, evenly spaced.
    std::string unknown_because;           ///< Of Curve::unknown, for messages.

    double to_light(double value) const;
    bool is_like(const Transfer &other) const;
    /** For messages: "sRGB", "the power 2.2". */
    std::string name() const;
};

Transfer srgb(const std::string &said_by);
/** @param exponent close to 1 it is linear. */
Transfer power(double exponent, const std::string &said_by);
/** Of what is there and cannot be read. @param because what it has, for messages. */
Transfer unknown_transfer(const std::string &said_by, const std::string &because);
/** Of a table of light at evenly spaced numbers from 0 to 1: linear and sRGB are known by it. */
Transfer transfer_of_table(std::vector<float> entries, const std::string &said_by);
/** Of a color space by its name, as renderers and OpenColorIO call it: sRGB, or a power ("g22_rec709"). Others are
 * linear, or unknown where the name says that they are logarithms or made for a screen. */
Transfer transfer_of_color_space(const std::string &name, const std::string &said_by);
/** Of an ICC profile, by its tone curves; one without any is known by its name only. */
Transfer transfer_of_icc(const unsigned char *data, std::size_t size_bytes);
/** Of the transfer characteristics of ITU-T H.273, as PNG's chunk cICP has them. @param full_range else black and white
 * lie within the codes. */
Transfer transfer_of_cicp(unsigned characteristics, bool full_range, const std::string &said_by);

} // namespace image_io

#endif // CLSPECKLE_IO_TRANSFER_HPP
