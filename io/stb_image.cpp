#include "io/stb_image.hpp"

#include <fmt/format.h>

#include <new>

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_BMP
#define STBI_ONLY_TGA
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_NO_HDR
#define STBI_MAX_DIMENSIONS 16384
#include <stb/stb_image.h>

namespace image_io {

namespace {

/** What stb_image reads from; it fills up with zeros behind the end and says nothing. */
struct Source {
    std::FILE *stream;
    bool past_end = false;
};

int read(void *user, char *data, int size) {
    auto *source = static_cast<Source *>(user);
    const std::size_t got = std::fread(data, 1, static_cast<std::size_t>(size), source->stream);
    source->past_end |= got == 0;
    return static_cast<int>(got);
}

void skip(void *user, int size) {
    auto *source = static_cast<Source *>(user);
    source->past_end |= ::fseeko(source->stream, size, SEEK_CUR) != 0;
}

int eof(void *user) {
    return static_cast<Source *>(user)->past_end ? 1 : 0;
}

} // namespace

StbPixels decode_by_stb(detail::InputFile &file, const Info &info) {
    file.seek(0);
    Source source{file.stream()};
    const stbi_io_callbacks callbacks = {read, skip, eof};
    int width = 0, height = 0, channels = 0;
    StbPixels pixels(stbi_load_from_callbacks(&callbacks, &source, &width, &height, &channels, 0), stbi_image_free);
    if (source.past_end)
        throw ReadError(file.path(), "is truncated: it ends before its last pixel; write or copy it again");
    if (!pixels)
        throw ReadError(file.path(), fmt::format("is damaged or of a kind that is not read ({}); write it again, or "
                                                 "convert it to PNG",
                                                 stbi_failure_reason()));
    if (width != static_cast<int>(info.width) || height != static_cast<int>(info.height) ||
        channels != static_cast<int>(info.channels))
        throw ReadError(file.path(), fmt::format("is damaged: its header says {} x {} pixels of {} channels, decoded "
                                                 "are {} x {} of {}",
                                                 info.width, info.height, info.channels, width, height, channels));
    return pixels;
}

} // namespace image_io
