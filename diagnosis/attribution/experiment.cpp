#include "attribution/experiment.hpp"

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

FoldStatistics Experiment::replicate(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                     std::uint64_t seed) {
    const std::size_t sequences = layout_.sequences.size();
    Codes codes;
    std::vector<std::uint32_t> frame_counts;
    for (std::size_t s = 0; s < sequences; ++s) {
        if (checkpoint)
            checkpoint();
        frame_counts.push_back(layout_.sequences[s].frame_count);
        codes.push_back(frames(effects, calibrated, s, seed, frame_counts[s]));
    }
    const Calibration calibration = measured_calibration(codes, frame_counts, std::vector<bool>(sequences, true));
    FoldStatistics result{Eigen::VectorXd(count()), Eigen::VectorXd(count())};
    for (std::size_t s = 0; s < sequences; ++s)
        measure(s, codes[s].data(), calibration, result);
    return result;
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
    const std::size_t step = (layout_.sequences[sequence].frame_count - half_count(sequence)) * layout_.pixel_count();
    statistics_[sequence].compute(codes, calibration, into.first.data() + begin(sequence), threads_);
    statistics_[sequence].compute(codes + step, calibration, into.second.data() + begin(sequence), threads_);
}

Eigen::VectorXd Experiment::half(const EffectSettings &effects, const CalibratedLevels &calibrated, std::uint64_t seed,
                                 const std::vector<bool> &concerned, const Eigen::VectorXd &otherwise) {
    const std::size_t sequences = layout_.sequences.size();
    Codes codes(sequences);
    std::vector<std::uint32_t> frame_counts;
    // Dark frames are the measure of all others: their levels must be known, also where no effect shows in them.
    std::vector<bool> present = concerned;
    for (std::size_t s = 0; s < sequences; ++s) {
        frame_counts.push_back(half_count(s));
        present[s] = present[s] || layout_.sequences[s].scene == CaptureScene::kDark;
        if (!present[s])
            continue;
        if (checkpoint)
            checkpoint();
        codes[s] = frames(effects, calibrated, s, seed, frame_counts[s]);
    }
    const Calibration calibration = measured_calibration(codes, frame_counts, present);
    Eigen::VectorXd result = otherwise.size() ? otherwise : Eigen::VectorXd::Zero(count());
    for (std::size_t s = 0; s < sequences; ++s)
        if (concerned[s])
            statistics_[s].compute(codes[s].data(), calibration, result.data() + begin(s), threads_);
    return result;
}

} // namespace clsp
