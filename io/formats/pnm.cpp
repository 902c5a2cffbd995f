// PNM after the Netpbm specification: P2 and P3 (text), P5 and P6 (binary, two bytes big-endian above 255), one image
// or several behind each other. Not by stb_image 2.27: it reads no text, drops the maximum value, leaves the words of
// 16 bits unswapped, takes the first image only, and gives what was in memory for pixels that a file lacks.
#include "io/byte_order.hpp"
#include "io/formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace image_io::format_files {

namespace {

class PnmReader final : public Reader {
  public:
    explicit PnmReader(const std::string &path) : Reader(path), file_(path) {
        for (std::uint64_t next = 0; next < file_.size();)
            next = add_image(next);
        const Image &first = images_.front();
        info_.sample = first.maximum > 255 ? "uint16" : "uint8";
        info_.width = first.width;
        info_.height = first.height;
        info_.channels = first.kind == '3' || first.kind == '6' ? 3 : 1;
        info_.full_scale = first.maximum;
        info_.frame_count = images_.size();
        look_at_byte_order();
    }

    void read_rows(std::uint64_t frame, const RowSink &sink) override {
        const Image &image = images_.at(frame);
        file_.seek(image.offset);
        std::vector<float> row(std::size_t{info_.width} * info_.channels);
        std::vector<unsigned char> bytes(image.is_text() ? 0 : row.size() * image.sample_bytes());
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            if (!image.is_text())
                file_.read(bytes.data(), bytes.size());
            for (std::size_t i = 0; i < row.size(); ++i) {
                const std::uint32_t value = image.is_text() ? number("pixel") : sample(image, bytes, i);
                if (value > image.maximum)
                    fail(fmt::format("pixel ({}, {}) is {}, above the file's maximum value {}{}", i / info_.channels, y,
                                     value, image.maximum, advice_if_swapped(image, value)));
                row[i] = static_cast<float>(value);
            }
            sink(row.data());
        }
    }

  private:
    struct Image {
        char kind = '5';
        std::uint32_t width = 0, height = 0, maximum = 0;
        std::uint64_t offset = 0; // of the pixels

        bool is_text() const { return kind == '2' || kind == '3'; }
        std::uint32_t sample_bytes() const { return maximum > 255 ? 2 : 1; }
        std::uint64_t samples() const { return std::uint64_t{width} * height * (kind == '3' || kind == '6' ? 3 : 1); }
    };

    std::uint64_t position() const { return static_cast<std::uint64_t>(::ftello(file_.stream())); }

    /** Reads the header of the image that begins there, and finds its end. @return where the next image begins. */
    std::uint64_t add_image(std::uint64_t start) {
        file_.seek(start);
        Image image;
        (void)file_.get();
        image.kind = static_cast<char>(file_.get());
        if (image.kind == '1' || image.kind == '4' || image.kind == '7')
            fail(fmt::format("is a PNM file of the kind P{0}; P2, P3, P5 and P6 are read. Convert it, for example by "
                             "Netpbm: {1} {2} > gray.pgm",
                             image.kind, image.kind == '7' ? "pamtopnm" : "pbmtopgm 1 1", path_));
        image.width = number("width");
        image.height = number("height");
        check_size(image.width, image.height);
        image.maximum = number("maximum value");
        if (image.maximum < 1 || image.maximum > 65535)
            fail(fmt::format("the maximum value of a PNM file is 1 to 65535, not {}", image.maximum));
        image.offset = position();
        if (!image.is_text())
            image.offset = begin_of_pixels(image);
        // A text sample takes a digit and a separator; the last one needs no separator.
        const std::uint64_t needed =
            image.samples() * (image.is_text() ? 2 : image.sample_bytes()) - (image.is_text() ? 1 : 0);
        const std::uint64_t rest = file_.size() - image.offset;
        if (rest < needed)
            fail(fmt::format("is truncated: {}{} x {} pixels need {} bytes of data, {} are there; write or copy it "
                             "again",
                             images_.empty() ? "" : fmt::format("image {}: ", images_.size() + 1), image.width,
                             image.height, needed, rest));
        if (!images_.empty())
            check_same(images_.front(), image);
        images_.push_back(image);
        if (images_.size() > max_frames)
            fail(fmt::format("holds more than {} images; split it", max_frames));
        return next_image(image, needed);
    }

    /** Of a binary image. One white space follows the maximum value; some programs write two characters for the end of
     * a line, or a comment: the size of the file tells. */
    std::uint64_t begin_of_pixels(const Image &image) {
        const std::uint64_t strict = image.offset;
        const std::uint64_t bytes = image.samples() * image.sample_bytes();
        if (ends_well(image, strict + bytes))
            return strict;
        file_.seek(strict - 1);
        const int separator = file_.get();
        int c = file_.get();
        if (separator == '\r' && c == '\n' && ends_well(image, strict + 1 + bytes))
            return strict + 1;
        file_.seek(strict);
        c = file_.get();
        if (c == '#') {
            while (c != '\n' && c != -1)
                c = file_.get();
            if (const std::uint64_t behind = position(); ends_well(image, behind + bytes))
                return behind;
        }
        return strict;
    }

    /** True if the file, or an image like this, ends there. */
    bool ends_well(const Image &image, std::uint64_t end) {
        return end == file_.size() || (end < file_.size() && begins_at(end, image.kind));
    }

    bool begins_at(std::uint64_t at, char kind) {
        file_.seek(at);
        if (file_.get() != 'P')
            return false;
        const int digit = file_.get();
        return (kind == 0 ? digit >= '1' && digit <= '7' : digit == kind) && std::isspace(file_.get());
    }

    std::uint64_t next_image(const Image &image, std::uint64_t needed) {
        std::uint64_t end = image.offset + needed;
        if (image.is_text()) {
            file_.seek(image.offset);
            for (std::uint64_t i = 0; i < image.samples(); ++i)
                (void)number("pixel");
            end = position();
        }
        // Some programs end an image with a new line. Behind the numbers of a text there may be a comment, too.
        std::uint64_t next = end;
        file_.seek(end);
        for (int c = file_.get(); std::isspace(c) || (c == '#' && image.is_text()); c = file_.get()) {
            while (c == '#' && (c = file_.get()) != '\n' && c != -1)
                c = '#';
            next = std::min(position(), file_.size());
        }
        if (next < file_.size() && begins_at(next, 0))
            return next;
        info_.surplus_bytes = next == file_.size() && image.is_text() ? 0 : file_.size() - end;
        return file_.size();
    }

    void check_same(const Image &first, const Image &image) const {
        if (first.width == image.width && first.height == image.height && first.maximum == image.maximum &&
            first.kind == image.kind)
            return;
        const auto told = [](const Image &one) {
            return fmt::format("P{}, {} x {} pixels, maximum value {}", one.kind, one.width, one.height, one.maximum);
        };
        fail(fmt::format("holds images that are no series: image 1 is {}, image {} is {}. Split it, for example by "
                         "Netpbm: pamsplit {} image%d.pgm",
                         told(first), images_.size() + 1, told(image), path_));
    }

    static std::uint32_t sample(const Image &image, const std::vector<unsigned char> &bytes, std::size_t i) {
        return image.sample_bytes() == 1 ? bytes[i] : static_cast<std::uint32_t>(bytes[2 * i] << 8 | bytes[2 * i + 1]);
    }

    static std::uint32_t swapped(std::uint32_t value) { return (value & 255) << 8 | value >> 8; }

    static std::string as_raw_words(const Image &image, std::uint32_t bits) {
        return fmt::format("read its pixels as raw words: --raw {0} (in capture.json \"raw\": \"{0}\")",
                           fmt::format("{}x{},{},unpacked,little,{}", image.width, image.height, bits, image.offset));
    }

    std::string advice_if_swapped(const Image &image, std::uint32_t value) const {
        if (image.is_text() || image.sample_bytes() != 2 || info_.channels != 1 || swapped(value) > image.maximum)
            return "; the file is damaged, or its header is wrong: write it again";
        return fmt::format("; with its bytes swapped it would be {}: PNM words are big-endian, these look "
                           "little-endian. Write the file again, or {}",
                           swapped(value), as_raw_words(image, detail::enough_bits(image.maximum)));
    }

    /** A header with 65535 takes any word. */
    void look_at_byte_order() {
        const Image &image = images_.front();
        if (image.is_text() || image.maximum != 65535 || info_.channels != 1)
            return;
        std::vector<unsigned char> bytes(2 * static_cast<std::size_t>(std::min<std::uint64_t>(image.samples(), 32768)));
        file_.seek(image.offset);
        file_.read(bytes.data(), bytes.size());
        detail::WholeNumbers words(2);
        for (std::size_t i = 0; 2 * i < bytes.size(); ++i)
            words.add(sample(image, bytes, i));
        const unsigned bits = words.bits_if_swapped();
        if (bits == 0)
            return;
        info_.looks_swapped =
            fmt::format("its words look little-endian, though PNM is big-endian: with their bytes swapped none needs "
                        "more than {} bits. If so, {}",
                        bits, as_raw_words(image, bits));
        info_.warnings.push_back(info_.looks_swapped);
    }

    /** The next decimal number, behind white space and comments; takes one character behind it, as the format wants. */
    std::uint32_t number(const char *what) {
        int c = file_.get();
        while (c == '#' || std::isspace(c)) {
            if (c == '#')
                while (c != '\n' && c != -1)
                    c = file_.get();
            else
                c = file_.get();
        }
        if (!std::isdigit(c))
            fail(c == -1 ? fmt::format("is truncated: it ends before its {}; write or copy it again", what)
                         : fmt::format("is damaged: its {} is not a number", what));
        std::uint32_t value = 0;
        for (; std::isdigit(c); c = file_.get()) {
            value = value * 10 + static_cast<std::uint32_t>(c - '0');
            if (value > 100000000)
                fail(fmt::format("is damaged: its {} is far too large", what));
        }
        if (c == '#')
            while (c != '\n' && c != -1)
                c = file_.get();
        if (c != -1 && !std::isspace(c))
            fail(fmt::format("is damaged: its {} is followed by neither a space nor a new line", what));
        return value;
    }

    detail::InputFile file_;
    std::vector<Image> images_;
};

} // namespace

Format pnm() {
    Format format;
    format.name = "PNM";
    format.place = 6;
    format.extensions = {".pgm", ".ppm", ".pnm"};
    format.magic = {"P1", "P2", "P3", "P4", "P5", "P6", "P7"};
    format.samples = "8/16";
    format.stacks = "PNM with several images";
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<PnmReader>(path);
    };
    return format;
}

} // namespace image_io::format_files
