// A capture and its simulator, measured alike: frames go in, statistics of two halves of the frames come out.
#pragma once

#include "inference/memo.hpp"
#include "statistics/workers.hpp"
#include "simulator/host_noise.hpp"
#include "simulator/simulator.hpp"
#include "statistics/device_sums.hpp"
#include "statistics/sequence_level.hpp"
#include "statistics/sequence_statistics.hpp"

#include <Eigen/Core>

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace clsp {

using EffectSettings = std::vector<EffectSetting>;

// Statistics of the first and the second half of every sequence's frames. A sequence of fewer than four frames is not
// parted: both are of all its frames.
struct FoldStatistics {
    Eigen::VectorXd first, second;
    Eigen::VectorXd mean() const { return 0.5 * (first + second); }
};

// Levels that make the simulator's frames agree with the real ones in what is calibrated, for one set of effects.
struct CalibratedLevels {
    double black_level_dn = 0.0, read_noise_dn = 0.0;
    // By sequence: gain times mean intensity over the real mean signal. 1 for a linear camera without further light.
    std::vector<double> signal_share;
    // How far one simulated camera is from these, where the capture does not tell them.
    double black_level_error_dn = 0.0, read_noise_ratio = 1.0;
    // By sequence, where the camera's gains are known: speckle gives each draw another mean. Empty: each has the real
    // one.
    std::vector<double> gain_dn = {};
};

// Where the seeds of a diagnosis's draws begin, one after the other: neighbouring seeds of the caller's share none of
// them.
constexpr std::uint64_t seed_of_draws(std::uint64_t seed) {
    return seed * 0x9E3779B97F4A7C15u;
}

// Simulates replicates of a capture and measures them. Work side by side (side_by_side()) is handed runners of its own,
// one for each worker: what it asks of such a runner is done in that worker.
class ReplicateRunner {
  public:
    // Throws kInvalidData if the capture has no sequence that can be measured.
    ReplicateRunner(std::shared_ptr<Context> context, const Capture &real, std::vector<Hypothesis> hypotheses,
                    unsigned threads);

    const CaptureLayout &layout() const { return shared_->layout; }
    const Simulator &simulator() const { return *shared_->simulators.front(); }
    const std::vector<StatisticInfo> &list() const { return shared_->list; }
    std::size_t count() const { return shared_->list.size(); }
    // Statistics [begin, end) belong to a sequence.
    std::size_t begin(std::size_t sequence) const { return shared_->offsets[sequence]; }
    std::size_t end(std::size_t sequence) const { return shared_->offsets[sequence + 1]; }
    // Whether a sequence's statistics are of few frames.
    bool has_few_frames(std::size_t sequence) const { return half_count(sequence) < kFewFrames; }
    bool parted() const { return shared_->parted; } // whether any sequence has two halves
    bool parted(std::size_t sequence) const {
        return half_count(sequence) < shared_->layout.sequences[sequence].frame_count;
    }
    const FoldStatistics &real() const { return shared_->real; }
    const SequenceLevel &real_level(std::size_t sequence) const { return shared_->real_levels[sequence]; }
    const Calibration &real_calibration() const { return shared_->real_calibration; }

    // Simulates until black level, read noise and signal levels are the capture's. start: levels that hold for the
    // sequences that `concerned` leaves out; nullptr: all are concerned.
    CalibratedLevels calibrate(const EffectSettings &effects, const std::vector<bool> &concerned,
                               const CalibratedLevels *start);
    SimulationLevels levels(const CalibratedLevels &calibrated, const EffectSettings &effects, std::size_t sequence,
                            std::uint64_t seed, std::uint32_t frame_count);

    // Whole simulated captures, one for each seed, measured as the real one. before_each: called with 0, 1, ... (may be
    // empty).
    std::vector<FoldStatistics> replicates(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                           const std::vector<std::uint64_t> &seeds,
                                           const std::function<void(std::size_t)> &before_each);
    // The same of the baseline, whose image ends where the world goes on: light that leaves at one border does not come
    // in at the other, dots beyond it are there. Sequences without laser light, to which that is the same, have zeros.
    std::vector<FoldStatistics> bordered_replicates(const CalibratedLevels &calibrated,
                                                    const std::vector<std::uint64_t> &seeds,
                                                    const std::function<void(std::size_t)> &before_each);
    // Simulated captures of half the frames. Sequences that `concerned` leaves out keep the values of `otherwise`, one
    // for each seed (no values: all are concerned).
    std::vector<Eigen::VectorXd> halves(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                        const std::vector<std::uint64_t> &seeds, const std::vector<bool> &concerned,
                                        const std::vector<Eigen::VectorXd> &otherwise);
    // Frames from elsewhere, measured as the real ones: what the dark sequences among them say (an empty one is left
    // out; the layout's levels where there is none), and both halves of one sequence.
    Calibration calibration_of(const std::vector<std::vector<std::uint16_t>> &codes) const;
    void measure(std::size_t sequence, const std::uint16_t *codes, const Calibration &calibration,
                 FoldStatistics &into) const;
    // Frames that are measured so have their dots elsewhere: statistics go by where dots are meant to be. False, and
    // nothing is changed, where there would be other statistics then.
    bool measure_dots_at(const std::vector<std::array<double, 2>> &positions_px);
    // Frames as they are simulated, of one sequence.
    std::vector<std::uint16_t> frames(const EffectSettings &effects, const CalibratedLevels &calibrated,
                                      std::size_t sequence, std::uint64_t seed, std::uint32_t frame_count);

    // The levels of a simulated capture's camera: where no dark sequence tells black level or read noise, every capture
    // has one of its own, as far from the data sheet's as the real one may be.
    CalibratedLevels drawn_levels(const CalibratedLevels &calibrated, std::uint64_t seed) const;

    // Calls work(runner, 0) ... work(runner, count - 1), which are to be independent of each other: each in a worker
    // that simulates and measures what the work asks `runner` for, helped by workers that have run out of work. A
    // worker's runner does all of them itself. Work that asks another runner than its own is refused.
    void side_by_side(std::size_t count, const std::function<void(ReplicateRunner &runner, std::size_t i)> &work);
    // Whether this is the runner of the thread that progress may be told on: other workers' are not.
    bool on_callers_thread() const { return !seat_ || seat_->self.number == 0; }

    // How much has been asked for so far, in whole captures without effects: by the number of frames, and of
    // interference patterns and filters in them. The same for the same questions, whatever was known already and
    // however many threads there are.
    double work() const;
    // What one capture takes, in units that runners of other parts of it share.
    double capture_work() const;

    // Called before each sequence, on the caller's thread; throws to cancel. Of a worker's runner: the worker's.
    std::function<void()> checkpoint;

  private:
    // How a sequence's frames are measured: the first half alone, or all frames in halves.
    enum class Folds : std::uint32_t { kFirst = 1, kBoth = 2 };
    std::uint32_t half_count(std::size_t sequence) const;
    std::uint32_t frame_count(std::size_t sequence, Folds folds) const;
    // What simulates and measures, used by one thread at a time.
    struct Worker {
        Simulator &simulator;
        statistics::DeviceSums *device; // nullptr: the host sums over pixels
        unsigned threads;               // that measuring may use
    };
    // Simulators of one camera, one for each worker.
    using Simulators = std::vector<std::unique_ptr<Simulator>>;
    statistics::DeviceSums *device_of(std::size_t worker) const {
        return shared_->device_sums.empty() ? nullptr : shared_->device_sums[worker].get();
    }
    // Statistics of the halves of a sequence that are asked for, one after the other.
    std::vector<double> measured(std::size_t sequence, Folds folds, const std::uint16_t *codes,
                                 const Calibration &calibration, const Worker &worker) const {
        return measured(shared_->statistics[sequence], sequence, folds, codes, calibration, worker);
    }
    std::vector<double> measured(const SequenceStatistics &statistics, std::size_t sequence, Folds folds,
                                 const std::uint16_t *codes, const Calibration &calibration,
                                 const Worker &worker) const;
    // Captures, sequence by sequence. `take` gets what is measured of those that are concerned, workers side by side;
    // seed_index counts the seeds. What was simulated before with the same effects on a sequence is not simulated
    // again.
    using TakeValues =
        std::function<void(std::size_t seed_index, std::size_t sequence, const std::vector<double> &values)>;
    void simulate(const Simulators &simulators, const EffectSettings &effects, const CalibratedLevels &calibrated,
                  const std::vector<std::uint64_t> &seeds, const std::vector<bool> &concerned,
                  const std::function<void(std::size_t)> &before_each, Folds folds, const TakeValues &take);
    // What the frames of a sequence depend on beside the seed.
    MemoKey key_of(const Simulator &simulator, const EffectSettings &effects, const CalibratedLevels &levels,
                   std::size_t sequence) const;
    // One sequence, drawn from one seed.
    struct Task {
        std::size_t seed_index, sequence;
        std::uint64_t seed;
    };
    // Workers side by side: each does its own tasks, then what the others have not begun. before_each: called with the
    // seed_index of tasks as they come (may be empty).
    using DoTask = std::function<void(const Task &task, const Worker &worker)>;
    void run_tasks(const Simulators &simulators, const std::vector<Task> &tasks,
                   const std::function<void(std::size_t)> &before_each, const DoTask &work);
    // The simulator that draws a sequence unless another one helps out: the same for the same random numbers, as it
    // keeps the light that it drew last.
    std::size_t worker_of(std::size_t sequence, std::uint64_t seed) const {
        return (shared_->places[sequence] + seed) % shared_->simulators.size();
    }
    // Of a worker's runner that worker. Throws for work side by side that asks for another one.
    std::size_t own_worker(std::size_t otherwise) const;
    // That worker's; of a worker's runner its own.
    Simulator &simulator_of(std::size_t sequence, std::uint64_t seed) const;
    // Mean image of the dark frames, of half of each sequence, which both halves of others are measured with. codes_of:
    // the frames of a dark sequence. Null without one.
    std::shared_ptr<const std::vector<float>>
    mean_dark_frame(const std::function<const std::uint16_t *(std::size_t sequence)> &codes_of) const;
    void sort_by_work();
    // What some of a sequence's frames take to simulate and measure.
    std::uint64_t work_of(const EffectSettings &effects, std::size_t sequence, std::uint32_t frame_count) const;
    SimulationLevels levels(Simulator &simulator, const CalibratedLevels &calibrated, const EffectSettings &effects,
                            std::size_t sequence, std::uint64_t seed, std::uint32_t frame_count) const;
    SpareBuffers<std::uint16_t>::Buffer frames(Simulator &simulator, const EffectSettings &effects,
                                               const CalibratedLevels &calibrated, std::size_t sequence,
                                               std::uint64_t seed, std::uint32_t frame_count) const;
    void put(std::size_t sequence, const std::vector<double> &values, FoldStatistics &into) const;
    // Parts of calibrate(), of one sequence. step_dn: of the converter.
    // To what the mean of even light is brought to the real one: a part of what chance leaves open.
    double mean_tolerance_dn(std::size_t sequence, double step_dn) const;
    void calibrate_dark(Simulator &simulator, const EffectSettings &effects, std::size_t sequence, double step_dn,
                        CalibratedLevels &levels);
    // Coarse ones give the level that they end at.
    SequenceLevel calibrate_coarse_dark(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                                        double step_dn, CalibratedLevels &levels);
    void calibrate_signal(Simulator &simulator, const EffectSettings &effects, std::size_t sequence, double step_dn,
                          CalibratedLevels &levels);
    SequenceLevel calibrate_coarse_signal(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                                          double step_dn, CalibratedLevels &levels);
    void calibrate_coarse_noise(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                                double step_dn, CalibratedLevels &levels);
    // The light of flats of one lamp goes as their exposure.
    void tie_to_exposures(CalibratedLevels &levels) const;
    // The read noise that dark and even frames show where steps are coarse.
    double noise_between_steps(const EffectSettings &effects, std::size_t dark, const std::vector<Task> &lit,
                               double step_dn, const CalibratedLevels &begin);
    // A sequence with its mean brought to the real one's, at a given read noise. variance: over time; scattered: how it
    // goes with the mean, how much of what is expected this draw lacks, and the error about that.
    struct SteppedLevel {
        double black_level_dn, mean_dn, variance;
        double slope, lack, error; // 0 if not scattered
    };
    SteppedLevel stepped_level(Simulator &simulator, const EffectSettings &effects, std::size_t sequence,
                               double step_dn, bool scattered, CalibratedLevels levels);
    // All frames of a sequence, drawn once.
    SequenceLevel simulated_level(Simulator &simulator, const EffectSettings &effects, const CalibratedLevels &levels,
                                  std::size_t sequence, std::uint64_t seed) const;
    // levels: of all sequences, those that are no dark ones of any content. present: those that count.
    Calibration measured_calibration(const std::vector<SequenceLevel> &levels,
                                     const std::vector<std::uint32_t> &frame_counts,
                                     const std::vector<bool> &present) const;

    // What the runners of all workers share.
    struct Shared {
        Shared(std::shared_ptr<Context> context_, const CaptureLayout &layout_, unsigned threads_);

        std::shared_ptr<Context> context;
        CaptureLayout layout;
        unsigned threads;
        Memo memo;
        // Sequences are simulated and measured side by side, each worker by a simulator of its own.
        Simulators simulators;
        std::vector<std::unique_ptr<statistics::DeviceSums>> device_sums; // one for each, or none
        std::atomic<bool> engaged{false};                                 // the workers work
        SpareBuffers<std::uint16_t> spare_codes;
        std::vector<std::size_t> by_work, places;   // sequences that take long first; the place of each
        std::vector<SequenceStatistics> statistics; // of half of a sequence's frames
        std::vector<SequenceStatistics> elsewhere;  // of frames whose dots are elsewhere; empty: of no others
        std::vector<StatisticInfo> list;
        std::vector<std::size_t> offsets;
        bool parted = false;
        bool knows_black_level = false, knows_read_noise = false; // from dark sequences
        std::atomic<std::uint64_t> work{0};                       // see work_of()
        FoldStatistics real;
        std::vector<SequenceLevel> real_levels;
        Calibration real_calibration;
    };
    // While all workers work for one call.
    class Engaged {
      public:
        explicit Engaged(Shared &shared);
        Engaged(const Engaged &) = delete;
        Engaged &operator=(const Engaged &) = delete;
        ~Engaged() { shared_.engaged = false; }

      private:
        Shared &shared_;
    };
    // A place among the workers of side_by_side().
    struct Seat {
        const WorkerThread &self;
        OpenTasks &tasks; // of all workers
    };
    ReplicateRunner(std::shared_ptr<Shared> shared, const Seat &seat)
        : checkpoint(seat.self.checkpoint), shared_(std::move(shared)), seat_(&seat) {}

    std::shared_ptr<Shared> shared_;
    const Seat *seat_ = nullptr; // of a worker's runner
};

} // namespace clsp
