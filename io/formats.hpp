/**
 * @file formats.hpp
 * @brief The registry of image formats: one record for each. Reading, writing, folder scans, options, help and errors
 * follow from it.
 *
 * A format is a file in io/formats. It defines a function of the file's name, which makes the record; CMake finds it.
 */
#ifndef CLSPECKLE_IO_FORMATS_HPP
#define CLSPECKLE_IO_FORMATS_HPP

#include "io/image_io.hpp"
#include "io/read_request.hpp"

#include <functional>
#include <list>
#include <type_traits>

namespace image_io {

/** An image as users name it: a file, or FILE: with page=N, full_scale=N and a channel behind, with commas between
 * them. */
struct ImageName {
    std::string path;
    std::string channel; ///< All that is behind the colon.
};

/** A file that there is goes by its whole name, whatever colons stand in it. @param is_path what may stand before the
 * colon; none: a file. */
ImageName split_name(const std::string &name, const std::function<bool(const std::string &)> &is_path = {});
/** The name of what split_name() took apart. */
std::string join_name(const ImageName &name);
/** The name of one image of several. */
std::string page_name(const std::string &name, std::uint64_t page);

/** Types of samples that are written. */
enum class Sample { uint8, uint16, float32 };

constexpr std::size_t size_of(Sample sample) {
    return sample == Sample::uint8 ? 1 : sample == Sample::uint16 ? 2 : 4;
}

/** What is to be written. */
struct WriteRequest {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    Sample sample = Sample::uint16;
    std::uint64_t stack_frames = 0; ///< Of a stack; 0: one image.
};

/** How frames may be stored: a word of the program's option render --format. */
struct FrameStorage {
    std::string word; ///< Of floating-point samples it begins with "float-".
    Sample sample = Sample::uint16;
    bool stack = false; ///< All frames in one file.
};

/** What a capture set may keep in a format. */
enum class Codes { none, frames, stacks };

/** All that is known of a format. */
struct Format {
    std::string name;                    ///< As errors and help say it: "PNG".
    int place = 0;                       ///< In lists, and among those whose magic bytes fit.
    std::vector<std::string> extensions; ///< In lower case; files are written with the first one.
    std::vector<std::string> magic;      ///< A file begins with one of them. The content decides, not the name.
    std::string samples;                 ///< For the help, where the format's name does not tell them: "8/16".
    std::string stacks;                  ///< Several images in one file, for the help: "3-D NPY"; empty: never.
    bool real = false;                   ///< Takes floating-point samples.
    Codes codes = Codes::none;
    /** Opens a file; none: this program or library knows the format, but does not read it. */
    std::unique_ptr<Reader> (*open)(const std::string &path, const ReadRequest &request) = nullptr;
    /** Opens a file for its named channels; none: channels have no names. */
    std::unique_ptr<ChannelFile> (*open_channels)(const std::string &path) = nullptr;
    /** Begins a file; none: the format is only read. */
    std::unique_ptr<Writer> (*create)(const std::string &path, const WriteRequest &request) = nullptr;
    std::vector<Sample> writes;        ///< What create() takes.
    std::vector<FrameStorage> storage; ///< What render offers.
    /** Of a format without magic bytes: whether a file is one, once no magic bytes fit. */
    bool (*recognizes)(detail::InputFile &file) = nullptr;
    std::string no_codes_because; ///< Of Codes::none, for a refusal: what frames in it would lack, and what to do.

    const std::string &extension() const { return extensions.front(); }
    bool is_read() const { return open != nullptr; }
    bool has_named_channels() const { return open_channels != nullptr; }
};

/** The formats, by their place. */
const std::list<Format> &formats();
/** Puts a format into the registry, or in place of the one of its name; before any file is opened. */
void add_format(Format format);

/** The format of a name, which there must be. */
const Format &format_named(const std::string &name);
/** The format that a file's name ends for, whatever its case; null: of none. */
const Format *format_of_extension(const std::string &path);

/** The format that a file's content tells; null: of none. Throws ReadError if it cannot be read. */
const Format *format_of_content(const std::string &path);
/** Of a file of another format that is known by name: that it is not read, and a way out; empty: it is of none. */
std::string why_foreign(const std::string &path);

/** Names of the formats that fit, or of all, for sentences: "PNG, TIFF or NPY". */
std::string listed(const char *word, const std::function<bool(const Format &)> &fits = {});

/** Opens an image; its content tells the format. @param name as split_name() takes it. */
std::unique_ptr<Reader> open(const std::string &name, const ReadRequest &request = {});
/** Opens an image where one is needed: a file of several is refused with a name for one of them. */
std::unique_ptr<Reader> open_one(const std::string &name, const ReadRequest &request = {});
/** Opens a file for its named channels; null if its format has none. Throws ReadError if it cannot be read at all. */
std::unique_ptr<ChannelFile> open_channels(const std::string &path);

/** Begins a file of a format; throws WriteError if the format does not hold that. */
std::unique_ptr<Writer> create(const std::string &path, const Format &format, const WriteRequest &request);

/** Writes one image. */
template <typename T>
void write(const std::string &path, const Format &format, std::uint32_t width, std::uint32_t height, const T *samples) {
    static_assert(std::is_same_v<T, std::uint8_t> || std::is_same_v<T, std::uint16_t> || std::is_same_v<T, float>);
    constexpr Sample sample = sizeof(T) == 1 ? Sample::uint8 : sizeof(T) == 2 ? Sample::uint16 : Sample::float32;
    const auto writer = create(path, format, {width, height, sample, 0});
    writer->append(samples);
    writer->commit();
}

} // namespace image_io

#endif // CLSPECKLE_IO_FORMATS_HPP
