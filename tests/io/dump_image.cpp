// Writes what the readers see, for comparison with independent ones.
//
// usage: clspeckle-image-dump FILE OUT [RAW]
//
// OUT gets the values of all frames as float32, or nothing if it is "-"; RAW describes raw frames. Prints width,
// height, channels, opacity, frames, full scale and how numbers stand for light, then a line for each warning. A
// refusal goes to stderr, with exit code 1. With CLSP_COUNT_WORK in the environment the last line of stdout counts what
// was done: bytes that zlib made, bytes and calls of reads, bytes and blocks of operator new.
#include "io/formats.hpp"
#include "io/openexr.hpp"

#include <zlib.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <fstream>
#include <new>
#include <stdexcept>
#include <unistd.h>

namespace {

std::atomic<std::uint64_t> inflated{0}, read_bytes{0}, reads{0}, allocated{0}, blocks{0};

template <typename Function> Function *next(const char *name) {
    return reinterpret_cast<Function *>(dlsym(RTLD_NEXT, name));
}

template <typename Count> Count counted(Count bytes) {
    ++reads;
    if (bytes != static_cast<Count>(-1))
        read_bytes += static_cast<std::uint64_t>(bytes);
    return bytes;
}

int tell(int code) {
    if (std::getenv("CLSP_COUNT_WORK"))
        std::printf("work %llu %llu %llu %llu %llu\n", static_cast<unsigned long long>(inflated),
                    static_cast<unsigned long long>(read_bytes), static_cast<unsigned long long>(reads),
                    static_cast<unsigned long long>(allocated), static_cast<unsigned long long>(blocks));
    return code;
}

} // namespace

// What the program defines comes before what libraries define.
extern "C" {
int inflate(z_streamp stream, int flush) {
    static auto *const real = next<int(z_streamp, int)>("inflate");
    const uInt room = stream ? stream->avail_out : 0;
    const int result = real(stream, flush);
    inflated += stream ? room - stream->avail_out : 0;
    return result;
}
ssize_t read(int file, void *to, size_t size) {
    static auto *const real = next<ssize_t(int, void *, size_t)>("read");
    return counted(real(file, to, size));
}
ssize_t pread(int file, void *to, size_t size, off_t at) {
    static auto *const real = next<ssize_t(int, void *, size_t, off_t)>("pread");
    return counted(real(file, to, size, at));
}
size_t fread(void *to, size_t size, size_t count, FILE *file) {
    static auto *const real = next<size_t(void *, size_t, size_t, FILE *)>("fread");
    const size_t result = real(to, size, count, file);
    counted(result * size);
    return result;
}
}

void *operator new(std::size_t size) {
    ++blocks;
    allocated += size;
    if (void *const block = std::malloc(size ? size : 1))
        return block;
    throw std::bad_alloc();
}
void operator delete(void *block) noexcept {
    std::free(block);
}
void operator delete(void *block, std::size_t) noexcept {
    std::free(block);
}

int main(int argc, char **argv) {
    if (argc != 3 && argc != 4)
        return 2;
    image_io::add_openexr();
    try {
        image_io::ReadRequest request;
        if (argc == 4)
            request.raw = image_io::parse_raw(argv[3]);
        const auto reader = image_io::open(argv[1], request);
        const image_io::Info &info = reader->info();
        std::ofstream out;
        if (std::string(argv[2]) != "-")
            out.open(argv[2], std::ios::binary);
        for (std::uint64_t frame = 0; frame < info.frame_count; ++frame)
            reader->read_rows(frame, [&](const float *row) {
                if (out.is_open())
                    out.write(reinterpret_cast<const char *>(row),
                              static_cast<std::streamsize>(sizeof(float) * info.width * info.channels));
            });
        std::printf("%u %u %u %d %llu %.17g %s\n", info.width, info.height, info.channels, info.alpha ? 1 : 0,
                    static_cast<unsigned long long>(info.frame_count), info.full_scale, info.transfer.name().c_str());
        for (const std::string &warning : info.warnings)
            std::printf("%s\n", warning.c_str());
        return tell(0);
    } catch (const image_io::ReadError &error) {
        std::fprintf(stderr, "%s\n", error.what());
    } catch (const std::invalid_argument &error) {
        std::fprintf(stderr, "%s\n", error.what());
    }
    return tell(1);
}
