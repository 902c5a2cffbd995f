#include "report/report_sections.hpp"

#include "measure/gap_stages.hpp"
#include "report/advice.hpp"
#include "report/explanations.hpp"
#include "report/figures.hpp"
#include "report/report_json.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>

namespace clsp {
namespace {

constexpr std::size_t kWorstStatistics = 25;
constexpr std::size_t kMapRows = 40;
constexpr const char *kChanceRemains =
    "Nothing significant is left, though less than all of the distance is gone: distances are what lies beyond the "
    "mean of chance, and "
    "chance exceeds its own mean in about half of all captures. The interval covers it.";

std::string percent(double share) {
    return std::isfinite(share) ? fmt::format("{:.0f} %", 100.0 * share) : "–";
}

const RankedEffect *find_ranked(const std::vector<RankedEffect> &list, const std::string &effect) {
    const auto found =
        std::find_if(list.begin(), list.end(), [&](const RankedEffect &ranked) { return ranked.effect == effect; });
    return found == list.end() ? nullptr : &*found;
}

std::string unit_of(const DiagnosisResult &result, const std::string &effect, const std::string &name) {
    for (const Candidate &candidate : result.candidates)
        for (const HypothesisParameter &parameter : candidate.parameters)
            if (candidate.id == effect && parameter.name == name)
                return parameter.unit == "1" ? "" : parameter.unit;
    return {};
}

// The statistics that differed most, on held-out frames.
void write_statistic_shrinkage(const DiagnosisResult &result, HtmlPage &page) {
    page.heading(3, "Statistic by statistic");
    std::vector<std::vector<std::string>> rows;
    for (const GapPlace &place : result.places) {
        const StatisticShrinkage &shrink = place.shrink;
        if (!shrink.held_out || !shrink.beyond_chance)
            continue;
        rows.push_back({place.statistic.sequence, place.statistic.name, explain_region(place.statistic.region),
                        figure(shrink.before), figure(shrink.after), percent(shrink.fraction),
                        percent(shrink.fraction_95[0]), percent(shrink.fraction_95[1])});
        if (rows.size() == kWorstStatistics)
            break;
    }
    if (rows.empty()) {
        page.paragraph("No single statistic differed beyond chance on frames that the fit has not seen, or there were "
                       "no such frames: a sequence needs four.");
        return;
    }
    page.paragraph("Each statistic's own distance on frames that the fit has not seen, on the scale of the distances "
                   "above, and the part of it that is gone. An interval that holds 100 % says that all of it may be "
                   "gone; one below 0 % that the effects made it worse.");
    page.table({"sequence", "statistic", "where in the image", "distance before", "after", "gone", "95 % from", "to"},
               rows, {3, 4, 5, 6, 7});
}

// Why the others are not in the ranking.
void write_screening(const DiagnosisResult &result, HtmlPage &page) {
    if (result.screened.empty())
        return;
    page.raw("<details><summary>All effects that were looked at</summary>\n");
    page.paragraph(
        "At first each effect is put into the simulator at a middle strength, and what changes is compared with "
        "what differs. The share is that part of the squared distance that so much of the effect as fits best "
        "would take away (of a very large gap that nothing explains so, of its change along a line to the strong end). "
        "Those that promise least are put aside; the others' parameters are fitted, as many as "
        "it takes until none can overtake the best one.");
    std::vector<std::vector<std::string>> rows;
    for (const ScreenedEffect &look : result.screened)
        rows.push_back({look.effect, explain_effect(result, look.effect), percent(look.share),
                        look.fitted ? "fitted" : "put aside"});
    page.table({"effect, alone", "what it is", "share", "then"}, rows, {2});
    page.raw("</details>\n");
}

void write_rungs(const DiagnosisResult &result, HtmlPage &page) {
    if (result.rungs.empty())
        return;
    std::vector<std::vector<std::string>> scenes;
    for (const RungResult &rung : result.rungs)
        scenes.push_back({scene_name(rung.scene), verdict_name(rung.verdict), figure(rung.distance_before),
                          figure(rung.distance_after), probability(rung.residual_p_value), joined(rung.effects)});
    page.table({"scene", "verdict", "distance", "with the effects", "p of what is left",
                "effects that take something away here"},
               scenes, {2, 3, 4});
    page.paragraph("From the back of the light path: the dark shows the sensor alone, flats its gains and the lens, "
                   "boards the speckle, dots the pattern. What one scene leaves unexplained takes no effect of "
                   "another scene away.");
}

} // namespace

void write_summary(const DiagnosisResult &result, HtmlPage &page) {
    page.raw(fmt::format("<section id=\"summary\" class=\"verdict {}\">\n",
                         result.no_light_judged ? "unjudged" : verdict_name(result.verdict)));
    page.paragraph(result.no_light_judged
                       ? fmt::format("Nothing could be judged. Verdict: {}, on the dark frames alone",
                                     verdict_name(result.verdict))
                       : fmt::format("Verdict: {}", verdict_name(result.verdict)),
                   "word");
    page.paragraph(verdict_sentence(result), "sentence");
    page.raw("</section>\n");
    write_rungs(result, page);
    std::vector<std::vector<std::string>> rows;
    rows.push_back(
        {"Is there a gap?", result.detected ? "yes" : "no",
         fmt::format(
             "a simulator that is right would look at least so different with probability {} (the alarm is set to {})",
             probability(result.p_value), figure(result.level))});
    rows.push_back({"How large is it?", figure(result.distance),
                    fmt::format("distance of the whole capture in standard deviations of the baseline, averaged over "
                                "all statistics, beyond "
                                "what chance gives; chance alone exceeds {} once in twenty times",
                                figure(result.null_95))});
    if (!result.steps.empty())
        rows.push_back({"How far does it shrink?", percent(result.fraction),
                        fmt::format("from {} to {}, in standard deviations of half captures simulated with the effects "
                                    "(another scale than the "
                                    "line above); 95 % interval {} to {}{}",
                                    figure(result.distance_before), figure(result.distance_after),
                                    percent(result.fraction_95[0]), percent(result.fraction_95[1]),
                                    result.held_out ? "; measured on frames that the fit has not seen" : "")});
    if (result.detected)
        rows.push_back(
            {"Is something left?", result.residual_detected ? "yes" : "no",
             fmt::format("probability of what is left by chance: {}", probability(result.residual_p_value))});
    page.table({"question", "answer", "what the number means"}, rows);
    if (!result.calibration.light.empty())
        page.paragraph(explain_calibration(result.calibration));
    if (const std::string light = explain_illumination(result.illumination); !light.empty())
        page.paragraph(light);
}

void write_places(const DiagnosisResult &result, HtmlPage &page) {
    page.raw("<section id=\"where\">\n");
    page.heading(2, "Where the gap lies");
    page.paragraph("Real and simulated frames are compared by physically named statistics. z says by how many standard "
                   "deviations of chance "
                   "a real value lies away from the simulator's. Among this many statistics |z| of 3 is nothing "
                   "unusual; 5 and more is.");
    if (result.places.empty()) {
        page.paragraph("No statistic could be measured.");
        page.raw("</section>\n");
        return;
    }
    page.plot(
        stage_map(result),
        "Largest |z| of each stage (rows) in each sequence (columns). Point at a square for the statistic behind it.");
    const std::size_t names = statistic_name_count(result);
    page.plot(statistic_map(result, kMapRows),
              fmt::format("Largest |z| over the regions of each statistic, {}sorted by stage.{}",
                          names > kMapRows ? fmt::format("the {} largest of {}, ", kMapRows, names) : std::string(),
                          result.steps.empty()
                              ? ""
                              : " Right: with the effects found in the simulator. What turned pale is explained."));
    page.heading(3, "The worst statistics");
    std::vector<std::vector<std::string>> rows, alike;
    for (std::size_t i = 0; i < std::min(kWorstStatistics, result.places.size()); ++i) {
        const GapPlace &place = result.places[i];
        (place.p_adjusted < result.level ? rows : alike)
            .push_back({place.statistic.sequence, place.statistic.stage, place.statistic.name,
                        explain_statistic(place.statistic.name), explain_region(place.statistic.region),
                        rounded(place.real, deviation_of(place)), rounded(place.sim, deviation_of(place)),
                        explain_unit(place.statistic.unit),
                        fmt::format("{:.1f}", place.z), probability(place.p_adjusted),
                        result.steps.empty() ? "–" : fmt::format("{:.1f}", place.z_after)});
    }
    const std::vector<std::string> head = {
        "sequence", "stage", "statistic", "what it measures", "where in the image", "real",
        "simulated", "unit", "z", "p (adjusted)", "z with effects"};
    if (rows.empty())
        page.paragraph("None differs beyond chance.");
    else
        page.table(head, rows, {5, 6, 8, 9, 10});
    page.folded("The next ones, which do not differ beyond chance", head, alike, {5, 6, 8, 9, 10});
    page.paragraph("The adjusted p counts all statistics: where it is below the level, the statistic differs even "
                   "though it was picked as the "
                   "worst of many.");
    if (names > kMapRows) {
        page.raw("<details><summary>The map with all statistics</summary>\n");
        page.plot(statistic_map(result, 0), "Largest |z| over the regions of each statistic.");
        page.raw("</details>\n");
    }
    page.raw("</section>\n");
}

void write_cause(const DiagnosisResult &result, HtmlPage &page) {
    page.raw("<section id=\"cause\">\n");
    page.heading(2, "What causes it");
    page.paragraph(verdict_sentence(result));
    if (result.verdict != Verdict::kNone)
        page.paragraph(
            fmt::format("Probability of this answer among those compared: {}.", probability(result.probability)));
    std::vector<std::string> items;
    for (const std::string &effect : result.effects)
        items.push_back(fmt::format("{}: {}", effect, explain_effect(result, effect)));
    for (const std::string &effect : result.equivalent)
        if (std::find(result.effects.begin(), result.effects.end(), effect) == result.effects.end())
            items.push_back(fmt::format("{} (equally likely): {}", effect, explain_effect(result, effect)));
    if (!items.empty())
        page.list(items);
    if (result.ranking.empty()) {
        page.paragraph(result.detected ? "No effect of the catalogue brought the simulator nearer to the real frames."
                                       : "Without a gap no cause was looked for.");
    } else {
        page.heading(3, "Ranking of the effects");
        page.paragraph(
            "Each effect was put into the simulator, its parameters were fitted to one half of the frames, and the "
            "other half judged "
            "it. With several effects this is the ranking of the first step; the later ones are listed below. The "
            "distance left is "
            "that of the whole capture, in standard deviations of the simulator with the effect; 0: no more than "
            "chance gives.");
        page.plot(ranking_figure(result), "Probability of each effect among those compared.");
        std::vector<std::vector<std::string>> rows;
        for (const RankedEffect &ranked : result.ranking)
            rows.push_back({effect_with_values(result, ranked), explain_effect(result, ranked.effect),
                            probability(ranked.probability), figure(ranked.distance_after)});
        page.table({"effect, alone", "what it is", "probability", "distance left"}, rows, {2, 3});
    }
    write_screening(result, page);
    if (!result.parameters.empty()) {
        page.heading(3, "Parameters of the effects found");
        std::vector<std::vector<std::string>> rows;
        for (const FittedParameter &parameter : result.parameters) {
            const double deviation = (parameter.high - parameter.low) / 4.0; // the interval is of 95 %
            rows.push_back({parameter.effect, parameter.name, rounded(parameter.value, deviation),
                            rounded(parameter.low, deviation), rounded(parameter.high, deviation),
                            unit_of(result, parameter.effect, parameter.name)});
        }
        page.table({"effect", "parameter", "value", "95 % from", "to", "unit"}, rows, {2, 3, 4});
    }
    page.raw("</section>\n");
}

void write_shrinkage(const DiagnosisResult &result, HtmlPage &page) {
    page.raw("<section id=\"shrink\">\n");
    page.heading(2, "How far the gap shrinks");
    if (result.steps.empty()) {
        page.paragraph(result.detected ? "No effect was added, so the gap stays as it is."
                                       : "There is no gap that could shrink.");
        page.raw("</section>\n");
        return;
    }
    page.paragraph(fmt::format(
        "With the effects found in the simulator the distance falls from {} to {}, by {} (95 % interval {} to {}). {}",
        figure(result.distance_before), figure(result.distance_after), percent(result.fraction),
        percent(result.fraction_95[0]), percent(result.fraction_95[1]),
        result.held_out ? "Each half of the frames was judged by a fit to the other half."
                        : "There were too few frames for a part that no fit has seen: the figure is optimistic."));
    page.paragraph("These distances are in standard deviations of half captures simulated with all effects found: a "
                   "scale of their own, to be "
                   "compared with one another only.");
    if (!result.residual_detected && result.fraction < 0.95)
        page.paragraph(kChanceRemains);
    page.plot(waterfall_figure(result),
              "What each effect takes off the distance, in the order in which the effects were added.");
    std::vector<std::vector<std::string>> rows;
    for (const ShrinkStep &step : result.steps) {
        const RankedEffect *ranked = find_ranked(result.found, step.effect);
        rows.push_back({step.effect, ranked ? probability(ranked->probability) : "–", figure(step.distance_after),
                        percent(step.fraction)});
    }
    page.table({"effect added", "probability in its step", "distance left", "shrunk so far"}, rows, {1, 2, 3});
    write_statistic_shrinkage(result, page);
    page.raw("</section>\n");
}

void write_downstream(const DiagnosisResult &result, HtmlPage &page) {
    page.raw("<section id=\"downstream\">\n");
    page.heading(2, "What it means for a depth camera");
    const Downstream &d = result.downstream;
    if (!d.valid) {
        page.paragraph(result.comparison
                           ? "No dots were compared, or none was found in both sets' frames, so the error "
                             "of the dots' centres is not known."
                           : "The capture holds no frames of dots, so the error of the dots' centres is "
                             "not known.");
    } else {
        page.paragraph(
            "A depth camera finds the centres of the dots in single frames; speckle, blur and noise move them. If the "
            "simulator's "
            "error is not the real one, an algorithm that was tuned on simulated frames is tuned to the wrong noise.");
        const auto row = [](const char *what, double real, double before, double after) {
            return std::vector<std::string>{what, figure(real), figure(before), figure(after)};
        };
        page.table({"error (root mean square)", version_name(Version::kReal), version_name(Version::kBaseline),
                    version_name(Version::kWithEffects)},
                   {row("centre of a dot, px", d.real, d.before, d.after),
                    row("depth, mm", d.depth_error_mm_real, d.depth_error_mm_before, d.depth_error_mm_after)},
                   {1, 2, 3});
        page.paragraph("Assumed for the depth: " + d.depth_assumption + ".");
        if (result.steps.empty())
            page.paragraph("No effect was added: the last column repeats the baseline.");
    }
    page.raw("</section>\n");
}

void write_advice(const DiagnosisResult &result, HtmlPage &page) {
    page.raw("<section id=\"advice\">\n");
    page.heading(2, "What to capture next");
    const std::vector<Advice> advice = advice_for(result.equivalent);
    if (!advice.empty()) {
        page.paragraph("These recordings would tell the effects apart:");
        std::vector<std::vector<std::string>> rows;
        for (const Advice &item : advice) {
            std::string effects;
            for (const std::string &effect : item.separates)
                effects += (effects.empty() ? "" : " or ") + effect;
            rows.push_back({effects, item.capture});
        }
        page.table({"to tell", "record"}, rows);
    } else if (result.verdict == Verdict::kAmbiguous) {
        page.paragraph("No single recording is known that would decide; more frames narrow it down.");
    } else if (result.verdict == Verdict::kUnknown) {
        page.paragraph("Look at the sequences and stages with the largest |z|, and at the difference images of those "
                       "sequences. An effect of your "
                       "own can be added to the comparison as a hypothesis.");
    } else if (result.verdict == Verdict::kNone) {
        page.paragraph("More frames would show smaller gaps. " + explain_reach(result));
    } else {
        page.paragraph("Put the effects with these parameters into the simulator.");
    }
    page.raw("</section>\n");
}

void write_notes(const DiagnosisResult &result, HtmlPage &page) {
    page.raw("<section id=\"notes\">\n");
    page.heading(2, "Notes");
    if (result.notes.empty())
        page.paragraph("Nothing to note.");
    else
        page.list(result.notes);
    page.raw("</section>\n");
}

void write_explanation(const DiagnosisResult &result, HtmlPage &page) {
    page.raw("<section id=\"reading\">\n");
    page.heading(2, "How to read this page");
    const bool few_frames = std::any_of(result.places.begin(), result.places.end(),
                                        [](const GapPlace &place) { return place.statistic.unit == "cbrt"; });
    page.list({
        "Real: the frames that the camera recorded. Baseline simulator: the ideal camera of the capture's data sheet, "
        "with its light levels, black "
        "level and read noise adjusted to the real frames; what this adjustment removes is no gap. Simulator with "
        "effects: the same with the "
        "effects that were found.",
        "DN: digital numbers, the camera's codes. px: pixels.",
        "z: how far a real value lies from the simulator's, in standard deviations of what chance alone gives. "
        "Positive: the real value is larger.",
        "p: the probability of a difference at least so large if the simulator were right.",
        "Distance: root mean square of z over all statistics, their correlations taken out, less what chance gives. "
        "Its standard "
        "deviations are those of the simulator that the frames are compared with, so that only distances of one "
        "section compare.",
        fmt::format("Verdicts: none (no difference at the level of {}), named (the effects explain the difference), "
                    "ambiguous (several effects "
                    "explain it equally well), unknown (something is left that no known effect explains).",
                    figure(result.level)),
        fmt::format(
            "Units: – is a pure number; ln, √{} and asinh are the natural logarithm, the square root{} and the inverse "
            "hyperbolic sine of one. A difference of "
            "0.1 in ln is about 10 % of the quantity itself.",
            few_frames ? ", ∛" : "", few_frames ? ", the cube root" : ""),
        "An effect has to explain the statistics that it should change and to disturb none of the others; a "
        "probability compares it with the "
        "other effects of the catalogue only.",
    });
    std::vector<std::vector<std::string>> stages;
    for (const char *stage : {"laser", "doe", "surface", "motion", "optics", "sensor"})
        stages.push_back({stage, explain_stage(stage)});
    page.table({"stage", "what belongs to it"}, stages);
    page.raw("</section>\n");
}

} // namespace clsp
