// What is in a capture set, and what it can and cannot tell apart.
#pragma once

#include "capture/capture.hpp"
#include "capture/frame_changes.hpp"
#include "capture/sequence_scan.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

// What no light at all gives.
struct DarkLevel {
    double level_dn = 0.0;
    bool measured = false; // from dark sequences; else the data sheet's black level
};
// scans: by sequence.
DarkLevel dark_level(const CaptureLayout &layout, const std::vector<SequenceScan> &scans);

// Where that share of the pixels is clipped, the level above the top code is unknown: a simulator cannot be brought to
// it.
constexpr double kMostClipped = 0.2;

// Of the unmasked pixels of all frames.
struct SequenceSummary {
    std::string name;
    CaptureScene scene = CaptureScene::kDark;
    bool moving = false;
    std::uint32_t frame_count = 0;
    double f_number = 0.0;
    std::optional<double> exposure_ms;
    double masked_fraction = 0.0; // pixels that do not count
    double mean_dn = 0.0;
    std::uint32_t minimum = 0, maximum = 0; // codes
    double saturated_fraction = 0.0;        // at the top code
    double zero_fraction = 0.0;             // at code 0
    // Root of the mean over pixels of the unbiased variance over frames; none for a single frame. In moving sequences
    // speckle is in it.
    std::optional<double> temporal_noise_dn;
    double level_above_dark_dn = 0.0; // mean less the dark level; of a dark sequence less the data sheet's black level
    // Spatial standard deviation within a frame over the level above dark, of flat and board; none without light.
    std::optional<double> contrast;
};
SequenceSummary summarize_sequence(const CaptureLayout &layout, std::size_t sequence, const SequenceScan &scan,
                                   const DarkLevel &dark);

// A question that captures answer or not.
struct CaptureAbility {
    std::string topic; // for example "laser lines or motion during the exposure"
    bool can = false;
    std::string reason; // the physics
    std::string advice; // what to capture; empty where it can
};

// Whether an effect of the catalogue can show.
struct EffectVisibility {
    std::string id, stage;
    std::vector<std::string> sequences; // where it shows; empty: nowhere
    std::string symptom;                // what it does there
    std::string reason;                 // why it cannot be seen; empty where it can
};

struct CaptureSummary {
    std::vector<SequenceSummary> sequences;
    DarkLevel dark;
    std::vector<CaptureAbility> abilities;
    std::vector<EffectVisibility> effects; // in the catalogue's order
    std::vector<SequenceChange> frame_changes;    // frame_changes.hpp; among the warnings, too
    std::vector<CaptureWarning> warnings;
};
CaptureSummary summarize_capture(const Capture &capture);

// What is odd about a valid capture: frames that are all alike or repeated, saturated or black sequences, single
// frames, light that is not there, dots outside the image, a pupil that the pixels cannot sample, and what contradicts
// its description (metadata_warnings.hpp). The reader's own warnings come first. scans, summaries: by sequence.
std::vector<CaptureWarning> capture_warnings(const Capture &capture, const std::vector<SequenceScan> &scans,
                                             const DarkLevel &dark, const std::vector<SequenceSummary> &summaries,
                                             const std::vector<SequenceChange> &frame_changes);

// Of the layout alone.
std::vector<CaptureAbility> capture_abilities(const CaptureLayout &layout,
                                              const std::vector<SequenceSummary> &sequences);
std::vector<EffectVisibility> effect_visibilities(const CaptureLayout &layout);

// All of it as one JSON object, with the camera.
std::string capture_summary_json(const Capture &capture);

} // namespace clsp
