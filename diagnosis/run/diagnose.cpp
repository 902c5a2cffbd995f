#include "run/diagnose.hpp"

#include "capture/capture_check.hpp"
#include "capture/exposure_series.hpp"
#include "capture/frame_changes.hpp"
#include "effects/effects.hpp"
#include "inference/ladder.hpp"
#include "inference/shrinkage.hpp"
#include "inference/thresholds.hpp"
#include "measure/camera_profile.hpp"
#include "measure/downstream.hpp"
#include "measure/emva1288.hpp"
#include "measure/evidence.hpp"
#include "measure/gap_stages.hpp"
#include "measure/verdict.hpp"
#include "run/judgeable.hpp"
#include "runtime/error.hpp"
#include "statistics/distributions.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/core.h>
#include <iterator>
#include <set>
#include <thread>
#include <utility>

namespace clsp {
namespace {

// Of light that falls off towards the corners, in a capture of lamp light or of laser light alone.
constexpr const char *kUnevenLight = "uneven_illumination";
bool dims_corners(const std::string &effect) {
    return in_catalogue(effect) && find_effect(effect).dims_corners;
}

// The stage of the effect that imitates most of an unknown cause; empty if none does.
std::string alike_stage(const DiagnosisResult &result) {
    double before = 0.0, most = kNaming.imitation;
    std::string stage;
    for (const ShrinkStep &step : result.steps) {
        if (step.fraction - before >= most) {
            most = step.fraction - before;
            stage = std::find_if(result.candidates.begin(), result.candidates.end(), [&](const Candidate &c) {
                        return c.id == step.effect;
                    })->stage;
        }
        before = std::max(before, step.fraction);
    }
    return stage;
}

// What lamp and laser share of their fall-off, no statistic tells from the lens's.
void widen_fall_off(std::vector<FittedParameter> &parameters, double deviation, double degrees_of_freedom) {
    const double of_lights = student_two_sided_quantile(0.05, degrees_of_freedom) * deviation;
    for (FittedParameter &one : parameters)
        if (dims_corners(one.effect)) {
            one.low = std::max(0.0, one.value - std::hypot(one.value - one.low, of_lights));
            one.high = std::min(1.0, one.value + std::hypot(one.high - one.value, of_lights));
        }
}

// By an effect, in standard deviations of the baseline: those of a model hold what its effects scatter themselves.
Eigen::VectorXd moved_by(const SearchResult &found, std::size_t step) {
    const Covariance &baseline = found.baseline.model.full();
    const Covariance &before = step ? found.models[step - 1].model.full() : baseline;
    return (found.models[step].model.full().mean() - before.mean()).cwiseQuotient(baseline.deviation());
}

std::uint32_t pool_seeds_of(const Capture &capture) {
    double pixels = 0.0;
    for (const std::vector<std::uint16_t> &codes : capture.codes)
        pixels += static_cast<double>(codes.size()) / static_cast<double>(capture.codes.size());
    return static_cast<std::uint32_t>(
        std::clamp(std::ceil(kNaming.usual_pixels / pixels), kNaming.least_seeds, kNaming.most_seeds));
}

// Numbers of the sequences that can be judged; notes say what cannot, and why.
std::vector<std::size_t> judgeable(const Capture &capture, const CaptureSummary &summary, DiagnosisResult &result) {
    std::vector<std::size_t> judged;
    for (std::size_t s = 0; s < capture.layout.sequences.size(); ++s) {
        const std::string &name = capture.layout.sequences[s].name;
        if (const std::string reason = why_not_judged(capture.layout, summary, s); !reason.empty()) {
            result.left_out.push_back(name);
            result.notes.push_back(left_out_note(name, reason));
            continue;
        }
        result.judged.push_back(name);
        judged.push_back(s);
    }
    return judged;
}

// What is judged of those sequences.
Capture judged_part(const Capture &capture, const std::vector<std::size_t> &sequences, const PartChoice &choice,
                    DiagnosisResult &result) {
    CaptureLayout layout = capture.layout;
    layout.sequences.clear();
    for (const std::size_t s : sequences)
        layout.sequences.push_back(capture.layout.sequences[s]);
    const JudgedPart part = choose_part(layout, choice);
    if (!part.is_whole()) {
        result.part = part;
        result.notes.push_back(
            fmt::format("judged were {}: they have the power that a verdict needs. Levels, saturation and "
                        "changes between frames are those of all; --window and --frames choose "
                        "otherwise",
                        part_text(part)));
    }
    return take_part(capture, sequences, layout.sequences, part);
}

bool in_memory(const Capture &capture) {
    return std::none_of(capture.stored.begin(), capture.stored.end(), [](const auto &stored) { return bool(stored); });
}

// What cannot be told from the sequences that stay: questions that they do not answer, effects that cannot show in
// them. Such effects leave the pool: what they do to the few statistics that there are, others do as well, and a
// verdict would name what the same report says to be out of sight.
void leave_untested(const CaptureLayout &layout, const std::vector<SequenceSummary> &sequences,
                    std::vector<Candidate> &pool, DiagnosisResult &result) {
    for (const CaptureAbility &ability : capture_abilities(layout, sequences))
        if (!ability.can) {
            result.untested_topics.push_back(ability.topic);
            result.notes.push_back(fmt::format("cannot be told: {} ({})", ability.topic, ability.reason));
        }
    std::string unseen;
    for (const EffectVisibility &effect : effect_visibilities(layout)) {
        const auto candidate =
            std::find_if(pool.begin(), pool.end(), [&](const Candidate &c) { return c.id == effect.id; });
        if (candidate == pool.end() || !effect.sequences.empty())
            continue;
        pool.erase(candidate);
        result.untested_effects.push_back(effect.id);
        unseen += (unseen.empty() ? "" : ", ") + effect.id;
    }
    if (!unseen.empty())
        result.notes.push_back("these effects cannot show in this capture: " + unseen);
}

// Whether there is a sequence of each scene, of laser light a resting and a moving one.
bool has_every_kind(const CaptureLayout &layout) {
    std::set<std::pair<CaptureScene, bool>> kinds;
    for (const SequenceLayout &sequence : layout.sequences)
        kinds.emplace(sequence.scene, sequence.moving);
    return kinds.size() >= 6;
}

CalibrationResult calibration_of(const ReplicateRunner &runner, const CalibratedLevels &levels) {
    CalibrationResult result{levels.black_level_dn, levels.read_noise_dn, {}};
    for (std::size_t s = 0; s < runner.layout().sequences.size(); ++s) {
        const SequenceLayout &sequence = runner.layout().sequences[s];
        SequenceLight light{sequence.name, runner.real_level(s).mean_dn, 0.0, 0.0};
        if (sequence.scene != CaptureScene::kDark) {
            light.share = levels.signal_share[s];
            light.light_dn = light.share * std::max(0.0, light.mean_dn - runner.real_calibration().black_level_dn);
        }
        result.light.push_back(light);
    }
    return result;
}

// Each scene by itself: what differs, which effects take away something of it, and what they leave.
std::vector<RungResult> rung_results(const ReplicateRunner &runner, const SearchResult &found,
                                     const std::vector<bool> &slight, double level, double residual_level) {
    std::vector<RungResult> results;
    std::vector<double> most(found.models.size());
    std::vector<std::size_t> own_rung(found.models.size());
    const FittedModel &last = found.last();
    const std::vector<Rung> rungs = rungs_of(runner.layout());
    const double count = double(rungs.size()); // Bonferroni over them
    for (const Rung &rung : rungs) {
        RungResult result;
        result.scene = rung.scene;
        const GapTest before = found.baseline.model.test(runner.real(), rung.sequences);
        const GapTest after = last.model.test(runner.real(), rung.sequences);
        result.p_value = std::min(1.0, count * before.p_value);
        result.distance_before = before.distance;
        result.residual_p_value = std::min(1.0, count * after.p_value);
        result.distance_after = after.distance;
        std::vector<bool> statistics(runner.count());
        for (std::size_t s = 0; s < rung.sequences.size(); ++s)
            std::fill(statistics.begin() + std::ptrdiff_t(runner.begin(s)),
                      statistics.begin() + std::ptrdiff_t(runner.end(s)), bool(rung.sequences[s]));
        // What others' parameters did when the effect came is none of its doing.
        const auto acts_on = [&](const std::string &id) {
            std::vector<bool> result_of = statistics;
            for (std::size_t s = 0; s < rung.sequences.size(); ++s)
                if (!runner.simulator().concerns(id, s))
                    std::fill(result_of.begin() + std::ptrdiff_t(runner.begin(s)),
                              result_of.begin() + std::ptrdiff_t(runner.end(s)), false);
            return result_of;
        };
        for (std::size_t i = 0; i < found.models.size(); ++i)
            if (const std::string &id = found.steps[i].added; !slight[i]) {
                const double moved = most_moved(moved_by(found, i), acts_on(id));
                if (moved > 0.0)
                    result.effects.push_back(id);
                if (moved > most[i]) {
                    most[i] = moved;
                    own_rung[i] = results.size();
                }
            }
        if (result.p_value <= level || !result.effects.empty())
            result.verdict = result.residual_p_value <= residual_level || result.effects.empty() ? Verdict::kUnknown
                                                                                                 : Verdict::kNamed;
        results.push_back(std::move(result));
    }
    for (std::size_t i = 0; i < most.size(); ++i)
        if (most[i] > 0.0)
            results[own_rung[i]].own.push_back(found.steps[i].added);
    return results;
}

// What a tolerance may be for.
std::vector<Measurable> measurables(const ReplicateRunner &runner, const Capture &capture) {
    std::vector<Measurable> result;
    const std::vector<DatasheetQuantity> quantities = camera_quantities(runner, capture);
    for (std::size_t q = 0; q < quantities.size(); ++q)
        if (const double real = quantities[q].versions.front().mean; std::isfinite(real))
            result.push_back({false, quantities[q].sequence, quantities[q].name, "", quantities[q].unit, real, q});
    const Eigen::VectorXd real = runner.real().mean();
    for (std::size_t k = 0; k < runner.count(); ++k) {
        const StatisticInfo &of = runner.list()[k];
        result.push_back({true, of.sequence, of.name, of.region, of.unit, real[static_cast<Eigen::Index>(k)], k});
    }
    return result;
}

// models: of the baseline, and with effects if there are any.
void judge(std::vector<AcceptanceRow> &rows, const DatasheetQuantities &datasheet,
           const std::vector<const GapModel *> &models, double null_replicates) {
    for (AcceptanceRow &row : rows)
        for (std::size_t v = 0; v < models.size(); ++v) {
            const auto k = static_cast<Eigen::Index>(row.of.index);
            QuantityMean simulated;
            if (row.of.is_statistic) {
                const Covariance &full = models[v]->full(); // without the model's own error, which is what is judged
                const double own = full.tolerance()[k], all = full.deviation()[k];
                simulated = {full.mean()[k], std::sqrt(std::max(0.0, all * all - own * own))};
            } else {
                simulated = datasheet.quantities[row.of.index].versions[v + 1];
            }
            row.versions.push_back(judge_difference(
                row.of.real, simulated.mean, simulated.deviation,
                row.of.is_statistic ? null_replicates : double(datasheet.simulated_captures), row.tolerance));
        }
}

// Of the progress.
constexpr double kOfRungsBelow = 0.15;

} // namespace

DiagnosisResult diagnose(std::shared_ptr<Context> context, const Capture &given, const DiagnosisOptions &options) {
    const auto start = std::chrono::steady_clock::now();
    const unsigned threads = options.threads ? options.threads : std::max(1u, std::thread::hardware_concurrency());
    std::vector<Candidate> pool = candidates(options.hypotheses, options.without);
    const Tolerances tolerances =
        options.tolerance_file.empty() ? Tolerances() : read_tolerances(options.tolerance_file);
    const CaptureSummary summary = summarize_capture(given);
    DiagnosisResult result;
    for (const CaptureWarning &warning : summary.warnings)
        result.notes.push_back(warning.sequence.empty() ? warning.text : warning.sequence + ": " + warning.text);
    const std::vector<std::size_t> judged = judgeable(given, summary, result);
    if (judged.empty()) {
        std::string reasons;
        for (const std::string &note : result.notes)
            if (note.find(" was left out: ") != std::string::npos)
                reasons += (reasons.empty() ? "" : "; ") + note;
        throw Error(Status::kInvalidData,
                    fmt::format("no sequence of the capture can be judged: {}. Check that the files belong to the "
                                "scenes that capture.json names, and record again with another exposure",
                                reasons));
    }
    Capture capture = judged_part(given, judged, options.part, result);
    std::vector<SequenceSummary> kept;
    for (const std::size_t s : judged)
        kept.push_back(summary.sequences[s]);
    const auto has_lit = [](const CaptureLayout &layout) {
        return std::any_of(layout.sequences.begin(), layout.sequences.end(),
                           [](const SequenceLayout &s) { return s.scene != CaptureScene::kDark; });
    };
    result.no_light_judged = has_lit(given.layout) && !has_lit(capture.layout);
    leave_untested(capture.layout, kept, pool, result);
    result.illumination = measure_lab_lights(capture);
    // What a hypothesis may be there to explain is not calibrated away.
    if (std::any_of(options.hypotheses.begin(), options.hypotheses.end(),
                    [](const Hypothesis &h) { return h.point != HypothesisPoint::kCodes; }))
        leave_uncalibrated(result.illumination);
    // A lamp drifts in a lab; one that steps makes another scene.
    std::vector<LampDrift> &lamp = result.illumination.drifts;
    for (const SequenceChange &change : summary.frame_changes)
        if (!change.level_drifts)
            lamp.erase(std::remove_if(lamp.begin(), lamp.end(),
                                      [&](const LampDrift &drift) { return drift.sequence == change.sequence; }),
                       lamp.end());
    set_illumination(result.illumination, capture.layout);
    std::vector<double> light_dn;
    for (const SequenceSummary &sequence : kept)
        light_dn.push_back(sequence.level_above_dark_dn);
    const ExposureSeries series = exposure_series(capture.layout, light_dn);
    for (const std::size_t s : series.flats)
        capture.layout.sequences[s].light_error = series.light_error;
    ReplicateRunner runner(context, capture, options.hypotheses, threads);
    if (!tolerances.entries.empty())
        result.acceptance = acceptance_rows(tolerances, measurables(runner, capture));
    scale_to_camera(pool, capture.layout, runner.real_calibration().read_noise_dn);
    hold_at_quantities(pool, pattern_quantities(capture, runner.real_calibration(), threads));
    std::string doing;
    double fraction = 0.0;
    const auto tell = [&] {
        if (options.progress && !options.progress(doing, fraction))
            throw Error(Status::kCancelled, "the diagnosis was cancelled by its progress callback");
    };
    runner.checkpoint = tell;
    SearchOptions search_options;
    const std::uint64_t first_seed = seed_of_draws(options.seed);
    search_options.seed = first_seed;
    search_options.pool_seeds = pool_seeds_of(capture);
    search_options.most_work *= search_options.pool_seeds / kNaming.least_seeds;
    search_options.null_replicates = options.null_replicates;
    search_options.max_effects = options.max_effects;
    // With fewer kinds of sequences more effects are confusable, and simulations take less time.
    if (!has_every_kind(capture.layout))
        search_options.refined *= 2;
    search_options.level = options.level;
    search_options.residual_level = 0.25 * options.level;
    const std::vector<Candidate> tried = with_alternatives(pool);
    std::vector<const Candidate *> all;
    for (const Candidate &candidate : tried)
        all.push_back(&candidate);
    // The rungs below take a part of the progress.
    const auto report_from = [&](double begin) {
        return [&, begin](const std::string &what, double part) {
            doing = what;
            fraction = std::max(fraction, begin > 0.0 ? begin + (1.0 - begin) * part : kOfRungsBelow * part);
            tell();
        };
    };
    const SearchStart below =
        climb(context, capture, options.hypotheses, tried, runner, threads, search_options, report_from(0.0));
    const SearchResult found = search(runner, all, below, search_options, report_from(kOfRungsBelow));

    result.seed = options.seed;
    result.level = options.level;
    result.candidates = pool;
    const GapTest &test = found.baseline.residual;
    // Halves of a sequence that changes half way are alike; its frames are not.
    for (const SequenceChange &change : summary.frame_changes) {
        const bool calibrated = change.level_drifts &&
                                std::any_of(lamp.begin(), lamp.end(),
                                            [&](const LampDrift &drift) { return drift.sequence == change.sequence; });
        // A sequence that is left out for its frames without light is no reason to find no gap.
        const bool counts = change.kind == kFramesWithoutLight ||
                            std::count(result.judged.begin(), result.judged.end(), change.sequence) > 0;
        if (!calibrated && counts)
            result.frame_changes.push_back(change);
    }
    const bool steady = result.frame_changes.empty();
    const auto with_changes = [&](double p) { return steady ? p : std::min(p, kChanceOfFrameChange); };
    result.detected = test.detected || !steady;
    result.p_value = with_changes(reported_p_value(test.p_value));
    result.distance = test.distance;
    result.null_95 = test.null_95;
    const FittedModel &last = found.last();
    result.calibration = calibration_of(runner, found.baseline.model.replicates().levels);
    if (!found.models.empty())
        result.calibration_after = calibration_of(runner, last.model.replicates().levels);
    const Eigen::VectorXd real = runner.real().mean();
    std::vector<StatisticShrinkage> shrunk(runner.count());
    if (result.detected && !found.models.empty())
        shrunk = statistic_shrinkages(runner, found.baseline, last);
    for (std::size_t k = 0; k < runner.count(); ++k)
        result.places.push_back({runner.list()[k], real[k], found.baseline.model.full().mean()[k], test.z[k],
                                 reported_p_value(test.p_adjusted[k]), last.residual.z[k], shrunk[k]});
    std::stable_sort(result.places.begin(), result.places.end(),
                     [](const GapPlace &a, const GapPlace &b) { return std::abs(a.z) > std::abs(b.z); });
    result.held_out = runner.parted();
    result.screened = found.screened;
    result.work_captures = below.work + found.work;
    result.ended_early = found.ended_early;
    if (found.ended_early)
        result.notes.push_back(fmt::format("the search ended after the work of {:.0f} simulated captures; fewer "
                                           "candidates (--without) leave more for the others",
                                           search_options.most_work));
    const std::vector<bool> slight = slight_effects(found.steps, last.parameters, pool);
    if (result.detected)
        result.rungs = rung_results(runner, found, slight, options.level, search_options.residual_level);
    if (result.detected) {
        // What a scene leaves by itself is left of the whole, too.
        double residual_p_value = last.residual.p_value;
        for (const RungResult &rung : result.rungs)
            residual_p_value = std::min(residual_p_value, rung.residual_p_value);
        result.residual_detected = residual_p_value <= search_options.residual_level || !steady;
        result.residual_p_value = with_changes(reported_p_value(residual_p_value));
        if (!found.models.empty()) {
            result.ranking = found.steps.front().ranking;
            result.parameters = last.parameters;
            widen_fall_off(result.parameters, result.illumination.shared_corner_loss_error,
                           static_cast<double>(last.model.replicates().draws.size()) - 1.0);
            for (std::size_t i = 0; i < found.models.size(); ++i) {
                const Shrinkage s = shrinkage(runner, found.baseline, found.models[i], last);
                result.found.push_back(found.steps[i].ranking.front());
                result.steps.push_back({found.steps[i].added, s.after, s.fraction});
                result.distance_before = s.before;
                result.distance_after = s.after;
                result.fraction = s.fraction;
                result.fraction_95 = s.fraction_95;
            }
        }
        std::vector<bool> passed_over = shows_nowhere(found.steps, result.rungs);
        for (std::size_t i = 0; i < found.steps.size(); ++i) {
            passed_over[i] = passed_over[i] || slight[i];
            if (passed_over[i])
                result.notes.push_back(fmt::format(
                    "{} was fitted, too, but is not named: {}", found.steps[i].added,
                    slight[i] ? std::string("it is far weaker than the catalogue has it, and beside stronger effects "
                                            "so little may be the simulator's error")
                              : fmt::format("it moves no statistic of a scene that it acts on by more than {:g} "
                                            "standard deviations, which others do",
                                            kNaming.own_statistics)));
        }
        if (result.residual_detected || found.models.empty()) {
            // An effect stands where it shows most: what imitates an unknown cause there may explain a little
            // elsewhere.
            const auto in_explained_rung = [&](const std::string &effect) {
                return std::any_of(result.rungs.begin(), result.rungs.end(), [&](const RungResult &rung) {
                    return rung.verdict == Verdict::kNamed && std::count(rung.own.begin(), rung.own.end(), effect) > 0;
                });
            };
            for (std::size_t i = 0; i < found.models.size(); ++i)
                passed_over[i] = passed_over[i] || !(in_explained_rung(found.steps[i].added) ||
                                                     explained(moved_by(found, i), last.residual.z));
            name_effects(found.steps, passed_over, result);
            result.verdict = Verdict::kUnknown;
            place_stages(runner.layout(), result.places, alike_stage(result));
        } else {
            name_effects(found.steps, passed_over, result);
            std::vector<std::string> either;
            std::copy_if(result.effects.begin(), result.effects.end(), std::back_inserter(either), dims_corners);
            if (result.illumination.lens_or_light && !either.empty()) {
                result.verdict = Verdict::kAmbiguous;
                either.push_back(kUnevenLight);
                for (const std::string &one : either)
                    if (!std::count(result.equivalent.begin(), result.equivalent.end(), one))
                        result.equivalent.push_back(one);
            }
        }
    }
    // A scene with such frames is not explained, whatever its statistics say.
    for (const CaptureWarning &change : result.frame_changes)
        for (const SequenceLayout &sequence : runner.layout().sequences)
            for (RungResult &rung : result.rungs)
                if (sequence.name == change.sequence && sequence.scene == rung.scene) {
                    rung.verdict = Verdict::kUnknown;
                    rung.p_value = with_changes(rung.p_value);
                    rung.residual_p_value = with_changes(rung.residual_p_value);
                }
    const FittedModel *final = found.models.empty() ? nullptr : &found.models.back();
    result.downstream = measure_downstream(runner, capture, found.baseline, final, first_seed);
    result.emva =
        std::make_shared<const Emva1288>(measure_emva1288(in_memory(given) && !result.part ? given : capture));
    result.datasheet = measure_datasheet(runner, capture, found.baseline, final, first_seed);
    const CalibratedLevels &levels = last.model.replicates().levels;
    result.profile = std::make_shared<const CameraProfile>(camera_profile(
        runner, given, result, last.effects, levels, measure_pattern_maps(given, result, last.effects, levels, tell)));
    std::vector<const GapModel *> models = {&found.baseline.model};
    if (final)
        models.push_back(&final->model);
    judge(result.acceptance, result.datasheet, models, double(options.null_replicates));
    if (options.evidence)
        result.evidence =
            std::make_shared<const Evidence>(collect_evidence(runner, capture, found.baseline, final, first_seed));
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
}

} // namespace clsp
