// BMP by stb_image: 1, 4 and 8 bits with a palette, 24 and 32 bits. stb_image widens the 5 and 6 bits of smaller pixels
// and takes colors that a palette lacks from memory of chance, so that those are refused.
#include "io/formats.hpp"
#include "io/stb_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace image_io::format_files {

namespace {

class BmpReader final : public Reader {
  public:
    explicit BmpReader(const std::string &path) : Reader(path), file_(path) {
        file_.seek(2);
        const std::uint64_t told_bytes = number(4); // of the whole file
        file_.seek(10);
        const std::uint32_t pixels_at = number(4);
        const std::uint32_t header_bytes = number(4);
        if (header_bytes != 40 && header_bytes != 108 && header_bytes != 124)
            refuse(
                fmt::format("its header has {} bytes; 40, 108 and 124 (versions 3, 4 and 5) are read", header_bytes));
        const std::int64_t width = static_cast<std::int32_t>(number(4));
        const std::int64_t height = static_cast<std::int32_t>(number(4)); // below 0: top to bottom
        if (width < 0)
            fail(fmt::format("is damaged: its width is {}; write or copy it again", width));
        check_size(static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(std::abs(height)));
        (void)number(2); // planes
        const std::uint32_t bits = number(2);
        const std::uint32_t compression = number(4);
        if (bits != 1 && bits != 4 && bits != 8 && bits != 24 && bits != 32)
            refuse(fmt::format("its pixels have {} bits; 1, 4, 8, 24 and 32 are read", bits));
        if (compression != 0 && !(compression == 3 && bits == 32))
            refuse(fmt::format("its pixels are compressed (method {})", compression));
        (void)number(4);                                          // bytes of the pixels
        const std::uint32_t across = number(4), down = number(4); // pixels in a metre
        if (across > 0)
            warn_of_aspect(static_cast<double>(down) / across);
        if (compression == 3)
            check_masks(header_bytes);
        const std::uint64_t row_bytes = (static_cast<std::uint64_t>(width) * bits + 31) / 32 * 4;
        const std::uint64_t needed = row_bytes * static_cast<std::uint64_t>(std::abs(height));
        if (pixels_at > file_.size() || file_.size() - pixels_at < needed)
            fail(fmt::format("is truncated: {} x {} pixels of {} bits need {} bytes behind byte {}, the file has {}; "
                             "write or copy it again",
                             width, std::abs(height), bits, needed, pixels_at, file_.size()));
        info_.sample = "uint8";
        info_.width = static_cast<std::uint32_t>(width);
        info_.height = static_cast<std::uint32_t>(std::abs(height));
        info_.full_scale = 255;
        decoded_ = info_;
        // A header of version 4 or 5 always tells of an opacity, one of version 3 only without masks.
        decoded_.channels = bits == 32 && !(header_bytes == 40 && compression == 3) ? 4 : 3;
        info_.alpha = decoded_.channels == 4;
        info_.channels = bits <= 8 && is_gray(bits, 14 + header_bytes, pixels_at) ? 1 : decoded_.channels;
        std::uint64_t end = pixels_at + needed;
        if (header_bytes > 40)
            end = std::max(end, look_at_color_space(header_bytes));
        // What the header counts belongs to the file, whatever it is.
        if (told_bytes <= file_.size())
            end = std::max(end, told_bytes);
        info_.surplus_bytes = file_.size() - end;
    }

    void read_rows(std::uint64_t, const RowSink &sink) override {
        const StbPixels pixels = decode_by_stb(file_, decoded_);
        std::vector<float> row(std::size_t{info_.width} * info_.channels);
        const unsigned char *from = pixels.get();
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            for (std::size_t x = 0; x < info_.width; ++x, from += decoded_.channels)
                for (std::size_t c = 0; c < info_.channels; ++c)
                    row[x * info_.channels + c] = from[c];
            sink(row.data());
        }
    }

  private:
    [[noreturn]] void refuse(const std::string &what) const {
        fail(fmt::format("is a BMP file that is not read: {}. Convert it to PNG", what));
    }

    std::uint32_t number(std::size_t bytes) {
        unsigned char data[4] = {};
        file_.read(data, bytes);
        return data[0] | std::uint32_t{data[1]} << 8 | std::uint32_t{data[2]} << 16 | std::uint32_t{data[3]} << 24;
    }

    void check_masks(std::uint32_t header_bytes) {
        file_.seek(14 + 40);
        const std::uint32_t red = number(4), green = number(4), blue = number(4);
        const std::uint32_t alpha = header_bytes > 40 ? number(4) : 0;
        if (red != 0xff0000 || green != 0xff00 || blue != 0xff || (alpha != 0 && alpha != 0xff000000))
            refuse(fmt::format("its masks of red, green and blue are {:08x}, {:08x} and {:08x}; 00ff0000, 0000ff00 and "
                               "000000ff are read",
                               red, green, blue));
        if (header_bytes > 40 && alpha == 0)
            refuse("its mask of opacity is 0");
    }

    /** True if the palette's colors are gray, so that one channel tells all. */
    bool is_gray(std::uint32_t bits, std::uint32_t palette_at, std::uint32_t pixels_at) {
        const std::uint32_t colors = pixels_at > palette_at ? (pixels_at - palette_at) / 4 : 0;
        if (colors < 1u << bits || colors > 256)
            refuse(fmt::format("its palette has {} colors; {} to 256 are read", colors, 1u << bits));
        file_.seek(palette_at);
        bool gray = true;
        for (std::uint32_t i = 0; i < 1u << bits; ++i) {
            const std::uint32_t color = number(4) & 0xffffff;
            gray = gray && (color & 255) == (color >> 8 & 255) && (color & 255) == color >> 16;
        }
        return gray;
    }

    /** Of versions 4 and 5. @return where an ICC profile ends; 0 without one. */
    std::uint64_t look_at_color_space(std::uint32_t header_bytes) {
        file_.seek(14 + 56);
        const std::uint32_t space = number(4);
        if (space == 0x73524742 || space == 0x57696e20)
            info_.transfer = srgb("its header");
        file_.seek(14 + 96);
        const std::uint32_t red = number(4), green = number(4), blue = number(4);
        if (space == 0 && (red | green | blue) != 0)
            info_.transfer = red == green && red == blue
                                 ? power(red / 65536.0, "its header")
                                 : unknown_transfer("its header", "other gammas for red, green and blue");
        if (header_bytes < 124 || (space != 0x4d424544 && space != 0x4c494e4b))
            return 0;
        (void)number(4); // intent
        const std::uint64_t at = 14 + std::uint64_t{number(4)}, size = number(4);
        constexpr std::uint64_t most = std::uint64_t{16} << 20;
        const char *said_by = "its ICC profile";
        if (space == 0x4c494e4b || size > most || at > file_.size() || size > file_.size() - at) {
            info_.transfer =
                unknown_transfer(said_by, space == 0x4c494e4b ? "its content in another file"
                                                              : "content that cannot be read (it is damaged or cut)");
            return 0;
        }
        std::vector<unsigned char> profile(static_cast<std::size_t>(size));
        file_.seek(at);
        file_.read(profile.data(), profile.size());
        info_.transfer = transfer_of_icc(profile.data(), profile.size());
        return at + size;
    }

    detail::InputFile file_;
    Info decoded_;
};

} // namespace

Format bmp() {
    Format format;
    format.name = "BMP";
    format.place = 8;
    format.extensions = {".bmp"};
    format.magic = {"BM"};
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<BmpReader>(path);
    };
    return format;
}

} // namespace image_io::format_files
