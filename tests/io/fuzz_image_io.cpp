// Feeds damaged variants of image files to the program's readers.
//
// usage: clspeckle-image-fuzz FOLDER ITERATIONS SEED
//
// Every file of FOLDER is opened ITERATIONS times with some bytes changed, cut, doubled or removed. A reader must
// either give the image or throw image_io::ReadError; anything else, a result that contradicts its own header, or a run
// of more than ten seconds ends the program with an error. A crash ends it by itself.
#include "io/formats.hpp"
#include "io/openexr.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <new>
#include <random>
#include <string>
#include <vector>

#include <unistd.h>

namespace {

using Bytes = std::vector<unsigned char>;

Bytes mutate(Bytes bytes, std::mt19937_64 &random) {
    const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
    // Headers are at the front: half of the changes go there.
    const auto place = [&]() {
        return random() % 2 ? below(bytes.size()) : below(std::min<std::size_t>(bytes.size(), 512));
    };
    static constexpr unsigned char telling[] = {0x00, 0x01, 0x7f, 0x80, 0xff, 0x40, '0', '9', ' ', '\n', '-', '\''};
    for (std::size_t changes = 1 + below(4); changes > 0 && !bytes.empty(); --changes) {
        const std::size_t at = place();
        switch (below(8)) {
        case 0:
            bytes.resize(at);
            break;
        case 1:
            bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                        bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), at + 1 + below(16))));
            break;
        case 2: {
            const Bytes part(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                             bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), at + 1 + below(64))));
            bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(place()), part.begin(), part.end());
            break;
        }
        case 3:
            // Four bytes at once reach the large numbers of a header.
            for (std::size_t i = at; i < std::min(bytes.size(), at + 4); ++i)
                bytes[i] = telling[below(sizeof(telling))];
            break;
        case 4:
            bytes[at] = telling[below(sizeof(telling))];
            break;
        case 5:
            bytes[at] = static_cast<unsigned char>(bytes[at] ^ (1u << below(8)));
            break;
        default:
            bytes[at] = static_cast<unsigned char>(random());
        }
    }
    return bytes;
}

/** Reads everything that the file claims to hold, up to three frames. @return true if it was accepted. */
bool read(const std::string &path, std::string &wrong) {
    try {
        std::vector<std::string> warnings;
        if (const auto file = image_io::open_channels(path)) {
            std::size_t rows = 0;
            file->read_rows(file->channels(), [&](const float *) { ++rows; });
            if (rows != file->height())
                wrong = "another number of rows than the header says";
        }
        const auto reader = image_io::open(path);
        const image_io::Info info = reader->info();
        if (info.width < 1 || info.height < 1 || info.width > image_io::max_side || info.height > image_io::max_side)
            wrong = "a size out of range";
        for (std::uint64_t frame = 0; frame < std::min<std::uint64_t>(info.frame_count, 3); ++frame) {
            const image_io::Plane plane = image_io::read_gray(*reader, frame, warnings);
            if (plane.values.size() != std::size_t{info.width} * info.height)
                wrong = "another number of pixels than the header says";
        }
        return true;
    } catch (const image_io::ReadError &) {
        return false;
    } catch (const std::bad_alloc &) {
        // A plausible header may ask for more than this machine has; that is reported, not a crash.
        return false;
    } catch (const std::exception &error) {
        wrong = std::string("an exception that is not a ReadError: ") + error.what();
        return false;
    }
}

} // namespace

int main(int argc, char **argv) {
    if (argc != 4) {
        std::fputs("usage: clspeckle-image-fuzz FOLDER ITERATIONS SEED\n", stderr);
        return 2;
    }
    image_io::add_openexr();
    const std::filesystem::path folder = argv[1];
    const int iterations = std::atoi(argv[2]);
    const auto seed = static_cast<std::uint64_t>(std::atoll(argv[3]));
    const std::string scratch =
        (std::filesystem::temp_directory_path() / ("clspeckle-fuzz-" + std::to_string(::getpid()))).string();
    std::vector<std::filesystem::path> files;
    for (const auto &entry : std::filesystem::directory_iterator(folder))
        files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    int failures = 0;
    for (const std::filesystem::path &file : files) {
        std::ifstream stream(file, std::ios::binary);
        const Bytes original((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
        std::mt19937_64 random(seed);
        int accepted = 0;
        double slowest = 0;
        std::string wrong;
        if (!read(file.string(), wrong)) {
            std::printf("%s: the undamaged file is refused\n", file.filename().c_str());
            ++failures;
        }
        for (int i = 0; i < iterations && wrong.empty(); ++i) {
            const Bytes damaged = mutate(original, random);
            std::ofstream(scratch, std::ios::binary | std::ios::trunc)
                .write(reinterpret_cast<const char *>(damaged.data()), static_cast<std::streamsize>(damaged.size()));
            const auto start = std::chrono::steady_clock::now();
            accepted += read(scratch, wrong) ? 1 : 0;
            slowest =
                std::max(slowest, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
            if (slowest > 60)
                wrong = "it took " + std::to_string(slowest) + " s";
            if (!wrong.empty()) {
                const std::string kept = scratch + "-" + file.filename().string();
                std::filesystem::copy_file(scratch, kept, std::filesystem::copy_options::overwrite_existing);
                std::printf("%s: iteration %d: %s (kept as %s)\n", file.filename().c_str(), i, wrong.c_str(),
                            kept.c_str());
                ++failures;
            }
        }
        std::printf("%s: %d of %d damaged files read, slowest %.3f s\n", file.filename().c_str(), accepted, iterations,
                    slowest);
    }
    std::error_code ignored;
    std::filesystem::remove(scratch, ignored);
    return failures == 0 && !files.empty() ? 0 : 1;
}
