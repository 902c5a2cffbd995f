#include "report/report_json.hpp"

#include "report/comparison_report.hpp"
#include "report/advice.hpp"
#include "report/emva_report.hpp"
#include "report/explanations.hpp"
#include "report/paste.hpp"
#include "io/json_text.hpp"
#include "measure/credibility.hpp"
#include "measure/verdict.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace clsp {

using image_io::JsonText;

namespace {

JsonText calibration_json(const CalibrationResult &calibration) {
    JsonText sequences = JsonText::array();
    for (const SequenceLight &light : calibration.light)
        sequences.push_back({{"name", light.sequence},
                             {"mean_dn", light.mean_dn},
                             {"light_dn", light.light_dn},
                             {"share", light.share}});
    return {{"black_level_dn", calibration.black_level_dn},
            {"read_noise_dn", calibration.read_noise_dn},
            {"sequences", sequences}};
}

JsonText illumination_json(const LabLights &found) {
    JsonText lights = JsonText::array();
    for (const LabLight &light : found.lights)
        lights.push_back({{"light", light.name},
                          {"sequences", light.sequences},
                          {"uneven", !light.light.coefficients.empty()},
                          {"p_value", std::max(light.p_value, 1e-300)},
                          {"slope_x", light.slope[0]},
                          {"slope_x_error", light.slope_error[0]},
                          {"slope_y", light.slope[1]},
                          {"slope_y_error", light.slope_error[1]},
                          {"corner_loss", light.corner_loss},
                          {"corner_loss_error", light.corner_loss_error}});
    JsonText drifts = JsonText::array();
    for (const LampDrift &drift : found.drifts)
        drifts.push_back({{"sequence", drift.sequence}, {"deviation", drift.deviation}});
    return {{"lights", lights},
            {"lamp_drifts", drifts},
            {"shared_corner_loss", found.shared_corner_loss},
            {"shared_corner_loss_error", found.shared_corner_loss_error},
            {"shared_slope", {found.shared_slope[0], found.shared_slope[1]}},
            {"lens_or_light", found.lens_or_light}};
}

// What is not known is null, and no_interval says why.
void add_shrinkage(const GapPlace &place, const DiagnosisResult &result, JsonText &entry) {
    const StatisticShrinkage &shrink = place.shrink;
    const bool has_part = shrink.held_out && shrink.beyond_chance;
    entry["distance_before"] = shrink.held_out ? JsonText(shrink.before) : JsonText(nullptr);
    entry["distance_after"] = shrink.held_out ? JsonText(shrink.after) : JsonText(nullptr);
    entry["fraction"] = has_part ? JsonText(shrink.fraction) : JsonText(nullptr);
    entry["ci95"] = has_part ? JsonText{shrink.fraction_95[0], shrink.fraction_95[1]} : JsonText(nullptr);
    if (const std::string reason = why_no_interval(place, result); !reason.empty())
        entry["no_interval"] = reason;
}

JsonText place_json(const GapPlace &place, const DiagnosisResult &result) {
    JsonText entry = {{"stage", place.statistic.stage},
                  {"sequence", place.statistic.sequence},
                  {"statistic", place.statistic.name},
                  {"region", place.statistic.region},
                  {"unit", place.statistic.unit},
                  {"real", place.real},
                  {"sim", place.sim},
                  {"z", place.z},
                  {"p_adjusted", place.p_adjusted},
                  {"z_after", place.z_after}};
    add_shrinkage(place, result, entry);
    return entry;
}

void add_version(const char *name, const QuantityMean &value, JsonText &entry) {
    entry[name] = value.mean;
    if (std::isfinite(value.deviation))
        entry[std::string(name) + "_deviation"] = value.deviation;
}

JsonText transfer_json(const char *version, const PhotonTransfer &transfer) {
    JsonText points = JsonText::array();
    for (const TransferPoint &point : transfer.points)
        points.push_back({{"sequence", point.sequence},
                          {"signal_dn", point.signal_dn},
                          {"variance_dn2", point.variance_dn2},
                          {"variance_error_dn2", point.variance_error_dn2}});
    const auto fitted = [&](double value) { return transfer.fitted ? JsonText(value) : JsonText(nullptr); };
    return {{"version", version},
            {"points", points},
            {"system_gain_dn_per_electron", fitted(transfer.gain_dn_per_electron)},
            {"system_gain_error", fitted(transfer.gain_error)},
            {"intercept_dn2", fitted(transfer.intercept_dn2)},
            {"intercept_error", fitted(transfer.intercept_error)}};
}

JsonText datasheet_json(const DatasheetQuantities &datasheet) {
    constexpr const char *kVersions[] = {"real", "sim", "sim_with_effects"};
    JsonText quantities = JsonText::array(), transfer = JsonText::array();
    for (const DatasheetQuantity &quantity : datasheet.quantities) {
        JsonText entry = {{"sequence", quantity.sequence.empty() ? JsonText(nullptr) : JsonText(quantity.sequence)},
                      {"quantity", quantity.name},
                      {"unit", quantity.unit}};
        for (std::size_t v = 0; v < quantity.versions.size(); ++v)
            add_version(kVersions[v], quantity.versions[v], entry);
        quantities.push_back(entry);
    }
    for (std::size_t v = 0; v < datasheet.transfer.size(); ++v)
        transfer.push_back(transfer_json(kVersions[v], datasheet.transfer[v]));
    return {{"simulated_captures", datasheet.simulated_captures},
            {"quantities", quantities},
            {"photon_transfer", transfer}};
}

JsonText part_json(const JudgedPart &part) {
    JsonText used = JsonText::array();
    for (const JudgedPart::Sequence &sequence : part.sequences) {
        JsonText runs = JsonText::array();
        for (const FrameRun &run : sequence.runs)
            runs.push_back({{"first", run.first}, {"count", run.count}});
        used.push_back({{"sequence", sequence.name},
                        {"frames", sequence.frames()},
                        {"of", sequence.frame_count},
                        {"runs", runs},
                        {"x", part.window.x},
                        {"y", part.window.y},
                        {"width", part.window.width},
                        {"height", part.window.height}});
    }
    return used;
}

JsonText credibility_json(const DatasheetQuantities &datasheet) {
    constexpr const char *kVersions[] = {"sim", "sim_with_effects"};
    JsonText rows = JsonText::array();
    for (const CredibilityRow &row : credibility(datasheet)) {
        JsonText entry = {{"sequence", row.sequence.empty() ? JsonText(nullptr) : JsonText(row.sequence)},
                      {"quantity", row.quantity},
                      {"unit", row.unit}};
        for (std::size_t v = 0; v < row.versions.size(); ++v)
            entry[kVersions[v]] = {{"area_metric", row.versions[v].area},
                                   {"bias", row.versions[v].bias},
                                   {"scatter", row.versions[v].scatter}};
        rows.push_back(entry);
    }
    return rows;
}

JsonText acceptance_json(const std::vector<AcceptanceRow> &rows) {
    constexpr const char *kVersions[] = {"sim", "sim_with_effects"};
    JsonText result = JsonText::array();
    for (const AcceptanceRow &row : rows) {
        const Measurable &of = row.of;
        JsonText entry = {{"sequence", of.sequence.empty() ? JsonText(nullptr) : JsonText(of.sequence)},
                      {of.is_statistic ? "statistic" : "quantity", of.name}};
        if (of.is_statistic)
            entry["region"] = of.region;
        entry["unit"] = of.unit;
        entry["real"] = of.real;
        entry["tolerance"] = row.tolerance;
        for (std::size_t v = 0; v < row.versions.size(); ++v) {
            const JudgedDifference &judged = row.versions[v];
            entry[kVersions[v]] = {{"difference", judged.difference},
                                   {"ci95", {judged.interval_95[0], judged.interval_95[1]}},
                                   {"acceptance", acceptance_name(judged.acceptance)}};
        }
        result.push_back(std::move(entry));
    }
    return result;
}

JsonText ranked_json(const RankedEffect &ranked, const std::vector<Candidate> &all,
                     const std::vector<FittedParameter> &fitted) {
    JsonText parameters = JsonText::object(), intervals = JsonText::object();
    const auto candidate =
        std::find_if(all.begin(), all.end(), [&](const Candidate &c) { return c.id == ranked.effect; });
    for (std::size_t p = 0; candidate != all.end() && p < ranked.values.size(); ++p)
        parameters[candidate->parameters[p].name] = ranked.values[p];
    for (const FittedParameter &parameter : fitted)
        if (parameter.effect == ranked.effect) {
            parameters[parameter.name] = parameter.value;
            intervals[parameter.name] = {parameter.low, parameter.high};
        }
    return {{"effect", ranked.effect},
            {"parameters", parameters},
            {"intervals", intervals},
            {"probability", ranked.probability},
            {"distance_after", ranked.distance_after},
            {"gain", ranked.gain}};
}

// Which distance is measured in what: they differ, so that one must not be subtracted from another.
JsonText scales() {
    return {
        {"gap.distance",
         "root of the mean square of all statistics' deviations beyond what chance gives; whole capture against the "
         "baseline, in standard deviations of the baseline"},
        {"cause.ranking.distance_after",
         "the same of the whole capture against the baseline with the effect, in standard deviations of "
         "that model, along no fitted direction; 0: not beyond chance"},
        {"shrink.distance_before",
         "of halves of the capture against the baseline, in standard deviations of halves simulated with all "
         "effects found, which are the scale of distance_after too"},
        {"shrink.fraction",
         "1 - distance_after / distance_before. A right model keeps a distance_after above 0 in about half of all "
         "captures, since chance fluctuates about its mean: less than 1 is no defect where residual_detected is "
         "false, and ci95 covers it"},
        {"p", "p_value, p_adjusted and residual_p_value are never 0: tails are those of Student's and of a Gamma law, "
              "and what is below 1e-300 is given as 1e-300"}};
}

} // namespace

const char *verdict_name(Verdict verdict) {
    switch (verdict) {
    case Verdict::kNone:
        return "none";
    case Verdict::kNamed:
        return "named";
    case Verdict::kAmbiguous:
        return "ambiguous";
    case Verdict::kUnknown:
        break;
    }
    return "unknown";
}

std::string report_json(const DiagnosisResult &result) {
    JsonText report = {{"format", "clspeckle-gap-report"}, {"version", 1}};
    report["gap"] = {{"detected", result.detected},
                     {"p_value", result.p_value},
                     {"distance", result.distance},
                     {"null_95", result.null_95},
                     {"level", result.level}};
    JsonText changes = JsonText::array();
    for (const CaptureWarning &change : result.frame_changes)
        changes.push_back({{"sequence", change.sequence}, {"text", change.text}});
    report["gap"]["frame_changes"] = changes;
    JsonText where = JsonText::array(), all = JsonText::array();
    for (const GapPlace &place : result.places) {
        all.push_back(place_json(place, result));
        if (place.p_adjusted <= result.level)
            where.push_back(all.back());
    }
    // A gap of many small deviations has no single significant one: the largest are shown.
    if (result.detected && where.empty())
        for (std::size_t i = 0; i < std::min<std::size_t>(5, all.size()); ++i)
            where.push_back(all[i]);
    report["where"] = where;
    JsonText ranking = JsonText::array();
    const auto add_ranked = [&](const RankedEffect &ranked) {
        ranking.push_back(ranked_json(ranked, result.candidates, result.parameters));
        ranking.back()["conditional"] = is_conditional(ranked.effect, result.rungs);
    };
    for (const RankedEffect &ranked : result.ranking)
        add_ranked(ranked);
    // Later effects of a set have been ranked in steps of their own; all that were found are listed with their
    // parameters.
    for (const RankedEffect &ranked : result.found)
        if (std::none_of(result.ranking.begin(), result.ranking.end(),
                         [&](const RankedEffect &other) { return other.effect == ranked.effect; }))
            add_ranked(ranked);
    report["cause"] = {{"verdict", verdict_name(result.verdict)},
                       {"effects", result.effects},
                       {"probability", result.probability},
                       {"equivalent", result.equivalent},
                       {"ranking", ranking}};
    if (!result.rungs.empty()) {
        JsonText rungs = JsonText::array();
        for (const RungResult &rung : result.rungs)
            rungs.push_back({{"rung", scene_name(rung.scene)},
                             {"verdict", verdict_name(rung.verdict)},
                             {"effects", rung.effects},
                             {"p_value", reported_p_value(rung.p_value)},
                             {"residual_p_value", reported_p_value(rung.residual_p_value)},
                             {"distance_before", rung.distance_before},
                             {"distance_after", rung.distance_after}});
        report["cause"]["rungs"] = rungs;
    }
    if (!result.comparison) {
        JsonText looks = JsonText::array();
        for (const ScreenedEffect &look : result.screened)
            looks.push_back({{"effect", look.effect}, {"share", look.share}, {"fitted", look.fitted}});
        report["cause"]["screening"] = looks;
    }
    JsonText steps = JsonText::array(), per_statistic = JsonText::array();
    for (const ShrinkStep &step : result.steps)
        steps.push_back(
            {{"effect", step.effect}, {"distance_after", step.distance_after}, {"fraction", step.fraction}});
    for (const GapPlace &place : result.places) {
        per_statistic.push_back({{"sequence", place.statistic.sequence},
                                 {"statistic", place.statistic.name},
                                 {"region", place.statistic.region},
                                 {"z_before", place.z},
                                 {"z_after", place.z_after}});
        add_shrinkage(place, result, per_statistic.back());
    }
    report["shrink"] = {{"distance_before", result.distance_before},
                        {"distance_after", result.distance_after},
                        {"fraction", result.fraction},
                        {"ci95", {result.fraction_95[0], result.fraction_95[1]}},
                        {"held_out", result.held_out},
                        {"residual_detected", result.residual_detected},
                        {"residual_p_value", result.residual_p_value},
                        {"steps", steps},
                        {"per_statistic", per_statistic}};
    if (result.downstream.valid)
        report["shrink"]["downstream"] = {{"dot_centre_rms_px",
                                           {{"real", result.downstream.real},
                                            {"before", result.downstream.before},
                                            {"after", result.downstream.after}}},
                                          {"depth_error_mm",
                                           {{"real", result.downstream.depth_error_mm_real},
                                            {"before", result.downstream.depth_error_mm_before},
                                            {"after", result.downstream.depth_error_mm_after}}},
                                          {"depth_assumption", result.downstream.depth_assumption}};
    JsonText advice = JsonText::array();
    for (const Advice &item : advice_for(result.equivalent))
        advice.push_back({{"separates", item.separates}, {"capture", item.capture}});
    report["advice"] = advice;
    report["coverage"] = {{"statistics", result.places.size()},
                          {"sequences", result.judged},
                          {"left_out", result.left_out},
                          {"effects_not_visible", result.untested_effects},
                          {"questions_open", result.untested_topics},
                          {"judged", !result.no_light_judged}};
    if (result.part)
        report["coverage"]["used"] = part_json(*result.part);
    if (!result.calibration.light.empty()) {
        report["calibration"] = calibration_json(result.calibration);
        if (!result.calibration_after.light.empty())
            report["calibration"]["with_effects"] = calibration_json(result.calibration_after);
        report["calibration"]["illumination"] = illumination_json(result.illumination);
    }
    if (!result.comparison) {
        report["measurements"] = datasheet_json(result.datasheet);
        report["credibility"] = credibility_json(result.datasheet);
        if (!result.acceptance.empty())
            report["acceptance"] = acceptance_json(result.acceptance);
    }
    if (result.emva)
        report["emva1288"] = emva_json(*result.emva);
    if (!result.comparison)
        report["search"] = {{"work_captures", result.work_captures}, {"ended_early", result.ended_early}};
    if (result.profile) {
        const PasteTexts paste = paste_texts(*result.profile);
        report["paste"] = {{"command_line", paste.command_line}, {"python", paste.python}, {"c", paste.c}};
    }
    report["scales"] = scales();
    if (result.comparison)
        report["compare"] = comparison_json(*result.comparison);
    report["notes"] = result.notes;
    report["seed"] = result.seed;
    return report.text(1);
}

} // namespace clsp
