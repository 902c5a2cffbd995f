#include "run/compare.hpp"

#include "capture/capture_check.hpp"
#include "capture/frame_changes.hpp"
#include "capture/json_file.hpp"
#include "inference/closing.hpp"
#include "inference/shrinkage.hpp"
#include "measure/camera_profile.hpp"
#include "measure/downstream.hpp"
#include "measure/evidence.hpp"
#include "measure/verdict.hpp"
#include "run/judgeable.hpp"
#include "runtime/error.hpp"
#include "simulator/finished_frames.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/core.h>
#include <functional>
#include <numeric>
#include <thread>

namespace clsp {
namespace {

// The level is shared between the statistics and the read noise, which is calibrated out of them.
constexpr double kStatisticsShare = 0.9;
// By an effect, in standard deviations.
Eigen::VectorXd moved_by(const ClosingResult &closed, const GapModel &null, std::size_t step) {
    Eigen::VectorXd moved = closed.models[step].change.mean();
    if (step)
        moved -= closed.models[step - 1].change.mean();
    return moved.cwiseQuotient(null.full().deviation());
}

// A difference by chance about the last model, after the fit of its first half.
Eigen::VectorXd strayed(const ClosedGap &last, const FoldStatistics &draw) {
    const Eigen::VectorXd fitted = last.model->coefficients(last.model->fold(), draw.first - last.model->first_mean());
    return draw.second - last.model->second_mean() - last.jacobian * fitted;
}

// On the second halves, which no fit has seen; in the metric of the last model.
void measure_shrinkage(const ClosingResult &closed, const FoldStatistics &difference, const GapModel &null,
                       DiagnosisResult &result) {
    const ClosedGap &last = closed.models.back();
    const Covariance &metric = last.model->fold();
    const double count = static_cast<double>(difference.second.size());
    const auto mean_square = [&](const Eigen::VectorXd &v) { return metric.whiten(v).squaredNorm() / count; };
    double chance_before = 0.0;
    for (const FoldStatistics &draw : null.replicates().draws)
        chance_before += mean_square(draw.second - null.second_mean()) / double(null.replicates().draws.size());
    const auto &draws = last.model->replicates().draws;
    Eigen::VectorXd before(static_cast<Eigen::Index>(draws.size())), after(before.size());
    for (Eigen::Index r = 0; r < before.size(); ++r) {
        before[r] = mean_square(draws[std::size_t(r)].second);
        after[r] = mean_square(strayed(last, draws[std::size_t(r)]));
    }
    const double chance_after = after.mean();
    result.distance_before = beyond_chance(mean_square(difference.second), chance_before);
    for (std::size_t i = 0; i < closed.models.size(); ++i) {
        const double left =
            beyond_chance(mean_square(difference.second - closed.models[i].change.second), chance_after);
        result.steps.push_back({closed.steps[i].added, left, gone(result.distance_before, left)});
    }
    result.distance_after = result.steps.back().distance_after;
    result.fraction = result.steps.back().fraction;
    result.fraction_95 = gone_95(result.fraction, before, chance_before, after, chance_after);
}

// Of each statistic, on the second halves likewise.
std::vector<StatisticShrinkage> shrinkages(const ReplicateRunner &runner, const ClosedGap &last,
                                           const FoldStatistics &difference) {
    const auto &draws = last.model->replicates().draws;
    std::vector<HeldOutDifferences> replicates;
    for (const FoldStatistics &draw : draws)
        replicates.push_back({draw.second, strayed(last, draw)});
    std::vector<StatisticShrinkage> result =
        statistic_shrinkages({difference.second, difference.second - last.change.second}, replicates,
                             last.model->fold().deviation(), least_deviations(runner.list(), draws));
    for (std::size_t s = 0; s < runner.layout().sequences.size(); ++s)
        for (std::size_t k = runner.begin(s); !runner.parted(s) && k < runner.end(s); ++k)
            result[k] = {};
    return result;
}

void set_verdict(const ClosingResult &closed, const GapModel &null, const GapTest &test, DiagnosisResult &result) {
    if (!result.detected)
        return;
    const GapTest &residual = closed.models.empty() ? test : closed.models.back().residual;
    result.residual_detected = closed.models.empty() ? true : residual.detected;
    result.residual_p_value = reported_p_value(residual.p_value);
    if (closed.models.empty() || residual.detected) {
        result.verdict = Verdict::kUnknown;
        for (std::size_t i = 0; i < closed.models.size(); ++i)
            if (explained(moved_by(closed, null, i), residual.z))
                result.effects.push_back(closed.steps[i].added);
        return;
    }
    name_effects(closed.steps, {}, result);
}

void add_notes(const PairedCaptures &captures, const Comparison &comparison, DiagnosisResult &result) {
    result.notes = captures.notes;
    const auto joined = [](const std::vector<std::string> &names) {
        std::string text;
        for (const std::string &name : names)
            text += (text.empty() ? "" : ", ") + name;
        return text;
    };
    if (!comparison.real_alone.empty())
        result.notes.push_back("without a partner in the simulated set: " + joined(comparison.real_alone));
    if (!comparison.sim_alone.empty())
        result.notes.push_back("without a partner in the real set: " + joined(comparison.sim_alone));
    for (const SequencePair &pair : comparison.pairs)
        if (pair.real_frames != pair.sim_frames)
            result.notes.push_back(fmt::format(
                "{} has {} frames, {} of the simulated set {}: the first {} of both are compared", pair.real,
                pair.real_frames, pair.sim, pair.sim_frames, std::min(pair.real_frames, pair.sim_frames)));
    const ReadNoiseComparison &noise = comparison.read_noise;
    if (noise.added_dn > 0.0)
        result.notes.push_back(fmt::format(
            "the simulated frames have a read noise of {:.2f} DN, the camera {:.2f} DN: {:.2f} DN were added",
            noise.sim.read_noise_dn, noise.real.read_noise_dn, noise.added_dn));
    if (noise.excess)
        result.notes.push_back(fmt::format(
            "the simulated frames have a read noise of {:.2f} DN, the camera only {:.2f} DN: it cannot be taken "
            "out of finished frames; lower it in the simulator",
            noise.sim.read_noise_dn, noise.real.read_noise_dn));
    if (!noise.real.noise_measured || !noise.sim.noise_measured)
        result.notes.push_back(
            "read noise was not compared: that takes dark sequences of two frames or more in both sets");
    for (const SurplusEffect &surplus : comparison.surplus)
        if (result.residual_detected)
            result.notes.push_back(fmt::format(
                "the differences point the other way for {}: the simulated frames may have more of it than the "
                "camera's, and it cannot be taken out of finished frames",
                surplus.effect));
}

// What is near a dot depends on the lattice: the mean statistics of our simulator's frames with the simulated set's
// dots less those with the real set's, by the same random numbers.
FoldStatistics change_by_lattice(const std::shared_ptr<Context> &context, const PairedCaptures &captures,
                                 const CaptureDots &dots, ReplicateRunner &runner, std::uint32_t count,
                                 std::uint64_t seed, unsigned threads, const std::function<void()> &checkpoint) {
    Capture others = captures.real; // whose levels hold for both
    others.layout.dots = dots;
    ReplicateRunner there(context, others, {}, threads);
    there.checkpoint = checkpoint;
    std::vector<std::uint64_t> seeds(count);
    std::iota(seeds.begin(), seeds.end(), seed + 1);
    const std::vector<bool> all(runner.layout().sequences.size(), true);
    const auto mean_of = [&](ReplicateRunner &one) {
        const auto size = static_cast<Eigen::Index>(one.count());
        FoldStatistics mean{Eigen::VectorXd::Zero(size), Eigen::VectorXd::Zero(size)};
        for (const FoldStatistics &draw : one.replicates({}, one.calibrate({}, all, nullptr), seeds, {})) {
            mean.first += draw.first / double(count);
            mean.second += draw.second / double(count);
        }
        return mean;
    };
    const FoldStatistics here = mean_of(runner), elsewhere = mean_of(there);
    FoldStatistics change{elsewhere.first - here.first, elsewhere.second - here.second};
    for (std::size_t s = 0; s < runner.layout().sequences.size(); ++s) {
        const auto begin = Eigen::Index(runner.begin(s)), size = Eigen::Index(runner.end(s)) - begin;
        if (runner.layout().sequences[s].scene != CaptureScene::kDots) {
            change.first.segment(begin, size).setZero();
            change.second.segment(begin, size).setZero();
        }
    }
    return change;
}

// Levels of both sets are measured from their dark sequences.
void check_dark(const CaptureLayout &layout, const std::vector<SequenceScan> &scans, const char *set) {
    for (std::size_t s = 0; s < scans.size(); ++s) {
        const SequenceLayout &sequence = layout.sequences[s];
        const double counted = double(scans[s].pixels) * sequence.frame_count;
        const double share = counted > 0.0 ? double(scans[s].saturated) / counted : 0.0;
        if (sequence.scene == CaptureScene::kDark && share > kMostClipped)
            throw Error(
                Status::kInvalidData,
                fmt::format("{} of the {} set: {:.0f} % of its pixels are at the top code, so it is no dark sequence; "
                            "record it with the lens covered, correct camera.bits, or leave it out",
                            sequence.name, set, 100.0 * share));
    }
}

// The dark sequences, also those without a partner, as far as they are judged.
Capture darks_of(const Capture &capture, PartChoice choice, const PixelWindow &window) {
    CaptureLayout darks = capture.layout;
    darks.sequences.clear();
    std::vector<std::size_t> numbers;
    for (std::size_t s = 0; s < capture.layout.sequences.size(); ++s)
        if (capture.layout.sequences[s].scene == CaptureScene::kDark) {
            darks.sequences.push_back(capture.layout.sequences[s]);
            numbers.push_back(s);
        }
    choice.whole_image = false;
    choice.window = window;
    return take_part(capture, numbers, darks.sequences, choose_part(darks, choice));
}

// The profile's camera, which took these frames.
KnownCamera known_camera(const CameraProfile &profile, const CaptureLayout &layout) {
    const auto check = [](const char *what, double real, double profiles) {
        if (rounded(real) != rounded(profiles))
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the profile is of another camera: {} is {} of the real set, {} of the profile; give "
                            "the profile that a diagnosis of the real set wrote",
                            what, real, profiles));
    };
    check("width", layout.width, profile.width);
    check("height", layout.height, profile.height);
    check("bits", layout.bits, profile.bits);
    check("pixel_pitch_m", layout.pixel_pitch_m, profile.pixel_pitch_m);
    check("wavelength_m", layout.wavelength_m, profile.wavelength_m);
    KnownCamera camera;
    for (const ProfileEffect &effect : profile.effects) {
        camera.effects.push_back({effect.id, {}});
        for (const ProfileParameter &parameter : effect.parameters)
            camera.effects.back().values.push_back(parameter.value);
    }
    return camera;
}

// Of the sequences that are compared.
std::vector<double> gains_of(const CameraProfile &profile, const CaptureLayout &layout) {
    std::vector<double> gains;
    for (const SequenceLayout &sequence : layout.sequences) {
        const auto found = std::find_if(profile.sequences.begin(), profile.sequences.end(),
                                        [&](const ProfileSequence &s) { return s.name == sequence.name; });
        if (found == profile.sequences.end())
            throw Error(
                Status::kInvalidArgument,
                fmt::format("the profile has no sequence \"{}\", which the real set has; give the profile that a "
                            "diagnosis of the real set wrote",
                            sequence.name));
        gains.push_back(found->gain_dn);
    }
    return gains;
}

// By how much the read noise that dark frames show is another by chance, relative: rows that jump make it so as well as
// pixels do.
double noise_scatter(const std::shared_ptr<Context> &context, const Capture &darks, const EffectSettings &effects,
                     std::uint64_t seed, unsigned threads) {
    constexpr std::uint64_t kDraws = 64;
    ReplicateRunner runner(context, darks, {}, threads);
    const CalibratedLevels levels = runner.calibrate(effects, std::vector<bool>(darks.codes.size(), true), nullptr);
    double sum = 0.0, squares = 0.0;
    Capture drawn = darks;
    for (std::uint64_t i = 0; i < kDraws; ++i) {
        for (std::size_t s = 0; s < drawn.codes.size(); ++s)
            drawn.codes[s] = runner.frames(effects, levels, s, seed + i, drawn.layout.sequences[s].frame_count);
        const double noise = std::log(std::max(1e-3, camera_levels(drawn).read_noise_dn));
        sum += noise;
        squares += noise * noise;
    }
    return std::sqrt(std::max(0.0, (squares - sum * sum / kDraws) / (kDraws - 1)));
}

} // namespace

DiagnosisResult compare(std::shared_ptr<Context> context, const Capture &real, const Capture &sim,
                        const DiagnosisOptions &options) {
    const auto start = std::chrono::steady_clock::now();
    const unsigned threads = options.threads ? options.threads : std::max(1u, std::thread::hardware_concurrency());
    if (!options.hypotheses.empty())
        throw Error(Status::kInvalidArgument,
                    "a comparison takes no hypotheses: they are functions on frames that our simulator draws");
    std::vector<Candidate> all = candidates({}, options.without);
    const std::uint64_t first_seed = seed_of_draws(options.seed);
    auto comparison = std::make_shared<Comparison>();
    const std::vector<SequenceScan> real_scans = scan_capture(real), sim_scans = scan_capture(sim);
    check_dark(real.layout, real_scans, "real");
    check_dark(sim.layout, sim_scans, "simulated");
    const CaptureSummary real_summary = summarize_capture(real), sim_summary = summarize_capture(sim);
    PairedCaptures captures = pair_captures(real, sim, options.part, [&](std::size_t r, std::size_t s) {
        const std::string &name = real.layout.sequences[r].name;
        if (const std::string reason = why_not_judged(real.layout, real_summary, r); !reason.empty())
            return left_out_note(name, reason);
        const std::string reason = why_not_judged(sim.layout, sim_summary, s);
        return reason.empty() ? reason : left_out_note(name, "of the simulator, " + reason);
    });
    const auto levels_of = [&](const Capture &capture) {
        return camera_levels(darks_of(capture, options.part, captures.part.window));
    };
    KnownCamera camera = options.profile ? known_camera(*options.profile, real.layout) : KnownCamera{};
    CameraLevels real_levels = levels_of(real), sim_levels = levels_of(sim);
    const CameraLevels recorded = sim_levels;
    if (!camera.effects.empty() && real_levels.noise_measured && sim_levels.noise_measured) {
        real_levels.noise_error = sim_levels.noise_error = noise_scatter(
            context, darks_of(real, options.part, captures.part.window), camera.effects, first_seed, threads);
        const double z =
            std::log(real_levels.read_noise_dn / sim_levels.read_noise_dn) / (std::sqrt(2.0) * real_levels.noise_error);
        // No noise is added to frames whose noise is that of the same camera.
        if (std::erfc(std::abs(z) / std::sqrt(2.0)) > (1.0 - kStatisticsShare) * options.level)
            sim_levels.read_noise_dn = real_levels.read_noise_dn;
    }
    comparison->read_noise = level_captures(captures, real_levels, sim_levels, bool(options.profile), first_seed);
    comparison->read_noise.sim = recorded;
    scale_to_camera(all, real.layout, comparison->read_noise.real.read_noise_dn);
    comparison->pairs = captures.pairs;
    comparison->real_alone = captures.real_alone;
    comparison->sim_alone = captures.sim_alone;
    DiagnosisResult result;
    result.seed = options.seed;
    result.level = options.level;
    if (!captures.part.is_whole()) {
        result.part = captures.part;
        captures.notes.push_back(
            fmt::format("compared were {}: --window and --frames choose otherwise", part_text(captures.part)));
    }
    for (const SequencePair &pair : captures.pairs)
        result.judged.push_back(pair.real);
    for (const SequenceLayout &sequence : real.layout.sequences)
        if (std::find(result.judged.begin(), result.judged.end(), sequence.name) == result.judged.end())
            result.left_out.push_back(sequence.name);
    const auto has_lit = [](const CaptureLayout &layout) {
        return std::any_of(layout.sequences.begin(), layout.sequences.end(),
                           [](const SequenceLayout &s) { return s.scene != CaptureScene::kDark; });
    };
    result.no_light_judged = has_lit(real.layout) && !has_lit(captures.real.layout);
    for (const Candidate &candidate : all) {
        const std::string refusal = finished_frames_refusal(candidate.id, captures.sim.layout);
        if (refusal.empty())
            result.candidates.push_back(candidate);
        else
            comparison->refused.push_back({candidate.id, candidate.stage, refusal});
    }

    double fraction = 0.0;
    std::string doing = "reading";
    const auto tell = [&](const std::string &what, double part) {
        doing = what;
        fraction = std::max(fraction, part);
        if (options.progress && !options.progress(doing, fraction))
            throw Error(Status::kCancelled, "the comparison was cancelled by its progress callback");
    };
    ReplicateRunner runner(context, captures.real, {}, threads);
    runner.checkpoint = [&] { tell(doing, fraction); };
    if (options.profile)
        camera.gain_dn = gains_of(*options.profile, runner.layout());
    // Statistics of dots are relative to where dots are meant to be, which each set says for itself. Their width is the
    // real set's: a simulator that is told another one has a gap.
    CaptureDots sim_dots = captures.sim.layout.dots.value_or(CaptureDots{});
    if (captures.real.layout.dots)
        sim_dots.sigma_px = captures.real.layout.dots->sigma_px;
    const bool has_dots = std::any_of(captures.real.layout.sequences.begin(), captures.real.layout.sequences.end(),
                                      [](const SequenceLayout &s) { return s.scene == CaptureScene::kDots; });
    const bool dots_apart = captures.dots_apart && has_dots;
    const bool own_dots = dots_apart && runner.measure_dots_at(sim_dots.positions_px);
    if (dots_apart)
        captures.notes.push_back(own_dots ? "each set's dots are measured where its own description has them"
                                          : "the sets' dots do not allow the same statistics: both sets are measured "
                                            "at the real set's positions");
    const bool has_dark = std::any_of(captures.sim.layout.sequences.begin(), captures.sim.layout.sequences.end(),
                                      [](const SequenceLayout &s) { return s.scene == CaptureScene::kDark; });
    const Calibration calibration =
        has_dark ? runner.calibration_of(captures.sim.codes)
                 : Calibration{captures.sim.layout.black_level_dn, captures.sim.layout.read_noise_dn};
    const auto count = static_cast<Eigen::Index>(runner.count());
    FoldStatistics simulated{Eigen::VectorXd(count), Eigen::VectorXd(count)};
    for (std::size_t s = 0; s < captures.sim.codes.size(); ++s)
        runner.measure(s, captures.sim.codes[s].data(), calibration, simulated);
    if (own_dots) {
        const FoldStatistics lattice =
            change_by_lattice(context, captures, sim_dots, runner, options.null_replicates, first_seed, threads,
                              [&] { tell("drawing the other dots", fraction); });
        simulated.first -= lattice.first;
        simulated.second -= lattice.second;
    }
    const FoldStatistics difference{runner.real().first - simulated.first, runner.real().second - simulated.second};
    const GapModel null(runner,
                        draw_differences(runner, camera.effects, camera.gain_dn, options.null_replicates, first_seed,
                                         [&](double part) { tell("drawing differences by chance", 0.5 * part); }),
                        kStatisticsShare * options.level, Eigen::MatrixXd(count, 0), Eigen::VectorXd::Zero(count));
    const GapTest test = null.test(difference);
    const ReadNoiseComparison &noise = comparison->read_noise;
    const double noise_p = noise.excess ? noise.p_value / (1.0 - kStatisticsShare) : 1.0;
    const bool noise_gap = noise_p <= options.level;
    // A sequence that is not of one scene, where the other set's is. One that is left out for its frames without light
    // is no reason to find no gap.
    const auto changes_of = [](const CaptureSummary &summary, const std::string &sequence, bool compared) {
        std::vector<SequenceChange> changes;
        for (const SequenceChange &change : summary.frame_changes)
            if (change.sequence == sequence && (compared || change.kind == kFramesWithoutLight))
                changes.push_back(change);
        return changes;
    };
    for (const bool compared : {true, false})
        for (const SequencePair &pair : compared ? captures.pairs : captures.left_out) {
            std::vector<SequenceChange> of_real = changes_of(real_summary, pair.real, compared);
            std::vector<SequenceChange> of_sim = changes_of(sim_summary, pair.sim, compared);
            if (of_real.empty() == of_sim.empty())
                continue;
            for (SequenceChange &change : of_sim)
                change.text = "of the simulator, " + change.text;
            for (SequenceChange &change : of_real.empty() ? of_sim : of_real) {
                captures.notes.push_back(change.sequence + ": " + change.text);
                result.frame_changes.push_back(std::move(change));
            }
        }
    const bool steady = result.frame_changes.empty();
    const double frames_p = steady ? 1.0 : kChanceOfFrameChange;
    result.detected = test.detected || noise_gap || !steady;
    result.p_value = reported_p_value(std::min({1.0, test.p_value / kStatisticsShare, noise_p, frames_p}));
    result.distance = test.distance;
    result.null_95 = test.null_95;

    // What is measured on the frames is put on copies whose levels are known.
    captures.sim.layout.black_level_dn = calibration.black_level_dn;
    captures.sim.layout.read_noise_dn = calibration.read_noise_dn;
    FinishedFrames finished(context, captures.sim);
    for (const Candidate &candidate : result.candidates) {
        bool visible = false;
        for (std::size_t s = 0; s < captures.pairs.size(); ++s)
            visible = visible || finished.concerns(candidate.id, s);
        if (!visible)
            result.untested_effects.push_back(candidate.id);
    }
    ClosingResult closed;
    hold_at_quantities(result.candidates, pattern_quantities(captures.real, runner.real_calibration(), threads));
    const std::vector<Candidate> tried = with_alternatives(result.candidates);
    if (test.detected) {
        ClosingOptions closing;
        closing.seed = first_seed;
        closing.max_effects = options.max_effects;
        closing.residual_level = 0.25 * options.level;
        closing.camera = camera;
        closed = close_gap(runner, finished, tried, difference, null, closing,
                           [&](const std::string &what, double part) { tell(what, 0.5 + 0.5 * part); });
        comparison->surplus = closed.surplus;
    }
    result.held_out = runner.parted();
    set_verdict(closed, null, test, result);
    if (noise_gap || !steady) {
        result.verdict = Verdict::kUnknown; // no effect of the catalogue takes noise away, or makes another scene
        result.residual_detected = true;
        result.residual_p_value = reported_p_value(std::min({result.residual_p_value, noise_p, frames_p}));
    }
    if (!closed.models.empty()) {
        measure_shrinkage(closed, difference, null, result);
        result.ranking = closed.steps.front().ranking;
        for (const SearchStep &step : closed.steps)
            result.found.push_back(step.ranking.front());
        result.parameters = closed.models.back().parameters;
        for (RankedEffect &found : result.found)
            for (const EffectSetting &effect : closed.models.back().effects)
                if (effect.id == found.effect)
                    found.values = effect.values;
    }
    const Eigen::VectorXd real_values = runner.real().mean(), sim_values = simulated.mean();
    const GapTest &last = closed.models.empty() ? test : closed.models.back().residual;
    std::vector<StatisticShrinkage> shrunk(runner.count());
    if (!closed.models.empty())
        shrunk = shrinkages(runner, closed.models.back(), difference);
    for (Eigen::Index k = 0; k < count; ++k)
        result.places.push_back({runner.list()[std::size_t(k)], real_values[k], sim_values[k], test.z[k],
                                 reported_p_value(test.p_adjusted[k]), last.z[k], shrunk[std::size_t(k)]});
    if (noise.excess) {
        std::string dark;
        for (const SequenceLayout &s : captures.real.layout.sequences)
            if (dark.empty() && s.scene == CaptureScene::kDark)
                dark = s.name;
        result.places.push_back({{"sensor", dark, "read_noise", "all", "DN"},
                                 noise.real.read_noise_dn,
                                 noise.sim.read_noise_dn,
                                 noise.z,
                                 reported_p_value(std::min(1.0, noise_p)),
                                 noise.z,
                                 {}});
    }
    std::stable_sort(result.places.begin(), result.places.end(),
                     [](const GapPlace &a, const GapPlace &b) { return std::abs(a.z) > std::abs(b.z); });
    add_notes(captures, *comparison, result);
    if (options.evidence) {
        const EffectSettings effects = closed.models.empty() ? EffectSettings{} : closed.models.back().effects;
        result.evidence = std::make_shared<const Evidence>(collect_evidence(
            runner, effects.empty() ? 2 : 3, [&](std::size_t version, std::size_t s, std::uint32_t frame_count) {
                std::vector<std::uint16_t> codes = version == 0   ? captures.real.codes[s]
                                                   : version == 1 ? captures.sim.codes[s]
                                                                  : finished.codes(s, effects, first_seed);
                codes.resize(frame_count * runner.layout().pixel_count());
                return codes;
            }));
    }
    const EffectSettings added = closed.models.empty() ? EffectSettings{} : closed.models.back().effects;
    result.downstream = measure_downstream(
        runner.layout(), own_dots ? &sim_dots : nullptr, added.empty() ? 2 : 3,
        [&](std::size_t version, std::size_t s, std::uint32_t frame_count) {
            std::vector<std::uint16_t> codes = version == 2   ? finished.codes(s, added, first_seed)
                                               : version == 1 ? captures.sim.codes[s]
                                                              : captures.real.codes[s];
            codes.resize(frame_count * runner.layout().pixel_count());
            return codes;
        },
        runner.checkpoint);
    result.comparison = comparison;
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
}

} // namespace clsp
