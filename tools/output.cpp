#include "output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <thread>

namespace tools {

float percentile(std::vector<float> &values, double share) {
    const auto index = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(index);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

PreviewScale PreviewScale::of(const Samples &samples) {
    std::vector<float> values;
    std::visit([&](const auto &all) { values.assign(all.begin(), all.end()); }, samples);
    PreviewScale scale;
    scale.black = percentile(values, 0.001);
    scale.white = percentile(values, 0.999);
    // Few bright dots on black: the percentiles coincide, the maximum does not.
    if (scale.white <= scale.black)
        scale.white = *std::max_element(values.begin(), values.end());
    if (scale.white <= scale.black)
        scale.white = scale.black + 1;
    return scale;
}

std::vector<std::string> FrameFormat::words() {
    std::vector<std::string> codes, values;
    for (const image_io::Format &format : image_io::formats())
        for (const image_io::FrameStorage &storage : format.storage)
            (storage.sample == image_io::Sample::float32 ? values : codes).push_back(storage.word);
    codes.insert(codes.end(), values.begin(), values.end());
    return codes;
}

FrameFormat::FrameFormat(const std::string &word) {
    for (const image_io::Format &one : image_io::formats())
        for (const image_io::FrameStorage &way : one.storage)
            if (way.word == word) {
                format = &one;
                storage = &way;
                return;
            }
    throw std::out_of_range("no way to store frames is called " + word);
}

std::string FrameFormat::file_name(std::uint64_t number) const {
    return storage->stack ? "frames" + format->extension() : fmt::format("frame_{:06}{}", number, format->extension());
}

Output::Output(std::string folder, const FrameFormat &format, std::uint64_t frame_count, std::uint32_t width,
               std::uint32_t height)
    : folder_(std::move(folder)), format_(format), width_(width), height_(height),
      job_limit_(std::max(2u, std::thread::hardware_concurrency())) {
    if (format_.storage->stack)
        stack_ = image_io::create(begin(format_.file_name(0)), *format_.format,
                                  {width, height, format_.storage->sample, frame_count});
}

// The jobs use everything else here: they end first. What they still write is whole.
Output::~Output() {
    jobs_.clear();
}

std::string Output::path(const std::string &name) {
    return (std::filesystem::path(folder_) / name).string();
}

std::string Output::begin(const std::string &name) {
    std::error_code ignored;
    if (std::filesystem::exists(std::filesystem::symlink_status(path(name), ignored))) {
        const std::lock_guard<std::mutex> lock(files_mutex_);
        replaced_.push_back(name);
    }
    return path(name);
}

void Output::wait() {
    for (std::future<void> &job : jobs_)
        job.wait();
}

std::size_t Output::discard() {
    wait();
    jobs_.clear();
    stack_.reset();
    std::size_t count = 0;
    std::error_code ignored;
    for (const std::string &name : files_)
        if (std::find(replaced_.begin(), replaced_.end(), name) == replaced_.end())
            count += std::filesystem::remove(path(name), ignored);
    files_.clear();
    return count;
}

void Output::enqueue(std::function<void()> job) {
    while (jobs_.size() >= job_limit_) {
        std::future<void> oldest = std::move(jobs_.front());
        jobs_.pop_front();
        oldest.get();
    }
    jobs_.push_back(std::async(std::launch::async, std::move(job)));
}

void Output::write_preview(const std::string &name, const Samples &samples, const PreviewScale &scale) {
    std::vector<std::uint8_t> codes;
    std::visit(
        [&](const auto &values) {
            codes.resize(values.size());
            const float factor = 255.0f / (scale.white - scale.black);
            std::transform(values.begin(), values.end(), codes.begin(), [&](auto value) {
                const float level = (static_cast<float>(value) - scale.black) * factor;
                return static_cast<std::uint8_t>(std::lround(std::clamp(level, 0.0f, 255.0f)));
            });
        },
        samples);
    image_io::write(begin(name), image_io::format_named("PNG"), width_, height_, codes.data());
    const std::lock_guard<std::mutex> lock(files_mutex_);
    files_.push_back(name);
}

void Output::write_frame(std::uint64_t number, Samples samples, const PreviewScale *preview) {
    if (stack_)
        std::visit([&](const auto &values) { stack_->append(values.data()); }, samples);
    if (stack_ && !preview)
        return;
    const bool has_preview = preview != nullptr;
    const PreviewScale scale = preview ? *preview : PreviewScale{};
    enqueue([this, number, samples = std::move(samples), has_preview, scale] {
        if (!stack_) {
            const std::string name = format_.file_name(number);
            std::visit(
                [&](const auto &values) {
                    image_io::write(begin(name), *format_.format, width_, height_, values.data());
                },
                samples);
            const std::lock_guard<std::mutex> lock(files_mutex_);
            files_.push_back(name);
        }
        if (has_preview)
            write_preview(fmt::format("preview_{:06}.png", number), samples, scale);
    });
}

void Output::write_ideal(std::uint64_t number, std::vector<float> values, const PreviewScale *preview) {
    const bool has_preview = preview != nullptr;
    const PreviewScale scale = preview ? *preview : PreviewScale{};
    enqueue([this, number, samples = Samples(std::move(values)), has_preview, scale] {
        const std::string name = fmt::format("ideal_{:06}.npy", number);
        image_io::write(begin(name), image_io::format_named("NPY"), width_, height_,
                        std::get<std::vector<float>>(samples).data());
        {
            const std::lock_guard<std::mutex> lock(files_mutex_);
            files_.push_back(name);
        }
        if (has_preview)
            write_preview(fmt::format("ideal_preview_{:06}.png", number), samples, scale);
    });
}

void Output::write_text(const std::string &name, const std::string &text) {
    image_io::write_text(begin(name), text);
    const std::lock_guard<std::mutex> lock(files_mutex_);
    files_.push_back(name);
}

void Output::finish() {
    while (!jobs_.empty()) {
        std::future<void> oldest = std::move(jobs_.front());
        jobs_.pop_front();
        oldest.get();
    }
    if (stack_) {
        stack_->commit();
        files_.push_back(format_.file_name(0));
        stack_.reset();
    }
}

std::vector<std::string> Output::files() const {
    const std::lock_guard<std::mutex> lock(files_mutex_);
    std::vector<std::string> sorted = files_;
    std::sort(sorted.begin(), sorted.end());
    return sorted;
}

} // namespace tools
