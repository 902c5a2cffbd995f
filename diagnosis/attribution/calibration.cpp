// Levels at which simulated frames agree with the real ones in what is calibrated. They are the same for all replicates, and drawn from
// frames of their own.
#include "attribution/experiment.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace clsp {
namespace {

constexpr std::uint64_t kCalibrationSeed = 0;
constexpr std::uint32_t kTrialFrames = 4;
constexpr int kRounds = 3;

// The mean code of even light follows the light where the converter's steps are finer than that many deviations of the noise: its ripple's slope
// is 2 exp(-2 (pi sigma / step)^2): 0.09 at 2.5, 0.58 at 4 (Widrow and Kollar, Quantization Noise, 4). Beyond, one sees steps, and no noise at
// all between them.
constexpr double kCoarse = 2.5;
// The data sheet's read noise is good to 15 %: twice that is looked through. One of 0 is not known.
constexpr double kNoiseRange = 0.3;
constexpr int kRootRounds = 12;

double converter_step_dn(const CaptureLayout &layout, const EffectSettings &effects) {
    for (const EffectSetting &effect : effects)
        if (effect.id == "adc_bits")
            return std::exp2(static_cast<double>(layout.bits) - std::round(effect.values.front()));
    return 1.0;
}

// Where a growing function is 0, by false position with Illinois' rule; the nearer end where that is not between the two.
template <typename Function> double root(double low, double high, double tolerance, const Function &function) {
    double below = function(low);
    if (below >= 0.0)
        return low;
    double above = function(high);
    if (above <= 0.0)
        return high;
    double at = low;
    for (int round = 0, last = 0; round < kRootRounds; ++round) {
        // Every third time in the middle: a staircase has long flat parts.
        at = round % 3 == 2 ? 0.5 * (low + high) : (low * above - high * below) / (above - below);
        const double value = function(at);
        if (std::abs(value) < tolerance)
            break;
        const int side = value < 0.0 ? -1 : 1;
        (side < 0 ? low : high) = at;
        (side < 0 ? below : above) = value;
        if (side == last)
            (side < 0 ? above : below) *= 0.5;
        last = side;
    }
    return at;
}

} // namespace

CalibratedLevels Experiment::calibrate(const EffectSettings &effects, const std::vector<bool> &concerned, const CalibratedLevels *start) {
    CalibratedLevels result;
    if (start)
        result = *start;
    else
        result = {real_calibration_.black_level_dn, real_calibration_.read_noise_dn,
                  std::vector<double>(layout_.sequences.size(), 1.0)};
    const double step = converter_step_dn(layout_, effects);
    // Noise of more than a step is not made by codes that flip between two: what was measured holds, whatever the data
    // sheet says. Steps that are an effect's hide it in the real frames, too.
    const bool resolved = step == 1.0 && real_calibration_.read_noise_dn >= step;
    const bool coarse = !resolved && step > kCoarse * layout_.read_noise_dn;
    // The first dark sequence: black level and noise do not depend on the light.
    std::optional<std::size_t> dark, still;
    std::vector<Task> lit;
    for (std::size_t s = 0; s < layout_.sequences.size(); ++s) {
        const SequenceLayout &sequence = layout_.sequences[s];
        if (!concerned[s])
            continue;
        if (sequence.scene == CaptureScene::kDark) {
            if (!dark)
                dark = s;
            continue;
        }
        if (real_levels_[s].mean_dn > real_calibration_.black_level_dn)
            lit.push_back({0, s, kCalibrationSeed});
        // Speckle that stands still has all levels at once, and shows the noise between the steps.
        if (!still && sequence.scene != CaptureScene::kFlat && !sequence.moving && sequence.frame_count >= 2)
            still = s;
    }
    // A part of it, from the levels at its begin; gives black level, read noise, and the sequence's share.
    const auto part = [&](char kind, std::size_t s, const CalibratedLevels &levels, const auto &work) {
        return memo_.value(key_of(effects, levels, s).add_kind(kind), [&] {
            CalibratedLevels own = levels;
            work(own);
            return std::vector<double>{own.black_level_dn, own.read_noise_dn, own.signal_share[s]};
        });
    };
    const auto on_dark = [&] {
        const std::vector<double> levels = part(coarse ? 'D' : 'd', *dark, result, [&](CalibratedLevels &own) {
            Simulator &simulator = simulator_of(*dark, kCalibrationSeed);
            if (coarse)
                calibrate_coarse_dark(simulator, effects, *dark, step, own);
            else
                calibrate_dark(simulator, effects, *dark, own);
        });
        result.black_level_dn = levels[0];
        result.read_noise_dn = levels[1];
    };
    if (coarse && dark) {
        result.read_noise_dn = layout_.read_noise_dn > 0.0 ? layout_.read_noise_dn : 0.5 * step / kCoarse;
        if (still) {
            on_dark();
            const std::vector<double> levels = part('n', *still, result, [&](CalibratedLevels &own) {
                Simulator &simulator = simulator_of(*still, kCalibrationSeed);
                calibrate_signal(simulator, effects, *still, own);
                calibrate_coarse_noise(simulator, effects, *still, step, own);
            });
            result.read_noise_dn = levels[1];
            result.signal_share[*still] = levels[2];
        }
    }
    if (dark)
        on_dark();
    const CalibratedLevels begin = result;
    run_tasks(lit, {}, [&](const Task &task, Simulator &simulator, unsigned) {
        const std::size_t s = task.sequence;
        const bool is_coarse = coarse && layout_.sequences[s].scene == CaptureScene::kFlat;
        result.signal_share[s] = part(is_coarse ? 'S' : 's', s, begin, [&](CalibratedLevels &own) {
            if (is_coarse)
                calibrate_coarse_signal(simulator, effects, s, step, own);
            else
                calibrate_signal(simulator, effects, s, own);
        })[2];
    });
    return result;
}

void Experiment::calibrate_dark(Simulator &simulator, const EffectSettings &effects, std::size_t sequence, CalibratedLevels &levels) {
    const std::uint32_t frame_count = std::min(kTrialFrames, layout_.sequences[sequence].frame_count);
    const double wanted = real_calibration_.read_noise_dn * real_calibration_.read_noise_dn + kQuantizationVariance;
    for (int round = 0; round < kRounds; ++round) {
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        const SequenceLevel level = sequence_level(layout_, sequence, codes.data(), frame_count);
        levels.black_level_dn += real_calibration_.black_level_dn - level.mean_dn;
        if (frame_count >= 2) {
            const double variance =
                levels.read_noise_dn * levels.read_noise_dn + wanted - level.temporal_noise_dn * level.temporal_noise_dn;
            levels.read_noise_dn = std::sqrt(std::max(kLeastReadNoise * kLeastReadNoise, variance));
        }
    }
}

void Experiment::calibrate_coarse_dark(Simulator &simulator, const EffectSettings &effects, std::size_t sequence, double step_dn, CalibratedLevels &levels) {
    const double centre = real_calibration_.black_level_dn;
    const std::uint32_t frame_count = layout_.sequences[sequence].frame_count;
    levels.black_level_dn = root(centre - step_dn, centre + step_dn, 1e-3 * step_dn, [&](double black_level_dn) {
        levels.black_level_dn = black_level_dn;
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        return sequence_level(layout_, sequence, codes.data(), frame_count).mean_dn - centre;
    });
}

void Experiment::calibrate_signal(Simulator &simulator, const EffectSettings &effects, std::size_t sequence, CalibratedLevels &levels) {
    const double signal = real_levels_[sequence].mean_dn - real_calibration_.black_level_dn;
    const std::uint32_t frame_count = std::min(kTrialFrames, layout_.sequences[sequence].frame_count);
    // Secant steps on mean(share) = wanted; the response is monotonic and nearly linear.
    double last_share = 0.0, last_mean = real_calibration_.black_level_dn;
    for (int round = 0; round < kRounds; ++round) {
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        const double mean = sequence_mean_dn(layout_, sequence, codes.data(), frame_count);
        const double share = levels.signal_share[sequence];
        const double slope = (mean - last_mean) / (share - last_share);
        if (std::abs(real_levels_[sequence].mean_dn - mean) < 1e-3 * signal || !(slope > 0.05 * signal))
            break;
        levels.signal_share[sequence] = std::clamp(share + (real_levels_[sequence].mean_dn - mean) / slope, 0.25 * share, 4.0 * share);
        last_share = share;
        last_mean = mean;
    }
}

void Experiment::calibrate_coarse_signal(Simulator &simulator, const EffectSettings &effects, std::size_t sequence, double step_dn, CalibratedLevels &levels) {
    const double wanted = real_levels_[sequence].mean_dn;
    const double signal = wanted - real_calibration_.black_level_dn;
    const std::uint32_t frame_count = layout_.sequences[sequence].frame_count;
    double &share = levels.signal_share[sequence];
    const double centre = share, reach = std::min(0.5 * centre, 2.0 * step_dn / signal);
    share = root(centre - reach, centre + reach, 1e-3 * step_dn, [&](double at) {
        share = at;
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        return sequence_level(layout_, sequence, codes.data(), frame_count).mean_dn - wanted;
    });
}

void Experiment::calibrate_coarse_noise(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                                        double step_dn, CalibratedLevels &levels) {
    const double wanted = real_levels_[sequence].temporal_noise_dn, stated = layout_.read_noise_dn;
    const double low = stated > 0.0 ? (1.0 - kNoiseRange) * stated : kLeastReadNoise;
    const double high = stated > 0.0 ? (1.0 + kNoiseRange) * stated : step_dn / kCoarse;
    const std::uint32_t frame_count = std::min(2 * kTrialFrames, layout_.sequences[sequence].frame_count);
    levels.read_noise_dn = root(low, high, 1e-3 * wanted, [&](double read_noise_dn) {
        levels.read_noise_dn = read_noise_dn;
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        return sequence_level(layout_, sequence, codes.data(), frame_count).temporal_noise_dn - wanted;
    });
}

} // namespace clsp
