// PGM after the Netpbm specification: P2 (text) and P5 (binary, two bytes big-endian above 255). stb_image reads P5
// only and drops the maximum value, without which a 10-bit image cannot be scaled.
#include "io/formats.hpp"

#include <fmt/format.h>

#include <cctype>

namespace image_io::format_files {

namespace {

class PgmReader final : public Reader {
  public:
    explicit PgmReader(const std::string &path) : Reader(path), file_(path) {
        (void)file_.get();
        text_ = file_.get() == '2';
        const std::uint32_t width = number("width");
        const std::uint32_t height = number("height");
        check_size(width, height);
        maximum_ = number("maximum value");
        if (maximum_ < 1 || maximum_ > 65535)
            fail(fmt::format("the maximum value of a PGM file is 1 to 65535, not {}", maximum_));
        data_offset_ = static_cast<std::uint64_t>(::ftello(file_.stream()));
        sample_bytes_ = maximum_ > 255 ? 2 : 1;
        // A text sample takes a digit and a separator; the last one needs no separator.
        const std::uint64_t needed = std::uint64_t{width} * height * (text_ ? 2 : sample_bytes_) - (text_ ? 1 : 0);
        if (file_.size() - data_offset_ < needed)
            fail(fmt::format("is truncated: {} x {} pixels need {} bytes of data, {} are there; write or copy it again",
                             width, height, needed, file_.size() - data_offset_));
        info_.sample = sample_bytes_ == 2 ? "uint16" : "uint8";
        info_.width = width;
        info_.height = height;
        info_.full_scale = maximum_;
    }

    void read_rows(std::uint64_t, const RowSink &sink) override {
        file_.seek(data_offset_);
        std::vector<float> row(info_.width);
        std::vector<unsigned char> bytes(text_ ? 0 : std::size_t{info_.width} * sample_bytes_);
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            if (!text_)
                file_.read(bytes.data(), bytes.size());
            for (std::uint32_t x = 0; x < info_.width; ++x) {
                std::uint32_t value;
                if (text_)
                    value = number("pixel");
                else if (sample_bytes_ == 2)
                    value = static_cast<std::uint32_t>(bytes[2 * x] << 8 | bytes[2 * x + 1]);
                else
                    value = bytes[x];
                if (value > maximum_)
                    fail(fmt::format("pixel ({}, {}) is {}, above the file's maximum value {}", x, y, value, maximum_));
                row[x] = static_cast<float>(value);
            }
            sink(row.data());
        }
    }

  private:
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
        if (c != -1 && !std::isspace(c))
            fail(fmt::format("is damaged: its {} is followed by neither a space nor a new line", what));
        return value;
    }

    detail::InputFile file_;
    bool text_ = false;
    std::uint32_t maximum_ = 0;
    std::uint32_t sample_bytes_ = 1;
    std::uint64_t data_offset_ = 0;
};

} // namespace

Format pgm() {
    Format format;
    format.name = "PGM";
    format.place = 6;
    format.extensions = {".pgm"};
    format.magic = {"P2", "P5"};
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<PgmReader>(path);
    };
    return format;
}

} // namespace image_io::format_files
