#include "capture/capture_check.hpp"

#include "capture/frame_changes.hpp"

#include "capture/capture_validation.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace clsp {
namespace {

// Exact sums of one sequence's unmasked pixels.
struct Sums {
    std::uint64_t pixels = 0; // that count, of one frame
    std::uint64_t sum = 0;
    std::uint64_t saturated = 0, zero = 0;
    std::uint32_t minimum = 65535, maximum = 0;
    double within_frame_variance = 0.0; // mean over frames of the spatial variance
    double temporal_variance = 0.0;     // mean over pixels of the unbiased variance over frames
};

Sums sums_of(const CaptureLayout &layout, std::size_t sequence, const std::vector<std::uint16_t> &codes) {
    const SequenceLayout &s = layout.sequences[sequence];
    const std::size_t pixels = layout.pixel_count();
    const auto top = static_cast<std::uint32_t>(layout.maximum_code());
    Sums sums;
    std::vector<std::uint64_t> sum(pixels, 0);
    std::vector<std::uint64_t> square(pixels, 0);
    for (std::uint32_t frame = 0; frame < s.frame_count; ++frame) {
        const std::uint16_t *now = codes.data() + frame * pixels;
        std::uint64_t count = 0, frame_sum = 0, frame_square = 0;
        for (std::size_t i = 0; i < pixels; ++i) {
            if (!s.mask.empty() && s.mask[i] == 0)
                continue;
            const std::uint64_t code = now[i];
            ++count;
            frame_sum += code;
            frame_square += code * code;
            sum[i] += code;
            square[i] += code * code;
            sums.saturated += code == top;
            sums.zero += code == 0;
            sums.minimum = std::min(sums.minimum, std::uint32_t{now[i]});
            sums.maximum = std::max(sums.maximum, std::uint32_t{now[i]});
        }
        const double mean = static_cast<double>(frame_sum) / static_cast<double>(count);
        sums.within_frame_variance +=
            std::max(0.0, static_cast<double>(frame_square) / static_cast<double>(count) - mean * mean) / s.frame_count;
        sums.sum += frame_sum;
        sums.pixels = count;
    }
    if (s.frame_count > 1) {
        const double n = s.frame_count;
        double total = 0.0;
        for (std::size_t i = 0; i < pixels; ++i)
            total += static_cast<double>(square[i]) - static_cast<double>(sum[i]) * static_cast<double>(sum[i]) / n;
        sums.temporal_variance = std::max(0.0, total / (n - 1.0) / static_cast<double>(sums.pixels));
    }
    return sums;
}

} // namespace

DarkLevel dark_level(const Capture &capture) {
    const CaptureLayout &layout = capture.layout;
    double sum = 0.0, count = 0.0;
    for (std::size_t i = 0; i < layout.sequences.size(); ++i) {
        if (layout.sequences[i].scene != CaptureScene::kDark)
            continue;
        const Sums sums = sums_of(layout, i, capture.codes[i]);
        sum += static_cast<double>(sums.sum);
        count += static_cast<double>(sums.pixels) * layout.sequences[i].frame_count;
    }
    return count > 0.0 ? DarkLevel{sum / count, true} : DarkLevel{layout.black_level_dn, false};
}

SequenceSummary summarize_sequence(const Capture &capture, std::size_t sequence, const DarkLevel &dark) {
    const CaptureLayout &layout = capture.layout;
    const SequenceLayout &s = layout.sequences[sequence];
    const Sums sums = sums_of(layout, sequence, capture.codes[sequence]);
    const double count = static_cast<double>(sums.pixels) * s.frame_count;
    SequenceSummary summary;
    summary.name = s.name;
    summary.scene = s.scene;
    summary.moving = s.moving;
    summary.frame_count = s.frame_count;
    summary.f_number = s.f_number;
    summary.exposure_ms = s.exposure_ms;
    summary.masked_fraction = 1.0 - static_cast<double>(sums.pixels) / static_cast<double>(layout.pixel_count());
    summary.mean_dn = static_cast<double>(sums.sum) / count;
    summary.minimum = sums.minimum;
    summary.maximum = sums.maximum;
    summary.saturated_fraction = static_cast<double>(sums.saturated) / count;
    summary.zero_fraction = static_cast<double>(sums.zero) / count;
    if (s.frame_count > 1)
        summary.temporal_noise_dn = std::sqrt(sums.temporal_variance);
    const bool is_dark = s.scene == CaptureScene::kDark;
    summary.level_above_dark_dn = summary.mean_dn - (is_dark ? layout.black_level_dn : dark.level_dn);
    if ((s.scene == CaptureScene::kFlat || s.scene == CaptureScene::kBoard) && summary.level_above_dark_dn > 0.5)
        summary.contrast = std::sqrt(sums.within_frame_variance) / summary.level_above_dark_dn;
    return summary;
}

CaptureSummary summarize_capture(const Capture &capture) {
    validate_capture(capture);
    CaptureSummary summary;
    summary.dark = dark_level(capture);
    for (std::size_t i = 0; i < capture.layout.sequences.size(); ++i)
        summary.sequences.push_back(summarize_sequence(capture, i, summary.dark));
    summary.abilities = capture_abilities(capture.layout, summary.sequences);
    summary.effects = effect_visibilities(capture.layout);
    for (std::size_t i = 0; i < capture.layout.sequences.size(); ++i)
        for (CaptureWarning &change : frame_changes(capture, i, summary.dark.level_dn))
            summary.frame_changes.push_back(std::move(change));
    summary.warnings = capture_warnings(capture, summary.dark, summary.sequences, summary.frame_changes);
    return summary;
}

std::string capture_summary_json(const Capture &capture) {
    using Json = nlohmann::ordered_json;
    const CaptureSummary summary = summarize_capture(capture);
    const CaptureLayout &layout = capture.layout;
    const auto optional = [](const std::optional<double> &value) { return value ? Json(*value) : Json(); };
    Json root = {{"format", "clspeckle-capture-summary"}, {"version", 1}};
    root["camera"] = {{"width", layout.width},
                      {"height", layout.height},
                      {"bits", layout.bits},
                      {"pixel_pitch_um", layout.pixel_pitch_m * 1e6},
                      {"f_number", layout.f_number},
                      {"wavelength_nm", layout.wavelength_m * 1e9},
                      {"pupil_diameter_cycles_per_px", layout.pixel_pitch_m / (layout.wavelength_m * layout.f_number)},
                      {"black_level_dn", layout.black_level_dn},
                      {"read_noise_dn", layout.read_noise_dn},
                      {"dots", layout.dots ? layout.dots->positions_px.size() : 0}};
    root["dark_level"] = {{"level_dn", summary.dark.level_dn}, {"measured", summary.dark.measured}};
    root["sequences"] = Json::array();
    for (const SequenceSummary &s : summary.sequences)
        root["sequences"].push_back({{"name", s.name},
                                     {"scene", scene_name(s.scene)},
                                     {"motion", motion_name(s.moving)},
                                     {"frames", s.frame_count},
                                     {"f_number", s.f_number},
                                     {"exposure_ms", optional(s.exposure_ms)},
                                     {"masked_fraction", s.masked_fraction},
                                     {"mean_dn", s.mean_dn},
                                     {"minimum", s.minimum},
                                     {"maximum", s.maximum},
                                     {"saturated_fraction", s.saturated_fraction},
                                     {"zero_fraction", s.zero_fraction},
                                     {"temporal_noise_dn", optional(s.temporal_noise_dn)},
                                     {"level_above_dark_dn", s.level_above_dark_dn},
                                     {"contrast", optional(s.contrast)}});
    root["abilities"] = Json::array();
    for (const CaptureAbility &a : summary.abilities)
        root["abilities"].push_back({{"topic", a.topic}, {"can", a.can}, {"reason", a.reason}, {"advice", a.advice}});
    root["effects"] = Json::array();
    for (const EffectVisibility &e : summary.effects)
        root["effects"].push_back({{"id", e.id},
                                   {"stage", e.stage},
                                   {"visible", !e.sequences.empty()},
                                   {"sequences", e.sequences},
                                   {"symptom", e.symptom},
                                   {"reason", e.reason}});
    root["warnings"] = Json::array();
    for (const CaptureWarning &w : summary.warnings)
        root["warnings"].push_back({{"sequence", w.sequence}, {"text", w.text}});
    return root.dump(1, ' ', false, Json::error_handler_t::replace);
}

} // namespace clsp
