// What a list of effects makes of one sequence of a capture: the parameters of optics and sensor, and the hypotheses on
// the way.
#pragma once

#include "capture/capture.hpp"
#include "pipeline/pipeline.hpp"
#include "simulator/hypothesis.hpp"
#include "simulator/settings.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace clsp {

// A hypothesis that is on.
struct ActiveHypothesis {
    const Hypothesis *hypothesis;
    const double *values; // of the list of effects
};

struct SequenceModel {
    PipelineModel model;
    // Factors and offsets of the whole intensity image; the model's own members for them are 0.
    double power_flicker = 0.0, corner_loss = 0.0, ambient_dn = 0.0;
    bool uneven = false;   // lamp or laser: SequenceLayout::illumination
    bool drifting = false; // the lamp: SequenceLayout::frame_light
    std::vector<ActiveHypothesis> on_irradiance, on_intensity, on_codes;
    // What the intensities behind the lens depend on beside sequence and seed, in the catalogue's order.
    std::vector<EffectSetting> optical;

    // Frames differ in light, before laser power and hypotheses on the intensity come to it.
    bool frames_differ = false;
};

// Throws kInvalidArgument for ids that are neither in the catalogue nor among the hypotheses, ids given twice, and
// values out of range.
SequenceModel sequence_model(const CaptureLayout &layout, const std::vector<Hypothesis> &hypotheses,
                             std::size_t sequence, const std::vector<EffectSetting> &effects);

// Throws unless ids and parameters are usable and clash with nothing.
void check_hypotheses(const std::vector<Hypothesis> &hypotheses);

} // namespace clsp
