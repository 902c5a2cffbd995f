// The file of a compiled program: a head that says what it is of, the binary's size and hash, the binary.
#pragma once

#include "runtime/cache_folder.hpp"

#include <optional>
#include <string>

namespace clsp {

// The binary; none unless the file is whole and begins with that head.
std::optional<std::string> read_program_file(CacheFolder::File &file, const std::string &head);
void write_program_file(image_io::AtomicFile &file, const std::string &head, const std::string &binary);

} // namespace clsp
