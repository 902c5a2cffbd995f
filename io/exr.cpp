// OpenEXR: scanline and tiled files, half, float and uint channels. The image is the display window; what lies outside
// the data window is 0, as the format defines.
#include "image_io.hpp"

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

} // namespace

struct ExrFile::Impl {
    std::string path;
    std::unique_ptr<Imf::InputFile> file;
    Imath::Box2i data;
    Imath::Box2i display;
    std::vector<std::string> channels;

    [[noreturn]] void fail(const std::string &what) const { throw ReadError(path, what); }
};

ExrFile::ExrFile(std::string path) : impl_(std::make_unique<Impl>()) {
    static std::once_flag limits;
    std::call_once(limits, [] {
        Imf::Header::setMaxImageSize(static_cast<int>(max_side), static_cast<int>(max_side));
        Imf::Header::setMaxTileSize(static_cast<int>(max_side), static_cast<int>(max_side));
    });
    impl_->path = std::move(path);
    // For the messages about missing, empty and unreadable files.
    const detail::InputFile probe(impl_->path);
    try {
        impl_->file = std::make_unique<Imf::InputFile>(impl_->path.c_str(), 0);
    } catch (const std::bad_alloc &) {
        throw;
    } catch (const std::exception &error) {
        impl_->fail(fmt::format("is not a readable EXR file: {}", error.what()));
    }
    const Imf::Header &header = impl_->file->header();
    impl_->data = header.dataWindow();
    impl_->display = header.displayWindow();
    const auto side = [](int low, int high) { return std::int64_t{high} - low + 1; };
    for (const Imath::Box2i &window : {impl_->display, impl_->data}) {
        const std::int64_t width = side(window.min.x, window.max.x);
        const std::int64_t height = side(window.min.y, window.max.y);
        if (width < 1 || height < 1)
            impl_->fail("the image is empty");
        if (width > max_side || height > max_side)
            impl_->fail(fmt::format("the image has {} x {} pixels; at most {} x {} are taken", width, height, max_side,
                                    max_side));
    }
    if (!impl_->data.intersects(impl_->display))
        impl_->fail("the stored pixels (data window) lie outside the image (display window)");
    if (!impl_->file->isComplete())
        impl_->fail("is truncated: parts of the image are missing; write or copy it again");
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel)
        impl_->channels.emplace_back(channel.name());
}

ExrFile::~ExrFile() = default;
ExrFile::ExrFile(ExrFile &&) noexcept = default;
ExrFile &ExrFile::operator=(ExrFile &&) noexcept = default;

const std::string &ExrFile::path() const {
    return impl_->path;
}
std::uint32_t ExrFile::width() const {
    return static_cast<std::uint32_t>(impl_->display.max.x - impl_->display.min.x + 1);
}
std::uint32_t ExrFile::height() const {
    return static_cast<std::uint32_t>(impl_->display.max.y - impl_->display.min.y + 1);
}
const std::vector<std::string> &ExrFile::channels() const {
    return impl_->channels;
}
bool ExrFile::has(const std::string &channel) const {
    return std::find(impl_->channels.begin(), impl_->channels.end(), channel) != impl_->channels.end();
}
std::string ExrFile::sample(const std::string &channel) const {
    const Imf::Channel *found = impl_->file->header().channels().findChannel(channel);
    return found ? sample_name(found->type) : "";
}

void ExrFile::read_rows(const std::vector<std::string> &names, const RowSink &sink) const {
    const Imath::Box2i &data = impl_->data;
    const Imath::Box2i &display = impl_->display;
    for (const std::string &name : names) {
        const Imf::Channel *channel = impl_->file->header().channels().findChannel(name);
        if (!channel)
            impl_->fail(fmt::format("has no channel \"{}\"; its channels are: {}", name, listed(impl_->channels)));
        if (channel->xSampling != 1 || channel->ySampling != 1)
            impl_->fail(fmt::format("channel \"{}\" is subsampled, which is not supported", name));
    }
    const std::size_t count = names.size();
    const std::int64_t stored_width = std::int64_t{data.max.x} - data.min.x + 1;
    const std::size_t image_width = width();
    // Enough rows for every compression's block, few enough to cost nothing.
    constexpr int band_rows = 32;
    std::vector<float> band(static_cast<std::size_t>(stored_width) * band_rows * count);
    std::vector<float> row(image_width * count);
    const int first = std::max(display.min.x, data.min.x);
    const int last = std::min(display.max.x, data.max.x);
    for (int y = display.min.y; y <= display.max.y;) {
        if (y < data.min.y || y > data.max.y) {
            std::fill(row.begin(), row.end(), 0.0f);
            sink(row.data());
            ++y;
            continue;
        }
        const int y_end = std::min({y + band_rows - 1, data.max.y, display.max.y});
        Imf::FrameBuffer buffer;
        const std::size_t x_stride = count * sizeof(float);
        const std::size_t y_stride = static_cast<std::size_t>(stored_width) * x_stride;
        for (std::size_t c = 0; c < count; ++c)
            buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, band.data() + c, Imath::V2i(data.min.x, y),
                                                     stored_width, std::int64_t{y_end} - y + 1, x_stride, y_stride));
        try {
            impl_->file->setFrameBuffer(buffer);
            impl_->file->readPixels(y, y_end);
        } catch (const std::bad_alloc &) {
            throw;
        } catch (const std::exception &error) {
            impl_->fail(fmt::format("is truncated or damaged, write or copy it again: {}", error.what()));
        }
        for (int band_y = y; band_y <= y_end; ++band_y) {
            std::fill(row.begin(), row.end(), 0.0f);
            const float *from =
                band.data() + (static_cast<std::size_t>(band_y - y) * static_cast<std::size_t>(stored_width) +
                               static_cast<std::size_t>(first - data.min.x)) *
                                  count;
            std::copy(from, from + static_cast<std::size_t>(last - first + 1) * count,
                      row.begin() +
                          static_cast<std::ptrdiff_t>(static_cast<std::size_t>(first - display.min.x) * count));
            sink(row.data());
        }
        y = y_end + 1;
    }
}

namespace {

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
        info_.format = "EXR";
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

std::unique_ptr<Reader> detail::open_exr(const std::string &path, const std::string &channel) {
    return std::make_unique<ExrReader>(path, channel);
}

} // namespace image_io
