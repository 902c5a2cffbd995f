#include "capture/noise_warnings.hpp"

#include <cmath>
#include <fmt/format.h>
#include <string>

namespace clsp {
namespace {

constexpr const char *kKind = "denoised";
constexpr double kLeastOfNeighbours = 0.1, kLeastInTime = 0.25, kLeastOfRows = 0.4, kLessThanDark = 0.6;
constexpr double kFewPixels = 0.01; // of the pixels

bool stands_out(const NoiseCorrelation &correlation, double least) {
    return correlation.sure && std::abs(correlation.value) > least;
}

struct Place {
    std::string sequences;
    const NoiseCorrelations *most = nullptr;
};

void add(Place &place, const std::string &name, const NoiseCorrelations &one, double was, double is) {
    place.sequences += (place.sequences.empty() ? "" : ", ") + name;
    if (!place.most || std::abs(is) > std::abs(was))
        place.most = &one;
}

double of_neighbours(const NoiseCorrelations &one) {
    return std::abs(one.right.value) > std::abs(one.down.value) ? one.right.value : one.down.value;
}

} // namespace

std::vector<CaptureWarning> noise_warnings(const CaptureLayout &layout, const std::vector<SequenceScan> &scans,
                                           const std::vector<SequenceSummary> &summaries, double dark_noise_dn) {
    std::vector<CaptureWarning> warnings;
    Place space, time, rows;
    for (std::size_t i = 0; i < scans.size(); ++i) {
        const NoiseCorrelations &one = scans[i].correlations;
        const std::string &name = layout.sequences[i].name;
        if (stands_out(one.right, kLeastOfNeighbours) || stands_out(one.down, kLeastOfNeighbours))
            add(space, name, one, space.most ? of_neighbours(*space.most) : 0.0, of_neighbours(one));
        // Smoothing makes neighbouring rows alike, too.
        else if (one.rows.sure && one.rows.value > kLeastOfRows)
            add(rows, name, one, rows.most ? rows.most->rows_dn : 0.0, one.rows_dn);
        if (stands_out(one.next, kLeastInTime))
            add(time, name, one, time.most ? time.most->next.value : 0.0, one.next.value);
    }
    if (rows.most)
        warnings.push_back(
            {"",
             fmt::format(
                 "neighbouring rows go up and down together, by {:.1f} DN from frame to frame (in {}): bands of "
                 "light that flickers under a rolling shutter, or of a supply that hums. No effect does that. "
                 "Take steady light, or expose for whole periods of it",
                 rows.most->rows_dn, rows.sequences),
             "bands"});
    if (space.most)
        warnings.push_back(
            {"",
             fmt::format("the noise of neighbouring pixels goes together, by a correlation of {:.2f} along rows and "
                         "{:.2f} along columns, in all frames (in {}): the camera {}, or files were compressed with "
                         "loss. Switch that off and record raw codes: noise, contrast and grain are not the sensor's",
                         space.most->right.value, space.most->down.value, space.sequences,
                         !stands_out(space.most->down, kLeastOfNeighbours)
                             ? "reads its pixels so (the effect correlated_read_noise), or filters its rows"
                         : of_neighbours(*space.most) > 0.0 ? "denoises, interpolates or scales its frames"
                                                            : "sharpens its frames"),
             kKind});
    if (time.most)
        warnings.push_back(
            {"",
             fmt::format("the noise of a pixel goes on from frame to frame, by a correlation of {:.2f}, in all frames "
                         "(in {}): the camera averages its frames, or takes each for a part of the next. Switch "
                         "temporal denoising off and record raw codes: noise, contrast and motion are not the "
                         "scene's",
                         time.most->next.value, time.sequences),
             kKind});
    for (std::size_t i = 0; i < scans.size() && !space.most && !time.most; ++i) {
        const SequenceLayout &sequence = layout.sequences[i];
        const SequenceSummary &seen = summaries[i];
        if (sequence.scene == CaptureScene::kDark || (sequence.moving && is_laser(sequence.scene)) ||
            !seen.temporal_noise_dn || seen.saturated_fraction > kFewPixels || seen.zero_fraction > kFewPixels ||
            dark_noise_dn < double(least_step(scans[i].codes)) || seen.minimum == seen.maximum)
            continue;
        if (*seen.temporal_noise_dn < kLessThanDark * dark_noise_dn)
            warnings.push_back(
                {sequence.name,
                 fmt::format("its noise in time is {:.2f} DN, less than the {:.2f} DN of the dark frames, though light "
                             "has noise of its own: the camera denoises or compresses lit frames, or the dark is of "
                             "another setting. Switch that off and record raw codes",
                             *seen.temporal_noise_dn, dark_noise_dn),
                 kKind});
    }
    return warnings;
}

} // namespace clsp
