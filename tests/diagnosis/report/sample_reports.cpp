#include "diagnosis/report/sample_reports.hpp"
#include "measure/downstream.hpp"
#include "measure/evidence.hpp"

#include <limits>

namespace sample {

clsp::CaptureLayout layout(const std::vector<Sequence> &sequences) {
    clsp::CaptureLayout result = clsp::camera_layout(72, 60);
    for (const Sequence &s : sequences) {
        clsp::add_sequence(result, s.name, s.scene, s.moving, s.frames);
        if (s.scene == clsp::CaptureScene::kDots && !result.dots) {
            result.dots = clsp::CaptureDots{2.2, {}};
            for (int y = 6; y < 60; y += 12)
                for (int x = 6; x < 72; x += 12)
                    result.dots->positions_px.push_back({x + 0.3, y - 0.2});
        }
    }
    return result;
}

namespace {

// "Real" frames, from the simulator with effects.
clsp::Capture capture(const std::shared_ptr<clsp::Context> &context, const std::vector<Sequence> &sequences,
                             const clsp::EffectSettings &effects) {
    clsp::Simulator simulator(context, layout(sequences));
    std::vector<clsp::SimulationLevels> levels;
    for (const Sequence &s : sequences)
        levels.push_back({s.scene == clsp::CaptureScene::kDots ? 400.0 : 120.0, 64.0, 4.0});
    return clsp::simulate_capture(simulator, effects, levels, 11);
}

clsp::FittedModel model(clsp::ReplicateRunner &runner, const clsp::EffectSettings &effects) {
    clsp::Replicates replicates;
    replicates.effects = effects;
    replicates.levels = runner.calibrate(effects, std::vector<bool>(runner.layout().sequences.size(), true), nullptr);
    replicates.draws = runner.replicates(effects, replicates.levels, {1, 2, 3, 4, 5, 6, 7, 8}, {});
    clsp::FittedModel result;
    result.effects = effects;
    const auto count = static_cast<Eigen::Index>(runner.count());
    result.model =
        clsp::GapModel(runner, std::move(replicates), 0.02, Eigen::MatrixXd(count, 0), Eigen::VectorXd::Zero(count));
    result.jacobian.resize(count, 0);
    return result;
}

void name_defocus(clsp::DiagnosisResult &result) {
    result.verdict = clsp::Verdict::kNamed;
    result.detected = result.held_out = true;
    result.p_value = 1e-5;
    result.distance = 9.1;
    result.null_95 = 0.6;
    result.effects = {"defocus"};
    result.probability = 0.97;
    clsp::RankedEffect defocus{"defocus", {1.2}}, other{"subsurface_scattering", {2.5, 0.6}};
    defocus.probability = 0.97;
    defocus.distance_after = 0.4;
    other.probability = 0.03;
    other.distance_after = 5.2;
    result.ranking = {defocus, other};
    result.found = {defocus};
    result.parameters = {{"defocus", "waves", 1.2, 1.15, 1.26}};
    result.distance_before = 8.8;
    result.distance_after = 0.4;
    result.fraction = 0.955;
    result.fraction_95 = {0.93, 0.98};
    result.residual_p_value = 0.4;
    result.steps = {{"defocus", 0.4, 0.955}};
}

// Text that would break a page, an attribute, a script or an encoding if it were written as it stands.
constexpr const char *kHostile = "</script><img src=x onerror=alert(1)> & \"quoted\" 'single' \x01 \xff\xfe ü";

} // namespace

Sample with_evidence(const std::shared_ptr<clsp::Context> &context, const std::vector<Sequence> &sequences,
                            bool with_model) {
    const clsp::EffectSettings defocus{{"defocus", {1.2}}};
    Sample sample;
    sample.real = capture(context, sequences, defocus);
    sample.runner = std::make_unique<clsp::ReplicateRunner>(context, sample.real, std::vector<clsp::Hypothesis>(), 1);
    clsp::ReplicateRunner &runner = *sample.runner;
    sample.baseline = model(runner, {});
    if (with_model)
        sample.with_effects = model(runner, defocus);
    const clsp::FittedModel *final = with_model ? &sample.with_effects : nullptr;

    clsp::DiagnosisResult &result = sample.result;
    result.seed = 3;
    result.level = 0.02;
    result.candidates = clsp::candidates({}, {});
    const clsp::GapTest test = sample.baseline.model.test(runner.real());
    std::vector<clsp::StatisticShrinkage> shrunk(runner.count());
    if (with_model)
        shrunk = clsp::statistic_shrinkages(runner, sample.baseline, sample.with_effects);
    for (std::size_t k = 0; k < runner.count(); ++k) {
        const auto i = static_cast<Eigen::Index>(k);
        result.places.push_back({runner.list()[k], runner.real().mean()[i], sample.baseline.model.full().mean()[i],
                                 test.z[i], test.p_adjusted[i], 0.3 * test.z[i], shrunk[k]});
    }
    std::stable_sort(result.places.begin(), result.places.end(), [](const clsp::GapPlace &a, const clsp::GapPlace &b) {
        return std::abs(a.z) > std::abs(b.z);
    });
    result.calibration = {64.1, 4.05, {{"dark", 64.1, 0.0, 0.0}, {"board_moving", 184.2, 120.1, 1.0}}};
    result.datasheet = clsp::measure_datasheet(runner, sample.real, sample.baseline, final, result.seed);
    result.screened = {{"defocus", 0.9, true}, {"glare", 0.3, true}, {"pupil_obstruction", 0.1, false}};
    result.evidence = std::make_shared<const clsp::Evidence>(
        clsp::collect_evidence(runner, sample.real, sample.baseline, final, result.seed));
    result.downstream = clsp::measure_downstream(runner, sample.real, sample.baseline, final, result.seed);
    return sample;
}

std::vector<std::pair<std::string, clsp::DiagnosisResult>> reports(const std::shared_ptr<clsp::Context> &context) {
    using clsp::CaptureScene;
    std::vector<std::pair<std::string, clsp::DiagnosisResult>> all;

    clsp::DiagnosisResult named = with_evidence(context,
                                                {{"dark", CaptureScene::kDark, false, 4},
                                                 {"board_moving", CaptureScene::kBoard, true, 4},
                                                 {"dots_static", CaptureScene::kDots, false, 4},
                                                 {"dots_moving", CaptureScene::kDots, true, 6}},
                                                true)
                                      .result;
    name_defocus(named);
    all.emplace_back("named", named);

    clsp::DiagnosisResult ambiguous = named;
    ambiguous.verdict = clsp::Verdict::kAmbiguous;
    ambiguous.equivalent = {"defocus", "subsurface_scattering"};
    ambiguous.ranking[0].probability = ambiguous.probability = 0.55;
    ambiguous.ranking[1].probability = 0.45;
    all.emplace_back("ambiguous", ambiguous);

    clsp::DiagnosisResult none = with_evidence(context, {{"board", CaptureScene::kBoard, false, 4}}, false).result;
    none.judged = {"dark", "flat"};
    none.left_out = {"board_static"};
    none.untested_effects = {"defocus", "glare"};
    none.untested_topics = {"motion during the exposure"};
    all.emplace_back("none_without_dots", none);

    clsp::DiagnosisResult unknown = none;
    unknown.verdict = clsp::Verdict::kUnknown;
    unknown.detected = unknown.residual_detected = true;
    unknown.p_value = 0.0;
    unknown.distance = std::numeric_limits<double>::infinity();
    unknown.places[0].statistic.name = kHostile;
    unknown.places[0].statistic.sequence = kHostile;
    unknown.places[0].z = std::numeric_limits<double>::quiet_NaN();
    unknown.places[1].z = 400.0;
    unknown.notes = {kHostile, "second note"};
    unknown.effects = {kHostile};
    unknown.candidates.push_back({kHostile, "optics", kHostile, {{kHostile, kHostile, 0, 1, 0, 1}}});
    unknown.ranking = {{kHostile, {0.5}}};
    unknown.found = unknown.ranking;
    unknown.screened = {{kHostile, 0.5, true}};
    unknown.datasheet.quantities[0].sequence = unknown.datasheet.quantities[0].name = kHostile;
    unknown.steps = {{kHostile, 3.0, 0.1}};
    unknown.parameters = {{kHostile, kHostile, 0.5, 0.4, 0.6}};
    auto evidence = std::make_shared<clsp::Evidence>(*unknown.evidence);
    evidence->sequences[0].name = kHostile;
    unknown.evidence = evidence;
    all.emplace_back("unknown_hostile_names", unknown);

    clsp::DiagnosisResult single =
        with_evidence(context, {{"flat", CaptureScene::kFlat, false, 1}, {"dots", CaptureScene::kDots, true, 1}}, false)
            .result;
    single.verdict = clsp::Verdict::kUnknown;
    single.detected = true;
    all.emplace_back("single_frames", single);

    clsp::DiagnosisResult unlit = none;
    unlit.judged = {"dark"};
    unlit.no_light_judged = true;
    all.emplace_back("unlit", unlit);

    clsp::DiagnosisResult bare;
    bare.notes = {"nothing could be measured"};
    all.emplace_back("bare", bare);
    return all;
}

} // namespace sample
