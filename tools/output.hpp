/**
 * @file output.hpp
 * @brief What render writes: frames, previews and ideal images, in the background and never half.
 */
#ifndef CLSPECKLE_TOOLS_OUTPUT_HPP
#define CLSPECKLE_TOOLS_OUTPUT_HPP

#include "io/image_io.hpp"

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
     * @param format a word of the option render.format.
     */
    Output(std::string folder, const std::string &format, std::uint64_t frame_count, std::uint32_t width,
           std::uint32_t height);
    ~Output();

    static bool is_float(const std::string &format) { return format.rfind("float-", 0) == 0; }

    /** @param number of the frame, which names its file. */
    void write_frame(std::uint64_t number, Samples samples, const PreviewScale *preview);
    void write_ideal(std::uint64_t number, std::vector<float> values, const PreviewScale *preview);
    void write_text(const std::string &name, const std::string &text);
    /** Waits until everything is written, and throws the first error. */
    void finish();
    /** Of the frames' files, for a format that is not a stack. */
    static const char *extension(const std::string &format) {
        return format == "png16" ? "png" : format == "npy" || format == "float-npy" ? "npy" : "tiff";
    }
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
    std::string format_;
    std::uint32_t width_;
    std::uint32_t height_;
    std::unique_ptr<image_io::NpyStackWriter> stack_;
    std::string stack_name_;
    std::deque<std::future<void>> jobs_;
    std::size_t job_limit_;
    mutable std::mutex files_mutex_;
    std::vector<std::string> files_;
    std::vector<std::string> replaced_; ///< Names that were there before.
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_OUTPUT_HPP
