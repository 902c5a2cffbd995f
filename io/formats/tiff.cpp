// TIFF by libtiff: strips and tiles, chunky and planar; whole numbers of 1 to 16 and 32 bits, floating point of 16, 32
// and 64, palettes.
#include "io/formats.hpp"
#include "io/half.hpp"
#include "io/stack_shape.hpp"

#include <fmt/format.h>

#include <tiffio.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>

namespace image_io::format_files {

namespace {

/** libtiff's messages, which it would print. */
struct Messages {
    std::string first_error;
    static int error(TIFF *, void *user, const char *, const char *format, va_list arguments) {
        auto *self = static_cast<Messages *>(user);
        if (self->first_error.empty()) {
            char text[256];
            std::vsnprintf(text, sizeof(text), format, arguments);
            self->first_error = text;
        }
        return 1;
    }
    static int warning(TIFF *, void *, const char *, const char *, va_list) { return 1; }
};

struct TiffDeleter {
    void operator()(TIFF *tiff) const { TIFFClose(tiff); }
};
using Tiff = std::unique_ptr<TIFF, TiffDeleter>;

Tiff open_tiff_file(const std::string &path, const char *mode, Messages &messages) {
    std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions *)> options(TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
    if (!options)
        throw std::bad_alloc();
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), Messages::error, &messages);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), Messages::warning, &messages);
    // The largest strip that a plausible file has is the whole image of 16384 x 16384 x 4 bytes.
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), tmsize_t{1} << 31);
    return Tiff(TIFFOpenExt(path.c_str(), mode, options.get()));
}

constexpr std::uint16_t photometric_linear_raw = 34892; // of DNG

bool is_lossy(std::uint16_t compression) {
    return compression == COMPRESSION_JPEG || compression == COMPRESSION_OJPEG || compression == COMPRESSION_WEBP;
}

/** What a page calls itself, without its numbers: words of letters, which a number may follow. Empty where the text is
 * made for programs. */
std::string name_words(const char *text) {
    constexpr std::size_t most = 80;
    const std::string all = text ? std::string(text, strnlen(text, most + 1)) : "";
    if (all.size() > most || all.find_first_of("{}<>=\n") != std::string::npos)
        return "";
    std::string words;
    for (std::size_t at = 0; at < all.size();) {
        const auto letter = [&](std::size_t i) {
            return i < all.size() && std::isalpha(static_cast<unsigned char>(all[i])) != 0;
        };
        const auto digit = [&](std::size_t i) {
            return i < all.size() && std::isdigit(static_cast<unsigned char>(all[i])) != 0;
        };
        std::size_t end = at, behind = at;
        while (letter(end))
            ++end;
        for (behind = end; digit(behind);)
            ++behind;
        // Letters behind a digit are part of a number, as in 1a2f.
        if (end > at && !letter(behind))
            words += (words.empty() ? "" : " ") + all.substr(at, end - at);
        while (letter(behind) || digit(behind))
            ++behind;
        at = std::max(behind, at + 1);
    }
    return words;
}

constexpr std::uint64_t most_padding_bytes = std::uint64_t{64} << 20;

/** What one page holds. */
struct Layout {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint16_t bits = 1;
    std::uint16_t channels = 1;
    std::uint16_t sample_format = SAMPLEFORMAT_UINT;
    std::uint16_t photometric = PHOTOMETRIC_MINISBLACK;
    std::uint16_t planar = PLANARCONFIG_CONTIG;
    std::uint16_t compression = COMPRESSION_NONE;
    bool alpha = false; ///< There is a sample behind gray or the colors.
    bool is_opacity_told = false;
    bool tiled = false;
    std::uint16_t colors = 0; ///< Of a palette whose colors are looked up, 1 (gray) or 3; 0: none is.
    std::vector<float> palette[3];

    bool is_packed() const { return bits < 8 || (bits > 8 && bits < 16); } ///< Samples are no whole bytes.
    std::size_t row_bytes(std::size_t samples) const { return (samples * bits + 7) / 8; }
    /** What a reader gives for a stored sample. */
    std::uint16_t values() const { return colors > 0 ? colors : 1; }
    double full_scale() const {
        return sample_format != SAMPLEFORMAT_UINT || bits > 16 ? 0
               : colors > 0                                    ? 65535
               : bits < 8                                      ? 255 // widened, as PNG's
                                                               : (1 << bits) - 1;
    }
    std::string sample() const {
        if (sample_format == SAMPLEFORMAT_IEEEFP || bits > 16)
            return fmt::format("{}{}",
                               sample_format == SAMPLEFORMAT_IEEEFP ? "float"
                               : sample_format == SAMPLEFORMAT_INT  ? "int"
                                                                    : "uint",
                               bits);
        return fmt::format("{}{}", sample_format == SAMPLEFORMAT_INT ? "int" : "uint", bits > 8 || colors > 0 ? 16 : 8);
    }
};

/** One of the images that a file lists. */
struct Page {
    std::uint64_t offset = 0; ///< Of its directory.
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint16_t bits = 1;
    std::uint16_t channels = 1;
    std::uint16_t sample_format = SAMPLEFORMAT_UINT;
    std::string words;    ///< That change what its numbers mean; of the first frame they are told, or applied, for all.
    std::string called;   ///< Its name or description without numbers; empty: it has none.
    bool is_frame = true; ///< Neither another one at a lower resolution nor a mask.
    std::vector<std::uint64_t> children;

    bool like(const Page &other) const {
        return width == other.width && height == other.height && bits == other.bits && channels == other.channels &&
               sample_format == other.sample_format && words == other.words &&
               (called.empty() || other.called.empty() || called == other.called);
    }
};

/** What ImageJ makes of the numbers that a file stores. */
struct Calibration {
    double offset = 0, factor = 1;

    float operator()(float stored) const { return static_cast<float>(offset + factor * stored); }
};

/** Images that lie behind each other after one directory, which describes the first of them. */
struct Stack {
    std::uint64_t images = 0;
    std::uint64_t channels = 1; ///< That take turns.
    const char *said_by = "";
};

class TiffReader final : public Reader {
  public:
    TiffReader(const std::string &path, const ReadRequest &request)
        : Reader(path), file_(path), file_size_(file_.size()) {
        // "m": no memory map, or a file that another program cuts meanwhile would end this one.
        tiff_ = open_tiff_file(path, "rm", messages_);
        if (!tiff_)
            broken("is not a readable TIFF file");
        find_pages();
        choose_frames(request);
        go_to(frames_.front());
        const Layout layout = read_layout();
        info_.width = layout.width;
        info_.height = layout.height;
        info_.channels = layout.colors > 0 ? layout.colors : layout.channels;
        info_.alpha = layout.alpha;
        // A vector's fourth number is none of its own.
        const bool vector = request.role == Role::position || request.role == Role::normal;
        is_last_unexplained_ = layout.alpha && !layout.is_opacity_told && request.channel.empty() && !vector;
        info_.sample = layout.sample();
        info_.full_scale = layout.full_scale();
        info_.lossy = is_lossy(layout.compression);
        if (info_.lossy)
            info_.warnings.push_back(
                "its compression is lossy. Where intensities matter save it without, or with deflate or LZW");
        info_.white_is_zero = layout.photometric == PHOTOMETRIC_MINISWHITE;
        bits_ = layout.bits;
        info_.frame_count = frames_.size();
        warn_of_orientation(field<std::uint16_t>(TIFFTAG_ORIENTATION, 1));
        if (const float across = field<float>(TIFFTAG_XRESOLUTION, 0); across > 0)
            warn_of_aspect(field<float>(TIFFTAG_YRESOLUTION, 0) / across);
        std::uint32_t profile_bytes = 0;
        const void *profile = nullptr;
        if (TIFFGetField(tiff_.get(), TIFFTAG_ICCPROFILE, &profile_bytes, &profile))
            info_.transfer = transfer_of_icc(static_cast<const unsigned char *>(profile), profile_bytes);
        else if (stored_tag(TIFFTAG_ICCPROFILE))
            info_.transfer = unknown_transfer("its ICC profile", "content that cannot be read (it is damaged or cut)");
        else if (stored_tag(TIFFTAG_TRANSFERFUNCTION))
            info_.transfer = told_transfer(layout);
        else if (stored_tag(TIFFTAG_GRAYRESPONSECURVE))
            info_.transfer = unknown_transfer("its tag GrayResponseCurve", "a table of optical densities");
        else if (exif_says_srgb())
            info_.transfer = srgb("its EXIF data");
        warn_of_xmp(xmp());
        warn_of_missing();
        find_calibration(layout);
        if (!messages_.first_error.empty())
            broken("is damaged");
        find_stack(request, layout);
        if (!request.page && detail::may_lie_behind(info_.frame_count, info_.height, info_.width))
            info_.warnings.push_back(
                fmt::format("its images are taken as {} frames, {} pixels high and {} wide. If an array of height x "
                            "width x frames was saved, {}",
                            info_.frame_count, info_.height, info_.width, frames_first(true)));
    }

    void read_rows(std::uint64_t frame, const RowSink &sink) override {
        if (!is_last_unexplained_)
            return read_all(frame, sink);
        read_all(frame, [&](const float *row) {
            check_last(row);
            sink(row);
        });
    }

  private:
    /** Some programs say nothing of opacity. Where it is not full it may be another channel. */
    void check_last(const float *row) const {
        const double opaque = info_.full_scale > 0 ? info_.full_scale : 1.0;
        for (std::uint32_t x = 0; x < info_.width; ++x)
            if (row[(x + 1) * std::size_t{info_.channels} - 1] != opaque)
                fail(fmt::format("does not say what the last of its {0} samples for each pixel is (tag ExtraSamples): "
                                 "opacity, or a channel of its own. Name one behind the file's name: {1}:{2}, or the "
                                 "last, {1}:A",
                                 info_.channels, path_, info_.channels == 2 ? "Y" : "R,G,B"));
    }

    void read_all(std::uint64_t frame, const RowSink &sink) {
        messages_.first_error.clear();
        if (stack_.images > 0)
            return read_of_stack(first_of_stack_ + frame, sink);
        go_to(frames_.at(frame));
        const Layout layout = read_layout();
        if (layout.width != info_.width || layout.height != info_.height ||
            (layout.colors > 0 ? layout.colors : layout.channels) != info_.channels || layout.bits != bits_)
            fail("changed while it was read");
        if (layout.tiled)
            read_bands(layout, sink, tile_width(layout), tile_height(layout), TIFFTileSize64(tiff_.get()));
        else
            read_bands(layout, sink, layout.width, strip_height(layout), TIFFStripSize64(tiff_.get()));
    }

    [[noreturn]] void broken(const std::string &what) const {
        fail(messages_.first_error.empty() ? what : fmt::format("{}: {}", what, messages_.first_error));
    }

    void go_to(const Page &page) {
        if (!TIFFSetSubDirectory(tiff_.get(), page.offset))
            broken("is damaged: a page cannot be read");
    }

    Page this_page() const {
        Page page;
        page.offset = TIFFCurrentDirOffset(tiff_.get());
        page.width = field<std::uint32_t>(TIFFTAG_IMAGEWIDTH, 0);
        page.height = field<std::uint32_t>(TIFFTAG_IMAGELENGTH, 0);
        page.bits = field<std::uint16_t>(TIFFTAG_BITSPERSAMPLE, 1);
        page.channels = field<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL, 1);
        page.sample_format = field<std::uint16_t>(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
        if (field<std::uint16_t>(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK) == PHOTOMETRIC_MINISWHITE)
            page.words += ", 0 is white";
        if (const auto orientation = field<std::uint16_t>(TIFFTAG_ORIENTATION, 1); orientation > 1)
            page.words += fmt::format(", orientation {}", orientation);
        if (is_lossy(field<std::uint16_t>(TIFFTAG_COMPRESSION, COMPRESSION_NONE)))
            page.words += ", lossy";
        std::uint32_t profile_bytes = 0;
        const void *profile = nullptr;
        if (TIFFGetField(tiff_.get(), TIFFTAG_ICCPROFILE, &profile_bytes, &profile))
            page.words += fmt::format(", an ICC profile of {} bytes", profile_bytes);
        const std::uint16_t *tables[3] = {};
        if (TIFFGetField(tiff_.get(), TIFFTAG_TRANSFERFUNCTION, &tables[0], &tables[1], &tables[2]))
            page.words += ", a table of light";
        if (const std::string packet = xmp(); detail::orientation_of_xmp(packet) > 1)
            page.words += fmt::format(", orientation {} by XMP", detail::orientation_of_xmp(packet));
        for (const std::uint32_t tag : {TIFFTAG_PAGENAME, TIFFTAG_IMAGEDESCRIPTION})
            if (const char *text = nullptr; page.called.empty() && TIFFGetField(tiff_.get(), tag, &text))
                page.called = name_words(text);
        std::uint32_t kind = 0;
        std::uint16_t old_kind = 0;
        if (TIFFGetField(tiff_.get(), TIFFTAG_SUBFILETYPE, &kind))
            page.is_frame = (kind & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0;
        else if (TIFFGetField(tiff_.get(), TIFFTAG_OSUBFILETYPE, &old_kind))
            page.is_frame = old_kind != OFILETYPE_REDUCEDIMAGE;
        std::uint16_t count = 0;
        std::uint64_t *offsets = nullptr;
        if (TIFFGetField(tiff_.get(), TIFFTAG_SUBIFD, &count, &offsets))
            page.children.assign(offsets, offsets + count);
        return page;
    }

    void find_pages() {
        // A directory takes at least 6 bytes; more of them than the file can hold are a loop.
        const std::uint64_t most = std::min<std::uint64_t>(max_frames, file_size_ / 6);
        do
            pages_.push_back(this_page());
        while (pages_.size() < most && TIFFReadDirectory(tiff_.get()));
        if (!messages_.first_error.empty())
            broken("is damaged");
    }

    void choose_frames(const ReadRequest &request) {
        info_.one_page = request.page.has_value();
        if (request.page) {
            // Of one page: its number may be that of an image in a stack.
            if (pages_.size() == 1) {
                frames_ = pages_;
                return;
            }
            if (*request.page >= pages_.size())
                fail(fmt::format("has no page {}; its pages are: {}", *request.page, told_pages()));
            frames_ = {pages_[*request.page]};
            return;
        }
        for (const Page &page : pages_)
            if (page.is_frame)
                frames_.push_back(page);
        // A preview may come first, and list the image that it is made of.
        if (frames_.empty())
            for (const std::uint64_t offset : pages_.front().children) {
                if (!TIFFSetSubDirectory(tiff_.get(), offset))
                    broken("is damaged: a page cannot be read");
                if (const Page child = this_page(); child.is_frame)
                    frames_.push_back(child);
            }
        if (frames_.empty() && pages_.size() == 1)
            frames_ = pages_;
        if (frames_.empty())
            fail(fmt::format("holds reduced-resolution images and masks only: {}. Name one behind the file's name, for "
                             "example {}:page=0",
                             told_pages(), path_));
        for (const Page &frame : frames_)
            if (!frame.like(frames_.front()))
                fail(fmt::format("holds images that are no series: {}. Name one behind the file's name, for example "
                                 "{}:page=0",
                                 told_pages(), path_));
    }

    std::string told_pages() const {
        constexpr std::size_t most = 8;
        std::string text;
        for (std::size_t i = 0; i < std::min(most, pages_.size()); ++i) {
            const Page &page = pages_[i];
            text += fmt::format("{}page {}{} {} x {}, {} x {} bits{}{}", i ? "; " : "", i,
                                page.is_frame ? "" : " (reduced)", page.width, page.height, page.channels, page.bits,
                                page.words, page.called.empty() ? "" : fmt::format(", called \"{}\"", page.called));
        }
        return pages_.size() > most ? fmt::format("{}; and {} more", text, pages_.size() - most) : text;
    }

    /** By a table of light for each number, or one for each color. */
    Transfer told_transfer(const Layout &layout) const {
        const char *said_by = "its tag TransferFunction";
        const std::uint16_t *tables[3] = {};
        if (layout.sample_format != SAMPLEFORMAT_UINT || layout.bits > 16 ||
            !TIFFGetField(tiff_.get(), TIFFTAG_TRANSFERFUNCTION, &tables[0], &tables[1], &tables[2]) || !tables[0])
            return unknown_transfer(said_by, "content that cannot be read (it is damaged or cut)");
        if (layout.colors > 0 || layout.photometric == PHOTOMETRIC_MINISWHITE)
            return unknown_transfer(said_by, "a table of numbers that are no light by themselves");
        const std::size_t count = std::size_t{1} << layout.bits;
        for (const std::uint16_t *other : {tables[1], tables[2]})
            if (other && !std::equal(tables[0], tables[0] + count, other))
                return unknown_transfer(said_by, "other tables for red, green and blue");
        std::vector<float> entries(count);
        std::transform(tables[0], tables[0] + count, entries.begin(),
                       [](std::uint16_t light) { return static_cast<float>(light) / 65535.0f; });
        return transfer_of_table(std::move(entries), said_by);
    }

    /** A line of ImageJ's description; empty: it has none. */
    std::string said_by_imagej(const std::string &key) const {
        const char *text = nullptr;
        if (!TIFFGetField(tiff_.get(), TIFFTAG_IMAGEDESCRIPTION, &text) || !text ||
            std::strncmp(text, "ImageJ=", 7) != 0)
            return "";
        const std::string description = text, line = "\n" + key + "=";
        const std::size_t at = description.find(line);
        return at == std::string::npos
                   ? ""
                   : description.substr(at + line.size(), description.find('\n', at + 1) - at - line.size());
    }

    /** Numbers that stand for others. */
    void find_calibration(const Layout &layout) {
        const std::string function = said_by_imagej("cf");
        // ImageJ takes none of whole numbers of 32 bits, floating-point ones and colors.
        if (!function.empty() && function != "20" && layout.bits <= 16 && layout.channels == 1 &&
            layout.sample_format != SAMPLEFORMAT_IEEEFP) {
            const std::string offset = said_by_imagej("c0"), factor = said_by_imagej("c1");
            const Calibration told{std::strtod(offset.c_str(), nullptr), std::strtod(factor.c_str(), nullptr)};
            // So ImageJ keeps signed numbers, which it stores with their sign or without.
            if (function == "0" && layout.bits == 16 && layout.sample_format == SAMPLEFORMAT_INT &&
                told.offset == -32768 && told.factor == 1)
                return;
            calibrate(layout, told, function == "0" && !offset.empty() && !factor.empty(), "ImageJ",
                      said_by_imagej("vunit"));
        }
        constexpr std::uint32_t metadata = 42112;
        if (const std::string gdal = gdal_text(metadata); !gdal.empty()) {
            Calibration told;
            const bool any = gdal_item(gdal, "scale", told.factor) | gdal_item(gdal, "offset", told.offset);
            if (any)
                calibrate(layout, told, layout.channels == 1 && !calibration_, "GDAL", "");
        }
    }

    /** Applies it. @param is_line nothing but a factor and an offset. */
    void calibrate(const Layout &layout, const Calibration &told, bool is_line, const std::string &by,
                   const std::string &unit) {
        if (!is_line || !std::isfinite(told.offset) || !std::isfinite(told.factor) || told.factor == 0 ||
            layout.colors > 0 || (layout.bits < 8 && layout.sample_format == SAMPLEFORMAT_UINT) ||
            layout.photometric == PHOTOMETRIC_MINISWHITE)
            fail(
                fmt::format("its numbers are calibrated by {} in a way that is not applied here. Save the values as "
                            "NPY, or the numbers as they are stored: tifffile.imwrite(new_path, tifffile.imread(path))",
                            by));
        if (told.offset == 0 && told.factor == 1)
            return;
        calibration_ = told;
        const bool is_signed = told.offset == -32768 && told.factor == 1 && info_.full_scale == 65535;
        info_.full_scale = 0;
        info_.sample = is_signed ? "int16" : "float32";
        info_.warnings.push_back(
            fmt::format("its numbers are calibrated by {} and were taken so: {:g} + {:g} times the "
                        "number that is stored{}",
                        by, told.offset, told.factor, unit.empty() ? "" : fmt::format(", in {}", unit.substr(0, 40))));
    }

    /** XMP; empty: it has none. */
    std::string xmp() const {
        std::uint32_t size = 0;
        const char *packet = nullptr;
        return TIFFGetField(tiff_.get(), TIFFTAG_XMLPACKET, &size, &packet) && packet ? std::string(packet, size) : "";
    }

    /** A number that stands for none. 0 is no light and no surface anyhow, and NaN is told where it matters. */
    void warn_of_missing() {
        constexpr std::uint32_t tag = 42113;
        const std::string missing = gdal_text(tag);
        if (const double number = std::strtod(missing.c_str(), nullptr); number != 0 && std::isfinite(number))
            info_.warnings.push_back(fmt::format("it says that pixels of {0:.9g} have no value (tag GDAL_NODATA); they "
                                                 "are taken as numbers. If there are some, save "
                                                 "numpy.where(image == {0:.9g}, 0, image)",
                                                 number));
    }

    /** GDAL's text of a tag; empty: it has none. libtiff knows such tags by their numbers only. */
    std::string gdal_text(std::uint32_t tag) const {
        const TIFFField *known = TIFFFindField(tiff_.get(), tag, TIFF_ANY);
        if (!known || TIFFFieldDataType(known) != TIFF_ASCII || !TIFFFieldPassCount(known))
            return "";
        const char *text = nullptr;
        std::uint16_t count = 0;
        std::uint32_t large_count = 0;
        const bool found = TIFFFieldReadCount(known) == TIFF_VARIABLE2
                               ? TIFFGetField(tiff_.get(), tag, &large_count, &text) != 0
                               : TIFFGetField(tiff_.get(), tag, &count, &text) != 0;
        return found && text ? std::string(text, strnlen(text, large_count > 0 ? large_count : count)) : "";
    }

    /** The number of an item of that role. */
    static bool gdal_item(const std::string &text, const std::string &role, double &number) {
        const std::size_t at = text.find("role=\"" + role + "\"");
        const std::size_t begin = at == std::string::npos ? at : text.find('>', at);
        if (begin == std::string::npos)
            return false;
        number = std::strtod(text.c_str() + begin + 1, nullptr);
        return true;
    }

    /** What ImageJ and tifffile write of a stack whose pages they do not list, and OME of one whose pages are listed:
     * a set of several files has the same words in each. */
    Stack told_stack(const Layout &layout) const {
        const char *text = nullptr;
        if (!TIFFGetField(tiff_.get(), TIFFTAG_IMAGEDESCRIPTION, &text) || !text)
            return {};
        const std::string description = text;
        // Writers that know no axes call every image a channel: of more than colors have, they are frames.
        const auto taken = [](std::uint64_t images, std::uint64_t channels, const char *by) {
            return Stack{images, channels == images && channels > 4 ? 1 : channels, by};
        };
        if (description.find("<OME") != std::string::npos) {
            std::uint64_t images = 1;
            const auto size = [&](const std::string &key) {
                std::size_t at = description.find(key + "=");
                while (at != std::string::npos && !std::isspace(static_cast<unsigned char>(description[at - 1])))
                    at = description.find(key + "=", at + 1);
                // Behind the key come "=" and a quotation mark of either kind.
                const std::uint64_t value = at == std::string::npos || at + key.size() + 2 > description.size()
                                                ? 1
                                                : std::strtoull(description.c_str() + at + key.size() + 2, nullptr, 10);
                images *= std::clamp<std::uint64_t>(value, 1, max_frames);
                return value;
            };
            const std::uint64_t channels = size("SizeC") / layout.channels;
            (void)size("SizeZ");
            (void)size("SizeT");
            if (images / layout.channels == pages_.size())
                return taken(images / layout.channels, std::max<std::uint64_t>(1, channels), "OME");
        }
        if (description.rfind("ImageJ=", 0) == 0) {
            const auto number = [&](const char *key) {
                return std::strtoull(said_by_imagej(key).c_str(), nullptr, 10);
            };
            const std::uint64_t images = number("images"), channels = std::max<std::uint64_t>(1, number("channels"));
            return taken(images, channels, "ImageJ");
        }
        const std::size_t shape = description.find("\"shape\": [");
        if (shape == std::string::npos)
            return {};
        std::uint64_t values = 1;
        std::vector<std::uint64_t> sides;
        for (const char *at = description.c_str() + shape + 9; *at == '[' || *at == ',';) {
            char *end = nullptr;
            sides.push_back(std::strtoull(at + 1, &end, 10));
            values *= sides.back();
            at = end;
        }
        const std::uint64_t images = values / (std::uint64_t{layout.width} * layout.height * layout.channels);
        // Pages that are listed are frames, unless a letter for each side says that channels take turns.
        const std::string axes_key = "\"axes\": \"";
        if (const std::size_t axes = description.find(axes_key); axes != std::string::npos && images == pages_.size()) {
            const std::size_t first = axes + axes_key.size(), channel = description.find_first_of("C\"", first);
            if (description.find('"', first) - first == sides.size() && description[channel] == 'C' &&
                channel - first + 2 < sides.size())
                return taken(images, std::max<std::uint64_t>(1, sides[channel - first]), "tifffile");
        }
        if (description.find("\"truncated\": true") == std::string::npos)
            return {};
        return {images, 1, "tifffile"};
    }

    /** Where tifffile reads the frames as its first side. */
    std::string saved_by_pages() const {
        std::string text = frames_first(false);
        text[0] = 'S';
        return text;
    }

    /** How an array is saved frame by frame. @param behind whether tifffile reads the frames as its last side. */
    std::string frames_first(bool behind) const {
        const std::string array = fmt::format("tifffile.imread(\"{}\")", path_);
        std::filesystem::path other = path_;
        other.replace_filename(other.stem().string() + "_frames.tif");
        return fmt::format("save tifffile.imwrite(\"{}\", {}, photometric=\"minisblack\") and take that file instead",
                           other.string(), behind ? fmt::format("numpy.moveaxis({}, -1, 0)", array) : array);
    }

    void find_stack(const ReadRequest &request, const Layout &layout) {
        const Stack stack = told_stack(layout);
        const bool hidden = pages_.size() == 1 && stack.images > 1;
        if (stack.channels > 1 && stack.images > 1 && !request.page)
            fail(fmt::format("its {} images are those of {} channels in turn, says {}. Name one of them behind the "
                             "file's name, for example {}:page=0, or save each channel's images as a file of their own",
                             stack.images, stack.channels, stack.said_by, path_));
        if (!hidden) {
            if (request.page && *request.page >= pages_.size())
                fail(fmt::format("has no page {}; its pages are: {}", *request.page, told_pages()));
            if (stack.images > 1 && stack.images != pages_.size())
                info_.warnings.push_back(fmt::format("it holds {} pages, though {} images says {}", pages_.size(),
                                                     stack.images, stack.said_by));
            return;
        }
        const std::uint64_t bytes = layout.row_bytes(std::size_t{layout.width} * layout.channels) * layout.height;
        const auto refuse = [&](const std::string &why) {
            fail(fmt::format("holds {} images says {}, but lists one, and {}. Save it again, or name the first image: "
                             "{}:page=0",
                             stack.images, stack.said_by, why, path_));
        };
        if (request.page && *request.page == 0)
            return;
        const std::uint64_t *offsets = nullptr, *sizes = nullptr;
        if (layout.tiled || layout.compression != COMPRESSION_NONE ||
            (layout.planar == PLANARCONFIG_SEPARATE && layout.channels > 1) ||
            !TIFFGetField(tiff_.get(), TIFFTAG_STRIPOFFSETS, &offsets) ||
            !TIFFGetField(tiff_.get(), TIFFTAG_STRIPBYTECOUNTS, &sizes))
            refuse("the others cannot be found, as it is not stored plainly");
        for (std::uint32_t i = 1; i < TIFFNumberOfStrips(tiff_.get()); ++i)
            if (offsets[i] != offsets[i - 1] + sizes[i - 1])
                refuse("the others cannot be found, as its strips do not follow each other");
        if (stack.images > max_frames || offsets[0] > file_size_ || stack.images > (file_size_ - offsets[0]) / bytes)
            refuse(fmt::format("{} bytes are there for {} each", file_size_ - std::min(file_size_, offsets[0]), bytes));
        if (request.page && *request.page >= stack.images)
            fail(fmt::format("has no page {}; its {} images are numbered from 0", *request.page, stack.images));
        stack_ = stack;
        stack_offset_ = offsets[0];
        stack_layout_ = layout;
        first_of_stack_ = request.page.value_or(0);
        info_.frame_count = request.page ? 1 : stack.images;
    }

    void read_of_stack(std::uint64_t image, const RowSink &sink) {
        const std::size_t sample_bytes = stack_layout_.bits / 8;
        const std::size_t samples = std::size_t{info_.width} * stack_layout_.channels;
        std::vector<unsigned char> bytes(stack_layout_.row_bytes(samples));
        std::vector<float> row(samples * stack_layout_.values());
        const bool swapped = TIFFIsByteSwapped(tiff_.get()) != 0;
        file_.seek(stack_offset_ + image * info_.height * bytes.size());
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            file_.read(bytes.data(), bytes.size());
            for (std::size_t i = 0; swapped && !stack_layout_.is_packed() && i < samples; ++i)
                std::reverse(bytes.data() + i * sample_bytes, bytes.data() + (i + 1) * sample_bytes);
            convert(stack_layout_, bytes.data(), samples, row.data(), stack_layout_.values());
            sink(row.data());
        }
    }

    template <typename T> T field(std::uint32_t tag, T fallback) const {
        T value = fallback;
        return TIFFGetFieldDefaulted(tiff_.get(), tag, &value) ? value : fallback;
    }

    /** A tag as the page's directory has it, the lower 16 bits: libtiff leaves out, or changes, what does not fit. */
    std::optional<std::uint16_t> stored_tag(std::uint16_t tag) {
        return stored_tag(tag, TIFFCurrentDirOffset(tiff_.get()));
    }
    std::optional<std::uint16_t> stored_tag(std::uint16_t tag, std::uint64_t directory) {
        const bool big = TIFFIsBigTIFF(tiff_.get()) != 0, swapped = TIFFIsByteSwapped(tiff_.get()) != 0;
        const auto word = [&](const unsigned char *bytes) {
            return static_cast<std::uint16_t>(swapped ? bytes[0] << 8 | bytes[1] : bytes[1] << 8 | bytes[0]);
        };
        // Directories of 65536 entries or more are none that libtiff takes.
        const std::size_t count_bytes = big ? 8 : 2, entry_bytes = big ? 20 : 12, value_at = big ? 12 : 8;
        unsigned char count[8];
        if (directory + count_bytes > file_size_)
            return std::nullopt;
        file_.seek(directory);
        file_.read(count, count_bytes);
        std::vector<unsigned char> entries(entry_bytes * word(big && swapped ? count + 6 : count));
        if (entries.size() > file_size_ - directory - count_bytes)
            return std::nullopt;
        file_.read(entries.data(), entries.size());
        for (std::size_t at = 0; at < entries.size(); at += entry_bytes)
            if (word(&entries[at]) == tag) {
                const std::uint16_t type = word(&entries[at + 2]);
                const std::size_t above = type == TIFF_LONG8  ? 6
                                          : type == TIFF_LONG ? 2
                                                              : 0; // words, the highest first
                return word(&entries[at + value_at + (swapped ? above : 0)]);
            }
        return std::nullopt;
    }

    bool exif_says_srgb() {
        constexpr std::uint16_t color_space = 0xa001, srgb_space = 1;
        std::uint64_t directory = 0;
        return TIFFGetField(tiff_.get(), TIFFTAG_EXIFIFD, &directory) && directory < file_size_ &&
               stored_tag(color_space, directory) == srgb_space;
    }

    Layout read_layout() {
        Layout layout;
        layout.width = field<std::uint32_t>(TIFFTAG_IMAGEWIDTH, 0);
        layout.height = field<std::uint32_t>(TIFFTAG_IMAGELENGTH, 0);
        check_size(layout.width, layout.height);
        layout.bits = field<std::uint16_t>(TIFFTAG_BITSPERSAMPLE, 1);
        layout.channels = field<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL, 1);
        layout.sample_format = field<std::uint16_t>(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
        layout.photometric = field<std::uint16_t>(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
        layout.planar = field<std::uint16_t>(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
        layout.compression = field<std::uint16_t>(TIFFTAG_COMPRESSION, COMPRESSION_NONE);
        layout.tiled = TIFFIsTiled(tiff_.get()) != 0;
        if (const auto depth = field<std::uint32_t>(TIFFTAG_IMAGEDEPTH, 1); depth > 1)
            fail(fmt::format("holds a volume of {} images in one page (tag ImageDepth). {}", depth, saved_by_pages()));
        if (!TIFFIsCODECConfigured(layout.compression))
            fail(fmt::format("its compression (number {}) is not read; save it without, or with deflate or LZW",
                             layout.compression));
        if (layout.sample_format == SAMPLEFORMAT_VOID)
            layout.sample_format = SAMPLEFORMAT_UINT;
        const bool real = layout.sample_format == SAMPLEFORMAT_IEEEFP;
        const bool known = real ? layout.bits == 16 || layout.bits == 32 || layout.bits == 64
                           : layout.sample_format == SAMPLEFORMAT_INT
                               ? layout.bits == 8 || layout.bits == 16 || layout.bits == 32
                               : layout.sample_format == SAMPLEFORMAT_UINT &&
                                     ((layout.bits >= 1 && layout.bits <= 16) || layout.bits == 32);
        if (!known) {
            const char *kind = layout.sample_format == SAMPLEFORMAT_UINT  ? "unsigned"
                               : layout.sample_format == SAMPLEFORMAT_INT ? "signed"
                               : real                                     ? "floating-point"
                                                                          : "complex or unknown";
            const bool is_complex =
                layout.sample_format == SAMPLEFORMAT_COMPLEXIEEEFP || layout.sample_format == SAMPLEFORMAT_COMPLEXINT;
            fail(fmt::format("its samples are {} of {} bits; unsigned of 1 to 16 and 32, signed of 8, 16 and 32, and "
                             "floating-point of 16, 32 and 64 are taken. Save {}",
                             kind, layout.bits,
                             is_complex ? "numpy.abs(image).astype(numpy.float32)" : "it as one of those, or as NPY"));
        }
        std::uint16_t extra_count = 0;
        std::uint16_t *extra = nullptr;
        (void)TIFFGetFieldDefaulted(tiff_.get(), TIFFTAG_EXTRASAMPLES, &extra_count, &extra);
        const bool gray = layout.photometric == PHOTOMETRIC_MINISBLACK || layout.photometric == PHOTOMETRIC_MINISWHITE;
        // libtiff takes a palette without colors for gray.
        if (layout.photometric == PHOTOMETRIC_MINISBLACK && layout.channels == 1 && layout.bits >= 8 &&
            stored_tag(TIFFTAG_PHOTOMETRIC) == PHOTOMETRIC_PALETTE)
            fail("says that its numbers are those of a palette (photometric interpretation 3), and has no colors of "
                 "one (tag ColorMap), or is damaged there. If they are gray, save it as min-is-black, for example "
                 "tifffile.imwrite(new_path, image, photometric=\"minisblack\")");
        if (layout.photometric == PHOTOMETRIC_PALETTE)
            look_up_palette(layout);
        else if (layout.photometric == PHOTOMETRIC_CFA || layout.photometric == photometric_linear_raw)
            fail(fmt::format(
                "holds raw data of a camera (photometric interpretation {}). Save its codes as gray: "
                "tifffile.imwrite(new_path, image, photometric=\"minisblack\"); behind a color filter array, "
                "those of one color, image[0::2, 0::2]",
                layout.photometric));
        else if (!gray && layout.photometric != PHOTOMETRIC_RGB)
            fail(fmt::format("its color space (photometric interpretation {}) is not supported; gray, RGB and palettes "
                             "are: convert it to RGB",
                             layout.photometric));
        const unsigned colors = gray || layout.colors > 0 ? 1 : 3;
        if (layout.channels < colors || layout.channels > (colors == 1 ? 2 : 4))
            fail(fmt::format(
                "{} samples for each pixel of {} image are not supported; {} with or without opacity {}. "
                "Save each channel as an image of its own{}",
                layout.channels, colors == 1 ? "a gray" : "a color", colors, colors == 1 ? "is" : "are",
                colors > 1 ? "" : ". If they are frames, " + frames_first(layout.planar != PLANARCONFIG_SEPARATE)));
        layout.alpha = layout.channels == colors + 1;
        layout.is_opacity_told = extra_count > 0 && extra[0] != EXTRASAMPLE_UNSPECIFIED;
        if (layout.colors > 0 && layout.alpha)
            fail("has a palette and an opacity, which is not supported; convert it to RGB");
        if (layout.photometric == PHOTOMETRIC_MINISWHITE && layout.sample_format != SAMPLEFORMAT_UINT)
            fail("says that 0 is white, though its numbers have no top code to count from. Save it as min-is-black: "
                 "tifffile.imwrite(new_path, white - image, photometric=\"minisblack\"), where white is the number of "
                 "white; "
                 "image alone where the numbers are light already");
        return layout;
    }

    /** Of 16 bits for each color; gray where all colors are. */
    void look_up_palette(Layout &layout) const {
        std::uint16_t *red = nullptr, *green = nullptr, *blue = nullptr;
        if (layout.sample_format != SAMPLEFORMAT_UINT || layout.bits > 8 ||
            !TIFFGetField(tiff_.get(), TIFFTAG_COLORMAP, &red, &green, &blue))
            fail("has a palette of a kind that is not read; convert it to RGB");
        const std::size_t count = std::size_t{1} << layout.bits;
        std::uint16_t all = 0;
        for (const std::uint16_t *one : {red, green, blue})
            for (std::size_t i = 0; i < count; ++i)
                all |= one[i];
        // Some programs write colors of 8 bits as they are, or into the upper byte alone.
        const float factor = all < 256 ? 257.0f : (all & 255) == 0 ? 257.0f / 256.0f : 1.0f;
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t i = 0; i < count; ++i)
                layout.palette[c].push_back(factor * static_cast<float>((c == 0 ? red : c == 1 ? green : blue)[i]));
        layout.colors = layout.palette[0] == layout.palette[1] && layout.palette[0] == layout.palette[2] ? 1 : 3;
    }

    std::uint32_t tile_width(const Layout &) const {
        const auto width = field<std::uint32_t>(TIFFTAG_TILEWIDTH, 0);
        if (width == 0 || width > 2 * max_side)
            broken("is damaged: its tiles have no sensible width");
        return width;
    }
    std::uint32_t tile_height(const Layout &) const {
        const auto height = field<std::uint32_t>(TIFFTAG_TILELENGTH, 0);
        if (height == 0 || height > 2 * max_side)
            broken("is damaged: its tiles have no sensible height");
        return height;
    }
    std::uint32_t strip_height(const Layout &layout) const {
        return std::min(std::max<std::uint32_t>(1, field<std::uint32_t>(TIFFTAG_ROWSPERSTRIP, layout.height)),
                        layout.height);
    }

    /** Strips are tiles as wide as the image: both are read band by band. */
    void read_bands(const Layout &layout, const RowSink &sink, std::uint32_t block_width, std::uint32_t block_height,
                    std::uint64_t block_bytes) {
        const bool separate = layout.planar == PLANARCONFIG_SEPARATE && layout.channels > 1;
        const std::size_t block_channels = separate ? 1 : layout.channels, values = layout.values();
        const std::size_t block_row_bytes = layout.row_bytes(std::size_t{block_width} * block_channels);
        // What a strip or tile has beyond the image is read in vain.
        const std::uint64_t image_bytes = layout.row_bytes(std::size_t{layout.width} * layout.channels) * layout.height;
        if (block_bytes < block_row_bytes * block_height || block_bytes > image_bytes + most_padding_bytes)
            broken(fmt::format("is damaged: its strips or tiles have no sensible size ({} bytes of an image of {})",
                               block_bytes, image_bytes));
        // Far above what any of the compressions reaches; it keeps a damaged header from taking gigabytes.
        const std::uint64_t ratio = layout.compression == COMPRESSION_NONE ? 1 : 100000;
        if (block_bytes / ratio > file_size_)
            broken("is truncated or damaged: its strips or tiles are larger than the file");
        std::vector<unsigned char> block(static_cast<std::size_t>(block_bytes));
        const std::size_t row_samples = std::size_t{layout.width} * info_.channels;
        std::vector<float> band;
        for (std::uint32_t y0 = 0; y0 < layout.height; y0 += block_height) {
            const std::uint32_t rows = std::min(block_height, layout.height - y0);
            if (!layout.tiled && !separate) {
                band.resize(row_samples);
                read_block(layout, block, 0, y0, 0, block_row_bytes * rows);
                for (std::uint32_t y = 0; y < rows; ++y) {
                    convert(layout, block.data() + y * block_row_bytes, row_samples / values, band.data(), values);
                    sink(band.data());
                }
                continue;
            }
            band.resize(row_samples * rows);
            for (std::uint16_t plane = 0; plane < (separate ? layout.channels : 1); ++plane) {
                for (std::uint32_t x0 = 0; x0 < layout.width; x0 += block_width) {
                    read_block(layout, block, x0, y0, plane, block_row_bytes * (layout.tiled ? block_height : rows));
                    const std::uint32_t columns = std::min(block_width, layout.width - x0);
                    for (std::uint32_t y = 0; y < rows; ++y)
                        convert(layout, block.data() + y * block_row_bytes, columns * block_channels,
                                band.data() + y * row_samples + std::size_t{x0} * info_.channels + plane,
                                separate ? layout.channels : values);
                }
            }
            for (std::uint32_t y = 0; y < rows; ++y)
                sink(band.data() + y * row_samples);
        }
    }

    void read_block(const Layout &layout, std::vector<unsigned char> &block, std::uint32_t x, std::uint32_t y,
                    std::uint16_t plane, std::size_t needed) {
        TIFF *tiff = tiff_.get();
        const auto size = static_cast<tmsize_t>(block.size());
        tmsize_t got;
        if (layout.tiled)
            got = TIFFReadEncodedTile(tiff, TIFFComputeTile(tiff, x, y, 0, plane), block.data(), size);
        else
            got = TIFFReadEncodedStrip(tiff, TIFFComputeStrip(tiff, y, plane), block.data(), size);
        // An error that libtiff goes on after leaves pixels of chance behind.
        if (got < 0 || static_cast<std::size_t>(got) < needed || !messages_.first_error.empty())
            broken(fmt::format("is truncated or damaged near row {}", y));
    }

    /** Samples of one row. @param stride from value to value. */
    void convert(const Layout &layout, const unsigned char *bytes, std::size_t count, float *to,
                 std::size_t stride) const {
        for (std::size_t i = 0; i < count; ++i, to += stride) {
            const float value = layout.is_packed() ? static_cast<float>(packed(bytes, i, layout.bits))
                                                   : whole(layout, bytes + i * (layout.bits / 8));
            if (layout.colors > 0) {
                for (std::uint16_t c = 0; c < layout.colors; ++c)
                    to[c] = layout.palette[c][static_cast<std::size_t>(value)];
                continue;
            }
            *to = layout.photometric != PHOTOMETRIC_MINISWHITE ? value
                  : layout.bits == 32                          ? static_cast<float>(4294967295.0 - value)
                                                               : static_cast<float>((1 << layout.bits) - 1) - value;
            if (calibration_)
                *to = (*calibration_)(*to);
            if (layout.bits < 8)
                *to *= 255.0f / static_cast<float>((1 << layout.bits) - 1);
        }
    }

    /** Of samples that lie bit by bit, the highest first. */
    static std::uint32_t packed(const unsigned char *bytes, std::size_t i, unsigned bits) {
        std::uint32_t value = 0;
        for (std::size_t bit = i * bits; bit < (i + 1) * bits; ++bit)
            value = value << 1 | (bytes[bit / 8] >> (7 - bit % 8) & 1u);
        return value;
    }

    static float whole(const Layout &layout, const unsigned char *bytes) {
        if (layout.sample_format == SAMPLEFORMAT_IEEEFP)
            return layout.bits == 16   ? detail::half_to_float(bytes)
                   : layout.bits == 32 ? detail::to_float<float>(bytes)
                                       : detail::to_float<double>(bytes);
        if (layout.sample_format == SAMPLEFORMAT_INT)
            return layout.bits == 8    ? detail::to_float<std::int8_t>(bytes)
                   : layout.bits == 16 ? detail::to_float<std::int16_t>(bytes)
                                       : detail::to_float<std::int32_t>(bytes);
        return layout.bits == 8    ? static_cast<float>(*bytes)
               : layout.bits == 16 ? detail::to_float<std::uint16_t>(bytes)
                                   : detail::to_float<std::uint32_t>(bytes);
    }

    detail::InputFile file_;
    std::uint64_t file_size_ = 0;
    Messages messages_;
    Tiff tiff_;
    std::vector<Page> pages_;
    std::vector<Page> frames_;
    unsigned bits_ = 0;
    bool is_last_unexplained_ = false; ///< Of the samples.
    std::optional<Calibration> calibration_;
    Stack stack_; ///< None: images is 0.
    Layout stack_layout_;
    std::uint64_t stack_offset_ = 0;
    std::uint64_t first_of_stack_ = 0;
};

class TiffWriter final : public Writer {
  public:
    TiffWriter(const std::string &path, const WriteRequest &request) : Writer(path), path_(path), request_(request) {
        file_.close();
    }

    void append(const void *samples) override {
        const std::uint32_t width = request_.width, height = request_.height;
        const auto bits = static_cast<std::uint16_t>(8 * size_of(request_.sample));
        Messages messages;
        const Tiff tiff = open_tiff_file(file_.temporary_path(), "w", messages);
        const auto fail = [&]() {
            const int code = errno;
            throw WriteError(path_,
                             fmt::format("cannot be written: {}",
                                         messages.first_error.empty() ? std::strerror(code) : messages.first_error));
        };
        if (!tiff)
            fail();
        const std::uint32_t rows = std::max<std::uint32_t>(1, std::min(height, 65536 / (width * bits / 8) + 1));
        TIFFSetField(tiff.get(), TIFFTAG_IMAGEWIDTH, width);
        TIFFSetField(tiff.get(), TIFFTAG_IMAGELENGTH, height);
        TIFFSetField(tiff.get(), TIFFTAG_BITSPERSAMPLE, bits);
        TIFFSetField(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, 1);
        TIFFSetField(tiff.get(), TIFFTAG_SAMPLEFORMAT, bits == 32 ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
        TIFFSetField(tiff.get(), TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
        TIFFSetField(tiff.get(), TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
        TIFFSetField(tiff.get(), TIFFTAG_ROWSPERSTRIP, rows);
        TIFFSetField(tiff.get(), TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
        // The predictor for floating point is one that many readers lack.
        TIFFSetField(tiff.get(), TIFFTAG_PREDICTOR, bits == 32 ? PREDICTOR_NONE : PREDICTOR_HORIZONTAL);
        TIFFSetField(tiff.get(), TIFFTAG_ZIPQUALITY, 3);
        const std::size_t row_bytes = std::size_t{width} * (bits / 8);
        // The predictor works in place.
        std::vector<unsigned char> strip;
        const auto *bytes = static_cast<const unsigned char *>(samples);
        for (std::uint32_t y = 0, index = 0; y < height; y += rows, ++index) {
            const std::size_t size = row_bytes * std::min(rows, height - y);
            strip.assign(bytes + y * row_bytes, bytes + y * row_bytes + size);
            if (TIFFWriteEncodedStrip(tiff.get(), index, strip.data(), static_cast<tmsize_t>(size)) < 0)
                fail();
        }
        // TIFFClose has no result: what it would write is written here.
        if (!TIFFFlush(tiff.get()) || !messages.first_error.empty())
            fail();
    }

  private:
    std::string path_;
    WriteRequest request_;
};

} // namespace

Format tiff() {
    Format format;
    format.name = "TIFF";
    format.place = 2;
    format.extensions = {".tiff", ".tif"};
    format.magic = {{"II\x2a\0", 4}, {"MM\0\x2a", 4}, {"II\x2b\0", 4}, {"MM\0\x2b", 4}};
    format.samples = "8/16/float";
    format.stacks = "TIFF with pages";
    format.real = true;
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &request) -> std::unique_ptr<Reader> {
        return std::make_unique<TiffReader>(path, request);
    };
    format.create = [](const std::string &path, const WriteRequest &request) -> std::unique_ptr<Writer> {
        return std::make_unique<TiffWriter>(path, request);
    };
    format.writes = {Sample::uint16, Sample::float32};
    format.storage = {{"tiff16", Sample::uint16}, {"float-tiff", Sample::float32}};
    return format;
}

} // namespace image_io::format_files
