// What is compared between a real capture and a simulated one: physically named statistics of each sequence.
#pragma once

#include "capture/capture.hpp"
#include "statistics/spare_buffers.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clsp {

namespace statistics {
struct Geometry;
class DeviceSums;
}

// The stages of the report: laser, doe, surface, motion, optics, sensor. A statistic belongs to the stage whose effects
// it shows first.
struct StatisticInfo {
    std::string stage;
    std::string sequence; // the sequence's name
    std::string name;     // for example "dot_width_x"
    std::string region;   // "all", "r0c2" (of 3 x 3), "ring1" ...
    std::string unit;     // "DN", "px", "1" ...
    // Its standard deviation is never taken as less: replicates without any of a rare thing say little of how often one comes.
    double least_deviation = 0.0;
};

// Of fewer frames, squares over frames (of a frame's shift, of its mean's deviation) are far from Gaussian in their
// logarithm, and so is much else; sequences of more are measured and tested without regard to it.
constexpr std::uint32_t kFewFrames = 8;

// What was calibrated before any statistic is spoken of.
struct Calibration {
    double black_level_dn = 0.0;
    double read_noise_dn = 0.0;
};

// The statistics of one sequence of a capture. Its list is fixed by the layout: the same for real and simulated frames
// of any content.
class SequenceStatistics {
  public:
    // frame_count: how many frames compute() will get (a part of the sequence's); temporal statistics need at least 2.
    // spare: shared with others that measure in turn; nullptr: its own.
    SequenceStatistics(const CaptureLayout &layout, std::size_t sequence, std::uint32_t frame_count,
                       std::shared_ptr<SpareBuffers<float>> spare = nullptr);

    const std::vector<StatisticInfo> &list() const { return list_; }
    // codes: frame_count * height * width. values: list().size() numbers, all finite. Thread-safe; uses `threads`
    // threads, and for sums over pixels the device, if there is one that takes the sequence: the numbers are the same. device: used by one
    // thread at a time.
    void compute(const std::uint16_t *codes, const Calibration &calibration, double *values, unsigned threads,
                 statistics::DeviceSums *device = nullptr) const;

  private:
    std::shared_ptr<const statistics::Geometry> geometry_;
    std::shared_ptr<SpareBuffers<float>> spare_;
    std::vector<StatisticInfo> list_;
};

// What the nuisances are calibrated on.
struct SequenceLevel {
    double mean_dn = 0.0; // of all unmasked pixels and frames
    double temporal_noise_dn =
        0.0; // pixel noise: rows, columns and whole frames taken out, robust against hot pixels; 0 of a single frame
};
SequenceLevel sequence_level(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                             std::uint32_t frame_count);
// Its mean alone.
double sequence_mean_dn(const CaptureLayout &layout, std::size_t sequence, const std::uint16_t *codes,
                        std::uint32_t frame_count);

} // namespace clsp
