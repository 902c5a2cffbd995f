// What a reader of the report is shown: the real frames beside those of the simulator, before and after effects are
// added.
#pragma once

#include "inference/model_fit.hpp"
#include "measure/evidence_statistics.hpp"
#include "measure/picture.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace clsp {

constexpr std::uint32_t kEvidenceFrames = 8; // of each sequence at most
constexpr std::uint32_t kPictureWidth = 320; // px at most; larger images are averaged over squares of pixels

enum class Version : std::uint32_t { kReal = 0, kBaseline = 1, kWithEffects = 2 };

// A sequence in one version. Pictures of one kind have the same scale in all versions.
struct VersionEvidence {
    Picture first_frame, mean_image;
    Picture temporal_deviation;          // standard deviation of each pixel over the frames; empty for a single frame
    Picture difference;                  // mean image minus the real one; empty for the real version
    Picture smooth_difference;           // the same, averaged over squares of smooth_px: free of speckle
    Picture dot_stack;                   // mean image around a dot, all dots averaged; empty without dots
    std::vector<double> histogram;       // share of the pixels in each bin
    double histogram_outside = 0.0;      // share of the pixels below or above all bins
    std::vector<double> power;           // DN^2 per (cycle/px)^2, by band of frequency
    std::vector<double> autocorrelation; // between frames that lie 0, 1, 2 ... apart; empty for a single frame
    std::vector<double> dot_profile_dn;  // signal by distance from the dot; empty without dots
};

struct SequenceEvidence {
    std::string name;
    CaptureScene scene = CaptureScene::kDark;
    bool moving = false;
    std::uint32_t frame_count = 0; // of each version
    std::uint32_t averaged_px = 1; // edge of the squares that one pixel of a picture stands for
    std::uint32_t smooth_px = 1;
    Fluctuation fluctuation = Fluctuation::kOverTime;
    double histogram_first_dn = 0.0, histogram_step_dn = 1.0; // centre of the first bin; codes of a bin
    std::vector<double> frequency;                            // cycles/px, centre of each band
    std::vector<double> dot_radius_px;
    std::uint32_t dot_count = 0;           // of the stack
    std::vector<VersionEvidence> versions; // real, baseline, and with effects if there are any
};

struct Evidence {
    std::uint32_t width = 0, height = 0, bits = 0;
    std::vector<SequenceEvidence> sequences;
};

// seed: of the simulated frames. final: nullptr if no effect was found. Simulates at most kEvidenceFrames frames of
// each sequence.
Evidence collect_evidence(ReplicateRunner &runner, const Capture &real, const FittedModel &baseline,
                          const FittedModel *final, std::uint64_t seed = 0);

// The same of frames from anywhere: real (0), simulated (1) and, with three versions, simulated with effects (2).
using EvidenceFrames =
    std::function<std::vector<std::uint16_t>(std::size_t version, std::size_t sequence, std::uint32_t frame_count)>;
Evidence collect_evidence(ReplicateRunner &runner, std::size_t version_count, const EvidenceFrames &frames_of);

// The frames of one version that are shown. Simulated ones are new draws, apart from those of any fit.
std::vector<std::uint16_t> evidence_frames(ReplicateRunner &runner, const Capture &real, const FittedModel *model,
                                           std::size_t sequence, std::uint32_t frame_count, std::uint64_t seed);

} // namespace clsp
