#include "inference/replicate_runner.hpp"

#include "capture/applicability.hpp"
#include "inference/thresholds.hpp"
#include "runtime/error.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fmt/core.h>
#include <mutex>
#include <numeric>
#include <string_view>

namespace clsp {
namespace {

using Codes = std::vector<std::vector<std::uint16_t>>;

// Each worker has memory of its own for the frames of one sequence. There are twice as many as processors: one waits
// for its kernels while another one measures.
constexpr std::size_t kMostWorkers = 8, kWorkersPerThread = 2;
constexpr std::size_t kCacheBytes = std::size_t{256} << 20; // of all of them
constexpr std::size_t kMemoBytes = std::size_t{64} << 20;

[[noreturn]] void refuse_another_runner() {
    throw Error(Status::kInternal,
                "work side by side is to ask its own runner, not that of all workers; please report this");
}

CaptureLayout with_border(CaptureLayout layout) {
    const std::uint32_t width = layout.width, height = layout.height;
    layout.width += 2 * kModelError.border_px;
    layout.height += 2 * kModelError.border_px;
    for (double &along : layout.principal_point_px)
        along += kModelError.border_px;
    if (layout.dots)
        for (std::array<double, 2> &position : layout.dots->positions_px)
            for (double &along : position)
                along += kModelError.border_px;
    // Means go by what is kept.
    for (SequenceLayout &sequence : layout.sequences) {
        for (double &along : sequence.illumination.origin_px)
            along += kModelError.border_px;
        std::vector<std::uint8_t> mask(layout.pixel_count(), 0);
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                mask[std::size_t{y + kModelError.border_px} * layout.width + x + kModelError.border_px] =
                    sequence.mask.empty() ? 1 : sequence.mask[std::size_t{y} * width + x];
        sequence.mask = std::move(mask);
    }
    return layout;
}

// To the image alone, in place.
void cut_border(std::uint16_t *codes, std::uint32_t frame_count, const CaptureLayout &whole) {
    const std::size_t width = whole.width - 2 * kModelError.border_px;
    std::uint16_t *to = codes;
    for (std::uint32_t frame = 0; frame < frame_count; ++frame)
        for (std::uint32_t y = kModelError.border_px; y < whole.height - kModelError.border_px; ++y) {
            const std::uint16_t *row =
                codes + (std::size_t{frame} * whole.height + y) * whole.width + kModelError.border_px;
            to = std::copy(row, row + width, to);
        }
}

} // namespace

ReplicateRunner::Shared::Shared(std::shared_ptr<Context> context_, const CaptureLayout &layout_, unsigned threads_)
    : context(std::move(context_)), layout(layout_), threads(threads_), memo(kMemoBytes) {}

ReplicateRunner::Engaged::Engaged(Shared &shared) : shared_(shared) {
    if (shared_.engaged.exchange(true))
        refuse_another_runner();
}

ReplicateRunner::ReplicateRunner(std::shared_ptr<Context> context, const Capture &real,
                                 std::vector<Hypothesis> hypotheses, unsigned threads)
    : shared_(std::make_shared<Shared>(std::move(context), real.layout, threads)) {
    const std::size_t sequences = shared_->layout.sequences.size();
    // The caller's functions are called on the caller's thread, one at a time.
    const bool calls_back = std::any_of(hypotheses.begin(), hypotheses.end(),
                                        [](const Hypothesis &hypothesis) { return bool(hypothesis.apply); });
    const std::size_t workers =
        !calls_back && threads > 1 ? std::min<std::size_t>(kWorkersPerThread * threads, kMostWorkers) : 1;
    const statistics::StatisticsChoice statistics_choice = statistics::environment_statistics_choice();
    for (std::size_t worker = 0; worker < workers; ++worker) {
        shared_->simulators.push_back(std::make_unique<Simulator>(shared_->context, real.layout, hypotheses));
        shared_->simulators.back()->set_cache_bytes(kCacheBytes / workers);
        if (worker == shared_->device_sums.size()) // none is made after one that could not be
            if (auto sums = statistics::make_device_sums(shared_->context, statistics_choice))
                shared_->device_sums.push_back(std::move(sums));
    }
    if (shared_->device_sums.size() < workers)
        shared_->device_sums.clear();
    if (!shared_->device_sums.empty())
        shared_->context->log(LogLevel::kInfo, "the device takes the statistics' sums over pixels");
    sort_by_work();
    const auto spare_residuals = std::make_shared<SpareBuffers<float>>();
    shared_->offsets.push_back(0);
    for (std::size_t s = 0; s < sequences; ++s) {
        shared_->parted = shared_->parted || shared_->layout.sequences[s].frame_count >= 4;
        shared_->statistics.emplace_back(shared_->layout, s, half_count(s), spare_residuals);
        const auto &list = shared_->statistics.back().list();
        shared_->list.insert(shared_->list.end(), list.begin(), list.end());
        shared_->offsets.push_back(shared_->list.size());
    }
    std::vector<std::uint32_t> frame_counts;
    for (std::size_t s = 0; s < sequences; ++s) {
        frame_counts.push_back(shared_->layout.sequences[s].frame_count);
        shared_->real_levels.push_back(sequence_level(shared_->layout, s, real.codes[s].data(), frame_counts[s]));
    }
    for (std::size_t s = 0; s < sequences; ++s)
        if (shared_->layout.sequences[s].scene == CaptureScene::kDark) {
            shared_->knows_black_level = true;
            // Frames that are all alike tell no noise (measured_calibration()); an effect may have made them so, which
            // is for a fit to find.
            shared_->knows_read_noise = shared_->knows_read_noise || frame_counts[s] >= 2;
        }
    shared_->real_calibration =
        measured_calibration(shared_->real_levels, frame_counts, std::vector<bool>(sequences, true));
    shared_->real_calibration.dark_frame = mean_dark_frame([&](std::size_t s) { return real.codes[s].data(); });
    shared_->real.first.resize(count());
    shared_->real.second.resize(count());
    for (std::size_t s = 0; s < sequences; ++s)
        measure(s, real.codes[s].data(), shared_->real_calibration, shared_->real);
}

std::shared_ptr<const std::vector<float>>
ReplicateRunner::mean_dark_frame(const std::function<const std::uint16_t *(std::size_t)> &codes_of) const {
    const std::size_t pixels = shared_->layout.pixel_count();
    std::vector<double> sum(pixels);
    double frames = 0.0;
    for (std::size_t s = 0; s < shared_->layout.sequences.size(); ++s) {
        const std::uint16_t *codes =
            shared_->layout.sequences[s].scene == CaptureScene::kDark ? codes_of(s) : nullptr;
        if (!codes)
            continue;
        for (std::uint32_t t = 0; t < half_count(s); ++t, ++frames)
            for (std::size_t i = 0; i < pixels; ++i)
                sum[i] += codes[t * pixels + i];
    }
    if (frames == 0.0)
        return nullptr;
    auto result = std::make_shared<std::vector<float>>(pixels);
    for (std::size_t i = 0; i < pixels; ++i)
        (*result)[i] = static_cast<float>(sum[i] / frames);
    return result;
}

std::uint32_t ReplicateRunner::half_count(std::size_t sequence) const {
    const std::uint32_t frames = shared_->layout.sequences[sequence].frame_count;
    return frames >= 4 ? frames / 2 : frames;
}

std::uint32_t ReplicateRunner::frame_count(std::size_t sequence, Folds folds) const {
    return folds == Folds::kFirst ? half_count(sequence) : shared_->layout.sequences[sequence].frame_count;
}

Calibration ReplicateRunner::measured_calibration(const std::vector<SequenceLevel> &levels,
                                                  const std::vector<std::uint32_t> &frame_counts,
                                                  const std::vector<bool> &present) const {
    Calibration result{shared_->layout.black_level_dn, shared_->layout.read_noise_dn};
    double mean = 0.0, variance = 0.0;
    unsigned means = 0, variances = 0;
    for (std::size_t s = 0; s < levels.size(); ++s) {
        if (shared_->layout.sequences[s].scene != CaptureScene::kDark || !present[s])
            continue;
        const SequenceLevel &level = levels[s];
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
        result.read_noise_dn = std::max(kCalibration.least_read_noise,
                                        std::sqrt(std::max(0.0, variance / variances - kQuantizationVariance)));
    return result;
}

SimulationLevels ReplicateRunner::levels(const CalibratedLevels &calibrated, const EffectSettings &effects,
                                         std::size_t sequence, std::uint64_t seed, std::uint32_t frame_count) {
    return levels(simulator_of(sequence, seed), calibrated, effects, sequence, seed, frame_count);
}

SimulationLevels ReplicateRunner::levels(Simulator &simulator, const CalibratedLevels &calibrated,
                                         const EffectSettings &effects, std::size_t sequence, std::uint64_t seed,
                                         std::uint32_t frame_count) const {
    SimulationLevels result;
    result.black_level_dn = calibrated.black_level_dn + calibrated.black_level_error_dn;
    result.read_noise_dn = calibrated.read_noise_dn * calibrated.read_noise_ratio;
    if (shared_->layout.sequences[sequence].scene == CaptureScene::kDark)
        return result;
    if (!calibrated.gain_dn.empty()) {
        result.gain_dn = calibrated.gain_dn[sequence];
        return result;
    }
    // The mean is the real one's, whatever part of it is light.
    const double signal = std::max(0.0, shared_->real_levels[sequence].mean_dn -
                                            shared_->real_calibration.black_level_dn - calibrated.black_level_error_dn);
    const double intensity = simulator.mean_intensity(sequence, effects, seed, frame_count);
    if (!(intensity > 0.0)) {
        const SequenceLayout &given = shared_->layout.sequences[sequence];
        std::string causes;
        if (given.scene == CaptureScene::kDots)
            causes += "are its dots inside the image, ";
        if (!given.mask.empty())
            causes += "is its mask open where there is light, ";
        // With effects that together block all light the simulator is asked for too much, which is no fault of the
        // capture.
        throw Error(
            effects.empty() ? Status::kInvalidData : Status::kInvalidArgument,
            fmt::format("no light reaches the pixels of the sequence {} in the simulation: {}have all of its frames "
                        "light? clspeckle capture check says what is odd about them",
                        given.name, causes));
    }
    result.gain_dn = calibrated.signal_share[sequence] * signal / intensity;
    return result;
}

std::vector<std::uint16_t> ReplicateRunner::frames(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                   std::size_t sequence, std::uint64_t seed,
                                                   std::uint32_t frame_count) {
    const auto codes = frames(simulator_of(sequence, seed), effects, calibrated, sequence, seed, frame_count);
    return {codes.data(), codes.data() + codes.size()};
}

SpareBuffers<std::uint16_t>::Buffer ReplicateRunner::frames(Simulator &simulator, const EffectSettings &effects,
                                                            const CalibratedLevels &calibrated, std::size_t sequence,
                                                            std::uint64_t seed, std::uint32_t frame_count) const {
    const CaptureLayout &drawn = simulator.layout();
    auto codes = shared_->spare_codes.take(std::size_t{frame_count} * drawn.pixel_count());
    simulator.codes(sequence, effects, levels(simulator, calibrated, effects, sequence, seed, frame_count), seed,
                    frame_count, codes.data());
    if (drawn.width != shared_->layout.width)
        cut_border(codes.data(), frame_count, drawn);
    return codes;
}

std::vector<FoldStatistics> ReplicateRunner::replicates(const EffectSettings &effects,
                                                        const CalibratedLevels &calibrated,
                                                        const std::vector<std::uint64_t> &seeds,
                                                        const std::function<void(std::size_t)> &before_each) {
    const std::vector<bool> all(shared_->layout.sequences.size(), true);
    std::vector<FoldStatistics> result(seeds.size(), {Eigen::VectorXd(count()), Eigen::VectorXd(count())});
    simulate(shared_->simulators, effects, calibrated, seeds, all, before_each, Folds::kBoth,
             [&](std::size_t i, std::size_t s, const std::vector<double> &values) { put(s, values, result[i]); });
    return result;
}

std::vector<FoldStatistics> ReplicateRunner::bordered_replicates(const CalibratedLevels &calibrated,
                                                                 const std::vector<std::uint64_t> &seeds,
                                                                 const std::function<void(std::size_t)> &before_each) {
    const CaptureLayout layout = with_border(shared_->layout);
    const std::size_t cache_bytes = kCacheBytes / shared_->simulators.size();
    Simulators bordered;
    for (const std::unique_ptr<Simulator> &idle : shared_->simulators) {
        idle->set_cache_bytes(0); // what it keeps would be there twice
        idle->set_cache_bytes(cache_bytes);
        bordered.push_back(std::make_unique<Simulator>(shared_->context, layout, std::vector<Hypothesis>{}));
        bordered.back()->set_cache_bytes(cache_bytes);
    }
    std::vector<bool> lasers;
    for (const SequenceLayout &sequence : shared_->layout.sequences)
        lasers.push_back(is_laser(sequence.scene));
    const Eigen::VectorXd zeros = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(count()));
    std::vector<FoldStatistics> result(seeds.size(), {zeros, zeros});
    simulate(bordered, {}, calibrated, seeds, lasers, before_each, Folds::kBoth,
             [&](std::size_t i, std::size_t s, const std::vector<double> &values) { put(s, values, result[i]); });
    return result;
}

MemoKey ReplicateRunner::key_of(const Simulator &simulator, const EffectSettings &effects,
                                const CalibratedLevels &levels, std::size_t sequence) const {
    MemoKey key;
    key.add(std::uint64_t{sequence}).add(std::uint64_t{simulator.layout().width});
    key.add(simulator.concerning(effects, sequence));
    key.add(levels.black_level_dn + levels.black_level_error_dn).add(levels.read_noise_dn * levels.read_noise_ratio);
    if (shared_->layout.sequences[sequence].scene != CaptureScene::kDark)
        key.add(levels.gain_dn.empty() ? levels.signal_share[sequence] : -levels.gain_dn[sequence]);
    for (std::size_t s = 0; s < shared_->layout.sequences.size(); ++s) // flats are measured beside dark frames
        if (shared_->layout.sequences[sequence].scene == CaptureScene::kFlat &&
            shared_->layout.sequences[s].scene == CaptureScene::kDark)
            key.add(simulator.concerning(effects, s));
    return key;
}

CalibratedLevels ReplicateRunner::drawn_levels(const CalibratedLevels &calibrated, std::uint64_t seed) const {
    CalibratedLevels result = calibrated;
    const std::array<double, 2> normals = host_normals(seed, 0, kStreamCameraLevels);
    if (!shared_->knows_black_level)
        result.black_level_error_dn =
            kCalibration.sheet_black_level * std::max(1.0, shared_->layout.dn_of_ten_bits()) * normals[0];
    if (!shared_->knows_read_noise)
        result.read_noise_ratio = std::exp(kCalibration.sheet_read_noise * normals[1]);
    return result;
}

void ReplicateRunner::simulate(const Simulators &simulators, const EffectSettings &effects,
                               const CalibratedLevels &calibrated, const std::vector<std::uint64_t> &seeds,
                               const std::vector<bool> &concerned, const std::function<void(std::size_t)> &before_each,
                               Folds folds, const TakeValues &take) {
    const std::size_t sequences = shared_->layout.sequences.size();
    std::vector<std::uint32_t> frame_counts(sequences);
    std::vector<bool> dark(sequences);
    // Of each seed, or of all where the capture tells the levels.
    std::vector<CalibratedLevels> drawn = {calibrated};
    if (!shared_->knows_black_level || !shared_->knows_read_noise) {
        drawn.clear();
        for (const std::uint64_t seed : seeds)
            drawn.push_back(drawn_levels(calibrated, seed));
    }
    const auto levels_of = [&](std::size_t i) -> const CalibratedLevels & { return drawn[i % drawn.size()]; };
    std::vector<std::vector<MemoKey>> keys(drawn.size());
    for (std::size_t s = 0; s < sequences; ++s) {
        frame_counts[s] = frame_count(s, folds);
        dark[s] = shared_->layout.sequences[s].scene == CaptureScene::kDark;
        for (std::size_t d = 0; d < drawn.size(); ++d)
            keys[d].push_back(key_of(*simulators.front(), effects, drawn[d], s).add(std::uint64_t(folds)));
        if (concerned[s])
            shared_->work += seeds.size() * work_of(effects, s, frame_counts[s]);
    }
    std::vector<Calibration> calibrations(seeds.size());
    const auto statistics_key = [&](std::size_t i, std::size_t s) {
        MemoKey key = keys[i % keys.size()][s];
        return key.add_kind('m').add(seeds[i]).add(calibrations[i].black_level_dn).add(calibrations[i].read_noise_dn);
    };
    // Dark frames are the measure of all others: their levels must be known, also where no effect shows in them.
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < seeds.size(); ++i)
        tasks.push_back({i, shared_->by_work.back(), seeds[i]}); // all dark sequences; the last one is one if any is
    run_tasks(simulators, tasks, {}, [&](const Task &task, const Worker &worker) {
        const std::size_t i = task.seed_index;
        std::vector<SpareBuffers<std::uint16_t>::Buffer> codes(sequences);
        const auto codes_of = [&](std::size_t s) {
            if (codes[s].empty())
                codes[s] = frames(worker.simulator, effects, levels_of(i), s, task.seed, frame_counts[s]);
            return codes[s].data();
        };
        std::vector<SequenceLevel> levels(sequences);
        for (std::size_t s = 0; s < sequences; ++s) {
            if (!dark[s])
                continue;
            const std::vector<double> level =
                shared_->memo.value(MemoKey(keys[i % keys.size()][s]).add_kind('l').add(task.seed), [&] {
                    const SequenceLevel measured_level =
                        sequence_level(shared_->layout, s, codes_of(s), frame_counts[s]);
                    return std::vector<double>{measured_level.mean_dn, measured_level.temporal_noise_dn};
                });
            levels[s] = {level[0], level[1]};
        }
        calibrations[i] = measured_calibration(levels, frame_counts, dark);
        for (std::size_t s = 0; s < sequences; ++s)
            if (dark[s] && concerned[s])
                take(i, s, shared_->memo.value(statistics_key(i, s), [&] {
                    return measured(s, folds, codes_of(s), calibrations[i], worker);
                }));
    });
    // Made for the first flat that asks for it.
    std::vector<std::once_flag> dark_frame_made(seeds.size());
    const auto add_dark_frame = [&](std::size_t i, std::size_t s, const Worker &worker) {
        if (shared_->layout.sequences[s].scene != CaptureScene::kFlat)
            return;
        std::call_once(dark_frame_made[i], [&] {
            std::vector<SpareBuffers<std::uint16_t>::Buffer> codes(sequences);
            calibrations[i].dark_frame = mean_dark_frame([&](std::size_t d) {
                codes[d] = frames(worker.simulator, effects, levels_of(i), d, seeds[i], half_count(d));
                return codes[d].data();
            });
        });
    };
    tasks.clear();
    for (std::size_t i = 0; i < seeds.size(); ++i)
        for (const std::size_t s : shared_->by_work)
            if (!dark[s] && concerned[s])
                tasks.push_back({i, s, seeds[i]});
    run_tasks(simulators, tasks, before_each, [&](const Task &task, const Worker &worker) {
        const std::size_t i = task.seed_index, s = task.sequence;
        take(i, s, shared_->memo.value(statistics_key(i, s), [&] {
            add_dark_frame(i, s, worker);
            const auto codes = frames(worker.simulator, effects, levels_of(i), s, task.seed, frame_counts[s]);
            return measured(s, folds, codes.data(), calibrations[i], worker);
        }));
    });
}

void ReplicateRunner::run_tasks(const Simulators &simulators, const std::vector<Task> &tasks,
                                const std::function<void(std::size_t)> &before_each, const DoTask &work) {
    if (seat_) {
        seat_->tasks.run(seat_->self, tasks.size(), [&](const WorkerThread &by, std::size_t t) {
            by.checkpoint();
            work(tasks[t], {*simulators[by.number], device_of(by.number), 1});
        });
        return;
    }
    const Engaged engaged(*shared_);
    const std::size_t workers = simulators.size(), busy = std::clamp<std::size_t>(tasks.size(), 1, workers);
    // A worker with company measures on its own thread: starting others for so little takes longer.
    const unsigned threads = std::max(1u, shared_->threads / static_cast<unsigned>(busy));
    std::vector<std::atomic<bool>> begun(tasks.size());
    run_workers(workers, checkpoint, [&](const WorkerThread &self) {
        std::size_t seed_index = 0;
        const auto run = [&](std::size_t t) {
            if (begun[t].exchange(true))
                return;
            if (self.number == 0 && before_each && tasks[t].seed_index >= seed_index) {
                before_each(tasks[t].seed_index);
                seed_index = tasks[t].seed_index + 1;
            }
            self.checkpoint();
            work(tasks[t], {*simulators[self.number], device_of(self.number), threads});
        };
        for (std::size_t t = 0; t < tasks.size(); ++t)
            if (worker_of(tasks[t].sequence, tasks[t].seed) == self.number)
                run(t);
        for (std::size_t t = tasks.size(); t-- > 0;)
            run(t);
    });
}

void ReplicateRunner::side_by_side(std::size_t count,
                                   const std::function<void(ReplicateRunner &runner, std::size_t i)> &work) {
    if (count <= 1 || seat_) {
        for (std::size_t i = 0; i < count; ++i)
            work(*this, i);
        return;
    }
    const Engaged engaged(*shared_);
    std::atomic<std::size_t> next{0};
    OpenTasks tasks;
    run_workers(shared_->simulators.size(), checkpoint, [&](const WorkerThread &self) {
        const Seat seat{self, tasks};
        ReplicateRunner runner(shared_, seat);
        tasks.work(self, [&] {
            for (std::size_t i = next++; i < count; i = next++) {
                self.checkpoint();
                work(runner, i);
            }
        });
    });
}

Simulator &ReplicateRunner::simulator_of(std::size_t sequence, std::uint64_t seed) const {
    return *shared_->simulators[own_worker(worker_of(sequence, seed))];
}

std::size_t ReplicateRunner::own_worker(std::size_t otherwise) const {
    if (!seat_ && shared_->engaged)
        refuse_another_runner();
    return seat_ ? seat_->self.number : otherwise;
}

std::uint64_t ReplicateRunner::work_of(const EffectSettings &effects, std::size_t sequence,
                                       std::uint32_t frame_count) const {
    // In halves of what the sensor and the statistics of a frame take; an interference pattern takes about one of them,
    // a screen of air or a filter of the whole image three (bench_gap_simulator).
    constexpr std::uint64_t kMeasuring = 2, kFilter = 3;
    const SequenceLayout &layout = shared_->layout.sequences[sequence];
    if (layout.scene == CaptureScene::kDark || layout.scene == CaptureScene::kFlat)
        return kMeasuring * frame_count;
    // A moving surface has a pattern of its own in every frame; some effects take several for one.
    bool every_frame = layout.moving;
    std::uint64_t patterns = 1, filters = 0;
    for (const EffectSetting &setting : effects) {
        if (!in_catalogue(setting.id) || !acts_in(find_effect(setting.id), layout))
            continue;
        const EffectCost &cost = find_effect(setting.id).cost;
        patterns *= cost.patterns;
        filters += kFilter * cost.filters;
        every_frame = every_frame || cost.every_frame;
    }
    return kMeasuring * frame_count + (patterns + filters) * (every_frame ? frame_count : 1);
}

double ReplicateRunner::work() const {
    return static_cast<double>(shared_->work.load()) / capture_work();
}

double ReplicateRunner::capture_work() const {
    std::uint64_t capture = 0;
    for (std::size_t s = 0; s < shared_->layout.sequences.size(); ++s)
        capture += work_of({}, s, shared_->layout.sequences[s].frame_count);
    return static_cast<double>(capture);
}

void ReplicateRunner::sort_by_work() {
    shared_->by_work.resize(shared_->layout.sequences.size());
    std::iota(shared_->by_work.begin(), shared_->by_work.end(), std::size_t{0});
    const auto work = [&](std::size_t s) {
        const SequenceLayout &sequence = shared_->layout.sequences[s];
        return sequence.scene == CaptureScene::kDark ? 0 : work_of({}, s, sequence.frame_count);
    };
    std::stable_sort(shared_->by_work.begin(), shared_->by_work.end(),
                     [&](std::size_t a, std::size_t b) { return work(a) > work(b); });
    shared_->places.resize(shared_->by_work.size());
    for (std::size_t place = 0; place < shared_->by_work.size(); ++place)
        shared_->places[shared_->by_work[place]] = place;
}

Calibration ReplicateRunner::calibration_of(const Codes &codes) const {
    std::vector<std::uint32_t> frame_counts;
    std::vector<bool> present;
    std::vector<SequenceLevel> levels(codes.size());
    for (std::size_t s = 0; s < codes.size(); ++s) {
        frame_counts.push_back(shared_->layout.sequences[s].frame_count);
        present.push_back(!codes[s].empty());
        if (present[s] && shared_->layout.sequences[s].scene == CaptureScene::kDark)
            levels[s] = sequence_level(shared_->layout, s, codes[s].data(), frame_counts[s]);
    }
    Calibration result = measured_calibration(levels, frame_counts, present);
    result.dark_frame = mean_dark_frame([&](std::size_t s) { return present[s] ? codes[s].data() : nullptr; });
    return result;
}

std::vector<double> ReplicateRunner::measured(const SequenceStatistics &statistics, std::size_t sequence, Folds folds,
                                              const std::uint16_t *codes, const Calibration &calibration,
                                              const Worker &worker) const {
    const std::size_t values = end(sequence) - begin(sequence);
    std::vector<double> result(static_cast<std::size_t>(folds) * values);
    statistics.compute(codes, calibration, result.data(), worker.threads, worker.device);
    if (folds == Folds::kBoth) {
        const std::size_t step = frame_count(sequence, folds) - half_count(sequence);
        statistics.compute(codes + step * shared_->layout.pixel_count(), calibration, result.data() + values,
                           worker.threads, worker.device);
    }
    return result;
}

void ReplicateRunner::put(std::size_t sequence, const std::vector<double> &values, FoldStatistics &into) const {
    const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::copy(values.begin(), half, into.first.data() + begin(sequence));
    std::copy(half, values.end(), into.second.data() + begin(sequence));
}

void ReplicateRunner::measure(std::size_t sequence, const std::uint16_t *codes, const Calibration &calibration,
                              FoldStatistics &into) const {
    const SequenceStatistics &statistics =
        shared_->elsewhere.empty() ? shared_->statistics[sequence] : shared_->elsewhere[sequence];
    const std::size_t number = own_worker(0);
    const Worker worker{*shared_->simulators[number], device_of(number), shared_->threads};
    put(sequence, measured(statistics, sequence, Folds::kBoth, codes, calibration, worker), into);
}

bool ReplicateRunner::measure_dots_at(const std::vector<std::array<double, 2>> &positions_px) {
    CaptureLayout layout = shared_->layout;
    if (layout.dots)
        layout.dots->positions_px = positions_px;
    const auto spare_residuals = std::make_shared<SpareBuffers<float>>();
    std::vector<SequenceStatistics> elsewhere;
    for (std::size_t s = 0; s < layout.sequences.size(); ++s) {
        elsewhere.emplace_back(layout, s, half_count(s), spare_residuals);
        const std::vector<StatisticInfo> &list = elsewhere.back().list();
        const auto same = [](const StatisticInfo &a, const StatisticInfo &b) {
            return a.name == b.name && a.region == b.region && a.unit == b.unit;
        };
        if (!std::equal(list.begin(), list.end(), shared_->list.begin() + std::ptrdiff_t(begin(s)),
                        shared_->list.begin() + std::ptrdiff_t(end(s)), same))
            return false;
    }
    shared_->elsewhere = std::move(elsewhere);
    return true;
}

std::vector<Eigen::VectorXd> ReplicateRunner::halves(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                     const std::vector<std::uint64_t> &seeds,
                                                     const std::vector<bool> &concerned,
                                                     const std::vector<Eigen::VectorXd> &otherwise) {
    std::vector<Eigen::VectorXd> result(otherwise.begin(),
                                        otherwise.begin() + std::min(otherwise.size(), seeds.size()));
    result.resize(seeds.size(), Eigen::VectorXd::Zero(count()));
    simulate(shared_->simulators, effects, calibrated, seeds, concerned, {}, Folds::kFirst,
             [&](std::size_t i, std::size_t s, const std::vector<double> &values) {
                 std::copy(values.begin(), values.end(), result[i].data() + begin(s));
             });
    return result;
}

} // namespace clsp
