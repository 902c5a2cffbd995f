// From a frame to depth: dots, which of the pattern's they are, where their rays meet. The equations are in depth.h of
// the C API.
#pragma once

#include "depth/dot_detector.hpp"
#include "depth/identification.hpp"
#include "depth/triangulation.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

namespace clsp {

constexpr std::uint64_t kMaxDirections = 1000000;

struct DepthParameters {
    DotDetectorParameters detector;
    IdentificationParameters identification;
    DepthGeometry geometry;
    std::uint64_t direction_count = 0;  // 0: a detector alone
    const double *directions = nullptr; // host memory, only read by the constructor
};

struct DepthDot {
    DetectedDot detected;
    Identity identity;
    // NaN unless placed.
    double depth_m = 0.0, depth_sd_m = 0.0;
    std::array<double, 3> position_m{}, position_sd_m{};
};

struct PatternDot {
    DepthReason reason = DepthReason::kNotSeen;
    std::uint32_t detected = kNoDot;
};

// Bits; the numbers are those of CLSP_DEPTH_WARNING_*, capi asserts that they agree.
constexpr std::uint32_t kWarningNoDots = 1, kWarningFewPlaced = 2, kWarningEpipolar = 4, kWarningSaturated = 8,
                        kWarningMerged = 16;

struct DepthSummary {
    std::uint64_t detected = 0, fitted = 0, placed = 0, saturated = 0, merged = 0, in_view = 0;
    double median_epipolar_error_px = 0.0, expected_epipolar_error_px = 0.0; // NaN without placed dots
    double median_sigma_px = 0.0, median_centre_sd_px = 0.0;                 // NaN without fitted dots
    std::uint32_t warnings = 0;
};

struct DepthResult {
    std::vector<DepthDot> dots;      // in the order of the rows
    std::vector<PatternDot> pattern; // in the order of the directions
    DepthSummary summary;
};

class Depth {
  public:
    Depth(std::shared_ptr<Context> context, const DepthParameters &parameters);

    const std::shared_ptr<Context> &context() const { return detector_.context(); }
    const DotDetectorParameters &detector_parameters() const { return detector_.parameters(); }
    std::uint64_t direction_count() const { return lines_.size(); }

    void enqueue_detect(CommandChain &chain, const ImageView &image);
    // Of the last frame; waits for the queue once, later calls have the result already. nullptr: throws kInvalidState
    // unless there is a result already.
    const DepthResult &result(cl_command_queue queue);

  private:
    DotDetector detector_;
    IdentificationParameters identification_;
    double focal_length_px_ = 0.0;
    std::vector<EpipolarLine> lines_;
    std::unique_ptr<DepthResult> result_;
};

} // namespace clsp
