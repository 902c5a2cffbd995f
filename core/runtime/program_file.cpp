#include "runtime/program_file.hpp"

#include "runtime/hash.hpp"

#include <cstdint>

namespace clsp {

std::optional<std::string> read_program_file(CacheFolder::File &file, const std::string &head) {
    std::string found(head.size(), '\0');
    std::uint64_t size = 0, hash = 0;
    if (!file || !file.read(found.data(), found.size()) || found != head || !file.read(&size, sizeof size) ||
        !file.read(&hash, sizeof hash) || size != file.size() - head.size() - sizeof size - sizeof hash)
        return {};
    std::string binary(size, '\0');
    if (!file.read(binary.data(), size) || fnv1a(binary) != hash)
        return {};
    return binary;
}

void write_program_file(image_io::AtomicFile &file, const std::string &head, const std::string &binary) {
    const std::uint64_t size = binary.size(), hash = fnv1a(binary);
    file.write(head.data(), head.size());
    file.write(&size, sizeof size);
    file.write(&hash, sizeof hash);
    file.write(binary.data(), binary.size());
}

} // namespace clsp
