// OpenEXR: known everywhere, so that errors can name it; read where add_openexr() was called (io/openexr.cpp).
#include "io/formats.hpp"

namespace image_io::format_files {

Format exr() {
    Format format;
    format.name = "EXR";
    format.place = 3;
    format.extensions = {".exr"};
    format.magic = {"\x76\x2f\x31\x01"};
    format.real = true;
    return format;
}

} // namespace image_io::format_files
