// Sums over the pixels of every frame of a sequence, which is what takes time of its statistics: on the host's threads,
// or on the device (device_sums.hpp). Both take them in the same order and give the same bits.
#pragma once

#include "statistics/frames.hpp"
#include "statistics/speckle_sums.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace clsp::statistics {

// How codes become residuals (Frames::residual), by frame: scale (code - black) - shift, less the pixel's mean of
// these.
struct ResidualScale {
    float black = 0.0f;
    float pivot = 0.0f;               // the sequence's mean signal, about which sums are taken
    std::vector<float> scale, offset; // shift = offset + pivot
    std::uint32_t clipping = 0;       // codes from there on are clipped
    bool any_clip = false;            // whether such codes can be
};

// Lags of pixel pairs in the noise: right, down, both diagonals, two right, two down.
constexpr std::array<Lag, 6> kNoiseLags{{{1, 0}, {0, 1}, {1, 1}, {-1, 1}, {2, 0}, {0, 2}}};
// Of one frame's residual.
struct ResidualFrameSums {
    Powers powers;
    double column_variance = 0.0;
    std::array<double, kNoiseLags.size()> noise{};
    double square = 0.0; // weighted
    std::vector<double> temporal;
    std::array<double, 4> motion{};
};

// What the residuals of a static laser scene are multiplied with; empty for others.
struct ResidualWeights {
    std::vector<float> brightness;
    std::array<std::vector<float>, 4> derivatives; // Frames.mean by the motions of ResidualSums
};

// Of a frame's codes: mean absolute differences of neighbours, by column (row) of the left (upper) one, as whole sums.
struct EdgeFrameSums {
    std::vector<std::uint64_t> columns, rows;
};

constexpr std::array<Lag, 9> kDotLags{{{1, 0}, {2, 0}, {4, 0}, {0, 1}, {0, 2}, {0, 4}, {1, 1}, {-1, 1}, {0, 0}}};
using DotLagFrameSums = std::array<double, kDotLags.size()>;

// Frames apart, and the rows that are taken, of the differences of frames.
constexpr std::size_t kFarthestRepeat = 8, kRepeatRows = 8;

// One object measures one sequence at a time: count_codes(), make_residuals(), then the others in any order.
class FrameSums {
  public:
    FrameSums() = default;
    FrameSums(const FrameSums &) = delete;
    FrameSums &operator=(const FrameSums &) = delete;
    virtual ~FrameSums() = default;

    // Sums of the unmasked codes of each frame, and how often each occurs (histogram: by code, zeros). codes: kept
    // until the sequence is done with.
    virtual std::vector<double> count_codes(const Geometry &geometry, const std::uint16_t *codes,
                                            std::vector<std::uint64_t> &histogram) = 0;
    // Mean image, residuals, their variance and the means of their rows. frames: with mean_signal and histogram.
    virtual void make_residuals(const Geometry &geometry, const ResidualScale &scale, Frames &frames) = 0;

    virtual std::vector<ResidualFrameSums> sum_residuals(const Geometry &geometry, const Frames &frames,
                                                         const ResidualWeights &weights,
                                                         const std::vector<std::size_t> &lags) = 0;
    virtual std::vector<SpeckleFrameSums> sum_speckle(const Geometry &geometry, const Frames &frames) = 0;
    virtual std::vector<DotLagFrameSums> sum_dot_lags(const Geometry &geometry, const Frames &frames) = 0;
    virtual std::vector<EdgeFrameSums> sum_edges(const Geometry &geometry) = 0;
    // By frame t: squared differences to the frames t + 1, t + 2, ... up to kFarthestRepeat, of every kRepeatRows-th
    // row.
    virtual std::vector<std::vector<double>> frame_differences(const Geometry &geometry, const Frames &frames) = 0;
    // The residuals of some frames, in the host's memory; good until the next sequence.
    virtual std::vector<const float *> residual_images(const Geometry &geometry, const Frames &frames,
                                                       const std::vector<std::size_t> &which) = 0;
};

std::unique_ptr<FrameSums> make_host_sums(unsigned threads, SpareBuffers<float> &spare);

} // namespace clsp::statistics
