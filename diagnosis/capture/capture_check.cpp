#include "capture/capture_check.hpp"

#include "capture/capture_validation.hpp"
#include "capture/odd_places.hpp"
#include "io/json_text.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace clsp {
namespace {

// Mean over frames of the spatial variance.
double within_frame_variance(const SequenceScan &scan) {
    double result = 0.0;
    for (const FrameScan &frame : scan.frames) {
        const double mean = double(frame.sum) / double(scan.pixels);
        result += std::max(0.0, double(frame.square) / double(scan.pixels) - mean * mean) / double(scan.frames.size());
    }
    return result;
}

std::uint64_t sum_of(const SequenceScan &scan) {
    return std::accumulate(scan.frames.begin(), scan.frames.end(), std::uint64_t{0},
                           [](std::uint64_t sum, const FrameScan &frame) { return sum + frame.sum; });
}

} // namespace

DarkLevel dark_level(const CaptureLayout &layout, const std::vector<SequenceScan> &scans) {
    double sum = 0.0, count = 0.0;
    for (std::size_t i = 0; i < layout.sequences.size(); ++i) {
        if (layout.sequences[i].scene != CaptureScene::kDark)
            continue;
        sum += static_cast<double>(sum_of(scans[i]));
        count += static_cast<double>(scans[i].pixels) * layout.sequences[i].frame_count;
    }
    return count > 0.0 ? DarkLevel{sum / count, true} : DarkLevel{layout.black_level_dn, false};
}

SequenceSummary summarize_sequence(const CaptureLayout &layout, std::size_t sequence, const SequenceScan &scan,
                                   const DarkLevel &dark) {
    const SequenceLayout &s = layout.sequences[sequence];
    const double count = static_cast<double>(scan.pixels) * s.frame_count;
    SequenceSummary summary;
    summary.name = s.name;
    summary.scene = s.scene;
    summary.moving = s.moving;
    summary.frame_count = s.frame_count;
    summary.f_number = s.f_number;
    summary.exposure_ms = s.exposure_ms;
    summary.masked_fraction = 1.0 - static_cast<double>(scan.pixels) / static_cast<double>(layout.pixel_count());
    summary.mean_dn = static_cast<double>(sum_of(scan)) / count;
    summary.minimum = scan.minimum;
    summary.maximum = scan.maximum;
    summary.saturated_fraction = static_cast<double>(scan.saturated) / count;
    summary.zero_fraction = static_cast<double>(scan.zero) / count;
    if (s.frame_count > 1)
        summary.temporal_noise_dn = std::sqrt(scan.temporal_variance);
    const bool is_dark = s.scene == CaptureScene::kDark;
    summary.level_above_dark_dn = summary.mean_dn - (is_dark ? layout.black_level_dn : dark.level_dn);
    if ((s.scene == CaptureScene::kFlat || s.scene == CaptureScene::kBoard) && summary.level_above_dark_dn > 0.5)
        summary.contrast = std::sqrt(within_frame_variance(scan)) / summary.level_above_dark_dn;
    return summary;
}

CaptureSummary summarize_capture(const Capture &capture) {
    validate_capture(capture);
    const std::vector<SequenceScan> scans = scan_capture(capture);
    CaptureSummary summary;
    summary.dark = dark_level(capture.layout, scans);
    for (std::size_t i = 0; i < capture.layout.sequences.size(); ++i)
        summary.sequences.push_back(summarize_sequence(capture.layout, i, scans[i], summary.dark));
    summary.abilities = capture_abilities(capture.layout, summary.sequences);
    summary.effects = effect_visibilities(capture.layout);
    // What is written into pixels changes as it likes: nothing else is told of them than that they are odd.
    std::vector<SequenceScan> told_of = scans;
    std::vector<SequenceSummary> seen;
    const std::vector<std::uint8_t> mask = beside_odd_blocks(capture.layout, scans);
    for (std::size_t i = 0; i < scans.size() && !mask.empty(); ++i) {
        told_of[i] = scan_masked(capture, i, mask);
        told_of[i].oddities = scans[i].oddities;
    }
    const DarkLevel dark = dark_level(capture.layout, told_of);
    for (std::size_t i = 0; i < scans.size(); ++i) {
        seen.push_back(summarize_sequence(capture.layout, i, told_of[i], dark));
        for (SequenceChange &change : frame_changes(capture.layout, i, told_of[i], dark.level_dn))
            summary.frame_changes.push_back(std::move(change));
    }
    summary.warnings = capture_warnings(capture, told_of, dark, seen, summary.frame_changes);
    return summary;
}

std::string capture_summary_json(const Capture &capture) {
    using image_io::JsonText;
    const auto blocks = [](const CaptureWarning &warning) {
        JsonText list = JsonText::array();
        for (const PixelBlock &block : warning.pixels)
            list.push_back(
                {{"rows", {block.first_row, block.last_row}}, {"columns", {block.first_column, block.last_column}}});
        return list;
    };
    const CaptureSummary summary = summarize_capture(capture);
    const CaptureLayout &layout = capture.layout;
    const auto optional = [](const std::optional<double> &value) { return value ? JsonText(*value) : JsonText(); };
    JsonText root = {{"format", "clspeckle-capture-summary"}, {"version", 1}};
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
    root["sequences"] = JsonText::array();
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
    root["abilities"] = JsonText::array();
    for (const CaptureAbility &a : summary.abilities)
        root["abilities"].push_back({{"topic", a.topic}, {"can", a.can}, {"reason", a.reason}, {"advice", a.advice}});
    root["effects"] = JsonText::array();
    for (const EffectVisibility &e : summary.effects)
        root["effects"].push_back({{"id", e.id},
                                   {"stage", e.stage},
                                   {"visible", !e.sequences.empty()},
                                   {"sequences", e.sequences},
                                   {"symptom", e.symptom},
                                   {"reason", e.reason}});
    root["warnings"] = JsonText::array();
    for (const CaptureWarning &w : summary.warnings)
        root["warnings"].push_back({{"kind", w.kind},
                                    {"sequence", w.sequence},
                                    {"text", w.text},
                                    {"frames", w.frames},
                                    {"pixels", blocks(w)}});
    return root.text(1);
}

} // namespace clsp
