#include "attribution/experiment.hpp"

#include "attribution/measurement_tasks.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

using Codes = std::vector<std::vector<std::uint16_t>>;

} // namespace

Experiment::Experiment(std::shared_ptr<Context> context, const Capture &real, std::vector<Hypothesis> hypotheses,
                       unsigned threads)
    : layout_(real.layout), threads_(threads),
      simulator_(std::make_unique<Simulator>(std::move(context), real.layout, std::move(hypotheses))) {
    const std::size_t sequences = layout_.sequences.size();
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
        throw Error(Status::kInvalidData, "the capture has no sequence that can be measured; record at least one with a frame");
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
    const double intensity = simulator_->mean_intensity(sequence, effects, seed, frame_count);
    if (!(intensity > 0.0))
        // With effects that together block all light the simulator is asked for too much, which is no fault of the capture.
        throw Error(effects.empty() ? Status::kInvalidData : Status::kInvalidArgument,
                    fmt::format("no light reaches the pixels of the sequence {} in the simulation; are its dots inside the "
                                "image and its mask open?",
                                layout_.sequences[sequence].name));
    result.gain_dn = calibrated.signal_share[sequence] * signal / intensity;
    return result;
}

std::vector<std::uint16_t> Experiment::frames(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                              std::size_t sequence, std::uint64_t seed, std::uint32_t frame_count) {
    std::vector<std::uint16_t> codes(std::size_t{frame_count} * layout_.pixel_count());
    simulator_->codes(sequence, effects, levels(calibrated, effects, sequence, seed, frame_count), seed, frame_count,
                      codes.data());
    return codes;
}

std::vector<FoldStatistics> Experiment::replicates(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                   const std::vector<std::uint64_t> &seeds,
                                                   const std::function<void(std::size_t)> &before_each) {
    const std::vector<bool> all(layout_.sequences.size(), true);
    std::vector<FoldStatistics> result(seeds.size(), {Eigen::VectorXd(count()), Eigen::VectorXd(count())});
    MeasurementTasks tasks(threads_);
    for (std::size_t i = 0; i < seeds.size(); ++i) {
        if (before_each)
            before_each(i);
        const auto frame_count = [&](std::size_t s) { return layout_.sequences[s].frame_count; };
        simulate(effects, calibrated, seeds[i], all, frame_count,
                 [&, i](std::size_t s, std::shared_ptr<const std::vector<std::uint16_t>> codes, const Calibration &calibration) {
                     tasks.start([this, s, codes, calibration, &into = result[i], threads = tasks.threads_each()] {
                         measure(s, codes->data(), calibration, into, threads);
                     });
                 });
    }
    tasks.finish();
    return result;
}

void Experiment::simulate(const EffectSettings &effects, const CalibratedLevels &calibrated, std::uint64_t seed,
                          const std::vector<bool> &concerned, const std::function<std::uint32_t(std::size_t)> &frame_count,
                          const TakeFrames &take) {
    const std::size_t sequences = layout_.sequences.size();
    const auto is_dark = [&](std::size_t s) { return layout_.sequences[s].scene == CaptureScene::kDark; };
    const auto simulated = [&](std::size_t s) {
        if (checkpoint)
            checkpoint();
        return frames(effects, calibrated, s, seed, frame_count(s));
    };
    // Dark frames are the measure of all others: their levels must be known, also where no effect shows in them.
    Codes dark(sequences);
    std::vector<std::uint32_t> frame_counts(sequences);
    std::vector<bool> present(sequences);
    for (std::size_t s = 0; s < sequences; ++s) {
        frame_counts[s] = frame_count(s);
        present[s] = is_dark(s);
        if (present[s])
            dark[s] = simulated(s);
    }
    const Calibration calibration = measured_calibration(dark, frame_counts, present);
    for (std::size_t s = 0; s < sequences; ++s)
        if (concerned[s])
            take(s, std::make_shared<const std::vector<std::uint16_t>>(is_dark(s) ? std::move(dark[s]) : simulated(s)), calibration);
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

void Experiment::measure(std::size_t sequence, const std::uint16_t *codes, const Calibration &calibration, FoldStatistics &into) const {
    measure(sequence, codes, calibration, into, threads_);
}

void Experiment::measure(std::size_t sequence, const std::uint16_t *codes, const Calibration &calibration, FoldStatistics &into,
                         unsigned threads) const {
    const std::size_t step = (layout_.sequences[sequence].frame_count - half_count(sequence)) * layout_.pixel_count();
    statistics_[sequence].compute(codes, calibration, into.first.data() + begin(sequence), threads);
    statistics_[sequence].compute(codes + step, calibration, into.second.data() + begin(sequence), threads);
}

std::vector<Eigen::VectorXd> Experiment::halves(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                const std::vector<std::uint64_t> &seeds, const std::vector<bool> &concerned,
                                                const std::vector<Eigen::VectorXd> &otherwise) {
    std::vector<Eigen::VectorXd> result(otherwise.begin(), otherwise.begin() + std::min(otherwise.size(), seeds.size()));
    result.resize(seeds.size(), Eigen::VectorXd::Zero(count()));
    MeasurementTasks tasks(threads_);
    for (std::size_t i = 0; i < seeds.size(); ++i)
        simulate(effects, calibrated, seeds[i], concerned, [&](std::size_t s) { return half_count(s); },
                 [&, i](std::size_t s, std::shared_ptr<const std::vector<std::uint16_t>> codes, const Calibration &calibration) {
                     tasks.start([this, s, codes, calibration, &into = result[i], threads = tasks.threads_each()] {
                         statistics_[s].compute(codes->data(), calibration, into.data() + begin(s), threads);
                     });
                 });
    tasks.finish();
    return result;
}

} // namespace clsp
