/**
 * @file image_io.hpp
 * @brief Image files: what a reader and a writer are, and files that are never seen half-written.
 *
 * Which formats there are says io/formats.hpp. Readers never trust a header: sizes are checked against max_side and,
 * where the format allows, against the size of the file before memory is taken, and rows are handed over one by one, so
 * that a damaged header costs nothing.
 */
#ifndef CLSPECKLE_IO_IMAGE_IO_HPP
#define CLSPECKLE_IO_IMAGE_IO_HPP

#include "io/atomic_file.hpp"
#include "io/transfer.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace image_io {

/** The library's own limit on both sides of an image. */
constexpr std::uint32_t max_side = 16384;
/** Frames of a stack; only to keep damaged headers from looping for hours. */
constexpr std::uint64_t max_frames = 1000000;

/** So many samples a file may hold whatever its size; of more, each byte may hold so many. */
constexpr std::uint64_t free_samples = 67108864; // 8192 x 8192
constexpr std::uint64_t samples_per_byte = 64;

/** A file that cannot be read: the message begins with its name. */
class ReadError : public std::runtime_error {
  public:
    ReadError(const std::string &path, const std::string &what) : std::runtime_error(path + ": " + what) {}
};

/** Refuses a small file of very many samples. @param size in words. */
void check_work(const std::string &path, std::uint64_t samples, const std::string &size);

struct Format;

/** What a file holds. */
struct Info {
    const Format *format = nullptr; ///< Of the registry.
    std::string sample;             ///< For example "uint16" or "float32".
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t channels = 1;        ///< Interleaved samples per pixel, alpha included.
    bool alpha = false;                ///< The last channel is an opacity, no measurement.
    std::uint64_t frame_count = 1;     ///< Pages of a TIFF, frames of an NPY stack.
    double full_scale = 0;             ///< Top code of an unsigned integer format; 0: the values are what they are.
    std::uint32_t axes = 2;            ///< Of an NPY array, before they are told apart as frames and channels.
    std::uint64_t surplus_bytes = 0;   ///< Behind all that the header describes; not read, which is a warning.
    std::vector<std::string> warnings; ///< What was ignored.
    Transfer transfer;                 ///< How numbers stand for light.
    unsigned significant_bits = 0;     ///< That the converter had, where the file says so; 0: it does not.
    bool lossy = false;                ///< The compression changes numbers.
    bool white_is_zero = false;        ///< The file says so; values are turned, so that more is brighter.
    bool full_scale_given = false;     ///< By ReadRequest::full_scale.
    std::string looks_swapped;         ///< The warning that its bytes seem to lie in the other order; empty: none.
    bool one_page = false;             ///< The reader took ReadRequest::page into account.
};

/** Takes one row of width * channels samples, as stored: integers are not scaled. */
using RowSink = std::function<void(const float *row)>;

/** An open image file. One thread at a time. */
class Reader {
  public:
    virtual ~Reader() = default;
    Reader(const Reader &) = delete;
    Reader &operator=(const Reader &) = delete;

    const Info &info() const { return info_; }
    /** Of the registry: what it says of every file that it opens. */
    void opened_as(const Format &format);
    const std::string &path() const { return path_; }
    /** Calls the sink once per row, top to bottom. Throws ReadError for damaged data. */
    virtual void read_rows(std::uint64_t frame, const RowSink &sink) = 0;

  protected:
    explicit Reader(std::string path) : path_(std::move(path)) {}
    [[noreturn]] void fail(const std::string &what) const { throw ReadError(path_, what); }
    /** @param orientation 1 (as stored) to 8, as TIFF and EXIF count; 0: the file says nothing. */
    void warn_of_orientation(unsigned orientation);
    /** @param aspect of a pixel: its width over its height. */
    void warn_of_aspect(double aspect);
    void warn_of_surplus(std::uint64_t bytes);
    /** @param where that the data are from. */
    void warn_of_exif(const unsigned char *data, std::size_t size_bytes, const std::string &where);
    /** @param packet of XMP, which counts orientation as TIFF does. */
    void warn_of_xmp(std::string_view packet);
    /** Refuses empty and oversized images. */
    void check_size(std::uint64_t width, std::uint64_t height) const;

    std::string path_;
    Info info_;
};

/** One value per pixel. */
struct Plane {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<float> values;     ///< height x width.
    double full_scale = 0;         ///< As Info::full_scale.
    std::string sample;            ///< As Info::sample.
    unsigned significant_bits = 0; ///< As Info::significant_bits.
    bool full_scale_given = false; ///< By ReadRequest::full_scale.
    bool white_is_zero = false;    ///< As Info::white_is_zero.

    bool empty() const { return values.empty(); }
    float at(std::uint32_t x, std::uint32_t y) const { return values[static_cast<std::size_t>(y) * width + x]; }
    /** Divides integers by their top code, so that 1 is full scale in every format. */
    void normalize();
};

/** Of a mask, in which all but 0 counts, with several numbers beside 0, as of a soft edge: how to make it of two;
 * empty: it has one. */
std::string told_soft(const std::vector<float> &mask);

/** Three values per pixel. */
struct VectorPlane {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<float> values; ///< height x width x 3.
    bool empty() const { return values.empty(); }
};

/** What becomes of R, G and B that differ: their mean is taken, with a warning, or they are refused. */
enum class Colors { mean, refused };

/** What becomes of numbers that are encoded for a screen: nothing; light, where the file says how, with a warning; or
 * light as if the file said linear or sRGB. */
enum class Encoding { as_stored, automatic, linear, srgb };

/** Reads a frame as one value per pixel: the only channel; equal R, G and B; else what `colors` says. Opacity is
 * ignored, with a warning where it is not full. */
Plane read_gray(Reader &reader, std::uint64_t frame, std::vector<std::string> &warnings, Colors colors = Colors::mean,
                Encoding encoding = Encoding::as_stored);

/** Reads a frame of three channels. @param whole_numbers are taken as they are, too. */
VectorPlane read_vectors(Reader &reader, std::uint64_t frame, bool whole_numbers = false);

/** A file whose channels have names, as those of a scene have; any of them can be read together. */
class ChannelFile {
  public:
    virtual ~ChannelFile() = default;
    ChannelFile(const ChannelFile &) = delete;
    ChannelFile &operator=(const ChannelFile &) = delete;

    const std::string &path() const { return path_; }
    std::uint32_t width() const { return width_; }
    std::uint32_t height() const { return height_; }
    /** In a file of several parts PART.CHANNEL, unless the channel's own name begins with that of its part. */
    const std::vector<std::string> &channels() const { return channels_; }
    /** By its name, or in a file of several parts by that within its part, where only one has it. */
    bool has(const std::string &channel) const { return !name_of(channel).empty(); }
    /** The whole name of a channel; empty if there is none. */
    std::string name_of(const std::string &channel) const;
    /** Type of a channel, for example "float16". */
    virtual std::string sample(const std::string &channel) const = 0;
    /** Reads some channels, interleaved in the order given, row by row. */
    virtual void read_rows(const std::vector<std::string> &names, const RowSink &sink) const = 0;

  protected:
    explicit ChannelFile(std::string path) : path_(std::move(path)) {}
    [[noreturn]] void fail(const std::string &what) const { throw ReadError(path_, what); }

    std::string path_;
    std::uint32_t width_ = 0;
    std::uint32_t height_ = 0;
    std::vector<std::string> channels_;
    std::vector<std::string> short_names_; ///< Within the part, of each of channels_.
};

/** An image file that is being written, frame by frame; without commit() it never appears. */
class Writer {
  public:
    virtual ~Writer() = default;
    Writer(const Writer &) = delete;
    Writer &operator=(const Writer &) = delete;

    /** @param samples height x width, of the type that was asked for. */
    virtual void append(const void *samples) = 0;
    void commit() { file_.commit(); }

  protected:
    explicit Writer(const std::string &path) : file_(path) {}
    AtomicFile file_;
};

namespace detail {

/** The orientation that EXIF data tell, which begin as a TIFF file does; 0: they tell none. Nothing where they are no
 * EXIF data. */
std::optional<unsigned> orientation_of_exif(const unsigned char *data, std::size_t size_bytes);

/** The orientation that a packet of XMP tells; 0: it tells none. */
unsigned orientation_of_xmp(std::string_view packet);

/** An open regular file, with its size known. */
class InputFile {
  public:
    explicit InputFile(const std::string &path);
    ~InputFile();
    InputFile(const InputFile &) = delete;
    InputFile &operator=(const InputFile &) = delete;

    std::FILE *stream() const { return stream_; }
    std::uint64_t size() const { return size_; }
    const std::string &path() const { return path_; }
    void seek(std::uint64_t offset);
    /** Reads exactly so many bytes or throws that the file is truncated. */
    void read(void *data, std::size_t size_bytes);
    /** The next byte, or -1 at the end. */
    int get() { return std::getc(stream_); }

  private:
    std::string path_;
    std::FILE *stream_ = nullptr;
    std::uint64_t size_ = 0;
};

} // namespace detail
} // namespace image_io

#endif // CLSPECKLE_IO_IMAGE_IO_HPP
