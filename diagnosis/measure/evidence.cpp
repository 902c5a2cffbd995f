#include "measure/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace clsp {
namespace {

using evidence::Frames;
using evidence::Plane;

// Apart from the seeds of replicates, which count up from 1, and of the pool.
constexpr std::uint64_t kEvidenceSeed = std::uint64_t{1} << 41;

// One version of a sequence while its pictures wait for their common scale.
struct Draft {
    std::vector<std::uint16_t> codes;
    Plane first, mean, deviation, difference, smooth_difference;
    evidence::DotStack stack;
};

struct PlaneScale {
    double low, high;
};

// From the lowest to the highest of the versions' quantiles.
PlaneScale common_scale(const std::vector<Draft> &drafts, Plane Draft::*plane, double low, double high) {
    PlaneScale scale{0.0, 0.0};
    for (std::size_t v = 0; v < drafts.size(); ++v) {
        const double first = evidence::quantile(drafts[v].*plane, low),
                     last = evidence::quantile(drafts[v].*plane, high);
        scale.low = v ? std::min(scale.low, first) : first;
        scale.high = v ? std::max(scale.high, last) : last;
    }
    return scale;
}

double common_reach(const std::vector<Draft> &drafts, Plane Draft::*plane) {
    const PlaneScale scale = common_scale(drafts, plane, 0.005, 0.995);
    return std::max(std::abs(scale.low), std::abs(scale.high));
}

Plane minus(const Plane &a, const Plane &b) {
    Plane result(a.size());
    std::transform(a.begin(), a.end(), b.begin(), result.begin(), [](float x, float y) { return x - y; });
    return result;
}

SequenceEvidence sequence_evidence(const ReplicateRunner &runner, std::size_t index, std::uint32_t frame_count,
                                   std::vector<Draft> &drafts) {
    const CaptureLayout &layout = runner.layout();
    const SequenceLayout &sequence = layout.sequences[index];
    const double black = runner.real_calibration().black_level_dn;
    SequenceEvidence result;
    result.name = sequence.name;
    result.scene = sequence.scene;
    result.moving = sequence.moving;
    result.frame_count = frame_count;
    result.averaged_px = (layout.width + kPictureWidth - 1) / kPictureWidth;
    // Some 24 squares across: large against a speckle, small against the field.
    result.smooth_px = std::max(result.averaged_px, std::max(4u, layout.width / 24u));
    const bool is_static_laser = !sequence.moving && is_laser(sequence.scene);
    result.fluctuation = is_static_laser || frame_count < 2 ? Fluctuation::kInFrame : Fluctuation::kOverTime;
    const std::size_t bands = evidence::band_count(layout);
    for (std::size_t k = 0; k < bands; ++k)
        result.frequency.push_back(0.5 * (double(k) + 0.5) / double(bands));

    std::vector<Frames> all;
    for (const Draft &draft : drafts)
        all.push_back({&layout, &sequence, frame_count, draft.codes.data()});
    const evidence::HistogramRange range = evidence::histogram_range(all);
    result.histogram_step_dn = range.step;
    result.histogram_first_dn = range.first + 0.5 * (range.step - 1.0);

    const std::uint32_t edge = result.averaged_px;
    const auto small = [&](const Plane &plane, std::uint32_t square) {
        return evidence::block_means(plane, layout.width, layout.height, square);
    };
    result.versions.resize(drafts.size());
    Plane real_mean;
    for (std::size_t v = 0; v < drafts.size(); ++v) {
        Draft &draft = drafts[v];
        VersionEvidence &version = result.versions[v];
        const Plane mean = evidence::mean_image(all[v]);
        evidence::Histogram histogram = evidence::histogram(all[v], range);
        version.histogram = std::move(histogram.bins);
        version.histogram_outside = histogram.outside;
        version.power = evidence::radial_power(all[v], mean, result.fluctuation, bands);
        version.autocorrelation = evidence::temporal_autocorrelation(all[v]);
        if (sequence.scene == CaptureScene::kDots)
            draft.stack = evidence::stack_dots(all[v], mean, black);
        version.dot_profile_dn = draft.stack.profile_dn;
        result.dot_count = draft.stack.dots;
        draft.first =
            small(Plane(draft.codes.begin(), draft.codes.begin() + std::ptrdiff_t(layout.pixel_count())), edge);
        draft.mean = small(mean, edge);
        if (frame_count > 1)
            draft.deviation = small(evidence::temporal_deviation(all[v], mean), edge);
        if (v == 0) {
            real_mean = mean;
        } else {
            const Plane difference = minus(mean, real_mean);
            draft.difference = small(difference, edge);
            draft.smooth_difference = small(difference, result.smooth_px);
        }
        draft.codes = {};
        draft.codes.shrink_to_fit();
    }
    if (result.dot_count)
        result.dot_radius_px = evidence::dot_profile_radii();

    const auto columns = [&](std::uint32_t square) { return (layout.width + square - 1) / square; };
    const auto rows = [&](std::uint32_t square) { return (layout.height + square - 1) / square; };
    const PlaneScale first = common_scale(drafts, &Draft::first, 0.005, 0.995),
                mean = common_scale(drafts, &Draft::mean, 0.005, 0.995);
    const PlaneScale deviation = common_scale(drafts, &Draft::deviation, 0.005, 0.995);
    PlaneScale stack{0.0, 0.0};
    for (const Draft &draft : drafts)
        stack.high = std::max(stack.high, evidence::quantile(draft.stack.image, 1.0));
    const double reach = common_reach(drafts, &Draft::difference),
                 smooth_reach = common_reach(drafts, &Draft::smooth_difference);
    for (std::size_t v = 0; v < drafts.size(); ++v) {
        const Draft &draft = drafts[v];
        VersionEvidence &version = result.versions[v];
        version.first_frame = evidence::gray_picture(draft.first, columns(edge), rows(edge), first.low, first.high);
        version.mean_image = evidence::gray_picture(draft.mean, columns(edge), rows(edge), mean.low, mean.high);
        if (frame_count > 1)
            version.temporal_deviation =
                evidence::gray_picture(draft.deviation, columns(edge), rows(edge), deviation.low, deviation.high);
        if (v > 0) {
            version.difference = evidence::diverging_picture(draft.difference, columns(edge), rows(edge), reach);
            version.smooth_difference = evidence::diverging_picture(draft.smooth_difference, columns(result.smooth_px),
                                                                    rows(result.smooth_px), smooth_reach);
        }
        if (draft.stack.dots)
            version.dot_stack =
                evidence::gray_picture(draft.stack.image, 2 * kDotReach + 1, 2 * kDotReach + 1, stack.low, stack.high);
    }
    return result;
}

} // namespace

std::vector<std::uint16_t> evidence_frames(ReplicateRunner &runner, const Capture &real, const FittedModel *model,
                                           std::size_t sequence, std::uint32_t frame_count, std::uint64_t seed) {
    if (model) {
        const Replicates &replicates = model->model.replicates();
        return runner.frames(replicates.effects, replicates.levels, sequence, seed + kEvidenceSeed, frame_count);
    }
    const auto first = real.codes[sequence].begin();
    return {first, first + std::ptrdiff_t(frame_count * real.layout.pixel_count())};
}

Evidence collect_evidence(ReplicateRunner &runner, const Capture &real, const FittedModel &baseline,
                          const FittedModel *final, std::uint64_t seed) {
    const FittedModel *models[] = {nullptr, &baseline, final};
    return collect_evidence(runner, final ? 3 : 2, [&](std::size_t version, std::size_t s, std::uint32_t frame_count) {
        return evidence_frames(runner, real, models[version], s, frame_count, seed);
    });
}

Evidence collect_evidence(ReplicateRunner &runner, std::size_t version_count, const EvidenceFrames &frames_of) {
    const CaptureLayout &layout = runner.layout();
    Evidence result;
    result.width = layout.width;
    result.height = layout.height;
    result.bits = layout.bits;
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        if (runner.checkpoint)
            runner.checkpoint();
        const std::uint32_t frame_count = std::min(kEvidenceFrames, layout.sequences[s].frame_count);
        std::vector<Draft> drafts(version_count);
        for (std::size_t v = 0; v < drafts.size(); ++v)
            drafts[v].codes = frames_of(v, s, frame_count);
        result.sequences.push_back(sequence_evidence(runner, s, frame_count, drafts));
    }
    return result;
}

} // namespace clsp
