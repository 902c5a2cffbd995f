#include "io/codes.hpp"

#include <fmt/format.h>

#include <filesystem>

namespace image_io {

std::string frame_formats(const char *word) {
    return listed(word, [](const Format &format) { return format.codes == Codes::frames; });
}

namespace {

std::string why_none_in(const Format &format) {
    return fmt::format("is of the format {}; expected an .npy stack, or {} frames{}", format.name, frame_formats("or"),
                       format.no_codes_because.empty() ? "" : ": " + format.no_codes_because);
}

} // namespace

std::string why_no_codes(const Info &info, const std::string &file) {
    if (info.format->codes == Codes::none)
        return why_none_in(*info.format);
    if (info.lossy)
        return "is compressed with losses, which change codes and their noise; let the camera store frames without: "
               "raw, PNG, or TIFF with deflate or LZW";
    if (info.channels != 1) {
        const std::string frames =
            info.axes == 3 ? fmt::format(". If the {} are frames, save numpy.moveaxis(array, -1, 0)", info.channels)
                           : "";
        return fmt::format("has {} channels; expected raw codes, one number for each pixel. Where the channels are "
                           "alike, save array[..., 0], or name one: \"file\": \"{}:{}\"{}",
                           info.channels, file, info.channels > 2 ? "R" : "Y", frames);
    }
    std::string but;
    for (const std::string &warning : info.warnings)
        but += ". But " + warning;
    if (info.sample.rfind("float", 0) == 0)
        return fmt::format("has samples of type {}; expected uint16: codes are whole numbers, as the converter gives "
                           "them; fractions and NaN are none. If they are whole, save codes.astype(numpy.uint16){}",
                           info.sample, but);
    if (info.sample != "uint16" && info.sample != "uint8")
        return fmt::format("has samples of type {}; expected uint16: the codes as the converter gives them, neither "
                           "scaled nor shifted: save codes.astype(numpy.uint16){}",
                           info.sample, but);
    return "";
}

std::string why_no_frame(const std::string &path) {
    // Notes, tables and reports lie beside frames.
    for (const char *text : {".txt", ".csv", ".html", ".htm", ".json", ".xml", ".md", ".log"})
        if (std::filesystem::path(path).extension() == text)
            return "";
    try {
        const Format *format = format_of_content(path);
        if (!format)
            return why_foreign(path);
        return format->codes == Codes::none
                   ? why_none_in(*format)
                   : fmt::format("is of the format {}; give it the ending {}", format->name, format->extension());
    } catch (const ReadError &) {
        return ""; // an empty file, or a pipe
    }
}

std::string told_white(const Info &info) {
    return fmt::format("its photometric interpretation says that 0 is white: a code is {} minus the number that is "
                       "stored",
                       info.full_scale);
}

} // namespace image_io
