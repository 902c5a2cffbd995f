// Levels at which simulated frames agree with the real ones in what is calibrated. They are the same for all
// replicates, and drawn from frames of their own.
#include "effects/effects.hpp"
#include "inference/replicate_runner.hpp"

#include "capture/exposure_series.hpp"
#include "inference/thresholds.hpp"
#include "effects/pipeline_model.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

namespace clsp {
namespace {

constexpr std::uint64_t kCalibrationSeed = 0;

// Away from 0, whose neighbours are the replicates of a diagnosis of seed 0.
constexpr std::uint64_t kScatterSeed = std::uint64_t{1} << 41;

struct NoiseRange {
    double stated, low, high;
    double deviation() const { return 0.25 * (high - low); }
};

NoiseRange noise_range(double stated, double step_dn) {
    if (stated > 0.0)
        return {stated, (1.0 - kCalibration.noise_range) * stated, (1.0 + kCalibration.noise_range) * stated};
    return {0.5 * step_dn / kCalibration.coarse, kCalibration.least_read_noise, step_dn / kCalibration.coarse};
}

// What a scene that stands still shows of the noise at most: that of the camera and of the converter's steps.
double most_noise_dn(const NoiseRange &range, double step_dn) {
    return std::sqrt(range.high * range.high + step_dn * step_dn * kQuantizationVariance);
}

// What a sequence shows of the read noise.
struct ShownNoise {
    double wanted = 0.0, error = 0.0; // variance over time, DN^2
    std::array<double, kCalibration.noise_points> variance{};
    double most_square = std::numeric_limits<double>::infinity(); // of its deviation that counts
};

// Lagrange's weights of equidistant points from 0 to 1.
std::array<double, kCalibration.noise_points> lagrange_weights(double at) {
    std::array<double, kCalibration.noise_points> weights;
    for (std::size_t i = 0; i < kCalibration.noise_points; ++i) {
        weights[i] = 1.0;
        for (std::size_t j = 0; j < kCalibration.noise_points; ++j)
            if (j != i)
                weights[i] *= (at * (kCalibration.noise_points - 1) - double(j)) / (double(i) - double(j));
    }
    return weights;
}

double likely_noise(const NoiseRange &range, const std::vector<ShownNoise> &sequences) {
    double best = range.stated, least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k <= kCalibration.noise_steps; ++k) {
        const double at = double(k) / kCalibration.noise_steps, noise = range.low + at * (range.high - range.low);
        const std::array<double, kCalibration.noise_points> weights = lagrange_weights(at);
        double loss = std::pow((noise - range.stated) / range.deviation(), 2);
        for (const ShownNoise &shown : sequences) {
            const double excess =
                std::inner_product(weights.begin(), weights.end(), shown.variance.begin(), -shown.wanted);
            loss += std::min(std::pow(excess / shown.error, 2), shown.most_square);
        }
        if (loss < least) {
            least = loss;
            best = noise;
        }
    }
    return best;
}

double converter_step_dn(const CaptureLayout &layout, const EffectSettings &effects) {
    PipelineModel model;
    SensorParameters &sensor = model.sensor.emplace();
    sensor.bits = layout.bits;
    for (const EffectSetting &setting : effects)
        if (in_catalogue(setting.id) && find_effect(setting.id).sets == kSetsSensor)
            find_effect(setting.id).apply(model, setting.values.data());
    return sensor.effective_bits ? std::exp2(double(layout.bits) - double(sensor.effective_bits)) : 1.0;
}

// Where a growing function is 0, by false position with Illinois' rule; the nearer end where that is not between the
// two.
template <typename Function> double root(double low, double high, double tolerance, const Function &function) {
    double below = function(low);
    if (below >= 0.0)
        return low;
    double above = function(high);
    if (above <= 0.0)
        return high;
    double at = low;
    for (int round = 0, last = 0; round < kCalibration.root_rounds; ++round) {
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

// How mean and variance of codes answer to level and variance of a Gaussian that the converter cuts off at 0: of no
// more than a level far above its noise, each to its own alone.
Eigen::Matrix2d clipped_response(double level, double deviation) {
    constexpr double kSqrtTwoPi = 2.5066282746310002;
    const double at =
        std::max(level / deviation, kCalibration.least_shown); // of what never shows nothing is to be told
    const double above = 0.5 * std::erfc(-at * M_SQRT1_2), density = std::exp(-0.5 * at * at) / kSqrtTwoPi;
    const double mean = deviation * (at * above + density);
    Eigen::Matrix2d response;
    response << above, density / (2.0 * deviation), 2.0 * mean * (1.0 - above), above - mean * density / deviation;
    return response;
}

} // namespace

CalibratedLevels ReplicateRunner::calibrate(const EffectSettings &effects, const std::vector<bool> &concerned,
                                            const CalibratedLevels *start) {
    CalibratedLevels result;
    if (start)
        result = *start;
    else
        result = {shared_->real_calibration.black_level_dn, shared_->real_calibration.read_noise_dn,
                  std::vector<double>(shared_->layout.sequences.size(), 1.0)};
    const double step = converter_step_dn(shared_->layout, effects);
    // Noise of more than a step is not made by codes that flip between two: what was measured holds, whatever the data
    // sheet says. Steps that are an effect's hide it in the real frames, too.
    const bool resolved = step == 1.0 && shared_->real_calibration.read_noise_dn >= step;
    const bool coarse = !resolved && step > kCalibration.coarse * shared_->layout.read_noise_dn;
    // The first dark sequence: black level and noise do not depend on the light.
    std::optional<std::size_t> dark, still;
    std::vector<Task> lit;
    for (std::size_t s = 0; s < shared_->layout.sequences.size(); ++s) {
        const SequenceLayout &sequence = shared_->layout.sequences[s];
        if (!concerned[s])
            continue;
        if (sequence.scene == CaptureScene::kDark) {
            if (!dark)
                dark = s;
            continue;
        }
        if (shared_->real_levels[s].mean_dn > shared_->real_calibration.black_level_dn)
            lit.push_back({0, s, kCalibrationSeed});
        // Speckle that stands still has all levels at once, and shows the noise between the steps; one that changes (a
        // living surface, air, a laser that flickers) shows that, and nothing of the noise beside it.
        if (!still && sequence.scene != CaptureScene::kFlat && !sequence.moving && sequence.frame_count >= 2 &&
            shared_->real_levels[s].temporal_noise_dn <
                most_noise_dn(noise_range(shared_->layout.read_noise_dn, step), step))
            still = s;
    }
    // A part of it, from the levels at its begin; gives black level, read noise, and the sequence's share.
    const auto part = [&](char kind, std::size_t s, const CalibratedLevels &levels, const auto &work) {
        return shared_->memo.value(key_of(this->simulator(), effects, levels, s).add_kind(kind), [&] {
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
                calibrate_dark(simulator, effects, *dark, step, own);
        });
        result.black_level_dn = levels[0];
        result.read_noise_dn = levels[1];
    };
    if (coarse && dark) {
        result.read_noise_dn = noise_range(shared_->layout.read_noise_dn, step).stated;
        if (!still) {
            result.read_noise_dn = noise_between_steps(effects, *dark, lit, step, result);
        } else {
            on_dark();
            const std::vector<double> levels = part('n', *still, result, [&](CalibratedLevels &own) {
                Simulator &simulator = simulator_of(*still, kCalibrationSeed);
                calibrate_signal(simulator, effects, *still, step, own);
                calibrate_coarse_noise(simulator, effects, *still, step, own);
            });
            result.read_noise_dn = levels[1];
            result.signal_share[*still] = levels[2];
        }
    }
    if (dark)
        on_dark();
    const CalibratedLevels begin = result;
    run_tasks(shared_->simulators, lit, {}, [&](const Task &task, const Worker &worker) {
        const std::size_t s = task.sequence;
        const bool is_coarse = coarse && shared_->layout.sequences[s].scene == CaptureScene::kFlat;
        result.signal_share[s] = part(is_coarse ? 'S' : 's', s, begin, [&](CalibratedLevels &own) {
            if (is_coarse)
                calibrate_coarse_signal(worker.simulator, effects, s, step, own);
            else
                calibrate_signal(worker.simulator, effects, s, step, own);
        })[2];
    });
    tie_to_exposures(result);
    return result;
}

void ReplicateRunner::tie_to_exposures(CalibratedLevels &levels) const {
    std::vector<double> signal, light;
    for (std::size_t s = 0; s < levels.signal_share.size(); ++s) {
        signal.push_back(shared_->real_levels[s].mean_dn - shared_->real_calibration.black_level_dn);
        light.push_back(levels.signal_share[s] * signal[s]);
    }
    const std::vector<double> own = light;
    tie_light_to_exposures(shared_->layout, light);
    for (std::size_t s = 0; s < light.size(); ++s)
        if (light[s] != own[s])
            levels.signal_share[s] *= light[s] / own[s];
}

double ReplicateRunner::noise_between_steps(const EffectSettings &effects, std::size_t dark,
                                            const std::vector<Task> &lit, double step_dn,
                                            const CalibratedLevels &begin) {
    const NoiseRange range = noise_range(shared_->layout.read_noise_dn, step_dn);
    std::vector<std::size_t> sequences = {dark};
    for (const Task &task : lit)
        if (shared_->layout.sequences[task.sequence].scene == CaptureScene::kFlat)
            sequences.push_back(task.sequence);
    // Dark frames that are all alike are a damaged recording (as for measured_calibration()).
    const bool dark_tells = shared_->real_levels[dark].temporal_noise_dn > 0.0;
    std::vector<std::array<SteppedLevel, kCalibration.noise_points>> found(sequences.size());
    const auto find = [&](std::size_t first, std::size_t last) {
        std::vector<Task> tasks;
        for (std::size_t k = first; k < last; ++k)
            for (std::size_t i = 0; i < kCalibration.noise_points; ++i)
                tasks.push_back({k * kCalibration.noise_points + i, sequences[k], kCalibrationSeed});
        run_tasks(shared_->simulators, tasks, {}, [&](const Task &task, const Worker &worker) {
            const std::size_t k = task.seed_index / kCalibration.noise_points,
                              i = task.seed_index % kCalibration.noise_points;
            CalibratedLevels levels = begin;
            levels.read_noise_dn = range.low + (range.high - range.low) * double(i) / (kCalibration.noise_points - 1);
            if (k > 0)
                levels.black_level_dn = found[0][i].black_level_dn;
            const bool scattered = 2 * i + 1 == kCalibration.noise_points;
            found[k][i] = stepped_level(worker.simulator, effects, task.sequence, step_dn, scattered, levels);
        });
    };
    find(0, 1); // the flats' light stands on the black level
    find(1, sequences.size());
    std::vector<ShownNoise> shown(sequences.size());
    for (std::size_t k = 0; k < sequences.size(); ++k) {
        const SequenceLevel &real = shared_->real_levels[sequences[k]];
        shown[k].wanted = real.temporal_noise_dn * real.temporal_noise_dn;
        // One code more or less in all frames is no more than chance.
        const double codes =
            double(shared_->layout.pixel_count()) * shared_->layout.sequences[sequences[k]].frame_count;
        const SteppedLevel &middle = found[k][kCalibration.noise_points / 2];
        shown[k].error = std::hypot(middle.error, step_dn * step_dn / codes);
        for (std::size_t i = 0; i < kCalibration.noise_points; ++i) {
            const SteppedLevel &level = found[k][i];
            shown[k].variance[i] =
                std::max(0.0, level.variance + middle.lack + middle.slope * (real.mean_dn - level.mean_dn));
        }
        if (k > 0)
            shown[k].most_square = kCalibration.most_square;
    }
    if (!dark_tells)
        shown.erase(shown.begin());
    return likely_noise(range, shown);
}

ReplicateRunner::SteppedLevel ReplicateRunner::stepped_level(Simulator &simulator, const EffectSettings &effects,
                                                             std::size_t sequence, double step_dn, bool scattered,
                                                             CalibratedLevels levels) {
    const bool is_dark = shared_->layout.sequences[sequence].scene == CaptureScene::kDark;
    if (is_dark)
        levels.black_level_dn = shared_->real_calibration.black_level_dn; // found whatever it is: one key for all
    const std::vector<double> values =
        shared_->memo.value(key_of(this->simulator(), effects, levels, sequence).add_kind('N'), [&] {
            const SequenceLevel at = is_dark ? calibrate_coarse_dark(simulator, effects, sequence, step_dn, levels)
                                             : calibrate_coarse_signal(simulator, effects, sequence, step_dn, levels);
            const double variance = at.temporal_noise_dn * at.temporal_noise_dn;
            std::vector<double> result = {levels.black_level_dn, at.mean_dn, variance, 0.0, 0.0, 0.0};
            if (!scattered)
                return result;
            Eigen::ArrayXd means(kCalibration.scatter_draws), variances(kCalibration.scatter_draws);
            for (Eigen::Index r = 0; r < kCalibration.scatter_draws; ++r) {
                const SequenceLevel drawn =
                    simulated_level(simulator, effects, levels, sequence, kScatterSeed + static_cast<std::uint64_t>(r));
                means[r] = drawn.mean_dn;
                variances[r] = drawn.temporal_noise_dn * drawn.temporal_noise_dn;
            }
            // The line through them: two codes' variance follows from the mean, and does not scatter about it.
            const double mean = means.mean(), mean_variance = variances.mean();
            const double square = (means - mean).square().sum();
            const double slope = square > 0.0 ? ((means - mean) * variances).sum() / square : 0.0;
            const double rest = (variances - mean_variance - slope * (means - mean)).square().sum();
            result[3] = slope;
            result[4] = mean_variance - variance + slope * (at.mean_dn - mean);
            // Of the real frames and of the line.
            result[5] = std::sqrt(rest / (kCalibration.scatter_draws - 2) * (1.0 + 1.0 / kCalibration.scatter_draws));
            return result;
        });
    return {values[0], values[1], values[2], values[3], values[4], values[5]};
}

SequenceLevel ReplicateRunner::simulated_level(Simulator &simulator, const EffectSettings &effects,
                                               const CalibratedLevels &levels, std::size_t sequence,
                                               std::uint64_t seed) const {
    const std::uint32_t frame_count = shared_->layout.sequences[sequence].frame_count;
    const auto codes = frames(simulator, effects, levels, sequence, seed, frame_count);
    return sequence_level(shared_->layout, sequence, codes.data(), frame_count);
}

void ReplicateRunner::calibrate_dark(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                                     double step_dn, CalibratedLevels &levels) {
    const std::uint32_t all = shared_->layout.sequences[sequence].frame_count;
    const bool exact = levels.read_noise_dn < kCalibration.smooth * step_dn;
    const double wanted =
        shared_->real_calibration.read_noise_dn * shared_->real_calibration.read_noise_dn + kQuantizationVariance;
    const double mean = shared_->real_levels[sequence].mean_dn;
    const bool clips =
        mean < kCalibration.clipping * std::sqrt(wanted) && mean > kCalibration.least_mean_shown * std::sqrt(wanted);
    // Of the codes' variance against that of the read noise: 1 but for coarse steps.
    double slope = 1.0, last_noise = 0.0, last_variance = 0.0;
    for (int round = 0; round < (exact || clips ? kCalibration.exact_rounds : kCalibration.rounds); ++round) {
        // How much pixels that jump add to the robust noise goes by the number of frames.
        const std::uint32_t frame_count = exact || round > 0 ? all : std::min(kCalibration.trial_frames, all);
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        const SequenceLevel level = sequence_level(shared_->layout, sequence, codes.data(), frame_count);
        const double noise = levels.read_noise_dn * levels.read_noise_dn;
        Eigen::Matrix2d response = Eigen::Matrix2d::Identity();
        if (clips)
            response = clipped_response(levels.black_level_dn, std::sqrt(noise + kQuantizationVariance));
        if (frame_count < 2) {
            levels.black_level_dn += (mean - level.mean_dn) / response(0, 0);
            continue;
        }
        const double variance = level.temporal_noise_dn * level.temporal_noise_dn;
        if (exact && round > 0 && noise != last_noise) {
            const double secant = (variance - last_variance) / (noise - last_noise);
            slope = secant > kCalibration.least_slope && secant < 1.0 / kCalibration.least_slope ? secant : 1.0;
        }
        last_noise = noise;
        last_variance = variance;
        const Eigen::Vector2d step =
            response.inverse() * Eigen::Vector2d(mean - level.mean_dn, (wanted - variance) / slope);
        // At most twice the noise at once: a response is that of where it is.
        const double most = clips ? 2.0 * std::sqrt(noise + wanted) : std::abs(step[0]);
        levels.black_level_dn += std::clamp(step[0], -most, most);
        levels.read_noise_dn =
            std::sqrt(std::clamp(noise + step[1], kCalibration.least_read_noise * kCalibration.least_read_noise,
                                 std::max(4.0 * noise, noise + kQuantizationVariance + wanted)));
    }
}

double ReplicateRunner::mean_tolerance_dn(std::size_t sequence, double step_dn) const {
    const double codes = double(shared_->layout.pixel_count()) * shared_->layout.sequences[sequence].frame_count;
    // Where all codes are one, a quarter of one that is another.
    return kCalibration.part_of_error *
           std::max(shared_->real_levels[sequence].temporal_noise_dn / std::sqrt(codes), step_dn / codes);
}

SequenceLevel ReplicateRunner::calibrate_coarse_dark(Simulator &simulator, const EffectSettings &effects,
                                                     std::size_t sequence, double step_dn, CalibratedLevels &levels) {
    const double centre = shared_->real_levels[sequence].mean_dn;
    SequenceLevel level;
    levels.black_level_dn =
        root(centre - step_dn, centre + step_dn, mean_tolerance_dn(sequence, step_dn), [&](double black_level_dn) {
            levels.black_level_dn = black_level_dn;
            level = simulated_level(simulator, effects, levels, sequence, kCalibrationSeed);
            return level.mean_dn - centre;
        });
    return level;
}

void ReplicateRunner::calibrate_signal(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                                       double step_dn, CalibratedLevels &levels) {
    const SequenceLevel &real = shared_->real_levels[sequence];
    const double signal = real.mean_dn - shared_->real_calibration.black_level_dn;
    const std::uint32_t all = shared_->layout.sequences[sequence].frame_count;
    const bool exact = shared_->layout.sequences[sequence].scene == CaptureScene::kFlat &&
                       levels.read_noise_dn < kCalibration.smooth * step_dn;
    const std::uint32_t frame_count = exact ? all : std::min(kCalibration.trial_frames, all);
    const double tolerance = exact
                                 ? std::min(kCalibration.part_of_signal * signal, mean_tolerance_dn(sequence, step_dn))
                                 : kCalibration.part_of_signal * signal;
    // Secant steps on mean(share) = wanted; the response is monotonic and nearly linear.
    double last_share = 0.0, last_mean = shared_->real_calibration.black_level_dn;
    for (int round = 0; round < (exact ? kCalibration.exact_rounds : kCalibration.rounds); ++round) {
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        const double mean = sequence_mean_dn(shared_->layout, sequence, codes.data(), frame_count);
        const double share = levels.signal_share[sequence];
        const double slope = (mean - last_mean) / (share - last_share);
        if (std::abs(real.mean_dn - mean) < tolerance || !(slope > 0.05 * signal))
            break;
        levels.signal_share[sequence] = std::clamp(share + (real.mean_dn - mean) / slope, 0.25 * share, 4.0 * share);
        last_share = share;
        last_mean = mean;
    }
}

SequenceLevel ReplicateRunner::calibrate_coarse_signal(Simulator &simulator, const EffectSettings &effects,
                                                       std::size_t sequence, double step_dn, CalibratedLevels &levels) {
    const double wanted = shared_->real_levels[sequence].mean_dn;
    const double signal = wanted - shared_->real_calibration.black_level_dn;
    double &share = levels.signal_share[sequence];
    const double centre = share, reach = std::min(0.5 * centre, 2.0 * step_dn / signal);
    SequenceLevel level;
    share = root(centre - reach, centre + reach, mean_tolerance_dn(sequence, step_dn), [&](double at) {
        share = at;
        level = simulated_level(simulator, effects, levels, sequence, kCalibrationSeed);
        return level.mean_dn - wanted;
    });
    return level;
}

void ReplicateRunner::calibrate_coarse_noise(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                                             double step_dn, CalibratedLevels &levels) {
    const double wanted = shared_->real_levels[sequence].temporal_noise_dn;
    const NoiseRange range = noise_range(shared_->layout.read_noise_dn, step_dn);
    const std::uint32_t frame_count =
        std::min(2 * kCalibration.trial_frames, shared_->layout.sequences[sequence].frame_count);
    levels.read_noise_dn = root(range.low, range.high, 1e-3 * wanted, [&](double read_noise_dn) {
        levels.read_noise_dn = read_noise_dn;
        const auto codes = frames(simulator, effects, levels, sequence, kCalibrationSeed, frame_count);
        return sequence_level(shared_->layout, sequence, codes.data(), frame_count).temporal_noise_dn - wanted;
    });
}

} // namespace clsp
