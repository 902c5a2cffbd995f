// TGA by stb_image: gray, RGB and palettes of 8 bits a channel, run-length encoded or not. stb_image widens the 5 bits
// of smaller pixels, takes color 0 for those that a palette lacks, and does not mirror rows: the first two are refused.
// The format begins with no mark of its own: a file is one by its footer, or by its name and a header that can be.
#include "io/formats.hpp"
#include "io/stb_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace image_io::format_files {

namespace {

constexpr std::size_t header_bytes = 18;
constexpr char footer[] = "TRUEVISION-XFILE."; // and a zero

struct Header {
    std::array<unsigned char, header_bytes> bytes{};

    unsigned at(std::size_t i) const { return bytes[i]; }
    unsigned word(std::size_t i) const { return bytes[i] | static_cast<unsigned>(bytes[i + 1]) << 8; }
    unsigned id_bytes() const { return at(0); }
    bool has_palette() const { return at(1) == 1; }
    unsigned type() const { return at(2) & ~8u; } ///< 1 palette, 2 RGB, 3 gray
    bool runs() const { return (at(2) & 8) != 0; }
    unsigned palette_first() const { return word(3); }
    unsigned palette_colors() const { return word(5); }
    unsigned palette_bits() const { return at(7); }
    unsigned width() const { return word(12); }
    unsigned height() const { return word(14); }
    unsigned bits() const { return at(16); }
    bool right_to_left() const { return (at(17) & 0x10) != 0; }

    bool plausible() const {
        return at(1) <= 1 && type() >= 1 && type() <= 3 && at(2) <= 11 && (type() == 1) == has_palette() &&
               width() > 0 && height() > 0 && bits() >= 1 && bits() <= 32 && (at(17) & 0xc0) == 0;
    }
};

Header read_header(detail::InputFile &file) {
    Header header;
    file.seek(0);
    file.read(header.bytes.data(), header.bytes.size());
    return header;
}

bool has_footer(detail::InputFile &file) {
    char end[sizeof footer];
    if (file.size() < header_bytes + 26)
        return false;
    file.seek(file.size() - sizeof end);
    file.read(end, sizeof end);
    return std::memcmp(end, footer, sizeof end) == 0;
}

bool recognizes(detail::InputFile &file) {
    if (file.size() <= header_bytes)
        return false;
    const Format *named = format_of_extension(file.path());
    return has_footer(file) || (named && named->name == "TGA" && read_header(file).plausible());
}

class TgaReader final : public Reader {
  public:
    explicit TgaReader(const std::string &path) : Reader(path), file_(path) {
        const Header header = read_header(file_);
        if (!header.plausible())
            refuse("its header is damaged, or of a kind that is not known");
        check_size(header.width(), header.height());
        const unsigned bits = header.has_palette() ? header.palette_bits() : header.bits();
        if (header.type() == 3 ? bits != 8 && bits != 16 : bits != 24 && bits != 32)
            refuse(fmt::format("its {} have {} bits; {} are read", header.has_palette() ? "palette's colors" : "pixels",
                               bits, header.type() == 3 ? "8, or 16 with an opacity," : "24 and 32"));
        if (header.has_palette() &&
            (header.bits() != 8 || header.palette_first() != 0 || header.palette_colors() < 256))
            refuse(fmt::format("its palette has the colors {} to {} for indices of {} bits; 0 to 255 and 8 are read",
                               header.palette_first(), header.palette_first() + header.palette_colors(),
                               header.bits()));
        const std::uint64_t pixels = std::uint64_t{header.width()} * header.height();
        const std::uint64_t pixel_bytes = header.has_palette() ? 1 : bits / 8;
        // A run of at most 128 pixels takes a byte and a pixel.
        const std::uint64_t needed = header_bytes + header.id_bytes() +
                                     (header.has_palette() ? header.palette_colors() * bits / 8 : 0) +
                                     (header.runs() ? (pixels + 127) / 128 * (1 + pixel_bytes) : pixels * pixel_bytes);
        if (file_.size() < needed)
            fail(fmt::format("is truncated: {} x {} pixels need {}{} bytes, the file has {}; write or copy it again",
                             header.width(), header.height(), header.runs() ? "at least " : "", needed, file_.size()));
        info_.sample = "uint8";
        info_.width = header.width();
        info_.height = header.height();
        info_.channels = bits / 8;
        info_.alpha = info_.channels == 2 || info_.channels == 4;
        info_.full_scale = 255;
        mirrored_ = header.right_to_left();
        // A footer tells that more may stand behind the pixels: a developer's and an extension area.
        if (has_footer(file_))
            look_at_extension();
        else
            info_.surplus_bytes = file_.size() - end_of_pixels(header, pixels, pixel_bytes);
    }

    void read_rows(std::uint64_t, const RowSink &sink) override {
        const StbPixels pixels = decode_by_stb(file_, info_);
        const std::size_t channels = info_.channels;
        std::vector<float> row(std::size_t{info_.width} * channels);
        const unsigned char *from = pixels.get();
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            for (std::size_t x = 0; x < info_.width; ++x, from += channels)
                std::copy(from, from + channels, &row[(mirrored_ ? info_.width - 1 - x : x) * channels]);
            sink(row.data());
        }
    }

  private:
    [[noreturn]] void refuse(const std::string &what) const {
        fail(fmt::format("is a TGA file that is not read: {}. Convert it to PNG", what));
    }

    std::uint64_t end_of_pixels(const Header &header, std::uint64_t pixels, std::uint64_t pixel_bytes) {
        const std::uint64_t begin = header_bytes + header.id_bytes() +
                                    (header.has_palette() ? header.palette_colors() * header.palette_bits() / 8 : 0);
        if (!header.runs())
            return begin + pixels * pixel_bytes;
        file_.seek(begin);
        for (std::uint64_t done = 0; done < pixels;) {
            const int packet = file_.get();
            const std::uint64_t count = static_cast<std::uint64_t>(packet & 127) + 1;
            for (std::uint64_t i = 0; i < pixel_bytes * ((packet & 128) != 0 ? 1 : count); ++i)
                if (file_.get() == -1)
                    return file_.size(); // what is cut is told when the pixels are read
            done += count;
        }
        return static_cast<std::uint64_t>(::ftello(file_.stream()));
    }

    /** Its pixels' aspect and its gamma are a number over another one each; over 0: none is told. */
    void look_at_extension() {
        unsigned char bytes[8];
        file_.seek(file_.size() - 26);
        file_.read(bytes, 4);
        constexpr std::uint64_t aspect_at = 474; // the gamma is behind it
        const std::uint64_t at =
            bytes[0] | std::uint64_t{bytes[1]} << 8 | std::uint64_t{bytes[2]} << 16 | std::uint64_t{bytes[3]} << 24;
        if (at == 0 || at + aspect_at + sizeof bytes > file_.size())
            return;
        file_.seek(at + aspect_at);
        file_.read(bytes, sizeof bytes);
        const auto word = [&](std::size_t i) { return static_cast<double>(bytes[i] | bytes[i + 1] << 8); };
        if (word(2) > 0)
            warn_of_aspect(word(0) / word(2));
        if (word(6) > 0)
            info_.transfer = power(word(4) / word(6), "its extension area");
    }

    detail::InputFile file_;
    bool mirrored_ = false;
};

} // namespace

Format tga() {
    Format format;
    format.name = "TGA";
    format.place = 9;
    format.extensions = {".tga"};
    format.recognizes = recognizes;
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<TgaReader>(path);
    };
    return format;
}

} // namespace image_io::format_files
