// PNG by libspng: unlike stb_image it verifies the checksums, so that a damaged file does not pass for a picture.
#include "io/formats.hpp"

#include <fmt/format.h>
#include <spng.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <set>
#include <string_view>

namespace image_io::format_files {

namespace {

struct ContextDeleter {
    void operator()(spng_ctx *context) const { spng_ctx_free(context); }
};
using Context = std::unique_ptr<spng_ctx, ContextDeleter>;

class PngReader final : public Reader {
  public:
    PngReader(const std::string &path, const ReadRequest &request) : Reader(path), file_(path) {
        look_at_chunks();
        refuse_several_images(request);
        const Context context = start();
        read_transfer(context.get());
        info_.width = header_.width;
        info_.height = header_.height;
        const bool indexed = header_.color_type == SPNG_COLOR_TYPE_INDEXED;
        const bool two_bytes = header_.bit_depth == 16;
        info_.alpha = header_.color_type == SPNG_COLOR_TYPE_GRAYSCALE_ALPHA ||
                      header_.color_type == SPNG_COLOR_TYPE_TRUECOLOR_ALPHA;
        const bool gray =
            header_.color_type == SPNG_COLOR_TYPE_GRAYSCALE || header_.color_type == SPNG_COLOR_TYPE_GRAYSCALE_ALPHA;
        info_.channels = (gray ? 1 : 3) + (info_.alpha ? 1 : 0);
        info_.sample = two_bytes ? "uint16" : "uint8";
        info_.full_scale = two_bytes ? 65535 : 255;
        // G8 widens 1, 2 and 4 bits; PNG gives the samples as they are, in host order, and indices bit by bit.
        output_format_ = header_.color_type == SPNG_COLOR_TYPE_GRAYSCALE && !two_bytes ? SPNG_FMT_G8 : SPNG_FMT_PNG;
        width_bytes_ = indexed ? (std::size_t{info_.width} * header_.bit_depth + 7) / 8
                               : std::size_t{info_.width} * info_.channels * (two_bytes ? 2 : 1);
        if (indexed)
            check(spng_get_plte(context.get(), &palette_));
        // Deflate cannot shrink by more than 1032, and rows of less than a byte per pixel are an eighth at the least.
        const std::size_t least = two_bytes || indexed || header_.bit_depth == 8 ? 1 : 8;
        if (width_bytes_ / least * info_.height > file_.size() * 1040)
            fail(fmt::format("is truncated or damaged: {} bytes cannot hold {} x {} pixels", file_.size(), info_.width,
                             info_.height));
    }

    void read_rows(std::uint64_t, const RowSink &sink) override {
        const Context context = start();
        std::vector<float> row(std::size_t{info_.width} * info_.channels);
        if (header_.interlace_method != SPNG_INTERLACE_NONE) {
            std::size_t size = 0;
            check(spng_decoded_image_size(context.get(), output_format_, &size));
            if (size != width_bytes_ * info_.height)
                fail("is damaged: its rows have an unexpected size");
            std::vector<unsigned char> image(size);
            check(spng_decode_image(context.get(), image.data(), image.size(), output_format_, 0));
            finish(context.get());
            for (std::uint32_t y = 0; y < info_.height; ++y) {
                convert(image.data() + y * width_bytes_, y, row);
                sink(row.data());
            }
            return;
        }
        check(spng_decode_image(context.get(), nullptr, 0, output_format_, SPNG_DECODE_PROGRESSIVE));
        std::vector<unsigned char> bytes(width_bytes_);
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            const int status = spng_decode_row(context.get(), bytes.data(), bytes.size());
            if (status != SPNG_OK && !(status == SPNG_EOI && y + 1 == info_.height))
                check(status);
            convert(bytes.data(), y, row);
            sink(row.data());
        }
        finish(context.get());
    }

  private:
    static std::uint32_t number(const unsigned char *bytes) {
        return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 | std::uint32_t{bytes[2]} << 8 | bytes[3];
    }

    /** Which chunks there are, and what libspng does not read: an animation, cICP, and EXIF data and XMP behind the
     * image. */
    void look_at_chunks() {
        std::uint64_t at = 8;
        unsigned char head[8];
        bool ended = false;
        while (!ended && at + 12 <= file_.size()) {
            file_.seek(at);
            file_.read(head, sizeof head);
            const std::uint64_t length = number(head);
            const std::string name(reinterpret_cast<const char *>(head + 4), 4);
            chunks_.insert(name);
            if (name == "iTXt" && at + 12 + length <= file_.size())
                read_xmp(length);
            if ((name == "cICP" || name == "acTL" || name == "eXIf") && at + 12 + length <= file_.size()) {
                // As much as any of them needs; behind the data is their checksum.
                std::vector<unsigned char> data(static_cast<std::size_t>(std::min<std::uint64_t>(length + 4, 65536)));
                file_.read(data.data(), data.size());
                // Primaries, transfer characteristics, matrix, full range.
                const bool whole = data.size() == length + 4;
                const bool intact = whole && number(&data[length]) == checksum(head + 4, data.data(), length);
                if (name == "cICP" && length == 4 && intact)
                    cicp_ = transfer_of_cicp(data[1], data[3] != 0, "its chunk cICP");
                if (name == "acTL" && length >= 4)
                    images_ = std::max<std::uint64_t>(1, number(data.data()));
                if (name == "eXIf")
                    warn_of_exif(data.data(), whole && !intact ? 0 : std::min<std::size_t>(length, data.size()),
                                 "its chunk eXIf");
            }
            ended = name == "IEND";
            at += 12 + length;
        }
        end_ = ended ? std::min(at, file_.size()) : file_.size();
    }

    /** Of a chunk iTXt, whose data begin here, if its keyword is XMP's. Compressed text, which XMP forbids, tells
     * nothing.
     */
    void read_xmp(std::uint64_t length) {
        using namespace std::string_view_literals;
        constexpr std::string_view keyword = "XML:com.adobe.xmp\0"sv;
        constexpr std::uint64_t most = 16 << 20;
        std::vector<unsigned char> data(static_cast<std::size_t>(std::min<std::uint64_t>(length, keyword.size())));
        file_.read(data.data(), data.size());
        if (std::string_view(reinterpret_cast<const char *>(data.data()), data.size()) != keyword || length > most)
            return;
        data.resize(static_cast<std::size_t>(length + 4));
        file_.read(data.data() + keyword.size(), data.size() - keyword.size());
        const auto *name = reinterpret_cast<const unsigned char *>("iTXt");
        if (number(&data[length]) == checksum(name, data.data(), length))
            warn_of_xmp({reinterpret_cast<const char *>(data.data()), static_cast<std::size_t>(length)});
    }

    /** Of a chunk's name and data. */
    static std::uint32_t checksum(const unsigned char *name, const unsigned char *data, std::size_t size) {
        std::uint32_t sum = 0xffffffff;
        for (std::size_t i = 0; i < 4 + size; ++i) {
            sum ^= i < 4 ? name[i] : data[i - 4];
            for (int bit = 0; bit < 8; ++bit)
                sum = sum >> 1 ^ ((sum & 1) != 0 ? 0xedb88320 : 0);
        }
        return ~sum;
    }

    /** An animation, or files behind each other as a pipe gives them. */
    void refuse_several_images(const ReadRequest &request) {
        if (images_ > 1 && !request.page)
            fail(fmt::format("is an animation of {0} images (APNG), of which the first one can be read: {1}:page=0. "
                             "Write the images into files of their own to read all",
                             images_, path_));
        if (end_ == file_.size())
            return;
        file_.seek(end_);
        const bool another = file_.get() == 0x89 && file_.get() == 'P' && file_.get() == 'N' && file_.get() == 'G';
        if (another && !request.page)
            fail(fmt::format("holds another PNG image behind the first one, which can be read: {}:page=0. Write the "
                             "images into files of their own to read all",
                             path_));
        if (!another)
            info_.surplus_bytes = file_.size() - end_;
    }

    /** Of several chunks the most exact one holds, whether it can be read or not: libspng passes over what is damaged.
     */
    void read_transfer(spng_ctx *context) {
        constexpr const char *unreadable = "content that cannot be read (it is damaged, or not where it must be)";
        std::uint8_t intent = 0;
        double gamma = 0;
        spng_iccp profile{};
        spng_sbit bits{};
        const auto has = [&](const char *name) { return chunks_.count(name) > 0; };
        if (spng_get_sbit(context, &bits) == SPNG_OK)
            info_.significant_bits =
                header_.color_type == SPNG_COLOR_TYPE_GRAYSCALE || header_.color_type == SPNG_COLOR_TYPE_GRAYSCALE_ALPHA
                    ? bits.grayscale_bits
                    : std::max({bits.red_bits, bits.green_bits, bits.blue_bits});
        else if (has("sBIT"))
            info_.warnings.push_back(fmt::format("its chunk sBIT has {} and is ignored", unreadable));
        spng_phys density{};
        if (spng_get_phys(context, &density) == SPNG_OK && density.ppu_x > 0)
            warn_of_aspect(static_cast<double>(density.ppu_y) / density.ppu_x);
        if (has("tRNS"))
            info_.warnings.push_back("the opacity that its chunk tRNS tells is ignored");
        if (has("pCAL"))
            info_.warnings.push_back("the physical values that its chunk pCAL gives its numbers are ignored; they are "
                                     "taken as stored");
        if (has("cICP")) {
            info_.transfer = cicp_ ? *cicp_ : unknown_transfer("its chunk cICP", unreadable);
        } else if (spng_get_iccp(context, &profile) == SPNG_OK) {
            info_.transfer =
                transfer_of_icc(reinterpret_cast<const unsigned char *>(profile.profile), profile.profile_len);
            if (info_.transfer.curve == Transfer::Curve::unknown && std::strstr(profile.profile_name, "sRGB"))
                info_.transfer = srgb("its ICC profile");
        } else if (has("iCCP")) {
            info_.transfer = unknown_transfer("its chunk iCCP", unreadable);
        } else if (has("sRGB")) {
            info_.transfer = spng_get_srgb(context, &intent) == SPNG_OK
                                 ? srgb("its chunk sRGB")
                                 : unknown_transfer("its chunk sRGB", unreadable);
        } else if (has("gAMA")) {
            info_.transfer = spng_get_gama(context, &gamma) == SPNG_OK && gamma > 0
                                 ? power(1 / gamma, "its chunk gAMA")
                                 : unknown_transfer("its chunk gAMA", unreadable);
        }
    }

    Context start() {
        file_.seek(0);
        Context context(spng_ctx_new(0));
        if (!context)
            throw std::bad_alloc();
        check(spng_set_chunk_limits(context.get(), std::size_t{16} << 20, std::size_t{64} << 20));
        check(spng_set_png_file(context.get(), file_.stream()));
        check(spng_get_ihdr(context.get(), &header_));
        check_size(header_.width, header_.height);
        return context;
    }

    /** Reads to the end of the file, so that a checksum there or a missing end is seen. */
    void finish(spng_ctx *context) { check(spng_decode_chunks(context)); }

    void check(int status) const {
        if (status == SPNG_OK)
            return;
        if (status == SPNG_IO_EOF || status == SPNG_EOF || status == SPNG_EIDAT_TOO_SHORT || status == SPNG_EOI)
            fail("is truncated: the PNG data end too early; write or copy it again");
        if (status == SPNG_EMEM)
            throw std::bad_alloc();
        fail(fmt::format("is damaged: {}; write or copy it again", spng_strerror(status)));
    }

    void convert(const unsigned char *bytes, std::uint32_t y, std::vector<float> &row) const {
        if (header_.color_type == SPNG_COLOR_TYPE_INDEXED) {
            const unsigned bits = header_.bit_depth, in_byte = 8 / bits;
            for (std::size_t x = 0; x < info_.width; ++x) {
                const auto shift = static_cast<unsigned>(8 - bits * (x % in_byte + 1));
                const unsigned entry = bytes[x / in_byte] >> shift & ((1u << bits) - 1);
                if (entry >= palette_.n_entries)
                    fail(fmt::format("is damaged: pixel ({}, {}) has the color {} of its palette, which has {}; write "
                                     "or copy it again",
                                     x, y, entry, palette_.n_entries));
                const spng_plte_entry &color = palette_.entries[entry];
                row[3 * x] = color.red;
                row[3 * x + 1] = color.green;
                row[3 * x + 2] = color.blue;
            }
            return;
        }
        if (info_.full_scale == 255) {
            for (std::size_t i = 0; i < row.size(); ++i)
                row[i] = bytes[i];
            return;
        }
        for (std::size_t i = 0; i < row.size(); ++i) {
            std::uint16_t value;
            std::memcpy(&value, bytes + 2 * i, 2);
            row[i] = value;
        }
    }

    detail::InputFile file_;
    std::set<std::string> chunks_;
    std::optional<Transfer> cicp_;
    std::uint64_t images_ = 1;
    std::uint64_t end_ = 0; ///< Of the first image.
    spng_ihdr header_{};
    spng_plte palette_{};
    std::size_t width_bytes_ = 0;
    int output_format_ = 0;
};

class PngWriter final : public Writer {
  public:
    PngWriter(const std::string &path, const WriteRequest &request) : Writer(path), path_(path), request_(request) {}

    void append(const void *samples) override {
        const Context context(spng_ctx_new(SPNG_CTX_ENCODER));
        if (!context)
            throw std::bad_alloc();
        spng_ihdr header{};
        header.width = request_.width;
        header.height = request_.height;
        header.bit_depth = static_cast<std::uint8_t>(8 * size_of(request_.sample));
        header.color_type = SPNG_COLOR_TYPE_GRAYSCALE;
        // Speckle is noise: more effort than this makes the file hardly smaller and the program much slower.
        check(spng_set_option(context.get(), SPNG_IMG_COMPRESSION_LEVEL, 3));
        check(spng_set_option(context.get(), SPNG_FILTER_CHOICE, SPNG_FILTER_CHOICE_SUB));
        check(spng_set_png_file(context.get(), file_.stream()));
        check(spng_set_ihdr(context.get(), &header));
        const std::size_t size = std::size_t{request_.width} * request_.height * size_of(request_.sample);
        check(spng_encode_image(context.get(), samples, size, SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE));
    }

  private:
    void check(int status) const {
        if (status == SPNG_OK)
            return;
        if (status == SPNG_EMEM)
            throw std::bad_alloc();
        if (status == SPNG_IO_ERROR || status == SPNG_EIO)
            throw WriteError(path_, fmt::format("cannot be written: {}", std::strerror(errno)));
        throw WriteError(path_, fmt::format("cannot be encoded as PNG: {}", spng_strerror(status)));
    }

    std::string path_;
    WriteRequest request_;
};

} // namespace

Format png() {
    Format format;
    format.name = "PNG";
    format.place = 1;
    format.extensions = {".png"};
    format.magic = {"\x89PNG"};
    format.samples = "8/16";
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &request) -> std::unique_ptr<Reader> {
        return std::make_unique<PngReader>(path, request);
    };
    format.create = [](const std::string &path, const WriteRequest &request) -> std::unique_ptr<Writer> {
        return std::make_unique<PngWriter>(path, request);
    };
    format.writes = {Sample::uint8, Sample::uint16};
    format.storage = {{"png16", Sample::uint16}};
    return format;
}

} // namespace image_io::format_files
