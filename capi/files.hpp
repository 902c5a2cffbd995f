// Files that the C interface writes.
#pragma once

#include "io/image_io.hpp"
#include "runtime/error.hpp"

#include <filesystem>
#include <fmt/core.h>
#include <string>

namespace clsp::capi {

// Where a file goes that replaces an older one by renaming.
inline std::string file_to_write(const char *path) {
    namespace fs = std::filesystem;
    if (*path == '\0')
        throw Error(Status::kInvalidArgument, "path is empty; name a file");
    std::error_code code;
    fs::path target(path);
    // What is put in place by renaming must not take the place of a device, a pipe or a link.
    if (fs::is_symlink(target, code))
        target = fs::weakly_canonical(target, code);
    if (fs::exists(target, code) && !fs::is_regular_file(target, code))
        throw Error(Status::kIo, fmt::format("{}: is no regular file; name another one", path));
    return target.string();
}

// The file appears, or replaces an older one, only when it is complete.
inline void write_file(const char *path, const std::string &text) {
    try {
        image_io::write_text(file_to_write(path), text);
    } catch (const image_io::WriteError &error) {
        throw Error(Status::kIo, error.what());
    }
}

} // namespace clsp::capi
