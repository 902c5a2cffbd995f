#include "report/comparison_report.hpp"

#include "measure/comparison_result.hpp"

#include <cmath>
#include <fmt/core.h>

namespace clsp {

using image_io::JsonText;

namespace {

JsonText levels_json(const CameraLevels &levels) {
    return {{"black_level_dn", levels.black_level_dn},
            {"read_noise_dn", levels.read_noise_dn},
            {"measured", levels.noise_measured}};
}

} // namespace

JsonText comparison_json(const Comparison &comparison) {
    JsonText pairs = JsonText::array(), refused = JsonText::array(), surplus = JsonText::array();
    for (const SequencePair &p : comparison.pairs)
        pairs.push_back({{"real", p.real},
                         {"sim", p.sim},
                         {"frames", p.frames},
                         {"real_frames", p.real_frames},
                         {"sim_frames", p.sim_frames},
                         {"real_light_dn", p.real_signal_dn},
                         {"sim_light_dn", p.sim_signal_dn},
                         {"real_scale", p.real_scale},
                         {"sim_scale", p.sim_scale}});
    for (const RefusedEffect &r : comparison.refused)
        refused.push_back({{"effect", r.effect}, {"stage", r.stage}, {"reason", r.reason}});
    for (const SurplusEffect &s : comparison.surplus)
        surplus.push_back({{"effect", s.effect}, {"gain", s.gain}});
    const ReadNoiseComparison &noise = comparison.read_noise;
    return {
        {"pairs", pairs},
        {"real_alone", comparison.real_alone},
        {"sim_alone", comparison.sim_alone},
        {"levels", {{"real", levels_json(noise.real)}, {"sim", levels_json(noise.sim)}}},
        {"read_noise",
         {{"z", noise.z}, {"p_value", noise.p_value}, {"added_dn", noise.added_dn}, {"sim_has_more", noise.excess}}},
        {"cannot_be_applied", refused},
        {"sim_may_have_more_of", surplus}};
}

void write_comparison(const DiagnosisResult &result, HtmlPage &page) {
    if (!result.comparison)
        return;
    const Comparison &comparison = *result.comparison;
    page.raw("<section id=\"compare\">\n");
    page.heading(2, "What was compared");
    page.paragraph("Two capture sets: \"real\" is the first, \"simulated\" the second, from any simulator. Each pair "
                   "was brought to the same "
                   "light above the black level; statistics scatter as differences of two independent captures do. "
                   "Effects were put on the "
                   "simulated frames; their parameters are what the frames lack.");
    std::vector<std::vector<std::string>> rows;
    for (const SequencePair &p : comparison.pairs)
        rows.push_back({p.real, p.sim, fmt::format("{}", p.frames), fmt::format("{:.1f}", p.real_signal_dn),
                        fmt::format("{:.1f}", p.sim_signal_dn), fmt::format("{:.3f}", p.real_scale),
                        fmt::format("{:.3f}", p.sim_scale)});
    page.table({"real sequence", "simulated sequence", "frames", "real light, DN", "simulated light, DN",
                "real frames times", "simulated frames times"},
               rows, {2, 3, 4, 5, 6});
    page.heading(3, "Effects that cannot be put on finished frames");
    rows.clear();
    for (const RefusedEffect &r : comparison.refused)
        rows.push_back({r.effect, r.stage, r.reason});
    page.table({"effect", "stage", "why"}, rows);
    page.raw("</section>\n");
}

} // namespace clsp
