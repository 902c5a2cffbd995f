// The camera's fixed patterns as maps of its pixels: offsets from dark frames, relative gains from flats.
#pragma once

#include "capture/capture.hpp"
#include "inference/replicate_runner.hpp"
#include "measure/diagnosis_result.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

struct PatternMap {
    std::vector<float> values;          // height x width
    std::vector<std::string> sequences; // whose frames it is of
    std::uint32_t frame_count = 0;
    // Noise over time that is left in the mean of so many frames, of a pixel.
    double standard_error = 0.0;
    // By which the pattern that the mean shows was multiplied, so that noise does not add to its variance: of single
    // pixels, of whole rows, of whole columns. Defects stay as they are.
    double pixel_part = 1.0, row_part = 1.0, column_part = 1.0;
    // Of the blocks of pixels: what changes slowly over the image, and is rather the light's than the pixels'.
    double smooth_deviation = 0.0;
};

struct PatternMaps {
    std::optional<PatternMap> dark; // DN above the black level
    std::optional<PatternMap> gain; // over the image's mean
    std::vector<std::string> notes; // why one is missing though the capture has such sequences, or what else is in it
};

// Of all frames and all pixels of the sequences that were judged and do not change. Larger images have none: it takes
// some sixty bytes for each pixel.
constexpr std::uint64_t kMostMapPixels = 1u << 24;

// given: the capture as it was recorded. result: with what was judged, and which sequences change. effects, levels: of
// the last model; they tell how bent the response is, and what of the dark is no pixel's own. checkpoint: called for
// each frame; throws to cancel.
PatternMaps measure_pattern_maps(const Capture &given, const DiagnosisResult &result, const EffectSettings &effects,
                                 const CalibratedLevels &levels, const std::function<void()> &checkpoint);

} // namespace clsp
