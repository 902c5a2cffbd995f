// Which of the laser's dots a detected dot is. The rule is in depth.h of the C API.
#pragma once

#include "depth/dot_detector.hpp"
#include "depth/triangulation.hpp"

#include <cstdint>
#include <vector>

namespace clsp {

// Why a dot was not placed; the numbers are those of CLSP_DEPTH_REASON_*, capi asserts that they agree.
enum class DepthReason : std::uint32_t {
    kPlaced = 0,
    kFitFailed = 1,
    kNoCandidate = 2,
    kUnsupported = 3,
    kAmbiguous = 4,
    kConflict = 5,
    kOutOfView = 6, // of a dot of the pattern, as the next
    kNotSeen = 7,
};

struct IdentificationParameters {
    double epipolar_tolerance_px = 1.0;
    double min_confidence = 0.9;
};

constexpr std::uint32_t kNoDot = 0xffffffffu;

struct Identity {
    DepthReason reason = DepthReason::kFitFailed;
    std::uint32_t dot = kNoDot; // of the pattern; also of a dot that is not placed, the likeliest
    std::uint32_t candidates = 0;
    double confidence = 0.0;
    LinePlace place; // on that dot's line
};

// Focal length: pixels, of what a surface's slope is measured with.
std::vector<Identity> identify(const std::vector<DetectedDot> &dots, const std::vector<EpipolarLine> &lines,
                               const IdentificationParameters &parameters, double focal_length_px, std::uint32_t width,
                               std::uint32_t height);

} // namespace clsp
