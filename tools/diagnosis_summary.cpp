#include "diagnose.hpp"

#include "effects.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tools {

namespace {

constexpr std::size_t places_shown = 10;
constexpr std::size_t ranked_shown = 8;
constexpr std::size_t measured_shown = 8;
// Of what is measured in a data sheet's units that is shown which differs by so many deviations of eight simulated
// captures: by chance (Student's t of seven degrees of freedom) one of a thousand does, of some 80.
constexpr double measured_apart = 6;
constexpr double bar_cells = 40;
// Of the level: at what a residual is tested, as there are several models to a capture (docs/method/diagnosis.md).
constexpr double residual_part = 0.25;

std::vector<std::string> words(const Json &list) {
    std::vector<std::string> result;
    for (const Json &word : list)
        result.push_back(word.get<std::string>());
    return result;
}

/** What the verdict does not reach. */
std::string reach_text(const Json &coverage) {
    std::string text;
    const auto add = [&](const char *what, const char *key) {
        if (!coverage[key].empty())
            text += wrapped(fmt::format("{} {}", what, joined(words(coverage[key]), " and ")), "  ") + "\n";
    };
    add("not judged:", "left_out");
    add("effects that cannot show in these sequences:", "effects_not_visible");
    add("questions that they leave open:", "questions_open");
    return text.empty() ? "Every effect of the catalogue could have shown.\n"
                        : "Not tested, so not shown to be right\n" + text;
}

std::string verdict_text(const clspeckle::Diagnosis &diagnosis, const ClspDiagnosisSummary &summary,
                         const Json &coverage) {
    const std::vector<std::string> effects = diagnosis.effects();
    switch (summary.verdict) {
    case CLSP_VERDICT_NONE: {
        const std::vector<std::string> sequences = words(coverage["sequences"]);
        return wrapped(fmt::format("NONE: no gap in what could be tested: at the level {:g}, none of {} statistics{} "
                                   "tells camera and "
                                   "simulator apart.",
                                   summary.level, coverage["statistics"].get<std::uint64_t>(),
                                   sequences.empty() ? "" : " of " + joined(sequences, " and ")),
                       "") +
               "\n\n" + reach_text(coverage);
    }
    case CLSP_VERDICT_NAMED:
        return fmt::format("NAMED: the gap between camera and simulator is explained by {} (probability {:.2f}).",
                           joined(effects, " and "), summary.probability);
    case CLSP_VERDICT_AMBIGUOUS: {
        std::string text =
            fmt::format("AMBIGUOUS: the data cannot tell {} apart.", joined(diagnosis.equivalents(), " and "));
        if (!effects.empty())
            text += fmt::format(" The gap is explained with {}.", joined(effects, " and "));
        return text;
    }
    default:
        break;
    }
    std::string text = "UNKNOWN: a significant part of the gap is explained by no effect of the catalogue.";
    if (!effects.empty())
        text += fmt::format(" Beside it {} {} found.", joined(effects, " and "), effects.size() == 1 ? "was" : "were");
    if (summary.equivalent_count > 0)
        text += fmt::format(" The data cannot tell {} apart.", joined(diagnosis.equivalents(), " and "));
    return text;
}

std::string probability_text(double p) {
    if (p < 1e-99)
        return "<1e-99";
    return p < 1e-3 ? fmt::format("{:.0e}", p) : fmt::format("{:.3f}", p);
}

std::string unit_text(const char *unit) {
    return std::string(unit) == "1" ? "" : unit;
}

std::string places_text(const clspeckle::Diagnosis &diagnosis, const ClspDiagnosisSummary &summary) {
    std::vector<std::vector<std::string>> rows = {
        {"stage", "sequence", "statistic", "region", "camera", "simulator", "", "z", "p", "z after"}};
    const std::vector<ClspDiagnosisPlace> places = diagnosis.places();
    const auto significant = static_cast<std::size_t>(std::count_if(
        places.begin(), places.end(), [&](const ClspDiagnosisPlace &p) { return p.p_adjusted <= summary.level; }));
    for (std::size_t i = 0; i < std::min(places.size(), places_shown); ++i) {
        const ClspDiagnosisPlace &p = places[i];
        rows.push_back({p.stage, p.sequence, p.statistic, p.region, fmt::format("{:.5g}", p.real),
                        fmt::format("{:.5g}", p.sim), unit_text(p.unit), fmt::format("{:+.1f}", p.z),
                        probability_text(p.p_adjusted), fmt::format("{:+.1f}", p.z_after)});
    }
    return fmt::format("Where: {} of {} statistics differ significantly; the largest differences\n{}\n"
                       "  z: in standard deviations of simulated captures; p: adjusted for the number of statistics\n",
                       significant, places.size(), table(rows, "  "));
}

/** Names and units of an effect's parameters; a ranked effect has their values only. */
std::vector<std::pair<std::string, std::string>> parameter_names(const std::string &id) {
    std::vector<std::pair<std::string, std::string>> names;
    for (const ClspEffectInfo &effect : effect_catalogue())
        if (id == effect.id)
            for (std::uint32_t i = 0; i < effect.parameter_count; ++i)
                names.emplace_back(effect.parameters[i].name, unit_text(effect.parameters[i].unit));
    return names;
}

std::string parameters_text(const ClspDiagnosisRanked &ranked, const std::vector<ClspDiagnosisParameter> &fitted) {
    std::string text;
    const auto add = [&](const std::string &part) { text += (text.empty() ? "" : ", ") + part; };
    const auto with_unit = [](const std::string &unit) { return unit.empty() ? "" : " " + unit; };
    for (const ClspDiagnosisParameter &p : fitted)
        if (std::string(p.effect) == ranked.effect)
            add(fmt::format("{} = {:.4g}{} ({:.4g} to {:.4g})", p.name, p.value, with_unit(unit_text(p.unit)), p.low,
                            p.high));
    if (!text.empty())
        return text;
    const auto names = parameter_names(ranked.effect);
    for (std::size_t i = 0; i < std::min<std::size_t>(ranked.parameter_count, names.size()); ++i)
        add(fmt::format("{} = {:.4g}{}", names[i].first, ranked.values[i], with_unit(names[i].second)));
    return text;
}

std::string ranking_text(const clspeckle::Diagnosis &diagnosis) {
    const std::vector<ClspDiagnosisParameter> fitted = diagnosis.parameters();
    const std::vector<std::string> steps = [&] {
        std::vector<std::string> ids;
        for (const ClspDiagnosisStep &step : diagnosis.steps())
            ids.emplace_back(step.effect);
        return ids;
    }();
    const std::vector<std::string> named = diagnosis.effects();
    const auto among = [](const std::vector<std::string> &ids, const char *id) {
        return std::find(ids.begin(), ids.end(), id) != ids.end();
    };
    std::vector<std::vector<std::string>> rows = {
        {"", "effect", "stage", "probability", "left [1]", "parameters (95 % interval)"}};
    std::size_t shown = 0;
    for (const ClspDiagnosisRanked &ranked : diagnosis.ranking()) {
        if (!among(steps, ranked.effect) && shown >= ranked_shown)
            continue;
        ++shown;
        rows.push_back({among(named, ranked.effect) ? "*" : "", ranked.effect, ranked.stage,
                        fmt::format("{:.3f}", ranked.probability), fmt::format("{:.3g}", ranked.distance_after),
                        parameters_text(ranked, fitted)});
    }
    return "Ranking (*: part of the explanation; probabilities are among the effects of one step)\n" +
           table(rows, "  ") +
           "\n  [1] beyond chance, in standard deviations of the simulator with the effect; 0: no more than chance\n";
}

std::string waterfall_text(const clspeckle::Diagnosis &diagnosis, const ClspDiagnosisSummary &summary) {
    const double whole = std::max(summary.distance_before, 1e-300);
    const auto bar = [&](double distance) {
        const double cells = std::clamp(std::round(bar_cells * distance / whole), 0.0, bar_cells);
        return std::string(static_cast<std::size_t>(cells), '#');
    };
    std::vector<std::vector<std::string>> rows = {
        {"simulator as it is", fmt::format("{:.3g}", summary.distance_before), "", bar(summary.distance_before)}};
    for (const ClspDiagnosisStep &step : diagnosis.steps())
        rows.push_back({fmt::format("with {}", step.effect), fmt::format("{:.3g}", step.distance_after),
                        fmt::format("{:.0f} % gone", 100 * step.fraction), bar(step.distance_after)});
    std::string text = fmt::format(
        "Shrinkage of the gap, {}\n{}\n  {:.0f} % of the gap is gone (95 % interval {:.0f} to {:.0f} %)\n"
        "  distances here: in standard deviations of half captures simulated with all effects found\n",
        summary.held_out ? "on frames that no fit has seen" : "on the frames of the fit: too few to part",
        table(rows, "  "), 100 * summary.fraction, 100 * summary.fraction_95[0], 100 * summary.fraction_95[1]);
    if (!summary.residual_detected && summary.fraction < 0.95)
        text += wrapped("nothing significant is left, though less than all is gone: distances are what lies beyond the "
                        "mean of chance, "
                        "which chance exceeds in about half of all captures; the interval covers it",
                        "  ") +
                "\n";
    return text;
}

/** What was adjusted before any gap was spoken of; not of a comparison. */
std::string calibration_text(const Json &report) {
    if (!report.contains("calibration"))
        return "";
    const Json &calibration = report["calibration"];
    const auto number = [](const Json &value, int digits) {
        return value.is_number() ? fmt::format("{:.{}f}", value.get<double>(), digits) : std::string("-");
    };
    std::vector<std::string> light;
    for (const Json &sequence : calibration["sequences"])
        if (sequence["share"] != 0.0)
            light.push_back(fmt::format("{} {}", sequence["name"].get<std::string>(), number(sequence["light_dn"], 1)));
    return wrapped(fmt::format("Calibrated: black level {} DN, read noise {} DN{}",
                               number(calibration["black_level_dn"], 2), number(calibration["read_noise_dn"], 2),
                               light.empty() ? "" : fmt::format("; light in DN: {}", fmt::join(light, ", "))),
                   "") +
           "\n";
}

/** Lamps and lasers that are not even, and lamps that drift: conditions of the lab, which are no gap. */
std::string illumination_text(const Json &report) {
    if (!report.contains("calibration") || !report["calibration"].contains("illumination"))
        return "";
    const Json &found = report["calibration"]["illumination"];
    const auto percent = [](const Json &value) { return 100.0 * value.get<double>(); };
    std::vector<std::string> parts;
    for (const Json &light : found["lights"])
        if (light["uneven"].get<bool>())
            parts.push_back(
                fmt::format("{} with slopes of {:.1f} % in x and {:.1f} % in y, {:.1f} % less in the corners",
                            light["light"].get<std::string>(), percent(light["slope_x"]), percent(light["slope_y"]),
                            percent(light["corner_loss"])));
    for (const Json &drift : found["lamp_drifts"])
        parts.push_back(fmt::format("a lamp that varies by {:.2g} % from frame to frame of {}",
                                    percent(drift["deviation"]), drift["sequence"].get<std::string>()));
    return parts.empty() ? "" : wrapped("Light of the lab, which is no gap: " + joined(parts, " and "), "") + "\n";
}

/** Each scene by itself. */
std::string rungs_text(const Json &cause) {
    if (!cause.contains("rungs"))
        return "";
    std::vector<std::vector<std::string>> rows = {
        {"scene", "verdict", "distance", "with the effects", "p of the rest", "effects"}};
    for (const Json &rung : cause["rungs"])
        rows.push_back({rung["rung"].get<std::string>(), rung["verdict"].get<std::string>(),
                        fmt::format("{:.3g}", rung["distance_before"].get<double>()),
                        fmt::format("{:.3g}", rung["distance_after"].get<double>()),
                        probability_text(rung["residual_p_value"].get<double>()),
                        joined(words(rung["effects"]), " and ")});
    return "Scene by scene, from the back of the light path\n" + table(rows, "  ") + "\n";
}

/** What nobody would read as a difference: noise that is not there leaves 0 in one capture and a little in the next. */
double least_apart(const std::string &unit) {
    constexpr std::pair<const char *, double> least[] = {{"DN", 0.02}, {"DN^2", 0.1}, {"px", 0.002},
                                                         {"%", 0.02}, {"1", 1e-3},   {"DN/electron", 2e-4}};
    for (const auto &[name, value] : least)
        if (unit == name)
            return value;
    return 0.0;
}

/** What differs most in the units of a data sheet. */
std::string measurements_text(const Json &report) {
    struct Row {
        const Json *entry;
        double apart;
    };
    if (!report.contains("measurements"))
        return "";
    const Json &measurements = report["measurements"];
    std::vector<Row> found;
    for (const Json &entry : measurements["quantities"]) {
        if (!entry["real"].is_number() || !entry["sim"].is_number())
            continue;
        const double real = entry["real"].get<double>(), sim = entry["sim"].get<double>();
        const double least = std::max(1e-3 * std::max(std::abs(real), std::abs(sim)),
                                      least_apart(entry["unit"].get<std::string>()));
        const double apart = std::abs(real - sim) / std::max(entry.value("sim_deviation", 0.0), least);
        if (apart >= measured_apart)
            found.push_back({&entry, apart});
    }
    std::stable_sort(found.begin(), found.end(), [](const Row &a, const Row &b) { return a.apart > b.apart; });
    found.resize(std::min(found.size(), measured_shown));
    if (found.empty())
        return "";
    const auto value = [](const Json &entry, const std::string &name) {
        if (!entry.contains(name) || !entry[name].is_number())
            return std::string("-");
        const std::string deviation = name + "_deviation";
        return fmt::format("{:.4g}", entry[name].get<double>()) +
               (entry.contains(deviation) ? fmt::format(" +- {:.2g}", entry[deviation].get<double>()) : "");
    };
    const bool with_effects = found.front().entry->contains("sim_with_effects");
    std::vector<std::vector<std::string>> rows = {{"sequence", "quantity", "unit", "camera", "simulator"}};
    if (with_effects)
        rows.front().emplace_back("with the effects");
    for (const Row &row : found) {
        const Json &entry = *row.entry;
        rows.push_back({entry["sequence"].is_string() ? entry["sequence"].get<std::string>() : "dark and flat",
                        entry["quantity"].get<std::string>(), unit_text(entry["unit"].get<std::string>().c_str()),
                        value(entry, "real"), value(entry, "sim")});
        if (with_effects)
            rows.back().push_back(value(entry, "sim_with_effects"));
    }
    return "Measured, as a data sheet has it: what differs most, beyond chance (all of it: --json, --html)\n" +
           table(rows, "  ") + "\n";
}

/** Differences from the camera by the user's tolerances. */
std::string acceptance_text(const Json &rows) {
    const bool with_effects = rows.front().contains("sim_with_effects");
    std::vector<std::vector<std::string>> lines = {
        {"sequence", "quantity", "unit", "tolerance", "simulator less camera", "simulator"}};
    if (with_effects)
        lines.front().insert(lines.front().end(), {"with the effects less camera", "with the effects"});
    const auto figure = [](const Json &value) {
        return value.is_number() ? fmt::format("{:.3g}", value.get<double>()) : std::string("-");
    };
    for (const Json &row : rows) {
        const std::string region = row.value("region", "all");
        lines.push_back({row["sequence"].is_string() ? row["sequence"].get<std::string>() : "dark and flat",
                         row.value("quantity", row.value("statistic", "")) + (region == "all" ? "" : ", " + region),
                         unit_text(row["unit"].get<std::string>().c_str()), figure(row["tolerance"])});
        for (const char *version : {"sim", "sim_with_effects"})
            if (row.contains(version)) {
                const Json &judged = row[version];
                lines.back().push_back(fmt::format("{} ({} to {})", figure(judged["difference"]),
                                                   figure(judged["ci95"][0]), figure(judged["ci95"][1])));
                lines.back().push_back(judged["acceptance"].get<std::string>());
            }
    }
    return "Accepted by your tolerances: differences with 95 % intervals, undecided where these reach beyond\n" +
           table(lines, "  ") + "\n";
}

/** One line of EMVA 1288's best-known numbers, and what contradicts itself. */
std::string emva_text(const Json &emva) {
    std::vector<std::string> parts;
    for (const char *name : {"system_gain", "dark_noise", "dsnu", "prnu", "dark_current"}) {
        const Json &entry = emva["values"][name];
        if (!entry.contains("unknown"))
            parts.push_back(fmt::format("{} {:.4g} ({:.4g} to {:.4g}) {}", name, entry["value"].get<double>(),
                                        entry["interval"][0].get<double>(), entry["interval"][1].get<double>(),
                                        entry["unit"].get<std::string>()));
    }
    std::string text;
    if (!parts.empty())
        text = wrapped("EMVA 1288, of the frames alone: " + joined(parts, " and "), "") + "\n";
    for (const Json &note : emva["notes"])
        text += wrapped((note["sequence"].is_null() ? "" : note["sequence"].get<std::string>() + ": ") +
                            note["text"].get<std::string>(),
                        "  ") +
                "\n";
    return text;
}

std::string downstream_text(const Json &report) {
    const Json &shrink = report["shrink"];
    if (!shrink.contains("downstream") || !shrink["downstream"].contains("dot_centre_rms_px"))
        return "";
    const Json &rms = shrink["downstream"]["dot_centre_rms_px"];
    const auto number = [&](const char *name) {
        return rms[name].is_number() ? fmt::format("{:.4f}", rms[name].get<double>()) : std::string("-");
    };
    return fmt::format(
        "Error of the dots' centres in single frames: camera {} px, simulator {} px, with the effects {} px\n",
        number("real"), number("before"), number("after"));
}

/** Of a comparison of two sets: what was compared, and what could not be. */
std::string comparison_text(const Json &compare) {
    std::vector<std::vector<std::string>> rows = {
        {"camera", "simulator", "frames", "light of both in DN", "compared at"}};
    const auto number = [](const Json &value) { return value.is_number() ? value.get<double>() : 0.0; };
    for (const Json &pair : compare["pairs"]) {
        const double real = number(pair["real_light_dn"]), sim = number(pair["sim_light_dn"]);
        rows.push_back({pair["real"].get<std::string>(), pair["sim"].get<std::string>(),
                        fmt::format("{}", pair["frames"].get<std::uint32_t>()),
                        real > 0.0 ? fmt::format("{:.1f}, {:.1f}", real, sim) : "",
                        real > 0.0 ? fmt::format("{:.1f}, {:.1f}", real * number(pair["real_scale"]),
                                                 sim * number(pair["sim_scale"]))
                                   : ""});
    }
    std::vector<std::string> refused;
    for (const Json &entry : compare["cannot_be_applied"])
        refused.push_back(entry["effect"].get<std::string>());
    std::string text = "Compared\n" + table(rows, "  ") + "\n";
    if (!refused.empty())
        text += wrapped("Effects that cannot be put on finished frames, and are no candidates (--json says why): " +
                            joined(refused, " and "),
                        "") +
                "\n";
    return text;
}

} // namespace

std::string diagnosis_summary(const clspeckle::Diagnosis &diagnosis) {
    const ClspDiagnosisSummary summary = diagnosis.summary();
    const Json report = Json::parse(diagnosis.report_json());
    std::string text;
    if (!report["coverage"]["judged"].get<bool>())
        text =
            wrapped(fmt::format("NOTHING COULD BE JUDGED of light: every sequence that has some was left out ({}; the "
                                "notes say why). What follows is about dark frames alone.",
                                joined(words(report["coverage"]["left_out"]), " and ")),
                    "") +
            "\n\n";
    text += verdict_text(diagnosis, summary, report["coverage"]) + "\n";
    if (summary.verdict != CLSP_VERDICT_NONE)
        text += "\n";
    text += fmt::format(
        "Gap: {:.3g} standard deviations of the baseline beyond chance (chance alone: below {:.3g} in 95 %), p = {}\n",
        summary.distance, summary.null_95, probability_text(summary.p_value));
    text += calibration_text(report) + illumination_text(report);
    if (report.contains("emva1288"))
        text += emva_text(report["emva1288"]);
    if (summary.detected)
        text += "\n" + places_text(diagnosis, summary);
    if (const std::string rungs = rungs_text(report["cause"]); !rungs.empty())
        text += "\n" + rungs;
    if (summary.ranked_count > 0)
        text += "\n" + ranking_text(diagnosis);
    if (summary.step_count > 0)
        text += "\n" + waterfall_text(diagnosis, summary);
    if (summary.detected)
        text += fmt::format("Residual: {} (p = {}; significant below {:.3g})\n",
                            summary.residual_detected ? "a significant gap remains" : "nothing significant remains",
                            probability_text(summary.residual_p_value), residual_part * summary.level);
    text += downstream_text(report);
    if (const std::string measured = summary.detected ? measurements_text(report) : ""; !measured.empty())
        text += "\n" + measured;
    if (report.contains("acceptance"))
        text += "\n" + acceptance_text(report["acceptance"]);
    if (report.contains("compare"))
        text += "\n" + comparison_text(report["compare"]);
    if (!report["advice"].empty())
        text += "\nAdvice\n";
    for (const Json &advice : report["advice"]) {
        std::vector<std::string> separates;
        for (const Json &id : advice["separates"])
            separates.push_back(id.get<std::string>());
        text += fmt::format("  {} would be told apart by: {}\n", joined(separates, " and "),
                            advice["capture"].get<std::string>());
    }
    if (report.contains("paste") && summary.step_count > 0)
        for (const auto &[name, key] : {std::pair{"command line", "command_line"}, {"Python", "python"}, {"C", "c"}})
            text += fmt::format("\nTo paste, {}\n\n{}", name, report["paste"][key].get<std::string>());
    const std::vector<std::string> notes = diagnosis.notes();
    if (!notes.empty())
        text += "\nNotes\n";
    for (const std::string &note : notes)
        text += wrapped(note, "  ") + "\n";
    text += fmt::format("\nSeed {}; {:.1f} s", summary.seed, summary.seconds);
    return text;
}

} // namespace tools
