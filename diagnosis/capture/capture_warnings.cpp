// What is odd about the codes of a valid capture.
#include "capture/capture_check.hpp"
#include "capture/code_warnings.hpp"
#include "capture/frame_changes.hpp"
#include "capture/metadata_warnings.hpp"
#include "capture/noise_warnings.hpp"
#include "capture/pixel_warnings.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <map>

namespace clsp {
namespace {

constexpr double kMostZeros = 0.01, kBlack = 0.5; // parts of the pixels

// How many frames are bit for bit one that came before, and the first such pair.
struct Repeats {
    std::uint32_t count = 0, first = 0, again = 0;
};

Repeats repeated_frames(const SequenceScan &scan) {
    Repeats result;
    std::map<std::array<std::uint64_t, 3>, std::uint32_t> seen; // no two frames agree in all three by chance
    for (std::uint32_t t = 0; t < scan.frames.size(); ++t) {
        const FrameScan &frame = scan.frames[t];
        const auto [same, is_new] = seen.try_emplace({frame.hash, frame.sum, frame.square}, t);
        if (!is_new && result.count++ == 0) {
            result.first = same->second;
            result.again = t;
        }
    }
    return result;
}

void warn_of_dots(const CaptureLayout &layout, std::vector<CaptureWarning> &warnings) {
    if (!layout.dots)
        return;
    const auto &positions = layout.dots->positions_px;
    // Dots just beyond the border belong into the list: their light reaches the image.
    const double reach = kDotReach * layout.dots->sigma_px + 0.5;
    const auto outside = std::count_if(positions.begin(), positions.end(), [&](const auto &p) {
        return p[0] < -reach || p[0] >= layout.width - 1 + reach || p[1] < -reach || p[1] >= layout.height - 1 + reach;
    });
    if (outside > 0)
        warnings.push_back({"",
                            fmt::format("{} of {} dots lie so far outside of the image of {} x {} pixels that no light "
                                        "of theirs reaches it; if that is not meant, "
                                        "positions_px may be in another order or unit ([x, y] in pixels)",
                                        outside, positions.size(), layout.width, layout.height),
                            "dots_outside"});
    // Two dots at one place are one brighter dot: mostly a list that was joined twice.
    std::vector<std::array<double, 2>> sorted = positions;
    std::sort(sorted.begin(), sorted.end());
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
    if (twice != sorted.end())
        warnings.push_back(
            {"", fmt::format("two or more dots are at ({}, {}); their light adds up", (*twice)[0], (*twice)[1]),
             "merged_dots"});
}

void warn_of_pupil(const CaptureLayout &layout, const SequenceLayout &s, std::vector<CaptureWarning> &warnings) {
    if (s.scene == CaptureScene::kDark || s.scene == CaptureScene::kFlat)
        return;
    const double diameter = layout.pixel_pitch_m / (layout.wavelength_m * s.f_number);
    if (diameter > 1.0)
        warnings.push_back(
            {s.name,
             fmt::format("at f/{:g} the pupil is {:.2f} cycles per pixel wide: speckle is finer than the pixels, and a "
                         "baseline that samples points cuts its spectrum off at 1; the size of the grain says little",
                         s.f_number, diameter),
             "fine_speckle"});
}

// noise_dn: of one pixel in the dark.
void warn_of_codes(const CaptureLayout &layout, std::size_t sequence, const SequenceScan &scan,
                   const SequenceSummary &summary, const DarkLevel &dark, double noise_dn,
                   std::vector<CaptureWarning> &warnings) {
    const SequenceLayout &s = layout.sequences[sequence];
    const auto warn = [&](const char *kind, std::string text, std::vector<std::size_t> frames = {}) {
        warnings.push_back({s.name, std::move(text), kind, std::move(frames)});
    };
    const bool lit = s.scene != CaptureScene::kDark;
    if (summary.minimum == summary.maximum)
        warn("constant",
             summary.minimum == layout.maximum_code()
                 ? fmt::format("every pixel of every frame is at the top code, {}: the sequence is saturated",
                               summary.minimum)
                 : fmt::format("every pixel of every frame has the code {}: the sensor delivered nothing, or the codes "
                               "were lost "
                               "on the way",
                               summary.minimum));
    if (s.frame_count == 1) {
        warn("one_frame", "has one frame only: nothing can be said about noise or change in time");
    } else if (summary.minimum == summary.maximum) {
        // That all frames are the same needs no word of its own then.
    } else if (const Repeats repeats = repeated_frames(scan); repeats.count + 1 == s.frame_count) {
        warn("repeated_frames",
             fmt::format("all {} frames are the same, bit for bit: there is no temporal noise; a real camera has some, "
                         "so the frames may be "
                         "copies of one",
                         s.frame_count));
    } else if (repeats.count > 0) {
        warn("repeated_frames",
             fmt::format("{} of {} frames are repeated, bit for bit (frame {} is frame {} again): the grabber may have "
                         "dropped frames",
                         repeats.count, s.frame_count, repeats.again, repeats.first));
    }
    if (!scan.torn.empty()) {
        std::vector<std::size_t> torn;
        for (const TornRows &rows : scan.torn)
            if (torn.empty() || torn.back() != rows.frame)
                torn.push_back(rows.frame);
        const TornRows &first = scan.torn.front();
        warn("torn_frames",
             fmt::format(
                 "{} of {} frames are torn: in frame {} rows {} to {} are those of the frame before, bit for bit, "
                 "and the others are not. The grabber hands out a frame before it is whole: let it wait for the end of "
                 "each, or leave those out: take {}",
                 torn.size(), s.frame_count, first.frame, first.first_row, first.last_row,
                 without_frames(torn, s.frame_count)),
             torn);
    }
    if (summary.saturated_fraction > 0.2 && summary.minimum != summary.maximum)
        warn("saturated",
             fmt::format("{:.0f} % of the pixels are at the top code, {}: the sequence is saturated and says little "
                         "about the light; expose less",
                         100.0 * summary.saturated_fraction, layout.maximum_code()));
    if (summary.minimum != summary.maximum && summary.zero_fraction > kMostZeros)
        warn("clipped_at_zero",
             fmt::format("{:.1f} % of the pixels have the code 0: {}", 100.0 * summary.zero_fraction,
                         lit && summary.zero_fraction > kBlack
                             ? "the sequence is black or the black level was taken off; raw codes are needed"
                         : lit
                             ? "what is darker is lost there, as where a black level was taken off; raw codes with "
                               "their black level have all of it"
                             : "the noise is clipped there, so that the codes' mean is above the black level and their "
                               "noise below the read noise. A diagnosis estimates both behind the clipping, less well "
                               "than from raw codes with their black level"));
    const bool inverted = summary.level_above_dark_dn < -3.0 * std::max(1.0, noise_dn);
    // A quarter of the noise of one pixel, but no less than half a code.
    if (lit && summary.level_above_dark_dn < std::max(0.5, 0.25 * noise_dn))
        warn("no_light",
             fmt::format("its mean, {:.2f} DN, is {} the dark level, {:.2f} DN ({}): {}", summary.mean_dn,
                         inverted ? "far below" : "not above", dark.level_dn,
                         dark.measured ? "of the dark sequences" : "the data sheet's black level",
                         inverted ? "are the codes inverted, so that 0 is white, or is the dark of another setting?"
                                  : "there is hardly any light in it"));
}

} // namespace

std::vector<CaptureWarning> capture_warnings(const Capture &capture, const std::vector<SequenceScan> &scans,
                                             const DarkLevel &dark, const std::vector<SequenceSummary> &summaries,
                                             const std::vector<SequenceChange> &frame_changes) {
    std::vector<CaptureWarning> warnings = capture.warnings;
    warn_of_dots(capture.layout, warnings);
    if (auto swapped = swapped_bytes(capture.layout, scans)) {
        for (const SequenceLayout &sequence : capture.layout.sequences)
            warn_of_pupil(capture.layout, sequence, warnings);
        // Files that say so themselves know how they are read in the other order.
        if (std::none_of(warnings.begin(), warnings.end(),
                         [](const CaptureWarning &warning) { return warning.kind == kSwappedBytes; }))
            warnings.push_back(std::move(*swapped));
        return warnings;
    }
    // A data sheet may say 0, or the noise of another gain.
    const double measured = measured_noise(summaries), noise = measured > 0.0 ? measured : capture.layout.read_noise_dn;
    for (std::size_t i = 0; i < capture.layout.sequences.size(); ++i) {
        warn_of_pupil(capture.layout, capture.layout.sequences[i], warnings);
        warn_of_codes(capture.layout, i, scans[i], summaries[i], dark, noise, warnings);
    }
    const auto changes = [&](const std::string &sequence) {
        return std::any_of(frame_changes.begin(), frame_changes.end(),
                           [&](const SequenceChange &change) { return change.sequence == sequence; });
    };
    for (CaptureWarning &warning : pixel_warnings(capture.layout, scans, dark))
        if (warning.kind != kTransientPixels || !changes(warning.sequence))
            warnings.push_back(std::move(warning));
    warnings.insert(warnings.end(), frame_changes.begin(), frame_changes.end());
    for (std::size_t i = 0; i < scans.size(); ++i)
        if (!changes(capture.layout.sequences[i].name))
            for (auto &warning : {level_fluctuation(capture.layout, i, scans[i], dark.level_dn),
                                  picture_shift(capture.layout, i, scans[i])})
                if (warning)
                    warnings.push_back(*warning);
    for (CaptureWarning &warning : noise_warnings(capture.layout, scans, summaries, measured))
        warnings.push_back(std::move(warning));
    for (CaptureWarning &warning : metadata_warnings(capture, scans, summaries, dark, frame_changes))
        warnings.push_back(std::move(warning));
    return warnings;
}

} // namespace clsp
