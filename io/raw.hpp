/**
 * @file raw.hpp
 * @brief How pixels lie in a file that does not tell it: what the program's option --raw and "raw" in capture.json say.
 */
#ifndef CLSPECKLE_IO_RAW_HPP
#define CLSPECKLE_IO_RAW_HPP

#include <cstdint>
#include <string>

namespace image_io {

/** How codes stand in bytes. */
enum class RawPacking {
    unpacked, ///< A byte each, or the lower bits of a word of two bytes.
    msb,      ///< The upper bits of a word of two bytes.
    mipi,     ///< MIPI CSI-2: the upper 8 bits of some pixels, then their lower bits together.
    genicam,  ///< GenICam PFNC "Mono10p": bit by bit, the lowest first.
    gige,     ///< GigE Vision "Mono10Packed": two pixels in three bytes, the lower bits in the middle one.
};

/** Frames in a file. */
struct RawLayout {
    std::uint32_t width = 0, height = 0;
    std::uint32_t bits = 0; ///< 8, 10, 12, 14 or 16.
    RawPacking packing = RawPacking::unpacked;
    bool big_endian = false;     ///< Words of two bytes.
    std::uint64_t offset = 0;    ///< Bytes before the first frame.
    std::uint64_t row_bytes = 0; ///< From row to row.
};

/** The form of a description, for help and errors. */
constexpr const char *raw_form = "WIDTHxHEIGHT,BITS[,PACKING][,little|big][,OFFSET][,stride=BYTES]";

/** Reads a description, for example "640x480,10,mipi"; throws std::invalid_argument that says what is wrong. */
RawLayout parse_raw(const std::string &text);

} // namespace image_io

#endif // CLSPECKLE_IO_RAW_HPP
