/**
 * @file stage_times.hpp
 * @brief Times of a frame's stages.
 */
#ifndef CLSPECKLE_TOOLS_STAGE_TIMES_HPP
#define CLSPECKLE_TOOLS_STAGE_TIMES_HPP

#include <clspeckle/clspeckle.hpp>

#include <string>
#include <vector>

namespace tools {

/** Times of one stage over the frames in which it ran. */
struct StageTimes {
    std::string name;
    std::vector<double> milliseconds;

    double mean() const;
    double median() const;
    double least() const;
    double most() const;
};

/** Of all frames. */
struct FrameTimes {
    std::vector<StageTimes> stages;
    StageTimes all{"all", {}};

    void add(const std::vector<ClspStageTiming> &timings);
    /** For eyes. */
    std::string table() const;
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_STAGE_TIMES_HPP
