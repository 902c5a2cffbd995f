#include "report/figures.hpp"

#include "report/explanations.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <map>
#include <utility>

namespace clsp {
namespace {

// Okabe and Ito's colours, told apart by the colour-blind; the lines differ in their dashes, too.
constexpr const char *kColours[] = {"#222222", "#D55E00", "#0072B2"};

JsonText axis_configuration() {
    return {{"axis",
             {{"labelFontSize", 11},
              {"titleFontSize", 12},
              {"titleFontWeight", "normal"},
              {"gridColor", "#e6e6e6"},
              {"domainColor", "#888888"},
              {"tickColor", "#888888"}}},
            {"legend", {{"labelFontSize", 12}, {"titleFontSize", 12}, {"titleFontWeight", "normal"}}},
            {"title", {{"fontSize", 13}, {"fontWeight", "normal"}}}};
}

JsonText specification(int width, int height) {
    return {{"width", width},
            {"height", height},
            {"padding", 5},
            {"background", "white"},
            {"config", axis_configuration()}};
}

// Steps of |z|: below 3 is what chance gives now and then among many statistics.
const std::vector<double> kSteps{2.0, 3.0, 5.0, 10.0, 20.0, 50.0};
JsonText deviation_scale() {
    return {{"name", "deviation"},
            {"type", "threshold"},
            {"domain", kSteps},
            {"range", {"#f7f7f7", "#fff1d6", "#fdd49e", "#fdae6b", "#ef6548", "#c0281c", "#7f0000"}}};
}
JsonText deviation_legend() {
    return {{"fill", "deviation"}, {"type", "symbol"}, {"symbolType", "square"},
            {"symbolSize", 160},   {"title", "|z|"},   {"format", "d"}};
}

struct Cell {
    std::string row, column, tip;
    double z = 0.0;
};

JsonText cell_table(const std::string &name, const std::vector<Cell> &cells) {
    JsonText values = JsonText::array();
    for (const Cell &cell : cells)
        values.push_back({{"row", cell.row},
                          {"column", cell.column},
                          {"z", cell.z},
                          {"label", cell.z < 10.0 ? fmt::format("{:.1f}", cell.z) : fmt::format("{:.0f}", cell.z)},
                          {"ink", cell.z >= 20.0 ? "white" : "black"},
                          {"tip", cell.tip}});
    return {{"name", name}, {"values", values}};
}

// Squares and the numbers in them.
JsonText cell_marks(const std::string &data) {
    const JsonText x = {{"scale", "column"}, {"field", "column"}}, y = {{"scale", "row"}, {"field", "row"}};
    JsonText middle_x = x, middle_y = y;
    middle_x["band"] = middle_y["band"] = 0.5;
    const JsonText whole_x = {{"scale", "column"}, {"band", 1}}, whole_y = {{"scale", "row"}, {"band", 1}};
    JsonText marks = JsonText::array();
    marks.push_back({{"type", "rect"},
                     {"from", {{"data", data}}},
                     {"encode",
                      {{"enter",
                        {{"x", x},
                         {"y", y},
                         {"width", whole_x},
                         {"height", whole_y},
                         {"fill", {{"scale", "deviation"}, {"field", "z"}}},
                         {"stroke", {{"value", "white"}}},
                         {"tooltip", {{"field", "tip"}}}}}}}});
    marks.push_back({{"type", "text"},
                     {"from", {{"data", data}}},
                     {"interactive", false},
                     {"encode",
                      {{"enter",
                        {{"x", middle_x},
                         {"y", middle_y},
                         {"align", {{"value", "center"}}},
                         {"baseline", {{"value", "middle"}}},
                         {"fontSize", {{"value", 10}}},
                         {"fill", {{"field", "ink"}}},
                         {"text", {{"field", "label"}}}}}}}});
    return marks;
}

JsonText row_axis(bool labels) {
    return {{"orient", "left"}, {"scale", "row"},    {"labels", labels}, {"ticks", false},
            {"domain", false},  {"labelPadding", 6}, {"labelLimit", 360}};
}
JsonText column_axis() {
    return {{"orient", "top"},   {"scale", "column"}, {"ticks", false},       {"domain", false},
            {"labelPadding", 6}, {"labelAngle", -50}, {"labelAlign", "left"}, {"labelLimit", 160}};
}

std::vector<std::string> sequence_names(const DiagnosisResult &result) {
    std::vector<std::string> names;
    if (result.evidence)
        for (const SequenceEvidence &sequence : result.evidence->sequences)
            names.push_back(sequence.name);
    for (const GapPlace &place : result.places)
        if (std::find(names.begin(), names.end(), place.statistic.sequence) == names.end())
            names.push_back(place.statistic.sequence);
    return names;
}

std::string tip_of(const GapPlace &place, double z) {
    return fmt::format("{}, {} ({}): real {}, simulated {}, z = {:.1f}. {}", place.statistic.sequence,
                       place.statistic.name, explain_region(place.statistic.region), figure(place.real),
                       figure(place.sim), z, explain_statistic(place.statistic.name));
}

// The statistic with the largest |z| of those that share a row and a column.
using Worst = std::map<std::pair<std::string, std::string>, std::pair<const GapPlace *, double>>;
template <class Row> Worst worst_of(const DiagnosisResult &result, double GapPlace::*deviation, const Row &row) {
    Worst worst;
    for (const GapPlace &place : result.places) {
        const double z = std::isfinite(place.*deviation) ? place.*deviation : 0.0;
        const auto entry =
            worst.emplace(std::make_pair(row(place), place.statistic.sequence), std::make_pair(&place, z)).first;
        if (std::abs(z) > std::abs(entry->second.second))
            entry->second = {&place, z};
    }
    return worst;
}

std::vector<Cell> cells_of(const Worst &worst, const std::vector<std::string> &rows) {
    std::vector<Cell> cells;
    for (const auto &[key, value] : worst)
        if (std::find(rows.begin(), rows.end(), key.first) != rows.end())
            cells.push_back({key.first, key.second, tip_of(*value.first, value.second), std::abs(value.second)});
    return cells;
}

std::string row_of(const GapPlace &place) {
    return place.statistic.stage + ": " + place.statistic.name;
}

constexpr const char *kStageOrder[] = {"laser", "doe", "surface", "motion", "optics", "sensor"};
std::size_t stage_rank(const std::string &stage) {
    return std::size_t(
        std::find_if(std::begin(kStageOrder), std::end(kStageOrder), [&](const char *s) { return stage == s; }) -
        std::begin(kStageOrder));
}

// "stage: name" of the statistics, those with the largest |z|; in the order of the stages, the largest first within
// each.
std::vector<std::string> statistic_rows(const DiagnosisResult &result, std::size_t count) {
    struct Row {
        std::string label, stage;
        double z;
    };
    std::vector<Row> rows;
    for (const GapPlace &place : result.places) {
        const std::string label = row_of(place);
        const auto known = std::find_if(rows.begin(), rows.end(), [&](const Row &r) { return r.label == label; });
        const double z = std::isfinite(place.z) ? std::abs(place.z) : 0.0;
        if (known == rows.end())
            rows.push_back({label, place.statistic.stage, z});
        else
            known->z = std::max(known->z, z);
    }
    std::stable_sort(rows.begin(), rows.end(), [](const Row &a, const Row &b) { return a.z > b.z; });
    if (count && rows.size() > count)
        rows.resize(count);
    std::stable_sort(rows.begin(), rows.end(),
                     [](const Row &a, const Row &b) { return stage_rank(a.stage) < stage_rank(b.stage); });
    std::vector<std::string> labels;
    for (const Row &row : rows)
        labels.push_back(row.label);
    return labels;
}

} // namespace

const char *version_name(Version version) {
    constexpr const char *kNames[] = {"real", "baseline simulator", "simulator with effects"};
    return kNames[static_cast<std::uint32_t>(version)];
}

JsonText curve_figure(const CurvePlot &plot) {
    JsonText values = JsonText::array();
    JsonText names = JsonText::array(), colours = JsonText::array(), dashes = JsonText::array();
    for (std::size_t v = 0; v < plot.y.size(); ++v) {
        names.push_back(version_name(static_cast<Version>(v)));
        colours.push_back(kColours[v]);
        dashes.push_back(v == 0 ? JsonText::array({1, 0}) : v == 1 ? JsonText::array({6, 3}) : JsonText::array({2, 2}));
        const std::vector<double> &x = plot.own_x.empty() ? plot.x : plot.own_x[v];
        for (std::size_t i = 0; i < std::min(x.size(), plot.y[v].size()); ++i) {
            const double y = plot.y[v][i];
            values.push_back(
                {{"x", x[i]}, {"y", plot.logarithmic ? std::max(y, plot.y_floor) : y}, {"version", names.back()}});
        }
    }
    JsonText figure_json = specification(430, 220);
    figure_json["data"] = JsonText::array({{{"name", "curves"}, {"values", values}}});
    JsonText y_scale = {{"name", "y"},
                        {"type", plot.logarithmic ? "log" : "linear"},
                        {"domain", {{"data", "curves"}, {"field", "y"}}},
                        {"range", "height"},
                        {"nice", !plot.logarithmic}};
    if (!plot.logarithmic)
        y_scale["zero"] = plot.from_zero;
    if (!plot.y_domain.empty())
        y_scale["domain"] = plot.y_domain;
    figure_json["scales"] =
        JsonText::array({{{"name", "x"},
                          {"type", "linear"},
                          {"domain", {{"data", "curves"}, {"field", "x"}}},
                          {"range", "width"},
                          {"zero", false}},
                         y_scale,
                         {{"name", "colour"}, {"type", "ordinal"}, {"domain", names}, {"range", colours}},
                         {{"name", "dash"}, {"type", "ordinal"}, {"domain", names}, {"range", dashes}}});
    JsonText y_axis = {{"orient", "left"}, {"scale", "y"}, {"title", plot.y_title}, {"grid", true}, {"tickCount", 5}};
    if (plot.logarithmic)
        y_axis["format"] = "~g";
    figure_json["axes"] =
        JsonText::array({{{"orient", "bottom"}, {"scale", "x"}, {"title", plot.x_title}, {"tickCount", 8}}, y_axis});
    figure_json["legends"] = JsonText::array({{{"stroke", "colour"},
                                               {"strokeDash", "dash"},
                                               {"symbolType", "stroke"},
                                               {"symbolStrokeWidth", 2},
                                               {"orient", "top"},
                                               {"direction", "horizontal"},
                                               {"symbolSize", 300}}});
    const JsonText x = {{"scale", "x"}, {"field", "x"}}, y = {{"scale", "y"}, {"field", "y"}},
                   colour = {{"scale", "colour"}, {"field", "version"}};
    JsonText marks = JsonText::array();
    marks.push_back({{"type", "line"},
                     {"from", {{"data", "line"}}},
                     {"encode",
                      {{"enter",
                        {{"x", x},
                         {"y", y},
                         {"stroke", colour},
                         {"strokeWidth", {{"value", 1.8}}},
                         {"strokeDash", {{"scale", "dash"}, {"field", "version"}}},
                         {"interpolate", {{"value", plot.steps ? "step" : "linear"}}}}}}}});
    if (plot.with_points)
        marks.push_back({{"type", "symbol"},
                         {"from", {{"data", "line"}}},
                         {"encode", {{"enter", {{"x", x}, {"y", y}, {"fill", colour}, {"size", {{"value", 28}}}}}}}});
    figure_json["marks"] =
        JsonText::array({{{"type", "group"},
                          {"from", {{"facet", {{"name", "line"}, {"data", "curves"}, {"groupby", "version"}}}}},
                          {"marks", marks}}});
    return figure_json;
}

JsonText stage_map(const DiagnosisResult &result) {
    std::vector<std::string> stages(std::begin(kStageOrder), std::end(kStageOrder));
    const std::vector<std::string> sequences = sequence_names(result);
    const Worst worst = worst_of(result, &GapPlace::z, [](const GapPlace &place) { return place.statistic.stage; });
    JsonText figure_json = specification(int(70 * sequences.size()), int(26 * stages.size()));
    figure_json["data"] = JsonText::array({cell_table("cells", cells_of(worst, stages))});
    figure_json["scales"] =
        JsonText::array({{{"name", "column"}, {"type", "band"}, {"domain", sequences}, {"range", "width"}},
                         {{"name", "row"}, {"type", "band"}, {"domain", stages}, {"range", "height"}},
                         deviation_scale()});
    figure_json["axes"] = JsonText::array({row_axis(true), column_axis()});
    figure_json["legends"] = JsonText::array({deviation_legend()});
    figure_json["marks"] = cell_marks("cells");
    return figure_json;
}

std::size_t statistic_name_count(const DiagnosisResult &result) {
    return statistic_rows(result, 0).size();
}

JsonText statistic_map(const DiagnosisResult &result, std::size_t rows) {
    const std::vector<std::string> labels = statistic_rows(result, rows), sequences = sequence_names(result);
    const bool has_after = !result.steps.empty();
    const int width = int(46 * sequences.size()), height = int(17 * labels.size());
    JsonText figure_json = specification(has_after ? 2 * width : width, height);
    figure_json["data"] =
        JsonText::array({cell_table("before", cells_of(worst_of(result, &GapPlace::z, row_of), labels))});
    if (has_after)
        figure_json["data"].push_back(
            cell_table("after", cells_of(worst_of(result, &GapPlace::z_after, row_of), labels)));
    figure_json["scales"] =
        JsonText::array({{{"name", "column"}, {"type", "band"}, {"domain", sequences}, {"range", {0, width}}},
                         {{"name", "row"}, {"type", "band"}, {"domain", labels}, {"range", {0, height}}},
                         deviation_scale()});
    figure_json["legends"] = JsonText::array({deviation_legend()});
    JsonText panels = JsonText::array();
    for (const bool is_after : {false, true}) {
        if (is_after && !has_after)
            continue;
        panels.push_back(
            {{"type", "group"},
             {"encode", {{"enter", {{"width", {{"value", width}}}, {"height", {{"value", height}}}}}}},
             {"title",
              {{"text", version_name(is_after ? Version::kWithEffects : Version::kBaseline)}, {"anchor", "start"}}},
             {"axes", JsonText::array({row_axis(!is_after), column_axis()})},
             {"marks", cell_marks(is_after ? "after" : "before")}});
    }
    figure_json["layout"] = {{"columns", 2}, {"padding", 16}, {"bounds", "full"}, {"align", "each"}};
    figure_json["marks"] = panels;
    return figure_json;
}

JsonText ranking_figure(const DiagnosisResult &result) {
    constexpr std::size_t kBars = 10;
    JsonText values = JsonText::array();
    std::vector<std::string> names;
    for (const RankedEffect &ranked : result.ranking) {
        if (names.size() >= kBars || std::find(names.begin(), names.end(), ranked.effect) != names.end())
            continue;
        names.push_back(ranked.effect);
        const double share = std::isfinite(ranked.probability) ? std::clamp(ranked.probability, 0.0, 1.0) : 0.0;
        values.push_back({{"effect", ranked.effect},
                          {"probability", share},
                          {"label", probability(ranked.probability)},
                          {"tip", effect_with_values(result, ranked)}});
    }
    JsonText figure_json = specification(420, int(24 * std::max<std::size_t>(1, names.size())));
    figure_json["data"] = JsonText::array({{{"name", "effects"}, {"values", values}}});
    figure_json["scales"] = JsonText::array(
        {{{"name", "x"}, {"type", "linear"}, {"domain", {0, 1}}, {"range", "width"}},
         {{"name", "row"}, {"type", "band"}, {"domain", names}, {"range", "height"}, {"padding", 0.25}}});
    figure_json["axes"] = JsonText::array(
        {{{"orient", "bottom"}, {"scale", "x"}, {"title", "probability among the effects compared"}, {"grid", true}},
         row_axis(true)});
    const JsonText y = {{"scale", "row"}, {"field", "effect"}}, x = {{"scale", "x"}, {"field", "probability"}};
    JsonText middle = y;
    middle["band"] = 0.5;
    figure_json["marks"] = JsonText::array();
    figure_json["marks"].push_back({{"type", "rect"},
                                    {"from", {{"data", "effects"}}},
                                    {"encode",
                                     {{"enter",
                                       {{"x", {{"scale", "x"}, {"value", 0}}},
                                        {"x2", x},
                                        {"y", y},
                                        {"height", {{"scale", "row"}, {"band", 1}}},
                                        {"fill", {{"value", kColours[2]}}},
                                        {"tooltip", {{"field", "tip"}}}}}}}});
    figure_json["marks"].push_back({{"type", "text"},
                                    {"from", {{"data", "effects"}}},
                                    {"encode",
                                     {{"enter",
                                       {{"x", {{"scale", "x"}, {"field", "probability"}, {"offset", 5}}},
                                        {"y", middle},
                                        {"baseline", {{"value", "middle"}}},
                                        {"fontSize", {{"value", 11}}},
                                        {"text", {{"field", "label"}}}}}}}});
    return figure_json;
}

JsonText waterfall_figure(const DiagnosisResult &result) {
    JsonText values = JsonText::array();
    std::vector<std::string> names;
    const auto add = [&](const std::string &name, double from, double to, const char *kind, const std::string &label) {
        names.push_back(name);
        values.push_back({{"step", name},
                          {"from", from},
                          {"to", to},
                          {"low", std::min(from, to)},
                          {"high", std::max(from, to)},
                          {"kind", kind},
                          {"label", label}});
    };
    add("before", 0.0, result.distance_before, "total", figure(result.distance_before));
    double left = result.distance_before;
    for (std::size_t i = 0; i < result.steps.size(); ++i) {
        const ShrinkStep &step = result.steps[i];
        // The order is a part of the name: a band scale needs different ones.
        add(fmt::format("{}. {}", i + 1, step.effect), left, step.distance_after,
            step.distance_after <= left ? "less" : "more", fmt::format("{:+.2g}", step.distance_after - left));
        left = step.distance_after;
    }
    add("left", 0.0, left, "total", figure(left));
    JsonText figure_json = specification(int(std::max<std::size_t>(4, names.size()) * 90), 240);
    figure_json["data"] = JsonText::array({{{"name", "steps"}, {"values", values}}});
    figure_json["scales"] =
        JsonText::array({{{"name", "x"}, {"type", "band"}, {"domain", names}, {"range", "width"}, {"padding", 0.3}},
                         {{"name", "y"},
                          {"type", "linear"},
                          {"domain", {{"data", "steps"}, {"field", "high"}}},
                          {"range", "height"},
                          {"zero", true},
                          {"nice", true}},
                         {{"name", "colour"},
                          {"type", "ordinal"},
                          {"domain", {"total", "less", "more"}},
                          {"range", {"#777777", "#0072B2", "#D55E00"}}}});
    figure_json["axes"] = JsonText::array(
        {{{"orient", "bottom"}, {"scale", "x"}, {"labelAngle", -25}, {"labelAlign", "right"}, {"labelLimit", 160}},
         {{"orient", "left"},
          {"scale", "y"},
          {"title", "distance (standard deviations, beyond chance)"},
          {"grid", true},
          {"tickCount", 5}}});
    figure_json["marks"] = JsonText::array();
    figure_json["marks"].push_back({{"type", "rect"},
                                    {"from", {{"data", "steps"}}},
                                    {"encode",
                                     {{"enter",
                                       {{"x", {{"scale", "x"}, {"field", "step"}}},
                                        {"width", {{"scale", "x"}, {"band", 1}}},
                                        {"y", {{"scale", "y"}, {"field", "high"}}},
                                        {"y2", {{"scale", "y"}, {"field", "low"}}},
                                        {"fill", {{"scale", "colour"}, {"field", "kind"}}}}}}}});
    figure_json["marks"].push_back({{"type", "text"},
                                    {"from", {{"data", "steps"}}},
                                    {"encode",
                                     {{"enter",
                                       {{"x", {{"scale", "x"}, {"field", "step"}, {"band", 0.5}}},
                                        {"y", {{"scale", "y"}, {"field", "high"}, {"offset", -6}}},
                                        {"align", {{"value", "center"}}},
                                        {"fontSize", {{"value", 11}}},
                                        {"text", {{"field", "label"}}}}}}}});
    return figure_json;
}

} // namespace clsp
