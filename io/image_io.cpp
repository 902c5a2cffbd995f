#include "image_io.hpp"

#include "io/byte_order.hpp"

#include <fmt/format.h>

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <iterator>

namespace image_io {

namespace {

std::string error_text(int code) {
    return std::strerror(code);
}

/** How a file's numbers become light; says so where that changes them. */
Transfer decoding(const Reader &reader, Encoding encoding, std::vector<std::string> &warnings) {
    const Transfer &told = reader.info().transfer;
    if (encoding == Encoding::srgb)
        return srgb("");
    if (encoding != Encoding::automatic || told.curve == Transfer::Curve::linear)
        return {};
    if (told.curve == Transfer::Curve::unknown) {
        throw ReadError(reader.path(), fmt::format("{} has {}, so that it cannot be told what its numbers mean as "
                                                   "light. --transfer linear takes them as they are, --transfer srgb "
                                                   "decodes them as sRGB",
                                                   told.said_by, told.name()));
    }
    warnings.push_back(fmt::format("{}: its numbers are encoded for a screen ({}, says {}) and were decoded to linear "
                                   "light; --transfer linear takes them as they are",
                                   reader.path(), told.name(), told.said_by));
    return told;
}

/** Decodes what a file stores. */
class Decoder {
  public:
    Decoder(const Transfer &transfer, double full_scale) : transfer_(transfer), top_(full_scale > 0 ? full_scale : 1) {
        // Of codes there are few, and a curve takes long.
        if (transfer.curve != Transfer::Curve::linear && full_scale > 0 && full_scale <= 65535)
            for (double code = 0; code <= full_scale; ++code)
                table_.push_back(top_ * transfer.to_light(code / top_));
    }
    double operator()(float value) const {
        if (transfer_.curve == Transfer::Curve::linear)
            return value;
        if (value >= 0 && value < static_cast<float>(table_.size()) && value == std::floor(value))
            return table_[static_cast<std::size_t>(value)];
        return top_ * transfer_.to_light(value / top_);
    }

  private:
    Transfer transfer_;
    double top_;
    std::vector<double> table_;
};

} // namespace

void check_work(const std::string &path, std::uint64_t samples, const std::string &size) {
    std::error_code code;
    const std::uint64_t bytes = std::filesystem::file_size(path, code);
    if (code || samples <= free_samples || samples / samples_per_byte <= bytes)
        return;
    throw ReadError(path, fmt::format("holds {} in {} bytes: more than {} million samples must take a byte for {} of "
                                      "them, so that no small file keeps the program busy. If it is meant, store it "
                                      "uncompressed, for example as NPY",
                                      size, bytes, free_samples / 1000000, samples_per_byte));
}

void Reader::opened_as(const Format &format) {
    info_.format = &format;
    check_work(path_, std::uint64_t{info_.width} * info_.height * info_.channels * info_.frame_count,
               fmt::format("{} image{} of {} x {} pixels and {} channel{}", info_.frame_count,
                           info_.frame_count == 1 ? "" : "s", info_.width, info_.height, info_.channels,
                           info_.channels == 1 ? "" : "s"));
    warn_of_surplus(info_.surplus_bytes);
}

void Reader::warn_of_surplus(std::uint64_t bytes) {
    const bool one = bytes == 1;
    if (bytes > 0)
        info_.warnings.push_back(fmt::format("{} byte{} follow{} the last image and {} not read; was another one, or "
                                             "something else, appended?",
                                             bytes, one ? "" : "s", one ? "s" : "", one ? "is" : "are"));
}

void Reader::warn_of_orientation(unsigned orientation) {
    if (orientation < 2 || orientation > 8)
        return;
    constexpr const char *ways[] = {"mirrored from left to right",
                                    "turned by 180 degrees",
                                    "mirrored from top to bottom",
                                    "transposed",
                                    "turned clockwise",
                                    "transposed across",
                                    "turned counterclockwise"};
    const std::string warning =
        fmt::format("it says that it shall be {} to be seen (orientation {}); the pixels are taken as "
                    "stored. Turn them and save them without that word if that is wrong",
                    ways[orientation - 2], orientation);
    // Some programs write it as EXIF and as XMP.
    if (std::find(info_.warnings.begin(), info_.warnings.end(), warning) == info_.warnings.end())
        info_.warnings.push_back(warning);
}

void Reader::warn_of_aspect(double aspect) {
    if (aspect > 0 && std::isfinite(aspect) && std::abs(aspect - 1) > 0.01)
        info_.warnings.push_back(
            fmt::format("it says that its pixels are {:.3g} times as wide as high; they are taken as square", aspect));
}

void Reader::warn_of_exif(const unsigned char *data, std::size_t size_bytes, const std::string &where) {
    if (const auto orientation = detail::orientation_of_exif(data, size_bytes))
        warn_of_orientation(*orientation);
    else
        info_.warnings.push_back(fmt::format("{} cannot be read (damaged or cut) and is ignored: whether the image is "
                                             "to be turned is not known",
                                             where));
}

void Reader::warn_of_xmp(std::string_view packet) {
    warn_of_orientation(detail::orientation_of_xmp(packet));
}

void Reader::check_size(std::uint64_t width, std::uint64_t height) const {
    if (width == 0 || height == 0)
        fail(fmt::format("the image is empty ({} x {} pixels)", width, height));
    if (width > max_side || height > max_side)
        fail(fmt::format("the image has {} x {} pixels; at most {} x {} are taken", width, height, max_side, max_side));
}

std::string ChannelFile::name_of(const std::string &channel) const {
    if (std::find(channels_.begin(), channels_.end(), channel) != channels_.end())
        return channel;
    const auto found = std::find(short_names_.begin(), short_names_.end(), channel);
    if (found == short_names_.end() || std::find(found + 1, short_names_.end(), channel) != short_names_.end())
        return "";
    return channels_[static_cast<std::size_t>(found - short_names_.begin())];
}

std::string told_soft(const std::vector<float> &mask) {
    std::vector<float> values;
    std::copy_if(mask.begin(), mask.end(), std::back_inserter(values), [](float m) { return m != 0; });
    if (std::adjacent_find(values.begin(), values.end(), std::not_equal_to<>()) == values.end())
        return "";
    const auto [least_at, most_at] = std::minmax_element(values.begin(), values.end());
    const float least = *least_at, most = *most_at;
    const auto soft = std::count_if(values.begin(), values.end(), [most = most](float m) { return m != most; });
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());
    return fmt::format("the mask has {} values beside 0, {} to {}, as of a soft edge: all count ({} pixels are neither "
                       "0 nor {}); if they are not to, make it of two values, "
                       "numpy.where(mask > {}, 255, 0).astype(numpy.uint8)",
                       values.size(), least, most, soft, most, least + (most - least) / 2);
}

void Plane::normalize() {
    if (full_scale <= 0)
        return;
    for (float &value : values)
        value = static_cast<float>(value / full_scale);
    full_scale = 0;
}

Plane read_gray(Reader &reader, std::uint64_t frame, std::vector<std::string> &warnings, Colors differing,
                Encoding encoding) {
    const Info &info = reader.info();
    std::size_t told = 0;
    const auto tell = [&] {
        for (; told < info.warnings.size(); ++told)
            warnings.push_back(reader.path() + ": " + info.warnings[told]);
    };
    tell();
    const std::uint32_t colors = info.channels - (info.alpha ? 1 : 0);
    Plane plane;
    plane.width = info.width;
    plane.height = info.height;
    plane.full_scale = info.full_scale;
    plane.sample = info.sample;
    plane.significant_bits = info.significant_bits;
    plane.white_is_zero = info.white_is_zero;
    plane.full_scale_given = info.full_scale_given;
    const std::size_t row_values = info.width;
    plane.values.reserve(row_values * info.height);
    const double opaque = info.full_scale > 0 ? info.full_scale : 1.0;
    const Decoder light(decoding(reader, encoding, warnings), info.full_scale);
    bool colored = false;
    bool transparent = false;
    // Whatever the format is; some look at their words when they are opened.
    constexpr std::size_t most_looked_at = 65536;
    const bool words = info.sample == "uint16" && info.looks_swapped.empty() && !info.white_is_zero;
    const std::size_t row_step = 1 + row_values * info.height / most_looked_at;
    detail::WholeNumbers whole(2);
    reader.read_rows(frame, [&](const float *row) {
        const std::size_t start = plane.values.size();
        if (words && start / row_values % row_step == 0)
            for (std::size_t x = 0; x < row_values; ++x)
                whole.add(static_cast<std::uint16_t>(row[x * info.channels]));
        plane.values.resize(start + row_values);
        float *out = plane.values.data() + start;
        for (std::size_t x = 0; x < row_values; ++x, row += info.channels) {
            // Exact for equal values: 3 v fits into a double.
            double sum = light(row[0]);
            for (std::uint32_t c = 1; c < colors; ++c) {
                sum += light(row[c]);
                colored |= row[c] != row[0] && !(std::isnan(row[c]) && std::isnan(row[0]));
            }
            transparent |= info.alpha && row[colors] != opaque;
            out[x] = static_cast<float>(sum / colors);
        }
    });
    tell(); // some readers know what follows the image only now
    if (const unsigned bits = whole.bits_if_swapped(); bits > 0)
        warnings.push_back(
            fmt::format("{}: its words {}. If so, save array.byteswap()", reader.path(), detail::told_swapped(bits)));
    if (colored && differing == Colors::refused)
        throw ReadError(
            reader.path(),
            fmt::format("its {} color channels differ, one number for each pixel is needed; name the channel "
                        "behind the file's name: {}:R",
                        colors, reader.path()));
    if (colored)
        warnings.push_back(fmt::format("{}: the {} color channels differ; their mean is taken (luminance weights mean "
                                       "nothing in the infrared)",
                                       reader.path(), colors));
    if (transparent)
        warnings.push_back(reader.path() + ": the opacity channel is ignored");
    return plane;
}

VectorPlane read_vectors(Reader &reader, std::uint64_t frame, bool whole_numbers) {
    const Info &info = reader.info();
    const bool fits = info.channels == 3 || (info.channels == 4 && info.alpha);
    if (!fits)
        throw ReadError(reader.path(),
                        fmt::format("three values per pixel (x, y, z) are needed, the file has {}; an NPY "
                                    "array is height x width x 3, or frames x height x width x 3{}",
                                    info.channels,
                                    info.channels == 1 && info.frame_count == 3
                                        ? ". Of one of 3 x height x width save numpy.moveaxis(array, 0, -1)"
                                        : ""));
    if (info.full_scale > 0 && !whole_numbers)
        throw ReadError(reader.path(),
                        fmt::format("normals must be floating-point, not {}. Of normals as colors, 0 to {} "
                                    "for -1 to 1, save (normals * (2 / {}) - 1).astype(numpy.float32)",
                                    info.sample, info.full_scale, info.full_scale));
    VectorPlane plane;
    plane.width = info.width;
    plane.height = info.height;
    const std::size_t row_values = std::size_t{3} * info.width;
    plane.values.reserve(row_values * info.height);
    reader.read_rows(frame, [&](const float *row) {
        for (std::uint32_t x = 0; x < info.width; ++x, row += info.channels)
            plane.values.insert(plane.values.end(), row, row + 3);
    });
    return plane;
}

namespace detail {

std::optional<unsigned> orientation_of_exif(const unsigned char *data, std::size_t size_bytes) {
    const bool big = size_bytes >= 4 && std::memcmp(data, "MM\0*", 4) == 0;
    if (size_bytes < 8 || (!big && std::memcmp(data, "II*\0", 4) != 0))
        return std::nullopt;
    const auto word = [&](std::size_t at) -> std::size_t {
        return at + 2 > size_bytes ? 0 : big ? data[at] << 8 | data[at + 1] : data[at + 1] << 8 | data[at];
    };
    const std::size_t directory = big ? word(4) << 16 | word(6) : word(6) << 16 | word(4);
    if (directory + 2 > size_bytes)
        return std::nullopt;
    for (std::size_t i = 0; i < word(directory) && directory + 2 + 12 * (i + 1) <= size_bytes; ++i)
        if (const std::size_t entry = directory + 2 + 12 * i; word(entry) == 0x0112)
            return static_cast<unsigned>(word(entry + 8));
    return 0;
}

unsigned orientation_of_xmp(std::string_view packet) {
    // An attribute, tiff:Orientation="6", or an element, <tiff:Orientation>6</tiff:Orientation>.
    constexpr std::string_view name = "tiff:Orientation";
    const std::size_t named = packet.find(name);
    if (named == std::string_view::npos)
        return 0;
    const std::size_t at = packet.find_first_not_of(" \t\r\n=>\"'", named + name.size());
    const auto is_digit = [&](std::size_t i) { return i < packet.size() && packet[i] >= '0' && packet[i] <= '9'; };
    return is_digit(at) && !is_digit(at + 1) ? static_cast<unsigned>(packet[at] - '0') : 0;
}

InputFile::InputFile(const std::string &path) : path_(path) {
    if (path.empty())
        throw ReadError("\"\"", "is no name of a file");
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0)
        throw ReadError(path, "cannot be read: " + error_text(errno));
    if (S_ISDIR(status.st_mode))
        throw ReadError(path, "is a folder, an image file is needed here");
    // Pipes and devices have no size to check a header against.
    if (!S_ISREG(status.st_mode))
        throw ReadError(path, "is not a regular file");
    if (status.st_size == 0)
        throw ReadError(path, "is empty (0 bytes); write or copy it again");
    stream_ = std::fopen(path.c_str(), "rb");
    if (!stream_)
        throw ReadError(path, "cannot be read: " + error_text(errno));
    size_ = static_cast<std::uint64_t>(status.st_size);
}

InputFile::~InputFile() {
    if (stream_)
        std::fclose(stream_);
}

void InputFile::seek(std::uint64_t offset) {
    if (::fseeko(stream_, static_cast<off_t>(offset), SEEK_SET) != 0)
        throw ReadError(path_, "cannot be read: " + error_text(errno));
}

void InputFile::read(void *data, std::size_t size_bytes) {
    if (std::fread(data, 1, size_bytes, stream_) == size_bytes)
        return;
    if (std::ferror(stream_))
        throw ReadError(path_, "cannot be read: " + error_text(errno));
    throw ReadError(path_,
                    fmt::format("is truncated: it ends at byte {} within its data; write or copy it again", size_));
}

} // namespace detail
} // namespace image_io
