// OpenEXR: scanline and tiled files of one part or several, half, float and uint channels. The image is the display
// window; what lies outside the data window is 0, as the format defines.
#include "io/openexr.hpp"

#include "io/channels.hpp"
#include "io/formats.hpp"

#include <fmt/format.h>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <openexr.h>

#include <algorithm>
#include <map>
#include <mutex>

namespace image_io {

namespace {

/** Renderers write some hundreds; the search for a channel, here and in the library, goes over all of them for each. */
constexpr std::size_t most_channels = 1024;

const char *sample_name(Imf::PixelType type) {
    return type == Imf::HALF ? "float16" : type == Imf::FLOAT ? "float32" : "uint32";
}

/** The name of a compression that changes numbers of that kind; empty: it keeps them. */
std::string lossy_name(Imf::Compression compression, const std::string &channel, Imf::PixelType type) {
    switch (compression) {
    case Imf::PXR24_COMPRESSION:
        return type == Imf::FLOAT ? "PXR24, of 24 bits" : "";
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
        return type == Imf::HALF ? "B44" : "";
    case Imf::DWAA_COMPRESSION:
    case Imf::DWAB_COMPRESSION: {
        // It knows pictures by the last word of a channel's name, and keeps the others.
        const std::string last = channel.substr(channel.rfind('.') + 1);
        const bool picture = last == "R" || last == "G" || last == "B" || last == "Y" || last == "RY" || last == "BY";
        return picture && type != Imf::UINT ? "DWA" : "";
    }
    default:
        return "";
    }
}

/** One part's pixels of a plain file, or of one with several parts. */
struct Part {
    std::unique_ptr<Imf::InputPart> pixels;
    std::string name;
    Imf::Compression compression = Imf::NO_COMPRESSION;
    Imath::Box2i data;
    Imath::Box2i display;
};

/** Lets the C library look at the header first: the C++ library does not hold the sizes of attributes against their
 * types, and loses its place. */
void check_header(const std::string &path) {
    exr_result_t told = EXR_ERR_SUCCESS;
    exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
    settings.user_data = &told;
    // Some faults are told, and passed over.
    settings.error_handler_fn = [](exr_const_context_t context, exr_result_t code, const char *) {
        void *user = nullptr;
        if (exr_get_user_data(context, &user) == EXR_ERR_SUCCESS)
            *static_cast<exr_result_t *>(user) = code;
    };
    exr_context_t context = nullptr;
    const exr_result_t result = exr_start_read(&context, path.c_str(), &settings);
    (void)exr_finish(&context);
    if (result != EXR_ERR_SUCCESS || told != EXR_ERR_SUCCESS)
        throw ReadError(path, fmt::format("is not a readable EXR file, write or copy it again: {}",
                                          exr_get_default_error_message(result != EXR_ERR_SUCCESS ? result : told)));
}

/** Holds the sizes of attributes against that of the file: the C++ library takes the memory before it reads. */
void check_attributes(const std::string &path) {
    detail::InputFile file(path);
    const auto word = [&] {
        unsigned char bytes[4];
        file.read(bytes, sizeof bytes);
        return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 | std::uint32_t{bytes[3]} << 24;
    };
    const auto text = [&] {
        std::string read;
        for (int c = file.get(); c > 0; c = file.get())
            read += static_cast<char>(c);
        return read;
    };
    const auto position = [&] { return static_cast<std::uint64_t>(::ftello(file.stream())); };
    std::size_t channels = 0;
    (void)word();
    const bool several = (word() & 0x1000) != 0;
    for (;;) {
        // An empty name ends a header; behind those of several parts there is one more.
        if (text().empty() && (!several || text().empty()))
            return;
        const bool list = text() == "chlist";
        const std::uint32_t size = word();
        const std::uint64_t end = position() + size;
        if (end > file.size())
            throw ReadError(path,
                            fmt::format("is truncated or damaged: an attribute of its header claims {} bytes, the "
                                        "file has {}; write or copy it again",
                                        size, file.size()));
        // The library reads the list of channels up to an empty name, whatever its size.
        bool ended = !list;
        while (!ended && position() < end) {
            ended = text().empty();
            if (!ended && ++channels > most_channels)
                throw ReadError(path, fmt::format("has more than {} channels; save those that are needed as a file of "
                                                  "their own",
                                                  most_channels));
            file.seek(position() + (ended ? 0 : 16));
        }
        if (list && !(ended && position() == end))
            throw ReadError(path, "is damaged: its list of channels has another size than it claims; write or copy it "
                                  "again");
        file.seek(end);
    }
}

class ExrFile final : public ChannelFile {
  public:
    explicit ExrFile(const std::string &path) : ChannelFile(path) {
        static std::once_flag limits;
        std::call_once(limits, [] {
            Imf::Header::setMaxImageSize(static_cast<int>(max_side), static_cast<int>(max_side));
            Imf::Header::setMaxTileSize(static_cast<int>(max_side), static_cast<int>(max_side));
        });
        check_attributes(path_); // first: the library's work grows with the square of the channels
        check_header(path_);
        try {
            file_ = std::make_unique<Imf::MultiPartInputFile>(path_.c_str(), 0);
            open_parts();
        } catch (const std::bad_alloc &) {
            throw;
        } catch (const ReadError &) {
            throw;
        } catch (const std::exception &error) {
            fail(fmt::format("is not a readable EXR file: {}", error.what()));
        }
        const Imath::Box2i &first = parts_.front().display;
        width_ = static_cast<std::uint32_t>(side(first.min.x, first.max.x));
        height_ = static_cast<std::uint32_t>(side(first.min.y, first.max.y));
    }

    std::string sample(const std::string &channel) const override {
        const Place *place = find(channel);
        return place ? sample_name(place->type) : "";
    }

    void read_rows(const std::vector<std::string> &names, const RowSink &sink) const override;

    /** The compression of a channel, where it changes numbers. */
    std::string lossy(const std::string &channel) const {
        const Place *place = find(channel);
        return place ? lossy_name(parts_[place->part].compression, place->name, place->type) : "";
    }

    /** Views of one file whose channels of the first have no word for it; empty: it has one. */
    std::vector<std::string> views() const {
        return Imf::hasMultiView(file_->header(0)) ? Imf::multiView(file_->header(0)) : std::vector<std::string>();
    }

    /** A text of the first part's header; empty: it has none. */
    std::string text(const char *attribute) const {
        const auto *found = file_->header(0).findTypedAttribute<Imf::StringAttribute>(attribute);
        return found ? found->value() : "";
    }

    /** What 1 means, as the first part says; 0: it does not. */
    float white_luminance() const {
        return Imf::hasWhiteLuminance(file_->header(0)) ? Imf::whiteLuminance(file_->header(0)) : 0.0f;
    }

    /** As programs that convert photographs keep it; 1: as stored. */
    unsigned orientation() const {
        const auto *found = file_->header(0).findTypedAttribute<Imf::IntAttribute>("Orientation");
        return found ? static_cast<unsigned>(std::max(0, found->value())) : 1;
    }

    /** Width over height of a pixel, as the first part says. */
    double pixel_aspect() const { return file_->header(0).pixelAspectRatio(); }

  private:
    /** Where a channel is. */
    struct Place {
        std::size_t part = 0;
        std::string name; ///< Within the part.
        Imf::PixelType type = Imf::FLOAT;
        bool subsampled = false;
    };

    static std::int64_t side(int low, int high) { return std::int64_t{high} - low + 1; }

    void open_parts() {
        bool deep = false;
        for (int i = 0; i < file_->parts(); ++i) {
            const Imf::Header &header = file_->header(i);
            if (header.hasType() && Imf::isDeepData(header.type())) {
                deep = true;
                continue;
            }
            Part part;
            part.compression = header.compression();
            part.data = header.dataWindow();
            part.display = header.displayWindow();
            part.name = file_->parts() > 1 && header.hasName() ? header.name() : "";
            const std::string of = part.name.empty() ? "" : fmt::format("part \"{}\": ", part.name);
            for (const Imath::Box2i &window : {part.display, part.data}) {
                const std::int64_t width = side(window.min.x, window.max.x);
                const std::int64_t height = side(window.min.y, window.max.y);
                if (width < 1 || height < 1)
                    fail(of + "the image is empty");
                if (width > max_side || height > max_side)
                    fail(fmt::format("{}the image has {} x {} pixels; at most {} x {} are taken", of, width, height,
                                     max_side, max_side));
            }
            if (!part.data.intersects(part.display))
                fail(fmt::format(
                    "{}the stored pixels (data window, x {} to {}, y {} to {}) lie outside the image (display window, "
                    "x {} to {}, y {} to {}). If they are the image, save it with one window: "
                    "file = OpenEXR.File(path, separate_channels=True); "
                    "file.header()[\"displayWindow\"] = file.header()[\"dataWindow\"]; "
                    "file.write(new_path)",
                    of, part.data.min.x, part.data.max.x, part.data.min.y, part.data.max.y, part.display.min.x,
                    part.display.max.x, part.display.min.y, part.display.max.y));
            if (!file_->partComplete(i))
                fail(of + "is truncated: parts of the image are missing; write or copy it again");
            part.pixels = std::make_unique<Imf::InputPart>(*file_, i);
            const std::string prefix = part.name.empty() ? "" : part.name + ".";
            for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
                const std::string name = channel.name();
                channels_.push_back(name.rfind(prefix, 0) == 0 ? name : prefix + name);
                short_names_.push_back(name);
                places_.push_back({parts_.size(), name, channel.channel().type,
                                   channel.channel().xSampling != 1 || channel.channel().ySampling != 1});
            }
            parts_.push_back(std::move(part));
        }
        if (parts_.empty())
            fail(deep ? "is not a readable EXR file: its pixels are deep (several values for each); flatten them"
                      : "is not a readable EXR file: it has no parts");
    }

    const Place *find(const std::string &channel) const {
        const auto found = std::find(channels_.begin(), channels_.end(), name_of(channel));
        return found == channels_.end() ? nullptr : &places_[static_cast<std::size_t>(found - channels_.begin())];
    }

    /** Reads rows of the image from one part; those outside of its data window stay. @param columns where each channel
     * goes. */
    void read_band(const Part &part, const std::vector<std::pair<std::string, std::size_t>> &columns, int y, int y_end,
                   std::size_t count, std::vector<float> &band) const;

    std::unique_ptr<Imf::MultiPartInputFile> file_;
    std::vector<Part> parts_;
    std::vector<Place> places_; ///< Of each of channels_.
};

void ExrFile::read_band(const Part &part, const std::vector<std::pair<std::string, std::size_t>> &columns, int y,
                        int y_end, std::size_t count, std::vector<float> &band) const {
    const int first_row = std::max(y, part.data.min.y), last_row = std::min(y_end, part.data.max.y);
    if (first_row > last_row)
        return;
    const auto stored_width = static_cast<std::size_t>(side(part.data.min.x, part.data.max.x));
    const std::size_t stored = columns.size();
    std::vector<float> pixels(stored_width * static_cast<std::size_t>(last_row - first_row + 1) * stored);
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < stored; ++c)
        buffer.insert(columns[c].first,
                      Imf::Slice::Make(Imf::FLOAT, pixels.data() + c, Imath::V2i(part.data.min.x, first_row),
                                       static_cast<std::int64_t>(stored_width), std::int64_t{last_row} - first_row + 1,
                                       stored * sizeof(float), stored_width * stored * sizeof(float)));
    try {
        part.pixels->setFrameBuffer(buffer);
        part.pixels->readPixels(first_row, last_row);
    } catch (const std::bad_alloc &) {
        throw;
    } catch (const std::exception &error) {
        fail(fmt::format("is truncated or damaged, write or copy it again: {}", error.what()));
    }
    const int first = std::max(part.display.min.x, part.data.min.x);
    const int last = std::min(part.display.max.x, part.data.max.x);
    for (int row = first_row; row <= last_row; ++row) {
        const float *from = pixels.data() + (static_cast<std::size_t>(row - first_row) * stored_width +
                                             static_cast<std::size_t>(first - part.data.min.x)) *
                                                stored;
        float *to = band.data() + (static_cast<std::size_t>(row - y) * width() +
                                   static_cast<std::size_t>(first - part.display.min.x)) *
                                      count;
        for (int x = first; x <= last; ++x, from += stored, to += count)
            for (std::size_t c = 0; c < stored; ++c)
                to[columns[c].second] = from[c];
    }
}

void ExrFile::read_rows(const std::vector<std::string> &names, const RowSink &sink) const {
    std::map<std::size_t, std::vector<std::pair<std::string, std::size_t>>> columns; // of each part
    for (std::size_t c = 0; c < names.size(); ++c) {
        const Place *place = find(names[c]);
        if (!place)
            fail(fmt::format("has no channel \"{}\"; its channels are: {}", names[c], fmt::join(channels(), ", ")));
        if (place->subsampled)
            fail(fmt::format("channel \"{}\" is subsampled, which is not supported; store it in full", names[c]));
        const Imath::Box2i &display = parts_[place->part].display;
        if (side(display.min.x, display.max.x) != width() || side(display.min.y, display.max.y) != height())
            fail(fmt::format("channel \"{}\" has {} x {} pixels, the first part {} x {}; store it in a file of its own",
                             names[c], side(display.min.x, display.max.x), side(display.min.y, display.max.y), width(),
                             height()));
        // A channel that is asked for twice is read once: a frame buffer holds each name once.
        auto &of_part = columns[place->part];
        for (const auto &[name, at] : of_part)
            if (name == place->name)
                fail(fmt::format("channel \"{}\" is named twice", names[c]));
        of_part.emplace_back(place->name, c);
    }
    // Enough rows for every compression's block, few enough to cost nothing.
    constexpr int band_rows = 32;
    const std::size_t row_samples = std::size_t{width()} * names.size();
    std::vector<float> band;
    const int rows = static_cast<int>(height());
    for (int y = 0; y < rows; y += band_rows) {
        const int count = std::min(band_rows, rows - y);
        band.assign(row_samples * static_cast<std::size_t>(count), 0.0f);
        for (const auto &[part, of_part] : columns) {
            const int top = parts_[part].display.min.y + y;
            read_band(parts_[part], of_part, top, top + count - 1, names.size(), band);
        }
        for (int row = 0; row < count; ++row)
            sink(band.data() + static_cast<std::size_t>(row) * row_samples);
    }
}

class ExrReader final : public Reader {
  public:
    ExrReader(const std::string &path, const ReadRequest &request) : Reader(path), file_(path) {
        ReadRequest known = request;
        if (const std::string name = file_.name_of(request.channel); !request.channel.empty() && !name.empty())
            known.channel = name;
        names_ = select_channels(path, file_.channels(), known);
        info_.sample = file_.sample(names_[0]);
        info_.width = file_.width();
        info_.height = file_.height();
        info_.channels = static_cast<std::uint32_t>(names_.size());
        if (const float luminance = file_.white_luminance(); luminance > 0 && request.role == Role::image)
            info_.warnings.push_back(fmt::format("its whiteLuminance ({:g} cd/m^2) is ignored: 1 is full scale "
                                                 "(--irradiance-scale)",
                                                 luminance));
        warn_of_aspect(file_.pixel_aspect());
        warn_of_orientation(file_.orientation());
        for (const std::string &name : names_)
            if (const std::string lossy = file_.lossy(name); !lossy.empty() && !info_.lossy) {
                info_.lossy = true;
                info_.warnings.push_back(fmt::format("its compression ({}) is lossy. Where intensities matter save it "
                                                     "with ZIP or PIZ",
                                                     lossy));
            }
        for (const char *said_by : {"colorInteropID", "oiio:ColorSpace"})
            if (const std::string space = file_.text(said_by); !space.empty())
                info_.transfer = transfer_of_color_space(space, fmt::format("its attribute {}", said_by));
        if (const std::vector<std::string> views = file_.views(); request.channel.empty() && views.size() > 1)
            info_.warnings.push_back(fmt::format("it holds the views {}, of which {} is taken; name one behind "
                                                 "the file's name, for example {}:{}",
                                                 fmt::join(views, ", "), views.front(), path, views[1]));
    }

    void read_rows(std::uint64_t, const RowSink &sink) override { file_.read_rows(names_, sink); }

  private:
    ExrFile file_;
    std::vector<std::string> names_;
};

} // namespace

void add_openexr() {
    Format format = format_named("EXR");
    format.open = [](const std::string &path, const ReadRequest &request) -> std::unique_ptr<Reader> {
        return std::make_unique<ExrReader>(path, request);
    };
    format.open_channels = [](const std::string &path) -> std::unique_ptr<ChannelFile> {
        return std::make_unique<ExrFile>(path);
    };
    add_format(std::move(format));
}

} // namespace image_io
