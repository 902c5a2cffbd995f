#include "statistics/make_frames.hpp"

#include <algorithm>
#include <cmath>

namespace clsp::statistics {

namespace {

// The code at which light clips: the highest that occurs, if no higher one can (a coarse converter's is below 2^bits -
// 1). maximum + 1 if nothing clips.
std::uint32_t clipping_code(const std::vector<std::uint64_t> &histogram) {
    const auto none = std::uint32_t(histogram.size());
    std::uint32_t highest = none - 1;
    while (highest > 0 && histogram[highest] == 0)
        --highest;
    std::uint32_t next = highest ? highest - 1 : 0;
    while (next > 0 && histogram[next] == 0)
        --next;
    return highest + (highest - next) >= none ? highest : none;
}

} // namespace

Frames make_frames(const Geometry &geometry, const std::uint16_t *codes, const Calibration &calibration,
                   FrameSums &sums) {
    Frames frames;
    const std::size_t count = geometry.frames;
    frames.histogram.assign(std::size_t(geometry.maximum_code) + 1, 0);
    frames.frame_mean = sums.count_codes(geometry, codes, frames.histogram);
    for (double &mean : frames.frame_mean)
        mean = mean / double(geometry.used) - calibration.black_level_dn;
    for (const double mean : frames.frame_mean)
        frames.mean_signal += mean / double(count);
    frames.read_variance = std::max(calibration.read_noise_dn * calibration.read_noise_dn, 1.0 / 12.0);
    const double read_noise = std::sqrt(frames.read_variance);
    // Where there should be light but is none, relative statistics stay finite.
    frames.light = geometry.is_lit() ? std::max(frames.mean_signal, 0.5 * read_noise) : read_noise;

    // Flicker multiplies the frame; what else changes a frame's mean adds to it.
    ResidualScale scale;
    scale.black = float(calibration.black_level_dn);
    scale.pivot = float(frames.mean_signal);
    scale.scale.assign(count, 1.0f);
    scale.offset.assign(count, 0.0f);
    for (std::size_t t = 0; t < count; ++t) {
        if (geometry.is_static_laser() && frames.frame_mean[t] > 0.25 * frames.light)
            scale.scale[t] = float(frames.mean_signal / frames.frame_mean[t]);
        else
            scale.offset[t] = float(frames.frame_mean[t] - frames.mean_signal);
    }
    const auto codes_end = std::uint32_t(frames.histogram.size());
    scale.clipping = geometry.is_static_laser() && count > 1 ? clipping_code(frames.histogram) : codes_end;
    scale.any_clip = scale.clipping < codes_end;
    sums.make_residuals(geometry, scale, frames);
    frames.pixel_variance = frames.read_variance;
    if (count > 1) {
        frames.pixel_variance = 0.0;
        for (std::size_t y = 0; y < geometry.height; ++y)
            frames.pixel_variance +=
                sum(frames.variance.data() + y * geometry.width, geometry.width) / double(geometry.used);
    }
    return frames;
}

} // namespace clsp::statistics
