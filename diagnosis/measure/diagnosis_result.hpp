// What a diagnosis is asked, and what it finds: gap, place, cause, shrinkage.
#pragma once

#include "capture/judged_part.hpp"
#include "inference/illumination.hpp"
#include "inference/search.hpp"
#include "inference/shrinkage.hpp"
#include "measure/acceptance.hpp"
#include "measure/datasheet_quantities.hpp"
#include "runtime/progress.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

struct Evidence;
struct Comparison;
struct Emva1288;

struct CameraProfile;

struct DiagnosisOptions {
    std::uint64_t seed = 0;
    std::uint32_t null_replicates = 48;
    double level = 0.02;              // probability of a false alarm
    std::vector<std::string> without; // effects that are no candidates
    std::vector<Hypothesis> hypotheses;
    std::uint32_t max_effects = 16;
    unsigned threads = 0;             // of the statistics; 0: as many as the machine has
    PartChoice part;                  // of the capture that is judged
    std::string tolerance_file;       // acceptance.hpp; empty: nothing is to be accepted
    ProgressFunction progress;
    // Of a comparison: the camera that both sets are of, by whose effects they scatter; null: of one without effects.
    std::shared_ptr<const CameraProfile> profile;
    bool evidence = true;             // pictures and curves for the HTML report are collected
};

enum class Verdict { kNone, kNamed, kAmbiguous, kUnknown };

// One statistic of the real capture against the baseline.
struct GapPlace {
    StatisticInfo statistic;
    double real = 0.0, sim = 0.0, z = 0.0, p_adjusted = 1.0;
    double z_after = 0.0;      // with the effects found
    StatisticShrinkage shrink; // by the effects found; of nothing held out if there are none
};

struct ShrinkStep {
    std::string effect;
    double distance_after = 0.0, fraction = 0.0;
};

// What a gap means downstream: root mean square error of the dots' centres in single frames, in pixels.
struct Downstream {
    bool valid = false;
    double real = 0.0, before = 0.0, after = 0.0;
    // Depth error that follows, in mm, for the camera that depth_assumption states.
    double depth_error_mm_real = 0.0, depth_error_mm_before = 0.0, depth_error_mm_after = 0.0;
    std::string depth_assumption;
};

// What was adjusted before any gap was spoken of. A sequence's light is what the simulator is run at: gain times mean
// intensity.
struct SequenceLight {
    std::string sequence;
    double mean_dn = 0.0;               // of the camera's frames
    double light_dn = 0.0, share = 0.0; // of the simulator's, and over the camera's mean above black; 0 of dark ones
};
struct CalibrationResult {
    double black_level_dn = 0.0, read_noise_dn = 0.0;
    std::vector<SequenceLight> light; // none of a comparison, whose sets have levels of their own
};

// One scene of the capture, by itself.
struct RungResult {
    CaptureScene scene = CaptureScene::kDark;
    Verdict verdict = Verdict::kNone;
    std::vector<std::string> effects; // that take away something significant here
    std::vector<std::string> own;     // those of them that do so more than in any other scene
    double p_value = 1.0, distance_before = 0.0;
    double residual_p_value = 1.0, distance_after = 0.0; // with all effects found
};

struct DiagnosisResult {
    std::uint64_t seed = 0;
    double level = 0.0;
    Verdict verdict = Verdict::kNone;
    bool detected = false;
    double p_value = 1.0, distance = 0.0, null_95 = 0.0;
    // Judged sequences whose frames are not of one scene. No effect makes such frames, so they are a gap that is left.
    std::vector<CaptureWarning> frame_changes;
    CalibrationResult calibration,
        calibration_after;        // of the baseline; with the effects found, nothing if there are none
    LabLights illumination;       // nothing of a comparison
    std::vector<GapPlace> places; // all statistics, worst first
    std::vector<RungResult> rungs; // none of a comparison
    std::vector<std::string> effects;
    double probability = 1.0;
    std::vector<std::string> equivalent;
    std::vector<RankedEffect> ranking; // of the first step
    std::vector<RankedEffect> found;   // the effect that each step added
    std::vector<ScreenedEffect> screened; // at all effects that can show, before any was fitted; not of comparisons
    std::vector<Candidate> candidates; // what the ranking was over
    std::vector<FittedParameter> parameters; // of the effects found
    // Shrinkage, on halves that the fit has not seen.
    bool held_out = false;
    double distance_before = 0.0, distance_after = 0.0, fraction = 0.0;
    std::array<double, 2> fraction_95{};
    bool residual_detected = false;
    double residual_p_value = 1.0;
    std::vector<ShrinkStep> steps;
    Downstream downstream;
    std::shared_ptr<const Emva1288> emva; // of the dark and flat frames alone; null of a comparison
    DatasheetQuantities datasheet; // none of a comparison, whose sets are brought to one light and noise first
    std::vector<AcceptanceRow> acceptance; // by the options' tolerances
    std::shared_ptr<const Evidence> evidence; // null unless the options ask for it
    std::shared_ptr<const CameraProfile> profile; // null of a comparison
    std::shared_ptr<const Comparison> comparison; // of two captures, see compare(); null of a diagnosis
    std::vector<std::string> notes; // what could not be judged, and why
    // The verdict's reach: sequences that were judged and those that were not, questions that the former cannot answer,
    // effects that cannot show in them.
    std::vector<std::string> judged, left_out, untested_topics, untested_effects;
    // Every sequence with light was left out: the verdict is about dark frames, and speaks of no light.
    bool no_light_judged = false;
    std::optional<JudgedPart> part; // that was judged; none: the whole capture, but for what was left out
    // What the search asked for, in whole simulated captures without effects; whether it ended there with more to try.
    double work_captures = 0.0;
    bool ended_early = false;
    double seconds = 0.0;
};

} // namespace clsp
