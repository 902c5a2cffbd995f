// OpenEXR: scanline and tiled files, half, float and uint channels. The image is the display window; what lies outside
// the data window is 0, as the format defines.
#include "io/openexr.hpp"

#include "io/formats.hpp"

#include <fmt/format.h>

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfVersion.h>

#include <algorithm>
#include <mutex>
#include <set>

namespace image_io {

namespace {

const char *sample_name(Imf::PixelType type) {
    return type == Imf::HALF ? "float16" : type == Imf::FLOAT ? "float32" : "uint32";
}

std::string listed(const std::vector<std::string> &names) {
    std::string text;
    for (const std::string &name : names)
        text += (text.empty() ? "" : ", ") + name;
    return text.empty() ? "none" : text;
}

class ExrFile final : public ChannelFile {
  public:
    explicit ExrFile(const std::string &path) : ChannelFile(path) {
        static std::once_flag limits;
        std::call_once(limits, [] {
            Imf::Header::setMaxImageSize(static_cast<int>(max_side), static_cast<int>(max_side));
            Imf::Header::setMaxTileSize(static_cast<int>(max_side), static_cast<int>(max_side));
        });
        try {
            file_ = std::make_unique<Imf::InputFile>(path_.c_str(), 0);
        } catch (const std::bad_alloc &) {
            throw;
        } catch (const std::exception &error) {
            fail(fmt::format("is not a readable EXR file: {}", error.what()));
        }
        const Imf::Header &header = file_->header();
        data_ = header.dataWindow();
        display_ = header.displayWindow();
        const auto side = [](int low, int high) { return std::int64_t{high} - low + 1; };
        for (const Imath::Box2i &window : {display_, data_}) {
            const std::int64_t width = side(window.min.x, window.max.x);
            const std::int64_t height = side(window.min.y, window.max.y);
            if (width < 1 || height < 1)
                fail("the image is empty");
            if (width > max_side || height > max_side)
                fail(fmt::format("the image has {} x {} pixels; at most {} x {} are taken", width, height, max_side,
                                 max_side));
        }
        if (!data_.intersects(display_))
            fail("the stored pixels (data window) lie outside the image (display window)");
        if (!file_->isComplete())
            fail("is truncated: parts of the image are missing; write or copy it again");
        width_ = static_cast<std::uint32_t>(side(display_.min.x, display_.max.x));
        height_ = static_cast<std::uint32_t>(side(display_.min.y, display_.max.y));
        for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
            channels_.emplace_back(channel.name());
    }

    std::string sample(const std::string &channel) const override {
        const Imf::Channel *found = file_->header().channels().findChannel(channel);
        return found ? sample_name(found->type) : "";
    }

    void read_rows(const std::vector<std::string> &names, const RowSink &sink) const override;

  private:
    std::unique_ptr<Imf::InputFile> file_;
    Imath::Box2i data_;
    Imath::Box2i display_;
};

void ExrFile::read_rows(const std::vector<std::string> &names, const RowSink &sink) const {
    for (const std::string &name : names) {
        const Imf::Channel *channel = file_->header().channels().findChannel(name);
        if (!channel)
            fail(fmt::format("has no channel \"{}\"; its channels are: {}", name, listed(channels_)));
        if (channel->xSampling != 1 || channel->ySampling != 1)
            fail(fmt::format("channel \"{}\" is subsampled, which is not supported", name));
    }
    const std::size_t count = names.size();
    const std::int64_t stored_width = std::int64_t{data_.max.x} - data_.min.x + 1;
    const std::size_t image_width = width();
    // Enough rows for every compression's block, few enough to cost nothing.
    constexpr int band_rows = 32;
    std::vector<float> band(static_cast<std::size_t>(stored_width) * band_rows * count);
    std::vector<float> row(image_width * count);
    const int first = std::max(display_.min.x, data_.min.x);
    const int last = std::min(display_.max.x, data_.max.x);
    for (int y = display_.min.y; y <= display_.max.y;) {
        if (y < data_.min.y || y > data_.max.y) {
            std::fill(row.begin(), row.end(), 0.0f);
            sink(row.data());
            ++y;
            continue;
        }
        const int y_end = std::min({y + band_rows - 1, data_.max.y, display_.max.y});
        Imf::FrameBuffer buffer;
        const std::size_t x_stride = count * sizeof(float);
        const std::size_t y_stride = static_cast<std::size_t>(stored_width) * x_stride;
        for (std::size_t c = 0; c < count; ++c)
            buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, band.data() + c, Imath::V2i(data_.min.x, y),
                                                     stored_width, std::int64_t{y_end} - y + 1, x_stride, y_stride));
        try {
            file_->setFrameBuffer(buffer);
            file_->readPixels(y, y_end);
        } catch (const std::bad_alloc &) {
            throw;
        } catch (const std::exception &error) {
            fail(fmt::format("is truncated or damaged, write or copy it again: {}", error.what()));
        }
        for (int band_y = y; band_y <= y_end; ++band_y) {
            std::fill(row.begin(), row.end(), 0.0f);
            const float *from =
                band.data() + (static_cast<std::size_t>(band_y - y) * static_cast<std::size_t>(stored_width) +
                               static_cast<std::size_t>(first - data_.min.x)) *
                                  count;
            std::copy(from, from + static_cast<std::size_t>(last - first + 1) * count,
                      row.begin() +
                          static_cast<std::ptrdiff_t>(static_cast<std::size_t>(first - display_.min.x) * count));
            sink(row.data());
        }
        y = y_end + 1;
    }
}

class ExrReader final : public Reader {
  public:
    ExrReader(const std::string &path, const std::string &channel) : Reader(path), file_(path) {
        std::vector<std::string> colors;
        for (const std::string &name : file_.channels())
            if (name != "A")
                colors.push_back(name);
        if (!channel.empty())
            names_ = {channel};
        else if (colors.size() == 1)
            names_ = colors;
        else if (file_.has("Y"))
            names_ = {"Y"};
        else if (file_.has("R") && file_.has("G") && file_.has("B"))
            names_ = {"R", "G", "B"};
        else
            fail(fmt::format("name the channel to read (--channel); its channels are: {}", listed(file_.channels())));
        for (const std::string &name : names_)
            if (!file_.has(name))
                fail(fmt::format("has no channel \"{}\"; its channels are: {}", name, listed(file_.channels())));
        info_.sample = file_.sample(names_[0]);
        info_.width = file_.width();
        info_.height = file_.height();
        info_.channels = static_cast<std::uint32_t>(names_.size());
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
        return std::make_unique<ExrReader>(path, request.channel);
    };
    format.open_channels = [](const std::string &path) -> std::unique_ptr<ChannelFile> {
        return std::make_unique<ExrFile>(path);
    };
    add_format(std::move(format));
}

} // namespace image_io
