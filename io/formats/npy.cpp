// NPY (format versions 1 to 3 of NumPy's lib.format). A reader of our own: xtensor's loads a whole stack at once, takes
// memory for whatever shape a header claims, and neither swaps bytes nor converts types.
#include "io/npy_header.hpp"

#include "io/byte_order.hpp"
#include "io/formats.hpp"
#include "io/half.hpp"
#include "io/stack_shape.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>

namespace image_io {

namespace {

/** The three entries of the header: a Python dictionary literal of known shape. */
class HeaderParser {
  public:
    HeaderParser(const std::string &path, const std::string &text) : path_(path), text_(text) {
        expect('{');
        while (!accept('}')) {
            const std::string key = quoted();
            expect(':');
            if (key == "descr")
                descr = description();
            else if (key == "fortran_order")
                fortran_order = boolean();
            else if (key == "shape")
                tuple();
            else
                fail(fmt::format("its header has an unknown key '{}'", key));
            if (!accept(',')) {
                expect('}');
                break;
            }
        }
        if (descr.empty() || !has_shape_)
            fail("its header lacks 'descr' or 'shape'");
    }

    std::string descr;
    bool fortran_order = false;
    std::vector<std::uint64_t> shape;

  private:
    [[noreturn]] void fail(const std::string &what) const {
        throw ReadError(path_, "is damaged: " + what + "; write or copy it again");
    }
    void skip() {
        while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])))
            ++at_;
    }
    bool accept(char c) {
        skip();
        if (at_ >= text_.size() || text_[at_] != c)
            return false;
        ++at_;
        return true;
    }
    void expect(char c) {
        if (!accept(c))
            fail(fmt::format("its header is not a dictionary ('{}' expected at character {})", c, at_));
    }
    std::string quoted() {
        skip();
        if (at_ >= text_.size() || (text_[at_] != '\'' && text_[at_] != '"'))
            fail(fmt::format("its header is not a dictionary (a string expected at character {})", at_));
        const std::size_t end = text_.find(text_[at_], at_ + 1);
        if (end == std::string::npos)
            fail("a string in its header does not end");
        const std::string value = text_.substr(at_ + 1, end - at_ - 1);
        at_ = end + 1;
        return value;
    }
    std::string description() {
        skip();
        if (at_ < text_.size() && text_[at_] == '[')
            throw ReadError(path_, "holds records with named fields; a plain array of numbers is needed: save one "
                                   "field, array[array.dtype.names[0]]");
        return quoted();
    }
    bool boolean() {
        skip();
        for (const bool value : {true, false}) {
            const std::string word = value ? "True" : "False";
            if (text_.compare(at_, word.size(), word) == 0) {
                at_ += word.size();
                return value;
            }
        }
        fail("'fortran_order' in its header is neither True nor False");
    }
    void tuple() {
        expect('(');
        has_shape_ = true;
        shape.clear();
        while (!accept(')')) {
            skip();
            std::uint64_t value = 0;
            const char *first = text_.data() + at_;
            const auto result = std::from_chars(first, text_.data() + text_.size(), value);
            if (result.ec != std::errc())
                fail("'shape' in its header is not a tuple of numbers");
            at_ += static_cast<std::size_t>(result.ptr - first);
            shape.push_back(value);
            if (shape.size() > 8)
                fail("'shape' in its header has more than 8 numbers");
            if (!accept(',')) {
                expect(')');
                break;
            }
        }
    }

    const std::string &path_;
    const std::string &text_;
    std::size_t at_ = 0;
    bool has_shape_ = false;
};

double real_number(const unsigned char *bytes, std::size_t size) {
    double value;
    if (size != sizeof value)
        return size == 2 ? detail::half_to_float(bytes) : detail::to_float<float>(bytes);
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

float bool_to_float(const unsigned char *bytes) {
    return *bytes ? 1.0f : 0.0f;
}

struct SampleType {
    const char *code;
    const char *name;
    std::size_t size_bytes;
    double full_scale;
    float (*convert)(const unsigned char *);
};

constexpr SampleType sample_types[] = {
    {"b1", "bool", 1, 0, bool_to_float},
    {"u1", "uint8", 1, 255, detail::to_float<std::uint8_t>},
    {"u2", "uint16", 2, 65535, detail::to_float<std::uint16_t>},
    {"u4", "uint32", 4, 0, detail::to_float<std::uint32_t>},
    {"u8", "uint64", 8, 0, detail::to_float<std::uint64_t>},
    {"i1", "int8", 1, 0, detail::to_float<std::int8_t>},
    {"i2", "int16", 2, 0, detail::to_float<std::int16_t>},
    {"i4", "int32", 4, 0, detail::to_float<std::int32_t>},
    {"i8", "int64", 8, 0, detail::to_float<std::int64_t>},
    {"f2", "float16", 2, 0, detail::half_to_float},
    {"f4", "float32", 4, 0, detail::to_float<float>},
    {"f8", "float64", 8, 0, detail::to_float<double>},
};

class NpyReader final : public Reader {
  public:
    explicit NpyReader(const std::string &path) : Reader(path), file_(path) {
        unsigned char start[10] = {};
        file_.read(start, 10);
        const unsigned version = start[6];
        if (version < 1 || version > 3)
            fail(fmt::format("NPY format version {}.{} is not known (1 to 3 are)", version, start[7]));
        std::uint64_t length = start[8] | start[9] << 8;
        data_offset_ = 10;
        if (version > 1) {
            unsigned char more[2];
            file_.read(more, 2);
            length |= std::uint64_t{more[0]} << 16 | std::uint64_t{more[1]} << 24;
            data_offset_ = 12;
        }
        if (length > 65535)
            fail(fmt::format("is damaged: its header claims {} bytes (at most 65535 are taken)", length));
        std::string text(static_cast<std::size_t>(length), '\0');
        file_.read(text.data(), text.size());
        data_offset_ += length;
        const HeaderParser header(path_, text);
        fortran_order_ = header.fortran_order;
        set_type(header.descr);
        set_shape(header.shape);
        const std::uint64_t needed =
            info_.frame_count * info_.width * info_.height * info_.channels * type_->size_bytes;
        if (file_.size() - data_offset_ < needed)
            fail(fmt::format("is truncated: its header claims {} bytes of data, {} are there; write or copy it again",
                             needed, file_.size() - data_offset_));
        info_.surplus_bytes = file_.size() - data_offset_ - needed;
        look_at_byte_order();
    }

    void read_rows(std::uint64_t frame, const RowSink &sink) override {
        if (fortran_order_)
            read_fortran(frame, sink);
        else
            read_c(frame, sink);
    }

  private:
    void set_type(const std::string &descr) {
        const bool marked = !descr.empty() && std::strchr("<>|=", descr[0]) != nullptr;
        const std::string code = marked ? descr.substr(1) : descr;
        for (const SampleType &type : sample_types)
            if (code == type.code)
                type_ = &type;
        if (code.substr(0, 1) == "O")
            fail(fmt::format(
                "its numbers are of type '{}', Python objects, as NumPy makes of frames that are not all of "
                "one size; an array of numbers is needed: save numpy.stack(frames) of frames of one size",
                descr.substr(0, 40)));
        if (!type_)
            fail(fmt::format("its numbers are of type '{}'; bool, integers of 8 to 64 bits and float16, 32 and 64 are "
                             "taken: save {}",
                             descr.substr(0, 40),
                             code[0] == 'c'
                                 ? "numpy.abs(array).astype(numpy.float32), or array.real.astype(numpy.float32)"
                                 : "array.astype(numpy.float32)"));
        // The program runs on little-endian hosts only; '=' and '|' mean host order and no order.
        swap_ = marked && descr[0] == '>' && type_->size_bytes > 1;
        info_.sample = type_->name;
        info_.full_scale = type_->full_scale;
    }

    void set_shape(std::vector<std::uint64_t> shape) {
        std::string text;
        for (const std::uint64_t side : shape)
            text += (text.empty() ? "" : " x ") + std::to_string(side);
        for (const std::uint64_t side : shape)
            if (side == 0)
                fail(fmt::format("holds an empty array ({}), no side may be 0; save it with at least one frame", text));
        info_.axes = static_cast<std::uint32_t>(shape.size());
        // Channels before height and width, as networks have them.
        const bool channels_first = shape.size() == 4 && shape[1] <= 4 && shape[3] > 4;
        if (channels_first && shape[1] > 1)
            fail(
                fmt::format("holds an array of {}: with {} channels before height and width. Save it with the channels "
                            "behind, numpy.moveaxis(array, 1, -1)",
                            text, shape[1]));
        if (channels_first)
            shape.erase(shape.begin() + 1);
        // A stack of frames that are 1 to 4 pixels wide makes no sense, so a short last axis is the channels.
        const bool colored =
            (shape.size() == 3 && shape[2] <= 4 && shape[1] > 4) || (shape.size() == 4 && shape[3] <= 4);
        if (colored) {
            info_.channels = static_cast<std::uint32_t>(shape.back());
            info_.alpha = info_.channels == 2 || info_.channels == 4;
            shape.pop_back();
        }
        if (shape.size() != 2 && shape.size() != 3)
            fail(fmt::format(
                "holds an array of {} ({} axes); height x width, frames x height x width, and either with 1 to 4 "
                "channels behind are taken",
                text.empty() ? "one number" : text, shape.size()));
        if (shape.size() == 3) {
            if (shape[0] > max_frames)
                fail(fmt::format("holds {} frames; at most {} are taken", shape[0], max_frames));
            info_.frame_count = shape[0];
        }
        const std::uint64_t height = shape[shape.size() - 2];
        const std::uint64_t width = shape[shape.size() - 1];
        check_size(width, height);
        info_.width = static_cast<std::uint32_t>(width);
        info_.height = static_cast<std::uint32_t>(height);
        if (info_.axes == 3 && detail::may_lie_behind(info_.frame_count, height, width))
            info_.warnings.push_back(fmt::format(
                "its array of {} is taken as {} frames, {} pixels high and {} wide. If it is height x width x frames, "
                "save numpy.moveaxis(array, -1, 0)",
                text, info_.frame_count, height, width));
    }

    /** What each order of their bytes would make of the numbers. Whole numbers may be meant as they are; such
     * floating-point numbers no image has. */
    void look_at_byte_order() {
        const std::size_t size = type_->size_bytes;
        if (size == 1)
            return;
        detail::WholeNumbers whole(size);
        detail::RealNumbers real(size);
        const bool is_real = type_->code[0] == 'f';
        // A border may be black.
        constexpr std::uint64_t most = 16, block_bytes = 4096;
        const std::uint64_t data_bytes = (file_.size() - data_offset_ - info_.surplus_bytes) / size * size;
        const std::uint64_t blocks = std::clamp<std::uint64_t>(data_bytes / block_bytes, 1, most);
        std::vector<unsigned char> bytes(static_cast<std::size_t>(std::min(data_bytes, block_bytes)));
        for (std::uint64_t block = 0; block < blocks; ++block) {
            file_.seek(data_offset_ + data_bytes / size * block / blocks * size);
            file_.read(bytes.data(), bytes.size());
            for (std::size_t at = 0; at < bytes.size(); at += size) {
                unsigned char as_read[8] = {}, as_swapped[8] = {};
                std::reverse_copy(&bytes[at], &bytes[at] + size, swap_ ? as_read : as_swapped);
                std::copy(&bytes[at], &bytes[at] + size, swap_ ? as_swapped : as_read);
                if (is_real) {
                    real.add(real_number(as_read, size), real_number(as_swapped, size));
                } else {
                    std::uint64_t number;
                    std::memcpy(&number, as_read, sizeof number);
                    whole.add(number);
                }
            }
        }
        if (real.look_swapped())
            fail(fmt::format("{:.0f} % of its numbers are such as no image has ({}), and with their bytes in the other "
                             "order nearly none is: its words have swapped bytes. Save array.byteswap()",
                             100 * real.odd_share(),
                             size == 2 ? "not finite, negative or subnormal"
                                       : "not finite, beyond 1e30 or closer to 0 than 1e-30"));
        const unsigned bits = whole.bits_if_swapped();
        if (bits == 0)
            return;
        info_.looks_swapped = fmt::format("its words {}. If so, save array.byteswap()", detail::told_swapped(bits));
        info_.warnings.push_back(info_.looks_swapped);
    }

    float convert(const unsigned char *bytes) const {
        unsigned char sample[8];
        std::memcpy(sample, bytes, type_->size_bytes);
        if (swap_)
            std::reverse(sample, sample + type_->size_bytes);
        return type_->convert(sample);
    }

    void convert_row(const unsigned char *bytes, std::vector<float> &row) const {
        // What cameras write, of which there may be gigabytes.
        const bool codes = !swap_ && type_->convert == &detail::to_float<std::uint16_t>;
        for (std::size_t i = 0; i < row.size(); ++i)
            row[i] = codes ? detail::to_float<std::uint16_t>(bytes + 2 * i) : convert(bytes + i * type_->size_bytes);
    }

    void read_c(std::uint64_t frame, const RowSink &sink) {
        const std::size_t samples = std::size_t{info_.width} * info_.channels;
        std::vector<unsigned char> bytes(samples * type_->size_bytes);
        std::vector<float> row(samples);
        file_.seek(data_offset_ + frame * info_.height * bytes.size());
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            file_.read(bytes.data(), bytes.size());
            convert_row(bytes.data(), row);
            sink(row.data());
        }
    }

    /** Element (n, y, x, c) lies at n + N (y + H (x + W c)): the whole file is read for any frame, of which as many as
     * fit are kept. */
    void read_fortran(std::uint64_t frame, const RowSink &sink) {
        constexpr std::size_t most_kept_bytes = std::size_t{128} << 20;
        const std::size_t size = type_->size_bytes, frames = info_.frame_count, height = info_.height;
        const std::size_t row_samples = std::size_t{info_.width} * info_.channels, samples = height * row_samples;
        if (kept_.empty() || frame < first_kept_ || (frame - first_kept_) * samples * size >= kept_.size()) {
            first_kept_ = frame;
            const std::size_t count = std::clamp<std::size_t>(most_kept_bytes / (samples * size), 1, frames - frame);
            kept_.resize(count * samples * size);
            std::vector<unsigned char> of_pixel(frames * size);
            file_.seek(data_offset_);
            for (std::size_t c = 0; c < info_.channels; ++c)
                for (std::size_t x = 0; x < info_.width; ++x)
                    for (std::size_t y = 0; y < height; ++y) {
                        file_.read(of_pixel.data(), of_pixel.size());
                        for (std::size_t n = 0; n < count; ++n)
                            std::memcpy(&kept_[(n * samples + y * row_samples + x * info_.channels + c) * size],
                                        &of_pixel[(frame + n) * size], size);
                    }
        }
        std::vector<float> row(row_samples);
        for (std::size_t y = 0; y < height; ++y) {
            convert_row(&kept_[((frame - first_kept_) * samples + y * row_samples) * size], row);
            sink(row.data());
        }
    }

    detail::InputFile file_;
    std::uint64_t data_offset_ = 0;
    bool fortran_order_ = false;
    const SampleType *type_ = nullptr;
    bool swap_ = false;
    std::vector<unsigned char> kept_; // frames of a Fortran-ordered file from first_kept_ on, in C order
    std::uint64_t first_kept_ = 0;
};

class NpyWriter final : public Writer {
  public:
    NpyWriter(const std::string &path, const WriteRequest &request)
        : Writer(path), left_(std::max<std::uint64_t>(1, request.stack_frames)),
          frame_bytes_(std::size_t{request.width} * request.height * size_of(request.sample)) {
        std::vector<std::uint64_t> shape = {request.height, request.width};
        if (request.stack_frames > 0)
            shape.insert(shape.begin(), request.stack_frames);
        const std::string header = npy_header(request.sample == Sample::uint16 ? "'<u2'" : "'<f4'", shape);
        file_.write(header.data(), header.size());
    }

    void append(const void *samples) override {
        file_.write(samples, frame_bytes_);
        // A full disk shows before commit(): of files that appear together none does.
        if (--left_ == 0)
            file_.close();
    }

  private:
    std::uint64_t left_;
    std::size_t frame_bytes_;
};

} // namespace

namespace format_files {

Format npy() {
    Format format;
    format.name = "NPY";
    format.place = 5;
    format.extensions = {".npy"};
    format.magic = {"\x93NUMPY"};
    format.stacks = "3-D NPY";
    format.real = true;
    format.codes = Codes::stacks;
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<NpyReader>(path);
    };
    format.create = [](const std::string &path, const WriteRequest &request) -> std::unique_ptr<Writer> {
        return std::make_unique<NpyWriter>(path, request);
    };
    format.writes = {Sample::uint16, Sample::float32};
    format.storage = {{"npy", Sample::uint16},
                      {"npy-stack", Sample::uint16, true},
                      {"float-npy", Sample::float32},
                      {"float-npy-stack", Sample::float32, true}};
    return format;
}

} // namespace format_files

std::string npy_header(const std::string &descr, const std::vector<std::uint64_t> &shape) {
    std::string text = fmt::format("{{'descr': {}, 'fortran_order': False, 'shape': (", descr);
    for (std::size_t i = 0; i < shape.size(); ++i)
        text += (i ? ", " : "") + std::to_string(shape[i]);
    text += shape.size() == 1 ? ",), }" : "), }";
    // Version 1.0: the data begin at a multiple of 64 bytes.
    text.append((64 - (10 + text.size() + 1) % 64) % 64, ' ');
    text += '\n';
    std::string header = "\x93NUMPY";
    header += '\x01';
    header += '\0';
    header += static_cast<char>(text.size() & 255);
    header += static_cast<char>(text.size() >> 8);
    return header + text;
}

} // namespace image_io
