#include "inference/experiment.hpp"

#include "capture/applicability.hpp"
#include "inference/workers.hpp"
#include "runtime/error.hpp"
#include "stages/philox.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fmt/core.h>
#include <numeric>
#include <string_view>

namespace clsp {
namespace {

using Codes = std::vector<std::vector<std::uint16_t>>;

// Each worker has memory of its own for the frames of one sequence. There are twice as many as processors: one waits for
// its kernels while another one measures.
constexpr std::size_t kMostWorkers = 8, kWorkersPerThread = 2;
constexpr std::size_t kCacheBytes = std::size_t{256} << 20; // of all of them
constexpr std::size_t kMemoBytes = std::size_t{64} << 20;

// What is simulated on each side of an image and cut off: light comes in at the other border from twice as far.
constexpr std::uint32_t kBorderPx = 24;

CaptureLayout with_border(CaptureLayout layout) {
    const std::uint32_t width = layout.width, height = layout.height;
    layout.width += 2 * kBorderPx;
    layout.height += 2 * kBorderPx;
    for (double &along : layout.principal_point_px)
        along += kBorderPx;
    if (layout.dots)
        for (std::array<double, 2> &position : layout.dots->positions_px)
            for (double &along : position)
                along += kBorderPx;
    // Means go by what is kept.
    for (SequenceLayout &sequence : layout.sequences) {
        std::vector<std::uint8_t> mask(layout.pixel_count(), 0);
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                mask[std::size_t{y + kBorderPx} * layout.width + x + kBorderPx] =
                    sequence.mask.empty() ? 1 : sequence.mask[std::size_t{y} * width + x];
        sequence.mask = std::move(mask);
    }
    return layout;
}

// To the image alone, in place.
void cut_border(std::uint16_t *codes, std::uint32_t frame_count, const CaptureLayout &whole) {
    const std::size_t width = whole.width - 2 * kBorderPx;
    std::uint16_t *to = codes;
    for (std::uint32_t frame = 0; frame < frame_count; ++frame)
        for (std::uint32_t y = kBorderPx; y < whole.height - kBorderPx; ++y) {
            const std::uint16_t *row = codes + (std::size_t{frame} * whole.height + y) * whole.width + kBorderPx;
            to = std::copy(row, row + width, to);
        }
}

} // namespace

// Lives as long as a thread works in a worker.
struct Experiment::Inside {
    Inside(const Experiment *experiment_, std::size_t worker_, const std::function<void()> &checkpoint_,
           OpenTasks &tasks_)
        : experiment(experiment_), worker(worker_), checkpoint(checkpoint_), tasks(tasks_), before(here) {
        here = this;
    }
    Inside(const Inside &) = delete;
    Inside &operator=(const Inside &) = delete;
    ~Inside() { here = before; }

    const Experiment *const experiment;
    const std::size_t worker;
    const std::function<void()> &checkpoint;
    OpenTasks &tasks;           // of all workers
    const Inside *const before; // of another experiment
    static thread_local const Inside *here;
};
thread_local const Experiment::Inside *Experiment::Inside::here = nullptr;

Experiment::Experiment(std::shared_ptr<Context> context, const Capture &real, std::vector<Hypothesis> hypotheses,
                       unsigned threads)
    : context_(std::move(context)), layout_(real.layout), threads_(threads), memo_(kMemoBytes) {
    const std::size_t sequences = layout_.sequences.size();
    // The caller's functions are called on the caller's thread, one at a time.
    const bool calls_back = std::any_of(hypotheses.begin(), hypotheses.end(),
                                        [](const Hypothesis &hypothesis) { return bool(hypothesis.apply); });
    const std::size_t workers =
        !calls_back && threads > 1 ? std::min<std::size_t>(kWorkersPerThread * threads, kMostWorkers) : 1;
    const statistics::StatisticsChoice statistics_choice = statistics::environment_statistics_choice();
    for (std::size_t worker = 0; worker < workers; ++worker) {
        simulators_.push_back(std::make_unique<Simulator>(context_, real.layout, hypotheses));
        simulators_.back()->set_cache_bytes(kCacheBytes / workers);
        if (worker == device_sums_.size()) // none is made after one that could not be
            if (auto sums = statistics::make_device_sums(context_, statistics_choice))
                device_sums_.push_back(std::move(sums));
    }
    if (device_sums_.size() < workers)
        device_sums_.clear();
    if (!device_sums_.empty())
        context_->log(LogLevel::kInfo, "the device takes the statistics' sums over pixels");
    sort_by_work();
    const auto spare_residuals = std::make_shared<SpareBuffers<float>>();
    offsets_.push_back(0);
    for (std::size_t s = 0; s < sequences; ++s) {
        parted_ = parted_ || layout_.sequences[s].frame_count >= 4;
        statistics_.emplace_back(layout_, s, half_count(s), spare_residuals);
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
    for (std::size_t s = 0; s < sequences; ++s)
        if (layout_.sequences[s].scene == CaptureScene::kDark) {
            knows_black_level_ = true;
            // Frames that are all alike tell no noise (measured_calibration()); an effect may have made them so, which
            // is for a fit to find.
            knows_read_noise_ = knows_read_noise_ || frame_counts[s] >= 2;
        }
    real_calibration_ = measured_calibration(real_levels_, frame_counts, std::vector<bool>(sequences, true));
    real_.first.resize(count());
    real_.second.resize(count());
    for (std::size_t s = 0; s < sequences; ++s)
        measure(s, real.codes[s].data(), real_calibration_, real_);
}

std::uint32_t Experiment::half_count(std::size_t sequence) const {
    const std::uint32_t frames = layout_.sequences[sequence].frame_count;
    return frames >= 4 ? frames / 2 : frames;
}

std::uint32_t Experiment::frame_count(std::size_t sequence, Folds folds) const {
    return folds == Folds::kFirst ? half_count(sequence) : layout_.sequences[sequence].frame_count;
}

Calibration Experiment::measured_calibration(const std::vector<SequenceLevel> &levels,
                                             const std::vector<std::uint32_t> &frame_counts,
                                             const std::vector<bool> &present) const {
    Calibration result{layout_.black_level_dn, layout_.read_noise_dn};
    double mean = 0.0, variance = 0.0;
    unsigned means = 0, variances = 0;
    for (std::size_t s = 0; s < levels.size(); ++s) {
        if (layout_.sequences[s].scene != CaptureScene::kDark || !present[s])
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
        result.read_noise_dn =
            std::max(kLeastReadNoise, std::sqrt(std::max(0.0, variance / variances - kQuantizationVariance)));
    return result;
}

SimulationLevels Experiment::levels(const CalibratedLevels &calibrated, const EffectSettings &effects,
                                    std::size_t sequence, std::uint64_t seed, std::uint32_t frame_count) {
    return levels(simulator_of(sequence, seed), calibrated, effects, sequence, seed, frame_count);
}

SimulationLevels Experiment::levels(Simulator &simulator, const CalibratedLevels &calibrated,
                                    const EffectSettings &effects, std::size_t sequence, std::uint64_t seed,
                                    std::uint32_t frame_count) const {
    SimulationLevels result;
    result.black_level_dn = calibrated.black_level_dn + calibrated.black_level_error_dn;
    result.read_noise_dn = calibrated.read_noise_dn * calibrated.read_noise_ratio;
    if (layout_.sequences[sequence].scene == CaptureScene::kDark)
        return result;
    // The mean is the real one's, whatever part of it is light.
    const double signal = std::max(0.0, real_levels_[sequence].mean_dn - real_calibration_.black_level_dn -
                                            calibrated.black_level_error_dn);
    const double intensity = simulator.mean_intensity(sequence, effects, seed, frame_count);
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
    const auto codes = frames(simulator_of(sequence, seed), effects, calibrated, sequence, seed, frame_count);
    return {codes.data(), codes.data() + codes.size()};
}

SpareBuffers<std::uint16_t>::Buffer Experiment::frames(Simulator &simulator, const EffectSettings &effects,
                                                       const CalibratedLevels &calibrated, std::size_t sequence,
                                                       std::uint64_t seed, std::uint32_t frame_count) const {
    const CaptureLayout &drawn = simulator.layout();
    auto codes = spare_codes_.take(std::size_t{frame_count} * drawn.pixel_count());
    simulator.codes(sequence, effects, levels(simulator, calibrated, effects, sequence, seed, frame_count), seed,
                    frame_count, codes.data());
    if (drawn.width != layout_.width)
        cut_border(codes.data(), frame_count, drawn);
    return codes;
}

std::vector<FoldStatistics> Experiment::replicates(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                   const std::vector<std::uint64_t> &seeds,
                                                   const std::function<void(std::size_t)> &before_each) {
    const std::vector<bool> all(layout_.sequences.size(), true);
    std::vector<FoldStatistics> result(seeds.size(), {Eigen::VectorXd(count()), Eigen::VectorXd(count())});
    simulate(effects, calibrated, seeds, all, before_each, Folds::kBoth,
             [&](std::size_t i, std::size_t s, const std::vector<double> &values) { put(s, values, result[i]); });
    return result;
}

std::vector<FoldStatistics> Experiment::bordered_replicates(const CalibratedLevels &calibrated,
                                                            const std::vector<std::uint64_t> &seeds,
                                                            const std::function<void(std::size_t)> &before_each) {
    const CaptureLayout layout = with_border(layout_);
    const std::size_t cache_bytes = kCacheBytes / simulators_.size();
    std::vector<std::unique_ptr<Simulator>> bordered;
    for (const std::unique_ptr<Simulator> &idle : simulators_) {
        idle->set_cache_bytes(0); // what it keeps would be there twice
        idle->set_cache_bytes(cache_bytes);
        bordered.push_back(std::make_unique<Simulator>(context_, layout, std::vector<Hypothesis>{}));
        bordered.back()->set_cache_bytes(cache_bytes);
    }
    std::vector<bool> lasers;
    for (const SequenceLayout &sequence : layout_.sequences)
        lasers.push_back(is_laser(sequence.scene));
    const Eigen::VectorXd zeros = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(count()));
    std::vector<FoldStatistics> result(seeds.size(), {zeros, zeros});
    struct Swapped {
        std::vector<std::unique_ptr<Simulator>> &a, &b;
        ~Swapped() { a.swap(b); }
    };
    simulators_.swap(bordered);
    const Swapped swapped{simulators_, bordered};
    simulate({}, calibrated, seeds, lasers, before_each, Folds::kBoth,
             [&](std::size_t i, std::size_t s, const std::vector<double> &values) { put(s, values, result[i]); });
    return result;
}

MemoKey Experiment::key_of(const EffectSettings &effects, const CalibratedLevels &levels, std::size_t sequence) const {
    MemoKey key;
    key.add(std::uint64_t{sequence}).add(std::uint64_t{simulators_.front()->layout().width});
    key.add(simulators_.front()->concerning(effects, sequence));
    key.add(levels.black_level_dn + levels.black_level_error_dn).add(levels.read_noise_dn * levels.read_noise_ratio);
    if (layout_.sequences[sequence].scene != CaptureScene::kDark)
        key.add(levels.signal_share[sequence]);
    return key;
}

CalibratedLevels Experiment::drawn_levels(const CalibratedLevels &calibrated, std::uint64_t seed) const {
    CalibratedLevels result = calibrated;
    const std::array<double, 2> normals = host_normals(seed, 0, kStreamCameraLevels);
    if (!knows_black_level_)
        result.black_level_error_dn = kSheetBlackLevel * std::max(1.0, layout_.dn_of_ten_bits()) * normals[0];
    if (!knows_read_noise_)
        result.read_noise_ratio = std::exp(kSheetReadNoise * normals[1]);
    return result;
}

void Experiment::simulate(const EffectSettings &effects, const CalibratedLevels &calibrated,
                          const std::vector<std::uint64_t> &seeds, const std::vector<bool> &concerned,
                          const std::function<void(std::size_t)> &before_each, Folds folds, const TakeValues &take) {
    const std::size_t sequences = layout_.sequences.size();
    std::vector<std::uint32_t> frame_counts(sequences);
    std::vector<bool> dark(sequences);
    // Of each seed, or of all where the capture tells the levels.
    std::vector<CalibratedLevels> drawn = {calibrated};
    if (!knows_black_level_ || !knows_read_noise_) {
        drawn.clear();
        for (const std::uint64_t seed : seeds)
            drawn.push_back(drawn_levels(calibrated, seed));
    }
    const auto levels_of = [&](std::size_t i) -> const CalibratedLevels & { return drawn[i % drawn.size()]; };
    std::vector<std::vector<MemoKey>> keys(drawn.size());
    for (std::size_t s = 0; s < sequences; ++s) {
        frame_counts[s] = frame_count(s, folds);
        dark[s] = layout_.sequences[s].scene == CaptureScene::kDark;
        for (std::size_t d = 0; d < drawn.size(); ++d)
            keys[d].push_back(key_of(effects, drawn[d], s).add(std::uint64_t(folds)));
        if (concerned[s])
            work_ += seeds.size() * work_of(effects, s, frame_counts[s]);
    }
    std::vector<Calibration> calibrations(seeds.size());
    const auto statistics_key = [&](std::size_t i, std::size_t s) {
        MemoKey key = keys[i % keys.size()][s];
        return key.add_kind('m').add(seeds[i]).add(calibrations[i].black_level_dn).add(calibrations[i].read_noise_dn);
    };
    // Dark frames are the measure of all others: their levels must be known, also where no effect shows in them.
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < seeds.size(); ++i)
        tasks.push_back({i, by_work_.back(), seeds[i]}); // all dark sequences; the last one is one if any is
    run_tasks(tasks, {}, [&](const Task &task, const Worker &worker) {
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
                memo_.value(MemoKey(keys[i % keys.size()][s]).add_kind('l').add(task.seed), [&] {
                    const SequenceLevel measured_level = sequence_level(layout_, s, codes_of(s), frame_counts[s]);
                    return std::vector<double>{measured_level.mean_dn, measured_level.temporal_noise_dn};
                });
            levels[s] = {level[0], level[1]};
        }
        calibrations[i] = measured_calibration(levels, frame_counts, dark);
        for (std::size_t s = 0; s < sequences; ++s)
            if (dark[s] && concerned[s])
                take(i, s, memo_.value(statistics_key(i, s), [&] {
                    return measured(s, folds, codes_of(s), calibrations[i], worker);
                }));
    });
    tasks.clear();
    for (std::size_t i = 0; i < seeds.size(); ++i)
        for (const std::size_t s : by_work_)
            if (!dark[s] && concerned[s])
                tasks.push_back({i, s, seeds[i]});
    run_tasks(tasks, before_each, [&](const Task &task, const Worker &worker) {
        const std::size_t i = task.seed_index, s = task.sequence;
        take(i, s, memo_.value(statistics_key(i, s), [&] {
            const auto codes = frames(worker.simulator, effects, levels_of(i), s, task.seed, frame_counts[s]);
            return measured(s, folds, codes.data(), calibrations[i], worker);
        }));
    });
}

void Experiment::run_tasks(const std::vector<Task> &tasks, const std::function<void(std::size_t)> &before_each,
                           const DoTask &work) {
    if (const Inside *place = inside()) {
        place->tasks.run(tasks.size(), [&](std::size_t t) {
            const Inside &helper = *inside(); // perhaps another worker
            helper.checkpoint();
            work(tasks[t], worker(helper.worker, 1));
        });
        return;
    }
    const std::size_t workers = simulators_.size(), busy = std::clamp<std::size_t>(tasks.size(), 1, workers);
    // A worker with company measures on its own thread: starting others for so little takes longer.
    const unsigned threads = std::max(1u, threads_ / static_cast<unsigned>(busy));
    std::vector<std::atomic<bool>> begun(tasks.size());
    run_workers(workers, checkpoint, [&](std::size_t number, const std::function<void()> &worker_checkpoint) {
        std::size_t seed_index = 0;
        const auto run = [&](std::size_t t) {
            if (begun[t].exchange(true))
                return;
            if (number == 0 && before_each && tasks[t].seed_index >= seed_index) {
                before_each(tasks[t].seed_index);
                seed_index = tasks[t].seed_index + 1;
            }
            worker_checkpoint();
            work(tasks[t], worker(number, threads));
        };
        for (std::size_t t = 0; t < tasks.size(); ++t)
            if (worker_of(tasks[t].sequence, tasks[t].seed) == number)
                run(t);
        for (std::size_t t = tasks.size(); t-- > 0;)
            run(t);
    });
}

void Experiment::side_by_side(std::size_t count, const std::function<void(std::size_t)> &work) {
    if (count <= 1 || inside()) {
        for (std::size_t i = 0; i < count; ++i)
            work(i);
        return;
    }
    std::atomic<std::size_t> next{0};
    OpenTasks tasks;
    run_workers(simulators_.size(), checkpoint, [&](std::size_t worker, const std::function<void()> &worker_checkpoint) {
        const Inside inside(this, worker, worker_checkpoint, tasks);
        tasks.work(worker_checkpoint, [&] {
            for (std::size_t i = next++; i < count; i = next++) {
                worker_checkpoint();
                work(i);
            }
        });
    });
}

const Experiment::Inside *Experiment::inside() const {
    const Inside *place = Inside::here;
    while (place && place->experiment != this)
        place = place->before;
    return place;
}

bool Experiment::on_callers_thread() const {
    const Inside *place = inside();
    return !place || place->worker == 0;
}

Simulator &Experiment::simulator_of(std::size_t sequence, std::uint64_t seed) const {
    const Inside *place = inside();
    return *simulators_[place ? place->worker : worker_of(sequence, seed)];
}

std::uint64_t Experiment::work_of(const EffectSettings &effects, std::size_t sequence,
                                  std::uint32_t frame_count) const {
    // In halves of what the sensor and the statistics of a frame take; an interference pattern takes about one of them,
    // a screen of air or a filter of the whole image three (bench_gap_simulator).
    constexpr std::uint64_t kMeasuring = 2, kFilter = 3;
    const SequenceLayout &layout = layout_.sequences[sequence];
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

double Experiment::work() const {
    std::uint64_t capture = 0;
    for (std::size_t s = 0; s < layout_.sequences.size(); ++s)
        capture += work_of({}, s, layout_.sequences[s].frame_count);
    return static_cast<double>(work_.load()) / static_cast<double>(capture);
}

void Experiment::sort_by_work() {
    by_work_.resize(layout_.sequences.size());
    std::iota(by_work_.begin(), by_work_.end(), std::size_t{0});
    const auto work = [&](std::size_t s) {
        const SequenceLayout &sequence = layout_.sequences[s];
        return sequence.scene == CaptureScene::kDark ? 0 : work_of({}, s, sequence.frame_count);
    };
    std::stable_sort(by_work_.begin(), by_work_.end(), [&](std::size_t a, std::size_t b) { return work(a) > work(b); });
    places_.resize(by_work_.size());
    for (std::size_t place = 0; place < by_work_.size(); ++place)
        places_[by_work_[place]] = place;
}

Calibration Experiment::calibration_of(const Codes &codes) const {
    std::vector<std::uint32_t> frame_counts;
    std::vector<bool> present;
    std::vector<SequenceLevel> levels(codes.size());
    for (std::size_t s = 0; s < codes.size(); ++s) {
        frame_counts.push_back(layout_.sequences[s].frame_count);
        present.push_back(!codes[s].empty());
        if (present[s] && layout_.sequences[s].scene == CaptureScene::kDark)
            levels[s] = sequence_level(layout_, s, codes[s].data(), frame_counts[s]);
    }
    return measured_calibration(levels, frame_counts, present);
}

std::vector<double> Experiment::measured(const SequenceStatistics &statistics, std::size_t sequence, Folds folds,
                                         const std::uint16_t *codes, const Calibration &calibration,
                                         const Worker &worker) const {
    const std::size_t values = end(sequence) - begin(sequence);
    std::vector<double> result(static_cast<std::size_t>(folds) * values);
    statistics.compute(codes, calibration, result.data(), worker.threads, worker.device);
    if (folds == Folds::kBoth) {
        const std::size_t step = frame_count(sequence, folds) - half_count(sequence);
        statistics.compute(codes + step * layout_.pixel_count(), calibration, result.data() + values, worker.threads,
                           worker.device);
    }
    return result;
}

void Experiment::put(std::size_t sequence, const std::vector<double> &values, FoldStatistics &into) const {
    const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::copy(values.begin(), half, into.first.data() + begin(sequence));
    std::copy(half, values.end(), into.second.data() + begin(sequence));
}

void Experiment::measure(std::size_t sequence, const std::uint16_t *codes, const Calibration &calibration,
                         FoldStatistics &into) const {
    const SequenceStatistics &statistics = elsewhere_.empty() ? statistics_[sequence] : elsewhere_[sequence];
    const Inside *place = inside();
    put(sequence,
        measured(statistics, sequence, Folds::kBoth, codes, calibration, worker(place ? place->worker : 0, threads_)),
        into);
}

bool Experiment::measure_dots_at(const std::vector<std::array<double, 2>> &positions_px) {
    CaptureLayout layout = layout_;
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
        if (!std::equal(list.begin(), list.end(), list_.begin() + std::ptrdiff_t(begin(s)),
                        list_.begin() + std::ptrdiff_t(end(s)), same))
            return false;
    }
    elsewhere_ = std::move(elsewhere);
    return true;
}

std::vector<Eigen::VectorXd> Experiment::halves(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                                const std::vector<std::uint64_t> &seeds,
                                                const std::vector<bool> &concerned,
                                                const std::vector<Eigen::VectorXd> &otherwise) {
    std::vector<Eigen::VectorXd> result(otherwise.begin(),
                                        otherwise.begin() + std::min(otherwise.size(), seeds.size()));
    result.resize(seeds.size(), Eigen::VectorXd::Zero(count()));
    simulate(effects, calibrated, seeds, concerned, {}, Folds::kFirst,
             [&](std::size_t i, std::size_t s, const std::vector<double> &values) {
                 std::copy(values.begin(), values.end(), result[i].data() + begin(s));
             });
    return result;
}

} // namespace clsp
