// What is compared between a real capture and a simulated one: physically named statistics of each sequence.
#pragma once

#include "capture/capture.hpp"
#include "statistics/spare_buffers.hpp"
#include "statistics/statistic.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

namespace statistics {
struct Geometry;
class DeviceSums;
}

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
    // threads, and for sums over pixels the device, if there is one that takes the sequence: the numbers are the same.
    // device: used by one thread at a time.
    void compute(const std::uint16_t *codes, const Calibration &calibration, double *values, unsigned threads,
                 statistics::DeviceSums *device = nullptr) const;

  private:
    std::shared_ptr<const statistics::Geometry> geometry_;
    std::shared_ptr<SpareBuffers<float>> spare_;
    std::vector<StatisticInfo> list_;
};

} // namespace clsp
