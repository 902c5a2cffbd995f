// Cache files, written whole or not at all.
#pragma once

#include <filesystem>
#include <functional>
#include <ostream>

namespace clsp {

// Makes the folders, lets `write` fill a temporary file beside `path` and renames it: nobody ever reads half a file,
// and of several writers one wins. Returns false, and leaves nothing, where that fails.
bool write_whole_file(const std::filesystem::path &path, const std::function<void(std::ostream &)> &write);

} // namespace clsp
