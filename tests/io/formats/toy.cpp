// A format as the recipe in docs/guide/architecture.md adds one: all of it. "TOY", width, height, then bytes.
#include "io/formats.hpp"

namespace image_io::format_files {

namespace {

class ToyReader final : public Reader {
  public:
    explicit ToyReader(const std::string &path) : Reader(path), file_(path) {
        file_.seek(3);
        info_.width = byte();
        info_.height = byte();
        check_size(info_.width, info_.height);
        info_.sample = "uint8";
        info_.full_scale = 255;
    }

    void read_rows(std::uint64_t, const RowSink &sink) override {
        file_.seek(5);
        std::vector<float> row(info_.width);
        for (std::uint32_t y = 0; y < info_.height; ++y) {
            for (float &value : row)
                value = byte();
            sink(row.data());
        }
    }

  private:
    unsigned char byte() {
        unsigned char value = 0;
        file_.read(&value, 1);
        return value;
    }

    detail::InputFile file_;
};

class ToyWriter final : public Writer {
  public:
    ToyWriter(const std::string &path, const WriteRequest &request)
        : Writer(path), size_(request.width * request.height) {
        const char header[] = {'T', 'O', 'Y', static_cast<char>(request.width), static_cast<char>(request.height)};
        file_.write(header, sizeof header);
    }
    void append(const void *samples) override { file_.write(samples, size_); }

  private:
    std::size_t size_;
};

} // namespace

Format toy();
Format toy() {
    Format format;
    format.name = "TOY";
    format.place = 99;
    format.extensions = {".toy"};
    format.magic = {"TOY"};
    format.codes = Codes::frames;
    format.open = [](const std::string &path, const ReadRequest &) -> std::unique_ptr<Reader> {
        return std::make_unique<ToyReader>(path);
    };
    format.create = [](const std::string &path, const WriteRequest &request) -> std::unique_ptr<Writer> {
        return std::make_unique<ToyWriter>(path, request);
    };
    format.writes = {Sample::uint8};
    return format;
}

} // namespace image_io::format_files
