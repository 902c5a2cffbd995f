#include "io/formats.hpp"

#include "io/channels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string_view>

namespace image_io {

// One function for each file in io/formats; CMake writes the list.
namespace format_files {
#define CLSP_FORMAT(name) Format name();
#include "io/format_list.inc"
#undef CLSP_FORMAT
} // namespace format_files

namespace {

std::list<Format> &registry() {
    static std::list<Format> list = [] {
        std::list<Format> all;
#define CLSP_FORMAT(name) all.push_back(format_files::name());
#include "io/format_list.inc"
#undef CLSP_FORMAT
        all.sort([](const Format &a, const Format &b) { return a.place < b.place; });
        return all;
    }();
    return list;
}

} // namespace

const std::list<Format> &formats() {
    return registry();
}

const Format *format_of_content(const std::string &path) {
    detail::InputFile file(path);
    char bytes[64];
    const std::string start(bytes, std::fread(bytes, 1, sizeof bytes, file.stream()));
    if (start.empty())
        throw ReadError(path, "cannot be read");
    for (const Format &format : formats())
        for (const std::string &magic : format.magic)
            if (start.compare(0, magic.size(), magic) == 0)
                return &format;
    for (const Format &format : formats())
        if (format.recognizes && format.recognizes(file))
            return &format;
    return nullptr;
}

void add_format(Format format) {
    std::list<Format> &all = registry();
    all.remove_if([&](const Format &other) { return other.name == format.name; });
    all.insert(std::upper_bound(all.begin(), all.end(), format,
                                [](const Format &a, const Format &b) { return a.place < b.place; }),
               std::move(format));
}

const Format &format_named(const std::string &name) {
    for (const Format &format : formats())
        if (format.name == name)
            return format;
    throw std::logic_error("no image format is named " + name);
}

const Format *format_of_extension(const std::string &path) {
    std::string name = path.substr(path.find_last_of('/') + 1);
    for (char &c : name)
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const std::size_t dot = name.find_last_of('.');
    if (dot == std::string::npos || dot == 0)
        return nullptr;
    for (const Format &format : formats())
        if (std::count(format.extensions.begin(), format.extensions.end(), name.substr(dot)) > 0)
            return &format;
    return nullptr;
}

std::string listed(const char *word, const std::function<bool(const Format &)> &fits) {
    std::vector<std::string> names;
    for (const Format &format : formats())
        if (!fits || fits(format))
            names.push_back(format.name);
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i)
        text += (i == 0 ? "" : i + 1 < names.size() ? ", " : fmt::format(" {} ", word)) + names[i];
    return text;
}

ImageName split_name(const std::string &name, const std::function<bool(const std::string &)> &is_path) {
    std::error_code ignored;
    if (std::filesystem::exists(name, ignored))
        return {name, ""};
    for (std::size_t colon = name.rfind(':'); colon != std::string::npos && colon > 0;
         colon = name.rfind(':', colon - 1))
        if (const std::string path = name.substr(0, colon);
            is_path ? is_path(path) : std::filesystem::is_regular_file(path, ignored))
            return {path, name.substr(colon + 1)};
    return {name, ""};
}

std::string join_name(const ImageName &name) {
    return name.channel.empty() ? name.path : name.path + ":" + name.channel;
}

std::string page_name(const std::string &name, std::uint64_t page) {
    const auto [path, channel] = split_name(name);
    return fmt::format("{}:page={}{}{}", path, page, channel.empty() ? "" : ",", channel);
}

namespace {

/** Takes page=N and full_scale=N out of the channel's name. */
void take_settings(const std::string &path, ReadRequest &request) {
    const auto take = [&](const std::string &key, auto number, const char *otherwise) {
        const std::string text = request.channel;
        const std::string value = text.substr(0, text.find(','));
        if (value.rfind(key, 0) != 0)
            return false;
        const char *first = value.data() + key.size(), *end = value.data() + value.size();
        const auto result = std::from_chars(first, end, *number);
        if (result.ec != std::errc() || result.ptr != end)
            throw ReadError(path, fmt::format("\"{}\" {}", value, otherwise));
        request.channel = value.size() == text.size() ? "" : text.substr(value.size() + 1);
        return true;
    };
    std::uint64_t page = 0;
    double full_scale = 0;
    for (bool more = true; more;) {
        more = false;
        if (take("page=", &page, "names no page; the first one is page=0")) {
            request.page = page;
            more = true;
        }
        if (take("full_scale=", &full_scale, "is no number that means 1; of 10 bits it is full_scale=1023")) {
            if (!(full_scale > 0 && std::isfinite(full_scale)))
                throw ReadError(path, fmt::format("full_scale={} is no number above 0", full_scale));
            request.full_scale = full_scale;
            more = true;
        }
    }
    const bool light = request.role == Role::image || request.role == Role::albedo || request.role == Role::visibility;
    if (request.full_scale && !light)
        throw ReadError(path,
                        "full_scale=N is of light and parts of it; depths, normals, masks, materials, dark frames "
                        "and gains are the numbers that they are. For depths --depth-scale does it");
}

/** Another reader's images with another number that means 1. */
class FullScale final : public Reader {
  public:
    FullScale(std::unique_ptr<Reader> reader, double full_scale) : Reader(reader->path()), reader_(std::move(reader)) {
        info_ = reader_->info();
        info_.full_scale = full_scale;
        info_.full_scale_given = true;
    }
    void read_rows(std::uint64_t frame, const RowSink &sink) override { reader_->read_rows(frame, sink); }

  private:
    std::unique_ptr<Reader> reader_;
};

/** What files of other formats begin with, and how they become images that are read. */
struct Foreign {
    std::size_t at;
    std::string_view magic;
    const char *name;
    const char *advice;
};
using namespace std::string_view_literals;
constexpr const char *convert_it = "convert it to PNG, TIFF or NPY";
constexpr Foreign foreign_formats[] = {
    {0, "GIF8"sv, "GIF", convert_it},
    {8, "WEBP"sv, "WebP", convert_it},
    {4, "ftypavif"sv, "AVIF", convert_it},
    {4, "ftyphei"sv, "HEIF", convert_it},
    {4, "jP  "sv, "JPEG 2000", convert_it},
    {0, "\xff\x4f\xff\x51"sv, "JPEG 2000", convert_it},
    {0, "\xff\x0a"sv, "JPEG XL", convert_it},
    {4, "JXL "sv, "JPEG XL", convert_it},
    {0, "DDS "sv, "DDS", convert_it},
    {0, "8BPS"sv, "Photoshop", convert_it},
    {0, "Pf\n"sv, "PFM", convert_it},
    {0, "PF\n"sv, "PFM", convert_it},
    {0, "SIMPLE  ="sv, "FITS", convert_it},
    {0, "\x89HDF"sv, "HDF5", "save its array as NPY: numpy.save(\"image.npy\", array)"},
    {0, "MATLAB"sv, "MATLAB", "save its array as NPY: numpy.save(\"image.npy\", array)"},
    {0, "\x80\x02"sv, "pickle", "save its array as NPY: numpy.save(\"image.npy\", array)"},
    {0, "\x80\x03"sv, "pickle", "save its array as NPY: numpy.save(\"image.npy\", array)"},
    {0, "\x80\x04"sv, "pickle", "save its array as NPY: numpy.save(\"image.npy\", array)"},
    {0, "\x80\x05"sv, "pickle", "save its array as NPY: numpy.save(\"image.npy\", array)"},
    {0, "\x1f\x8b"sv, "gzip", "unpack it"},
    {0, "\xfd\x37zXZ"sv, "xz", "unpack it"},
    {0, "BZh"sv, "bzip2", "unpack it"},
    {0, "7z\xbc\xaf"sv, "7z", "unpack it"},
    {0, "\x28\xb5\x2f\xfd"sv, "Zstandard", "unpack it"},
    {4, "ftyp"sv, "MP4", "save its frames as PNG, TIFF or NPY"},
    {8, "AVI "sv, "AVI", "save its frames as PNG, TIFF or NPY"},
    {0, "\x1a\x45\xdf\xa3"sv, "Matroska", "save its frames as PNG, TIFF or NPY"},
    {0, "#ROSBAG"sv, "ROS bag", "save its frames as PNG, TIFF or NPY"},
    {0, "<!DOCTYPE"sv, "HTML", "a page came in place of the file: download it again"},
    {0, "<html"sv, "HTML", "a page came in place of the file: download it again"},
    {0, "version https://git-lfs"sv, "Git LFS (a pointer)", "get the file that it stands for: git lfs pull"},
};

} // namespace

std::string why_foreign(const std::string &path) {
    detail::InputFile file(path);
    char bytes[256];
    const std::string start(bytes, std::fread(bytes, 1, sizeof bytes, file.stream()));
    for (const Foreign &one : foreign_formats)
        if (start.size() > one.at && start.compare(one.at, one.magic.size(), one.magic) == 0)
            return fmt::format("is a file of the format {}, which is not read; {}", one.name, one.advice);
    const std::size_t delimiter = start.find_first_of(",;");
    if (start.find_first_of("0123456789") != std::string::npos &&
        start.find_first_not_of("0123456789+-.eE,; \t\r\n") == std::string::npos)
        return fmt::format("is a text of numbers; save its array as NPY: numpy.save(\"image.npy\", "
                           "numpy.loadtxt(\"{}\"{}))",
                           path,
                           delimiter == std::string::npos ? "" : fmt::format(", delimiter=\"{}\"", start[delimiter]));
    if (start.rfind("PK\x03\x04", 0) != 0 || start.size() <= 30)
        return "";
    // A local header: the name's length, then behind the header the name.
    const std::size_t length = static_cast<unsigned char>(start[26]);
    const std::string name = start.substr(30, length);
    if (const std::size_t dot = name.rfind(".npy"); dot != std::string::npos && dot + 4 == name.size())
        return fmt::format("is an NPZ archive of arrays; save one of them as NPY, for example "
                           "numpy.save(\"{0}.npy\", numpy.load(\"{1}\")[\"{0}\"])",
                           name.substr(0, dot), path);
    return "is a ZIP archive; unpack it";
}

namespace {

/** One frame of another reader. */
class OnePage final : public Reader {
  public:
    OnePage(std::unique_ptr<Reader> reader, std::uint64_t page)
        : Reader(reader->path()), reader_(std::move(reader)), page_(page) {
        info_ = reader_->info();
        if (page_ >= info_.frame_count)
            fail(fmt::format("has no page {}; its {} image{} numbered from 0", page_, info_.frame_count,
                             info_.frame_count == 1 ? " is" : "s are"));
        info_.frame_count = 1;
    }
    void read_rows(std::uint64_t, const RowSink &sink) override { reader_->read_rows(page_, sink); }

  private:
    std::unique_ptr<Reader> reader_;
    std::uint64_t page_;
};

} // namespace

std::unique_ptr<Reader> open(const std::string &name, const ReadRequest &wanted) {
    const auto [path, channel] = split_name(name);
    ReadRequest request = wanted;
    if (!channel.empty() && !wanted.channel.empty() && channel != wanted.channel)
        throw ReadError(path,
                        fmt::format("two channels are named, \"{}\" and \"{}\"; name one", channel, wanted.channel));
    if (!channel.empty())
        request.channel = channel;
    take_settings(path, request);
    const Format *format = request.raw ? &format_named("raw") : format_of_content(path);
    if (!format) {
        const std::string foreign = why_foreign(path);
        throw ReadError(path,
                        !foreign.empty()
                            ? foreign
                            : fmt::format("is not a {} file (the content decides, not the name); raw frames must be "
                                          "described: {} (--raw, or \"raw\" in capture.json)",
                                          listed("or"), raw_form));
    }
    if (!format->open)
        throw ReadError(path, fmt::format("is an image of the format {}, which is not read here; {} are", format->name,
                                          listed("and", &Format::is_read)));
    auto reader = format->open(path, request);
    reader->opened_as(*format);
    if (request.page && !reader->info().one_page)
        reader = std::make_unique<OnePage>(std::move(reader), *request.page);
    if (!request.channel.empty() && !format->open_channels)
        reader = select_samples(std::move(reader), request);
    if (request.full_scale)
        reader = std::make_unique<FullScale>(std::move(reader), *request.full_scale);
    return reader;
}

std::unique_ptr<Reader> open_one(const std::string &name, const ReadRequest &request) {
    auto reader = open(name, request);
    const Info &info = reader->info();
    if (info.frame_count == 1)
        return reader;
    std::string but; // an array may be meant otherwise
    for (const std::string &warning : info.warnings)
        but += ". But " + warning;
    throw ReadError(reader->path(),
                    fmt::format("holds {} images, one is needed; name it behind the file's name, for example {}{}",
                                info.frame_count, page_name(name, 0), but));
}

std::unique_ptr<ChannelFile> open_channels(const std::string &path) {
    const Format *format = format_of_content(path);
    if (!format || !format->open_channels)
        return nullptr;
    auto file = format->open_channels(path);
    const std::size_t channels = file->channels().size(); // unpacked together, whichever are wanted
    check_work(path, std::uint64_t{file->width()} * file->height() * channels,
               fmt::format("an image of {} x {} pixels and {} channels", file->width(), file->height(), channels));
    return file;
}

std::unique_ptr<Writer> create(const std::string &path, const Format &format, const WriteRequest &request) {
    if (!format.create || std::count(format.writes.begin(), format.writes.end(), request.sample) == 0)
        throw WriteError(path,
                         fmt::format("cannot be written: {} files are not written with such samples", format.name));
    return format.create(path, request);
}

} // namespace image_io
