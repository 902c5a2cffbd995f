// Files of caches and records, written whole or not at all.
#pragma once

#include "io/atomic_file.hpp"

#include <filesystem>
#include <functional>

namespace clsp {

// Makes the folders and lets `write` fill the file: nobody ever reads half of it, and of several writers one wins.
// Returns false, and leaves nothing, where that fails.
bool write_whole_file(const std::filesystem::path &path, const std::function<void(image_io::AtomicFile &)> &write);

} // namespace clsp
