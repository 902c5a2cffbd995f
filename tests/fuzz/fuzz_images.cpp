// Any bytes through one of the image readers: an image, or image_io::ReadError; nothing else, and no stray access.
//
// With libFuzzer: fuzz_images CORPUS... --format=PNG. Without it (replay.cpp): the files named are read once
// each. For raw frames the bytes begin with a line, their description.
#include "io/formats.hpp"
#include "io/openexr.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>

namespace {

std::string format_name;

/** A file in memory, which readers open by its path. */
class MemoryFile {
  public:
    MemoryFile() : descriptor_(::memfd_create("image", 0)), path_("/proc/self/fd/" + std::to_string(descriptor_)) {}
    const std::string &path() const { return path_; }
    void fill(const unsigned char *data, std::size_t size) const {
        if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, data, size, 0) != static_cast<ssize_t>(size))
            std::abort();
    }

  private:
    int descriptor_;
    std::string path_;
};

/** Rows of a frame are counted; large images cost time only (tests/io/test_bombs.py). */
void read_all(image_io::Reader &reader) {
    const image_io::Info &info = reader.info();
    if (info.width < 1 || info.height < 1 || info.channels < 1 || info.frame_count < 1)
        std::abort();
    if (std::uint64_t{info.width} * info.height * info.channels > 1 << 20)
        return;
    for (std::uint64_t frame = 0; frame < info.frame_count && frame < 3; ++frame) {
        std::uint64_t rows = 0;
        float sum = 0;
        reader.read_rows(frame, [&](const float *row) {
            for (std::size_t i = 0; i < std::size_t{info.width} * info.channels; ++i)
                sum += row[i];
            ++rows;
        });
        // sum: the rows are whole.
        if (rows != info.height && sum != -1.0f)
            std::abort();
    }
}

} // namespace

extern "C" int LLVMFuzzerInitialize(int *argc, char ***argv) {
    image_io::add_openexr();
    for (int i = 1; i < *argc; ++i)
        if (const std::string word = (*argv)[i]; word.rfind("--format=", 0) == 0)
            format_name = word.substr(9);
    return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const unsigned char *data, std::size_t size) {
    static const MemoryFile file;
    const image_io::Format &format = image_io::format_named(format_name);
    image_io::ReadRequest request;
    try {
        if (format_name == "raw") {
            const std::string text(reinterpret_cast<const char *>(data), size);
            const std::size_t end = std::min(size, text.find('\n') == std::string::npos ? size : text.find('\n') + 1);
            request.raw = image_io::parse_raw(text.substr(0, end == 0 ? 0 : end - 1));
            data += end;
            size -= end;
        }
        file.fill(data, size);
        // By content, and whatever the content looks like.
        for (const bool by_content : {true, false}) {
            try {
                if (format.open_channels && !by_content) {
                    const auto channels = format.open_channels(file.path());
                    if (std::uint64_t{channels->width()} * channels->height() * channels->channels().size() <= 1 << 20)
                        channels->read_rows(channels->channels(), [](const float *) {});
                }
                const auto reader =
                    by_content ? image_io::open(file.path(), request) : format.open(file.path(), request);
                read_all(*reader);
            } catch (const image_io::ReadError &) {
            }
        }
    } catch (const std::invalid_argument &) {
    } catch (const std::bad_alloc &) {
    }
    return 0;
}
