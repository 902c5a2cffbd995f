// Writes what the readers see, for comparison with independent ones.
//
// usage: clspeckle-image-dump FILE OUT [RAW]
//
// OUT gets the values of all frames as float32, or nothing if it is "-"; RAW describes raw frames. Prints width,
// height, channels, opacity, frames, full scale and how numbers stand for light, then a line for each warning. A refusal goes to stderr, with exit
// code 1.
#include "io/formats.hpp"
#include "io/openexr.hpp"

#include <cstdio>
#include <fstream>
#include <stdexcept>

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
        return 0;
    } catch (const image_io::ReadError &error) {
        std::fprintf(stderr, "%s\n", error.what());
    } catch (const std::invalid_argument &error) {
        std::fprintf(stderr, "%s\n", error.what());
    }
    return 1;
}
