// All formats, EXR among them: what the library itself reads (open_without_exr) needs no OpenEXR.
#include "image_io.hpp"

#include <fmt/format.h>

namespace image_io {

std::unique_ptr<Reader> open(const std::string &path, const ReadOptions &options) {
    if (is_exr(path))
        return detail::open_exr(path, options.channel);
    if (!options.channel.empty())
        throw ReadError(path, fmt::format("a channel (\"{}\") can be named for EXR files only", options.channel));
    return open_without_exr(path);
}

} // namespace image_io
