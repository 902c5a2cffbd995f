// Radiance HDR (RGBE), after Greg Ward's description of the format: flat, old and new run-length encoded scanlines.
// stb_image 2.27 of Debian bookworm loops for ever on a file that ends within a run, so it is not used.
#include "io/formats.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <utility>

namespace image_io::format_files {

namespace {

class HdrReader final : public Reader {
  public:
    explicit HdrReader(const std::string &path) : Reader(path), file_(path) {
        bool rgbe = false;
        (void)line();
        for (std::string text = line(); !text.empty(); text = line()) {
            if (text == "FORMAT=32-bit_rle_rgbe")
                rgbe = true;
            else if (text.rfind("FORMAT=", 0) == 0)
                fail(fmt::format("its color format \"{}\" is not supported, only 32-bit_rle_rgbe; convert it to EXR",
                                 text.substr(7)));
            else if (text.rfind("EXPOSURE=", 0) == 0 && std::strtod(text.c_str() + 9, nullptr) != 1.0)
                info_.warnings.push_back(fmt::format("the exposure in its header ({}) is ignored", text.substr(9)));
            else if (text.rfind("GAMMA=", 0) == 0 && std::strtod(text.c_str() + 6, nullptr) != 1.0)
                info_.warnings.push_back(fmt::format("the gamma in its header ({}) is ignored", text.substr(6)));
            else if (text.rfind("PIXASPECT=", 0) == 0)
                warn_of_aspect(1 / std::strtod(text.c_str() + 10, nullptr)); // it is height over width
            else if (text.rfind("COLORCORR=", 0) == 0)
                info_.warnings.push_back(
                    fmt::format("the color correction in its header ({}) is ignored", text.substr(10)));
        }
        if (!rgbe)
            fail("has no line FORMAT=32-bit_rle_rgbe in its header");
        const std::string size = line();
        unsigned long width = 0;
        unsigned long height = 0;
        char tail = 0;
        // Seven digits cannot overflow and are already far too many.
        if (std::sscanf(size.c_str(), "-Y %7lu +X %7lu%c", &height, &width, &tail) != 2)
            fail(fmt::format("its size line is \"{}\", only \"-Y height +X width\" (from top to bottom, from left to "
                             "right) is supported; convert it to EXR",
                             size.substr(0, 60)));
        check_size(width, height);
        data_offset_ = static_cast<std::uint64_t>(::ftello(file_.stream()));
        info_.sample = "rgbe";
        info_.width = static_cast<std::uint32_t>(width);
        info_.height = static_cast<std::uint32_t>(height);
        info_.channels = 3;
    }

    void read_rows(std::uint64_t, const RowSink &sink) override {
        file_.seek(data_offset_);
        const std::size_t width = info_.width;
        std::vector<unsigned char> rgbe(4 * width);
        std::vector<float> row(3 * width);
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            read_scanline(rgbe, y);
            for (std::size_t x = 0; x < width; ++x) {
                const unsigned char *pixel = &rgbe[4 * x];
                // An exponent of 0 is black; the mantissas are m / 256 times 2^(e - 128).
                const double scale = pixel[3] ? std::ldexp(1.0, int{pixel[3]} - 136) : 0.0;
                for (std::size_t c = 0; c < 3; ++c)
                    row[3 * x + c] = static_cast<float>(pixel[c] * scale);
            }
            sink(row.data());
        }
        // Rows of runs end where they end.
        if (!std::exchange(was_read_, true))
            warn_of_surplus(file_.size() - static_cast<std::uint64_t>(::ftello(file_.stream())));
    }

  private:
    std::string line() {
        std::string text;
        for (int c = file_.get(); c != '\n'; c = file_.get()) {
            if (c == -1)
                fail("is truncated: it ends within its header; write or copy it again");
            text.push_back(static_cast<char>(c));
            if (text.size() > 4096)
                fail("is damaged: a line of its header is longer than 4096 characters");
        }
        if (!text.empty() && text.back() == '\r')
            text.pop_back();
        return text;
    }

    unsigned char byte() {
        const int c = file_.get();
        if (c == -1)
            fail(fmt::format("is truncated: it ends at byte {} within its pixels; write or copy it again",
                             file_.size()));
        return static_cast<unsigned char>(c);
    }

    void read_scanline(std::vector<unsigned char> &rgbe, std::uint32_t y) {
        const std::size_t width = info_.width;
        unsigned char first[4];
        for (unsigned char &value : first)
            value = byte();
        const bool run_length = width >= 8 && first[0] == 2 && first[1] == 2 && first[2] < 128;
        if (!run_length) {
            read_flat(rgbe, first, y);
            return;
        }
        if (std::size_t{first[2]} * 256 + first[3] != width)
            fail(fmt::format("is damaged: row {} claims {} pixels, the image is {} wide", y, first[2] * 256 + first[3],
                             width));
        for (std::size_t c = 0; c < 4; ++c) {
            for (std::size_t x = 0; x < width;) {
                std::size_t count = byte();
                const bool run = count > 128;
                count -= run ? 128 : 0;
                if (count == 0 || count > width - x)
                    fail(fmt::format("is damaged: a run in row {} does not fit the row", y));
                const unsigned char value = run ? byte() : 0;
                for (; count > 0; --count, ++x)
                    rgbe[4 * x + c] = run ? value : byte();
            }
        }
    }

    void read_flat(std::vector<unsigned char> &rgbe, const unsigned char (&first)[4], std::uint32_t y) {
        const std::size_t width = info_.width;
        unsigned char pixel[4] = {first[0], first[1], first[2], first[3]};
        unsigned shift = 0;
        for (std::size_t x = 0;;) {
            // Mantissas of 1 1 1 are not normalized: in the old encoding they say how often the last pixel is repeated.
            if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
                const std::uint64_t count = shift < 24 ? std::uint64_t{pixel[3]} << shift : ~std::uint64_t{0};
                if (x == 0 || count > width - x)
                    fail(fmt::format("is damaged: a run in row {} does not fit the row", y));
                for (std::uint64_t i = 0; i < count; ++i)
                    for (std::size_t c = 0; c < 4; ++c)
                        rgbe[4 * (x + i) + c] = rgbe[4 * (x - 1) + c];
                x += static_cast<std::size_t>(count);
                shift += 8;
            } else {
                for (std::size_t c = 0; c < 4; ++c)
                    rgbe[4 * x + c] = pixel[c];
                ++x;
                shift = 0;
            }
            if (x == width)
                return;
            for (unsigned char &value : pixel)
                value = byte();
        }
    }

    detail::InputFile file_;
    std::uint64_t data_offset_ = 0;
    bool was_read_ = false;
};

} // namespace

Format hdr() {
    Format format;
    format.name = "Radiance HDR";
    format.place = 4;
    format.extensions = {".hdr"};
    format.magic = {"#?"};
    format.real = true;
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<HdrReader>(path);
    };
    return format;
}

} // namespace image_io::format_files
