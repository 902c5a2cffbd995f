/**
 * @file input.hpp
 * @brief What render reads: ideal images, or scenes as G-buffers, frame by frame.
 */
#ifndef CLSPECKLE_TOOLS_INPUT_HPP
#define CLSPECKLE_TOOLS_INPUT_HPP

#include "console.hpp"
#include "frame_data.hpp"
#include "options.hpp"

#include <clspeckle/clspeckle.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace tools {

/** A source of frames. Frames may be read from another thread, one at a time. */
class Input {
  public:
    virtual ~Input() = default;

    bool scene = false;
    std::string kind; ///< For eyes.
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint64_t frame_count = 1;
    std::string first_name;
    std::vector<std::string> files;      ///< All that are read, which no output may replace.
    std::vector<std::string> oddities;   ///< Of the files' names, before any is read.
    std::vector<ClspMaterial> materials; ///< Entry i is id i; empty: one of the defaults.
    bool moves = false;                  ///< Frames tell how the scene moved.
    /** Of a scene: how to name a channel of its file that may be the ideal image; empty: there is none. */
    std::string image_name;

    /**
     * Reads and checks a frame: NaN, infinite and negative values are refused with file and pixel.
     * @param warnings is appended to.
     */
    virtual FrameData read(std::uint64_t frame, std::vector<std::string> &warnings) = 0;
};

/**
 * Finds out what the input is. What a sequence.json says goes into the configuration.
 * @param paths as the command line gives them.
 */
std::unique_ptr<Input> open_input(const InputPaths &paths, Config &config);

} // namespace tools

#endif // CLSPECKLE_TOOLS_INPUT_HPP
