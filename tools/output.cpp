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

Output::Output(std::string folder, const std::string &format, std::uint64_t frame_count, std::uint32_t width,
               std::uint32_t height)
    : folder_(std::move(folder)), format_(format), width_(width), height_(height),
      job_limit_(std::max(2u, std::thread::hardware_concurrency())) {
    if (format_ == "npy-stack" || format_ == "float-npy-stack") {
        stack_name_ = "frames.npy";
        stack_ = std::make_unique<image_io::NpyStackWriter>(begin(stack_name_), frame_count, width, height,
                                                            is_float(format_) ? sizeof(float) : sizeof(std::uint16_t));
    }
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
    image_io::write_png8(begin(name), width_, height_, codes.data());
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
        const auto *codes = std::get_if<std::vector<std::uint16_t>>(&samples);
        const auto *values = std::get_if<std::vector<float>>(&samples);
        if (!stack_) {
            const std::string name = fmt::format("frame_{:06}.{}", number, extension(format_));
            if (format_ == "png16")
                image_io::write_png16(begin(name), width_, height_, codes->data());
            else if (format_ == "tiff16")
                image_io::write_tiff(begin(name), width_, height_, codes->data());
            else if (format_ == "npy")
                image_io::write_npy(begin(name), width_, height_, codes->data());
            else if (format_ == "float-npy")
                image_io::write_npy(begin(name), width_, height_, values->data());
            else
                image_io::write_tiff(begin(name), width_, height_, values->data());
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
        image_io::write_npy(begin(name), width_, height_, std::get<std::vector<float>>(samples).data());
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
        files_.push_back(stack_name_);
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
