/**
 * @file output.hpp
 * @brief What render writes: frames, previews and ideal images, in the background and never half.
 */
#ifndef CLSPECKLE_TOOLS_OUTPUT_HPP
#define CLSPECKLE_TOOLS_OUTPUT_HPP

#include "io/formats.hpp"

#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <variant>
#include <vector>

namespace tools {

/** A frame in host memory: codes, or float values. */
using Samples = std::variant<std::vector<std::uint16_t>, std::vector<float>>;

/** How render stores frames: what a word of its option --format means. */
struct FrameFormat {
    /** The words, codes first. */
    static std::vector<std::string> words();
    /** Throws std::out_of_range for another word. */
    explicit FrameFormat(const std::string &word);

    bool is_float() const { return storage->sample == image_io::Sample::float32; }
    /** Of the file that holds all frames, or of one frame's file. */
    std::string file_name(std::uint64_t number) const;

    const image_io::Format *format = nullptr;
    const image_io::FrameStorage *storage = nullptr;
};

/** Linear scale of an 8-bit preview. */
struct PreviewScale {
    float black = 0;
    float white = 1;
    /** Between the 0.1th and the 99.9th percentile. */
    static PreviewScale of(const Samples &samples);
};

/** The value below which the given share of the values lies; `values` is reordered. */
float percentile(std::vector<float> &values, double share);

/** Writes the files of a run. One thread; the encoding runs in others. */
class Output {
  public:
    /**
     * @param folder which must exist.
     * @param format how frames are stored.
     */
    Output(std::string folder, const FrameFormat &format, std::uint64_t frame_count, std::uint32_t width,
           std::uint32_t height);
    ~Output();

    /** @param number of the frame, which names its file. */
    void write_frame(std::uint64_t number, Samples samples, const PreviewScale *preview);
    void write_ideal(std::uint64_t number, std::vector<float> values, const PreviewScale *preview);
    void write_text(const std::string &name, const std::string &text);
    /** Waits until everything is written, and throws the first error. */
    void finish();
    /** Waits for what is being written, without a word on errors. */
    void wait();
    /** After a failure: waits, and removes what this run wrote, except where it replaced a file. @return how many. */
    std::size_t discard();
    /** Names within the folder, sorted. */
    std::vector<std::string> files() const;
    const std::string &folder() const { return folder_; }

  private:
    std::string path(const std::string &name);
    /** The path of a file that is about to be written. */
    std::string begin(const std::string &name);
    void enqueue(std::function<void()> job);
    void write_preview(const std::string &name, const Samples &samples, const PreviewScale &scale);

    std::string folder_;
    FrameFormat format_;
    std::uint32_t width_;
    std::uint32_t height_;
    std::unique_ptr<image_io::Writer> stack_;
    std::deque<std::future<void>> jobs_;
    std::size_t job_limit_;
    mutable std::mutex files_mutex_;
    std::vector<std::string> files_;
    std::vector<std::string> replaced_; ///< Names that were there before.
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_OUTPUT_HPP
