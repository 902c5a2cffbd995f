#include "io/inside.hpp"

#include <fnmatch.h>

#include <algorithm>

namespace image_io {
namespace {

bool has_parent(const std::string &name, const char *separators, int flags) {
    for (std::size_t start = 0; start <= name.size();) {
        const std::size_t end = std::min(name.find_first_of(separators, start), name.size());
        const std::string part = name.substr(start, end - start);
        // As a pattern finds it: ".[.]", ".?" and "\.\." do.
        if (part == ".." || ::fnmatch(part.c_str(), "..", flags) == 0)
            return true;
        start = end + 1;
    }
    return false;
}

} // namespace

bool leaves_folder(const std::string &name) {
    if (name.empty())
        return false;
    const bool absolute = name[0] == '/' || name[0] == '\\' || (name.size() > 1 && name[1] == ':');
    // A backslash is a separator elsewhere, and takes a character's meaning in a pattern. Behind a colon is a channel.
    return absolute || name.find('\0') != std::string::npos || has_parent(name, "/\\:", FNM_PERIOD | FNM_NOESCAPE) ||
           has_parent(name, "/:", FNM_PERIOD);
}

} // namespace image_io
