// JPEG by libjpeg-turbo, which libtiff brings along: stb_image 2.27 reads outside of its Huffman tables for damaged
// files.
#include "io/formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string_view>

#include <jpeglib.h>

namespace image_io::format_files {

namespace {

/** libjpeg's state, whose errors jump out of it: what runs in guarded() must own nothing. */
class JpegDecoder {
  public:
    explicit JpegDecoder(std::FILE *stream) {
        info_.err = jpeg_std_error(&errors_);
        errors_.error_exit = [](j_common_ptr info) {
            auto *self = static_cast<JpegDecoder *>(info->client_data);
            info->err->format_message(info, self->message_);
            std::longjmp(self->jump_, 1);
        };
        errors_.emit_message = [](j_common_ptr info, int level) {
            auto *self = static_cast<JpegDecoder *>(info->client_data);
            // A warning is damage; libjpeg goes on with pixels of chance.
            if (level < 0 && self->message_[0] == '\0')
                info->err->format_message(info, self->message_);
        };
        progress_.progress_monitor = [](j_common_ptr info) {
            auto *self = static_cast<JpegDecoder *>(info->client_data);
            if (self->info_.input_scan_number <= most_scans)
                return;
            std::snprintf(self->message_, sizeof self->message_, "it has more than %d scans", most_scans);
            std::longjmp(self->jump_, 1);
        };
        info_.client_data = this;
        guarded([&] {
            jpeg_create_decompress(&info_);
            info_.progress = &progress_;
            info_.mem->max_memory_to_use = most_memory_bytes;
            jpeg_stdio_src(&info_, stream);
            jpeg_save_markers(&info_, JPEG_APP0 + 1, 0xffff);
            jpeg_save_markers(&info_, JPEG_APP0 + 2, 0xffff);
            jpeg_read_header(&info_, TRUE);
        });
    }
    ~JpegDecoder() { jpeg_destroy_decompress(&info_); }
    JpegDecoder(const JpegDecoder &) = delete;
    JpegDecoder &operator=(const JpegDecoder &) = delete;

    const jpeg_decompress_struct &info() const { return info_; }
    const char *message() const { return message_; } ///< Empty: all is well.

    void start(J_COLOR_SPACE colors) {
        guarded([&] {
            info_.out_color_space = colors;
            info_.dct_method = JDCT_ISLOW;
            jpeg_start_decompress(&info_);
        });
    }
    /** The parts of the ICC profile, in order; empty: they are not all there. */
    std::vector<unsigned char> profile() {
        JOCTET *data = nullptr;
        unsigned size = 0;
        guarded([&] { (void)jpeg_read_icc_profile(&info_, &data, &size); });
        std::vector<unsigned char> bytes(data, data + size);
        std::free(data);
        return bytes;
    }
    void read_row(unsigned char *row) {
        guarded([&] { jpeg_read_scanlines(&info_, &row, 1); });
    }
    void finish() {
        guarded([&] { jpeg_finish_decompress(&info_); });
    }

  private:
    // A progressive file has about ten; each costs a walk over the whole image.
    static constexpr int most_scans = 32;
    // Coefficients of progressive files; rows of the others take next to nothing.
    static constexpr long most_memory_bytes = 1L << 30;

    template <typename Body> void guarded(Body &&body) {
        if (setjmp(jump_) == 0)
            body();
    }

    jpeg_decompress_struct info_{};
    jpeg_error_mgr errors_{};
    jpeg_progress_mgr progress_{};
    std::jmp_buf jump_;
    char message_[JMSG_LENGTH_MAX] = {};
};

/** What stands behind a name in the first APP1 marker that begins with it. */
std::optional<std::string_view> named_data(const jpeg_decompress_struct &info, std::string_view name) {
    for (const jpeg_marker_struct *marker = info.marker_list; marker; marker = marker->next) {
        const std::string_view data(reinterpret_cast<const char *>(marker->data), marker->data_length);
        if (marker->marker == JPEG_APP0 + 1 && data.substr(0, name.size()) == name)
            return data.substr(name.size());
    }
    return std::nullopt;
}

bool has_profile(const jpeg_decompress_struct &info) {
    for (const jpeg_marker_struct *marker = info.marker_list; marker; marker = marker->next)
        if (marker->data_length >= 12 && std::memcmp(marker->data, "ICC_PROFILE", 12) == 0)
            return true;
    return false;
}

/** Whether a list of several pictures begins the file (CIPA DC-007), as cameras with two lenses write it. */
bool has_several(const jpeg_decompress_struct &info) {
    for (const jpeg_marker_struct *marker = info.marker_list; marker; marker = marker->next)
        if (marker->data_length >= 4 && std::memcmp(marker->data, "MPF", 4) == 0)
            return true;
    return false;
}

class JpegReader final : public Reader {
  public:
    explicit JpegReader(const std::string &path) : Reader(path), file_(path) {
        JpegDecoder decoder(file_.stream());
        check(decoder, "");
        const jpeg_decompress_struct &info = decoder.info();
        check_size(info.image_width, info.image_height);
        const bool gray = info.num_components == 1;
        if (!gray &&
            !(info.num_components == 3 && (info.jpeg_color_space == JCS_YCbCr || info.jpeg_color_space == JCS_RGB)))
            fail(fmt::format("has {} components, as for print (CMYK); gray and RGB are taken. Convert it to PNG",
                             info.num_components));
        info_.sample = "uint8";
        info_.width = info.image_width;
        info_.height = info.image_height;
        info_.channels = gray ? 1 : 3;
        info_.full_scale = 255;
        info_.lossy = true;
        info_.transfer = srgb("the format");
        if (has_profile(info)) {
            const std::vector<unsigned char> profile = decoder.profile();
            info_.transfer = profile.empty() ? unknown_transfer("its ICC profile", "content of which parts are missing")
                                             : transfer_of_icc(profile.data(), profile.size());
        }
        if (info.saw_JFIF_marker && info.X_density > 0)
            warn_of_aspect(static_cast<double>(info.Y_density) / info.X_density);
        info_.warnings.push_back(
            "the compression of JPEG is lossy. Where intensities matter use linear PNG, TIFF or EXR "
            "files");
        if (has_several(info))
            info_.warnings.push_back("it holds several pictures (MPO), of which the first is read. Save each as a file "
                                     "of its own, for example by PIL.Image.open(path).seek(1)");
        else
            info_.surplus_bytes = file_.size() - end_of_picture();
        using namespace std::string_view_literals;
        if (const auto exif = named_data(info, "Exif\0\0"sv))
            warn_of_exif(reinterpret_cast<const unsigned char *>(exif->data()), exif->size(), "its EXIF data");
        if (const auto xmp = named_data(info, "http://ns.adobe.com/xap/1.0/\0"sv))
            warn_of_xmp(*xmp);
    }

    void read_rows(std::uint64_t, const RowSink &sink) override {
        file_.seek(0);
        JpegDecoder decoder(file_.stream());
        check(decoder, "");
        if (decoder.info().image_width != info_.width || decoder.info().image_height != info_.height)
            fail("changed while it was read");
        decoder.start(info_.channels == 1 ? JCS_GRAYSCALE : JCS_RGB);
        check(decoder, "");
        std::vector<unsigned char> bytes(std::size_t{info_.width} * info_.channels);
        std::vector<float> row(bytes.size());
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            decoder.read_row(bytes.data());
            check(decoder, fmt::format(" near row {}", y));
            std::copy(bytes.begin(), bytes.end(), row.begin());
            sink(row.data());
        }
        decoder.finish();
        check(decoder, " behind its last row");
    }

  private:
    /** From segment to segment; codes of pixels have no marker but restarts. The end of the file where it is cut. */
    std::uint64_t end_of_picture() {
        file_.seek(2);
        int c = file_.get();
        while (c != -1) {
            const int marker = c == 0xff ? file_.get() : -2;
            if (marker == 0xd9)
                return static_cast<std::uint64_t>(::ftello(file_.stream()));
            const bool has_length = marker > 1 && marker != 0xff && (marker < 0xd0 || marker > 0xd7);
            if (marker == 0xff)
                continue; // padding: c is the next marker's begin
            if (has_length) {
                const int high = file_.get(), low = file_.get();
                for (int rest = 256 * high + low - 2; rest > 0 && file_.get() != -1;)
                    --rest;
            }
            c = file_.get();
            while (c != -1 && c != 0xff)
                c = file_.get();
        }
        return file_.size();
    }

    void check(const JpegDecoder &decoder, const std::string &where) const {
        if (decoder.message()[0] != '\0')
            fail(fmt::format("is truncated, damaged or of a kind that is not read{}: {}; write or copy it again", where,
                             decoder.message()));
    }

    detail::InputFile file_;
};

} // namespace

Format jpeg() {
    Format format;
    format.name = "JPEG";
    format.place = 7;
    format.extensions = {".jpg", ".jpeg"};
    format.magic = {"\xff\xd8\xff"};
    format.no_codes_because = "its compression changes codes and their noise; let the camera store raw frames, PNG, "
                              "TIFF or PGM, which keep them";
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<JpegReader>(path);
    };
    return format;
}

} // namespace image_io::format_files
