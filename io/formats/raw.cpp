// Raw frames: nothing but pixels, as grabbers and drivers write them. Their size and packing must be told.
#include "io/formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <stdexcept>

namespace image_io {

namespace {

struct PackingName {
    RawPacking packing;
    const char *name;
};
constexpr PackingName packing_names[] = {{RawPacking::unpacked, "unpacked"},
                                         {RawPacking::msb, "msb"},
                                         {RawPacking::mipi, "mipi"},
                                         {RawPacking::genicam, "genicam"},
                                         {RawPacking::gige, "gige"}};
constexpr std::uint32_t all_bits[] = {8, 10, 12, 14, 16};

/** The fewest pixels that fill whole bytes, and those bytes; no pixels where there is no such packing. */
struct Packed {
    std::uint32_t pixels = 0, bytes = 0;
};

Packed group_of(RawPacking packing, std::uint32_t bits) {
    if (bits == 8)
        return packing == RawPacking::unpacked ? Packed{1, 1} : Packed{};
    switch (packing) {
    case RawPacking::unpacked:
        return {1, 2};
    case RawPacking::msb:
        return bits < 16 ? Packed{1, 2} : Packed{};
    case RawPacking::gige:
        return bits == 10 || bits == 12 ? Packed{2, 3} : Packed{};
    case RawPacking::mipi:
    case RawPacking::genicam:
        break;
    }
    return bits == 10 ? Packed{4, 5} : bits == 12 ? Packed{2, 3} : bits == 14 ? Packed{4, 7} : Packed{};
}

[[noreturn]] void refuse(const std::string &text, const std::string &what) {
    throw std::invalid_argument(fmt::format("\"{}\": {}; expected is {}, for example 640x480,10,mipi or "
                                            "640x480,12,unpacked,little,512",
                                            text, what, raw_form));
}

/** All of a text as a number; false if it is none. */
bool is_number(const std::string &text, std::uint64_t &value) {
    const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
    return result.ec == std::errc() && result.ptr == text.data() + text.size();
}

class RawReader final : public Reader {
  public:
    RawReader(const std::string &path, const RawLayout &layout)
        : Reader(path), file_(path), layout_(layout), group_(group_of(layout.packing, layout.bits)),
          frame_bytes_(layout.row_bytes * layout.height) {
        check_size(layout.width, layout.height);
        const std::uint64_t there = file_.size() - std::min(file_.size(), layout.offset);
        info_.frame_count = there / frame_bytes_;
        if (info_.frame_count == 0 || there % frame_bytes_ != 0)
            fail(misfit(there));
        if (info_.frame_count > max_frames)
            fail(fmt::format("holds {} frames; at most {} are taken", info_.frame_count, max_frames));
        info_.sample = layout.bits == 8 ? "uint8" : "uint16";
        info_.width = layout.width;
        info_.height = layout.height;
        info_.full_scale = (1u << layout.bits) - 1;
    }

    void read_rows(std::uint64_t frame, const RowSink &sink) override {
        const std::size_t row_bytes = std::size_t{layout_.width} / group_.pixels * group_.bytes;
        std::vector<unsigned char> bytes(row_bytes + 2); // code() looks at three at once
        std::vector<float> row(layout_.width);
        for (std::uint32_t y = 0; y < layout_.height; ++y) {
            if (y == 0 || layout_.row_bytes != row_bytes)
                file_.seek(layout_.offset + frame * frame_bytes_ + y * layout_.row_bytes);
            file_.read(bytes.data(), row_bytes);
            for (std::uint32_t x = 0; x < layout_.width; ++x)
                row[x] = static_cast<float>(code(bytes.data() + x / group_.pixels * group_.bytes, x, y));
            sink(row.data());
        }
    }

  private:
    /** @param group the bytes of the pixels that x is one of. */
    std::uint32_t code(const unsigned char *group, std::uint32_t x, std::uint32_t y) const {
        const std::uint32_t bits = layout_.bits, i = x % group_.pixels;
        // Bits of a group from one on, the lowest of the first byte first.
        const auto lowest_first = [&](std::size_t first, std::uint32_t count) {
            const unsigned char *from = group + first / 8;
            const std::uint32_t three = from[0] | std::uint32_t{from[1]} << 8 | std::uint32_t{from[2]} << 16;
            return three >> first % 8 & ((1u << count) - 1);
        };
        switch (layout_.packing) {
        case RawPacking::mipi:
            return static_cast<std::uint32_t>(group[i]) << (bits - 8) |
                   lowest_first(8 * group_.pixels + i * (bits - 8), bits - 8);
        case RawPacking::genicam:
            return lowest_first(i * bits, bits);
        case RawPacking::gige:
            return static_cast<std::uint32_t>(group[2 * i]) << (bits - 8) |
                   (group[1] >> 4 * i & ((1u << (bits - 8)) - 1));
        case RawPacking::unpacked:
        case RawPacking::msb:
            break;
        }
        return bits == 8 ? group[0] : of_word(group, x, y);
    }

    std::uint32_t of_word(const unsigned char *bytes, std::uint32_t x, std::uint32_t y) const {
        const auto word = [&](bool big) -> std::uint32_t {
            return big ? bytes[0] << 8 | bytes[1] : bytes[1] << 8 | bytes[0];
        };
        const std::uint32_t value = word(layout_.big_endian), spare = 16 - layout_.bits, top = (1u << layout_.bits) - 1;
        const bool msb = layout_.packing == RawPacking::msb;
        if (msb ? (value & ((1u << spare) - 1)) == 0 : value <= top)
            return msb ? value >> spare : value;
        const std::uint32_t other = word(!layout_.big_endian);
        std::string cause;
        if (msb ? (other & ((1u << spare) - 1)) == 0 : other <= top)
            cause += fmt::format(" the words are {}-endian (\"{}\");", layout_.big_endian ? "little" : "big",
                                 layout_.big_endian ? "little" : "big");
        if (!msb && (value & ((1u << spare) - 1)) == 0)
            cause += " the codes stand in the upper bits (\"msb\");";
        if (msb && value <= top)
            cause += " the codes stand in the lower bits (\"unpacked\");";
        fail(fmt::format("pixel ({}, {}) is the word {}, which holds no code of {} bits in its {} bits. It may be that"
                         "{} there are more bits, or the file has another size, offset or packing",
                         x, y, value, layout_.bits, msb ? "upper" : "lower", cause));
    }

    static std::string counted(std::uint64_t frames) {
        return fmt::format("{} frame{}", frames, frames == 1 ? "" : "s");
    }

    /** Why the size of the file does not fit, and what would. */
    std::string misfit(std::uint64_t there) const {
        const std::uint64_t rest = there % frame_bytes_, frames = there / frame_bytes_;
        std::string text = fmt::format(
            "has {} bytes; {} before the first frame and {} for each frame ({} rows of {}) leave {} bytes "
            "behind {}.",
            file_.size(), layout_.offset, frame_bytes_, layout_.height, layout_.row_bytes, rest, counted(frames));
        std::string fits;
        // Padded rows, by less than what a row has; else what is in front, unless so much of a frame is no header.
        for (std::uint64_t count = frames; count > 0; --count)
            if (const std::uint64_t rows = count * layout_.height;
                there % rows == 0 && there / rows < 2 * std::uint64_t{layout_.row_bytes}) {
                fits += fmt::format("stride={} ({}), ", there / rows, counted(count));
                break;
            }
        if (2 * rest > frame_bytes_)
            text += fmt::format(" The last frame may be cut: {} bytes of it are missing.", frame_bytes_ - rest);
        else if (frames > 0)
            fits += fmt::format("an offset of {} ({}), ", layout_.offset + rest, counted(frames));
        for (const std::uint32_t bits : all_bits)
            for (const PackingName &packing : packing_names) {
                const Packed group = group_of(packing.packing, bits);
                if (group.pixels == 0 || layout_.width % group.pixels != 0)
                    continue;
                const std::uint64_t bytes = std::uint64_t{layout_.width} / group.pixels * group.bytes * layout_.height;
                if (bytes != frame_bytes_ && there >= bytes && there % bytes == 0)
                    fits += fmt::format("{},{} ({}), ", bits, packing.name, counted(there / bytes));
            }
        if (fits.empty())
            return text + fmt::format(" No other packing of {} x {} pixels fits: correct the size, or copy the file "
                                      "again",
                                      layout_.width, layout_.height);
        return text + " These would fit: " + fits.substr(0, fits.size() - 2);
    }

    detail::InputFile file_;
    RawLayout layout_;
    Packed group_;
    std::uint64_t frame_bytes_;
};

} // namespace

RawLayout parse_raw(const std::string &text) {
    std::vector<std::string> words(1);
    for (const char c : text)
        if (c == ',')
            words.emplace_back();
        else
            words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    RawLayout layout;
    const std::size_t cross = words[0].find('x');
    std::uint64_t width = 0, height = 0, bits = 0;
    if (cross == std::string::npos || !is_number(words[0].substr(0, cross), width) ||
        !is_number(words[0].substr(cross + 1), height) || width < 1 || height < 1)
        refuse(text, fmt::format("\"{}\" is no size", words[0]));
    if (width > max_side || height > max_side)
        refuse(text, fmt::format("at most {0} x {0} pixels are taken", max_side));
    if (words.size() < 2 || !is_number(words[1], bits) ||
        std::count(std::begin(all_bits), std::end(all_bits), bits) == 0)
        refuse(text, words.size() < 2 ? "the number of bits is missing"
                                      : fmt::format("\"{}\" bits are not read; 8, 10, 12, 14 and 16 are", words[1]));
    layout.width = static_cast<std::uint32_t>(width);
    layout.height = static_cast<std::uint32_t>(height);
    layout.bits = static_cast<std::uint32_t>(bits);
    bool packed = false, endian = false, offset = false;
    std::uint64_t stride = 0;
    for (std::size_t i = 2; i < words.size(); ++i) {
        const std::string &word = words[i];
        const auto once = [&](bool &given) {
            if (given)
                refuse(text, fmt::format("\"{}\" is one too many of its kind", word));
            given = true;
        };
        const auto name = std::find_if(std::begin(packing_names), std::end(packing_names),
                                       [&](const PackingName &one) { return word == one.name; });
        if (name != std::end(packing_names)) {
            once(packed);
            layout.packing = name->packing;
        } else if (word == "little" || word == "big") {
            once(endian);
            layout.big_endian = word == "big";
        } else if (word.rfind("stride=", 0) == 0 && stride == 0 && is_number(word.substr(7), stride) && stride > 0) {
            continue;
        } else if (is_number(word, layout.offset)) {
            once(offset);
        } else {
            refuse(text, fmt::format("\"{}\" is neither a packing (unpacked, msb, mipi, genicam, gige), nor little or "
                                     "big, nor an offset in bytes, nor a stride",
                                     word));
        }
    }
    const Packed group = group_of(layout.packing, layout.bits);
    const std::string packing = packing_names[static_cast<int>(layout.packing)].name;
    if (group.pixels == 0)
        refuse(text, fmt::format("there is no packing \"{}\" of {} bits: unpacked takes all, msb 10, 12 and 14, mipi "
                                 "and genicam 10, 12 and 14, gige 10 and 12",
                                 packing, layout.bits));
    if (width % group.pixels != 0)
        refuse(text,
               fmt::format("rows of {} pixels do not fill whole groups of {} pixels in {} bytes; give the width "
                           "as it is stored, with what fills the last group ({})",
                           width, group.pixels, group.bytes, (width + group.pixels - 1) / group.pixels * group.pixels));
    if (endian && group.pixels * 2 != group.bytes)
        refuse(text, "little and big are for words of two bytes");
    layout.row_bytes = width / group.pixels * group.bytes;
    if (stride != 0 && (stride < layout.row_bytes || stride > 16 * std::uint64_t{max_side}))
        refuse(text, fmt::format("a stride of {} bytes cannot be: a row has {}", stride, layout.row_bytes));
    if (stride != 0)
        layout.row_bytes = stride;
    if (layout.offset > std::uint64_t{1} << 62)
        refuse(text, fmt::format("an offset of {} bytes cannot be", layout.offset));
    return layout;
}

namespace format_files {

Format raw() {
    Format format;
    format.name = "raw";
    format.place = 10;
    format.extensions = {".raw"};
    format.samples = "8/10/12/14/16";
    format.stacks = "raw with several frames";
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &request) -> std::unique_ptr<Reader> {
        return std::make_unique<RawReader>(path, request.raw.value());
    };
    return format;
}

} // namespace format_files
} // namespace image_io
