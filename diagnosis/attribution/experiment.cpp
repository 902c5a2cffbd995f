#include "attribution/experiment.hpp"

#include "attribution/lanes.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <numeric>

namespace clsp {
namespace {

using Codes = std::vector<std::vector<std::uint16_t>>;

// Each lane has memory of its own for the frames of one sequence.
constexpr std::size_t kMostLanes = 4;
constexpr std::size_t kCacheBytes = std::size_t{256} << 20; // of all of them

} // namespace

Experiment::Experiment(std::shared_ptr<Context> context, const Capture &real, std::vector<Hypothesis> hypotheses,
                       unsigned threads)
    : layout_(real.layout), threads_(threads) {
    const std::size_t sequences = layout_.sequences.size();
    const auto lit = std::count_if(layout_.sequences.begin(), layout_.sequences.end(),
                                   [](const SequenceLayout &s) { return s.scene != CaptureScene::kDark; });
    // Hypotheses are called on the caller's thread, one at a time.
    const std::size_t lanes =
        hypotheses.empty() ? std::clamp<std::size_t>(std::min<std::size_t>(lit, threads), 1, kMostLanes) : 1;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
        simulators_.push_back(std::make_unique<Simulator>(context, real.layout, hypotheses));
        simulators_.back()->set_cache_bytes(kCacheBytes / lanes);
    }
    share_out(lanes);
    offsets_.push_back(0);
    for (std::size_t s = 0; s < sequences; ++s) {
        parted_ = parted_ || layout_.sequences[s].frame_count >= 4;
        has_dark_ = has_dark_ || layout_.sequences[s].scene == CaptureScene::kDark;
        statistics_.emplace_back(layout_, s, half_count(s));
        const auto &list = statistics_.back().list();
        list_.insert(list_.end(), list.begin(), list.end());
        offsets_.push_back(list_.size());
    }
    if (list_.empty())
        throw Error(Status::kInvalidData,
                    "the capture has no sequence that can be measured; record at least one with a frame");
    std::vector<std::uint32_t> frame_counts;
    for (std::size_t s = 0; s < sequences; ++s) {
        frame_counts.push_back(layout_.sequences[s].frame_count);
        real_levels_.push_back(sequence_level(layout_, s, real.codes[s].data(), frame_counts[s]));
    }
    real_calibration_ = measured_calibration(real.codes, frame_counts, std::vector<bool>(sequences, true));
    real_.first.resize(count());
    real_.second.resize(count());
    for (std::size_t s = 0; s < sequences; ++s)
        measure(s, real.codes[s].data(), real_calibration_, real_);
}

std::uint32_t Experiment::half_count(std::size_t sequence) const {
    const std::uint32_t frames = layout_.sequences[sequence].frame_count;
    return frames >= 4 ? frames / 2 : frames;
}

Calibration Experiment::measured_calibration(const Codes &codes, const std::vector<std::uint32_t> &frame_counts,
                                             const std::vector<bool> &present) const {
    Calibration result{layout_.black_level_dn, layout_.read_noise_dn};
    double mean = 0.0, variance = 0.0;
    unsigned means = 0, variances = 0;
    for (std::size_t s = 0; s < codes.size(); ++s) {
        if (layout_.sequences[s].scene != CaptureScene::kDark || !present[s])
            continue;
        const SequenceLevel level = sequence_level(layout_, s, codes[s].data(), frame_counts[s]);
        mean += level.mean_dn;
        ++means;
        // Frames that are all alike are a damaged recording, no noiseless camera: then the data sheet's noise counts.
        if (frame_counts[s] >= 2 && level.temporal_noise_dn > 0.0) {
            variance += level.temporal_noise_dn * level.temporal_noise_dn;
            ++variances;
        }
    }
    if (means)
        result.black_level_dn = mean / means;
    if (variances)
        result.read_noise_dn =
            std::max(kLeastReadNoise, std::sqrt(std::max(0.0, variance / variances - kQuantizationVariance)));
    return result;
}

SimulationLevels Experiment::levels(const CalibratedLevels &calibrated, const EffectSettings &effects,
                                    std::size_t sequence, std::uint64_t seed, std::uint32_t frame_count) {
    SimulationLevels result;
    result.black_level_dn = calibrated.black_level_dn;
    result.read_noise_dn = calibrated.read_noise_dn;
    if (layout_.sequences[sequence].scene == CaptureScene::kDark)
        return result;
    const double signal = std::max(0.0, real_levels_[sequence].mean_dn - real_calibration_.black_level_dn);
    const double intensity = simulators_[lanes_[sequence]]->mean_intensity(sequence, effects, seed, frame_count);
    if (!(intensity > 0.0))
        // With effects that together block all light the simulator is asked for too much, which is no fault of the
        // capture.
        throw Error(
            effects.empty() ? Status::kInvalidData : Status::kInvalidArgument,
            fmt::format("no light reaches the pixels of the sequence {} in the simulation; are its dots inside the "
                        "image and its mask open?",
                        layout_.sequences[sequence].name));
    result.gain_dn = calibrated.signal_share[sequence] * signal / intensity;
    return result;
}

std::vector<std::uint16_t> Experiment::frames(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                              std::size_t sequence, std::uint64_t seed, std::uint32_t frame_count) {
    std::vector<std::uint16_t> codes(std::size_t{frame_count} * layout_.pixel_count());
    simulators_[lanes_[sequence]]->codes(sequence, effects, levels(calibrated, effects, sequence, seed, frame_count),
                                         seed, frame_count, codes.data());
    return codes;
}

std::vector<FoldStatistics> Experiment::replicates(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                   const std::vector<std::uint64_t> &seeds,
                                                   const std::function<void(std::size_t)> &before_each) {
    const std::vector<bool> all(layout_.sequences.size(), true);
    std::vector<FoldStatistics> result(seeds.size(), {Eigen::VectorXd(count()), Eigen::VectorXd(count())});
    simulate(
        effects, calibrated, seeds, all, before_each, [&](std::size_t s) { return layout_.sequences[s].frame_count; },
        [&](std::size_t i, std::size_t s, const std::uint16_t *codes, const Calibration &calibration) {
            measure(s, codes, calibration, result[i]);
        });
    return result;
}

void Experiment::simulate(const EffectSettings &effects, const CalibratedLevels &calibrated,
                          const std::vector<std::uint64_t> &seeds, const std::vector<bool> &concerned,
                          const std::function<void(std::size_t)> &before_each,
                          const std::function<std::uint32_t(std::size_t)> &frame_count, const TakeFrames &take) {
    const std::size_t sequences = layout_.sequences.size();
    const auto is_dark = [&](std::size_t s) { return layout_.sequences[s].scene == CaptureScene::kDark; };
    std::vector<std::uint32_t> frame_counts(sequences);
    std::vector<bool> dark(sequences);
    for (std::size_t s = 0; s < sequences; ++s) {
        frame_counts[s] = frame_count(s);
        dark[s] = is_dark(s);
    }
    // Dark frames are the measure of all others: their levels must be known, also where no effect shows in them.
    std::vector<Calibration> calibrations;
    for (std::size_t i = 0; i < seeds.size(); ++i) {
        Codes codes(sequences);
        for (std::size_t s = 0; s < sequences; ++s)
            if (dark[s]) {
                if (checkpoint)
                    checkpoint();
                codes[s] = frames(effects, calibrated, s, seeds[i], frame_counts[s]);
            }
        calibrations.push_back(measured_calibration(codes, frame_counts, dark));
        for (std::size_t s = 0; s < sequences; ++s)
            if (dark[s] && concerned[s])
                take(i, s, codes[s].data(), calibrations[i]);
    }
    run_lanes(simulators_.size(), checkpoint, [&](std::size_t lane, const std::function<void()> &lane_checkpoint) {
        for (std::size_t i = 0; i < seeds.size(); ++i) {
            if (lane == 0 && before_each)
                before_each(i);
            for (std::size_t s = 0; s < sequences; ++s) {
                if (dark[s] || !concerned[s] || lanes_[s] != lane)
                    continue;
                lane_checkpoint();
                take(i, s, frames(effects, calibrated, s, seeds[i], frame_counts[s]).data(), calibrations[i]);
            }
        }
    });
}

// Sequences that take long first, each to the lane that has least to do.
void Experiment::share_out(std::size_t lane_count) {
    const std::size_t sequences = layout_.sequences.size();
    std::vector<std::size_t> order(sequences);
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto work = [&](std::size_t s) {
        const SequenceLayout &sequence = layout_.sequences[s];
        // A moving surface has an interference pattern of its own in every frame, which takes about as long as all
        // else.
        return sequence.scene == CaptureScene::kDark ? 0u : sequence.frame_count * (sequence.moving ? 2u : 1u);
    };
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return work(a) > work(b); });
    std::vector<std::uint64_t> load(lane_count, 0);
    lanes_.assign(sequences, 0);
    for (const std::size_t s : order) {
        lanes_[s] = static_cast<std::size_t>(std::min_element(load.begin(), load.end()) - load.begin());
        load[lanes_[s]] += work(s);
    }
}

Calibration Experiment::calibration_of(const Codes &codes) const {
    std::vector<std::uint32_t> frame_counts;
    std::vector<bool> present;
    for (std::size_t s = 0; s < codes.size(); ++s) {
        frame_counts.push_back(layout_.sequences[s].frame_count);
        present.push_back(!codes[s].empty());
    }
    return measured_calibration(codes, frame_counts, present);
}

void Experiment::measure(std::size_t sequence, const std::uint16_t *codes, const Calibration &calibration,
                         FoldStatistics &into) const {
    const std::size_t step = (layout_.sequences[sequence].frame_count - half_count(sequence)) * layout_.pixel_count();
    statistics_[sequence].compute(codes, calibration, into.first.data() + begin(sequence), threads_);
    statistics_[sequence].compute(codes + step, calibration, into.second.data() + begin(sequence), threads_);
}

std::vector<Eigen::VectorXd> Experiment::halves(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                const std::vector<std::uint64_t> &seeds,
                                                const std::vector<bool> &concerned,
                                                const std::vector<Eigen::VectorXd> &otherwise) {
    std::vector<Eigen::VectorXd> result(otherwise.begin(),
                                        otherwise.begin() + std::min(otherwise.size(), seeds.size()));
    result.resize(seeds.size(), Eigen::VectorXd::Zero(count()));
    simulate(
        effects, calibrated, seeds, concerned, {}, [&](std::size_t s) { return half_count(s); },
        [&](std::size_t i, std::size_t s, const std::uint16_t *codes, const Calibration &calibration) {
            statistics_[s].compute(codes, calibration, result[i].data() + begin(s), threads_);
        });
    return result;
}

} // namespace clsp
