#include "run/judgeable.hpp"

#include "capture/frame_changes.hpp"
#include "inference/thresholds.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

// 0: all have light, or none has.
std::size_t frames_without_light(const CaptureSummary &summary, const std::string &sequence) {
    for (const SequenceChange &change : summary.frame_changes)
        if (change.kind == kFramesWithoutLight && change.sequence == sequence)
            return change.frames.size();
    return 0;
}

bool has_light(const SequenceSummary &seen) {
    return seen.scene != CaptureScene::kDark && seen.level_above_dark_dn >= kNaming.least_light_dn &&
           seen.saturated_fraction <= kMostClipped;
}

} // namespace

std::string why_not_judged(const CaptureLayout &layout, const CaptureSummary &summary, std::size_t s) {
    const SequenceLayout &sequence = layout.sequences[s];
    const SequenceSummary &seen = summary.sequences[s];
    const bool lit = sequence.scene != CaptureScene::kDark, constant = seen.minimum == seen.maximum;
    const double unmasked = std::round((1.0 - seen.masked_fraction) * static_cast<double>(layout.pixel_count()));
    if (unmasked < kNaming.least_pixels)
        return fmt::format("its mask leaves {:.0f} pixels; at least {} are needed", unmasked, kNaming.least_pixels);
    if (seen.saturated_fraction > kMostClipped)
        return fmt::format("{:.0f} % of its pixels are at the top code, so that its light is not known",
                           100.0 * seen.saturated_fraction);
    if (lit && seen.level_above_dark_dn < kNaming.least_light_dn)
        return fmt::format("its mean is {:.2f} DN above the dark level, so there is no light to judge",
                           seen.level_above_dark_dn);
    if (lit && constant)
        return fmt::format("all its codes are {}: no camera records light without noise", seen.minimum);
    if (const std::size_t dark = frames_without_light(summary, sequence.name); dark > 0)
        return fmt::format("{} of its {} frames have no light", dark, sequence.frame_count);
    // Coarse steps may hide the noise of a dark sequence, which light then shows.
    if (!lit && constant && std::none_of(summary.sequences.begin(), summary.sequences.end(), has_light))
        return fmt::format("all its codes are {}: neither a black level nor noise is to be seen in it", seen.minimum);
    return "";
}

std::string left_out_note(const std::string &sequence, const std::string &reason) {
    return fmt::format("{} was left out: {}", sequence, reason);
}

} // namespace clsp
