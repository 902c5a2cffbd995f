#include "io/formats.hpp"

#include "io/channels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <stdexcept>

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

/** The format that the content tells; null: of none. */
const Format *recognized(const std::string &path) {
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

} // namespace

const std::list<Format> &formats() {
    return registry();
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

ImageName split_name(const std::string &name) {
    std::error_code ignored;
    if (std::filesystem::exists(name, ignored))
        return {name, ""};
    for (std::size_t colon = name.rfind(':'); colon != std::string::npos && colon > 0;
         colon = name.rfind(':', colon - 1))
        if (const std::string path = name.substr(0, colon); std::filesystem::is_regular_file(path, ignored))
            return {path, name.substr(colon + 1)};
    return {name, ""};
}

namespace {

/** Takes page=N out of the channel's name. */
void take_page(const std::string &path, ReadRequest &request) {
    const std::string key = "page=", text = request.channel;
    if (text.rfind(key, 0) != 0)
        return;
    const char *first = text.data() + key.size(), *end = text.data() + text.size();
    std::uint64_t page = 0;
    const auto result = std::from_chars(first, end, page);
    if (result.ec != std::errc() || (result.ptr != end && *result.ptr != ','))
        throw ReadError(path, fmt::format("\"{}\" names no page; the first one is page=0", text));
    request.page = page;
    request.channel = result.ptr == end ? "" : std::string(result.ptr + 1, end);
}

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
    take_page(path, request);
    const Format *format = request.raw ? &format_named("raw") : recognized(path);
    if (!format)
        throw ReadError(path, fmt::format("is not a {} file (the content decides, not the name); raw frames must be "
                                          "described: {} (--raw, or \"raw\" in capture.json)",
                                          listed("or"), raw_form));
    if (!format->open)
        throw ReadError(path, fmt::format("is an image of the format {}, which is not read here; {} are", format->name,
                                          listed("and", &Format::is_read)));
    auto reader = format->open(path, request);
    reader->opened_as(*format);
    if (request.page && !reader->info().one_page)
        reader = std::make_unique<OnePage>(std::move(reader), *request.page);
    if (!request.channel.empty() && !format->open_channels)
        reader = select_samples(std::move(reader), request);
    return reader;
}

std::unique_ptr<ChannelFile> open_channels(const std::string &path) {
    const Format *format = recognized(path);
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
