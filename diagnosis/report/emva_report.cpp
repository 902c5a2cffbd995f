#include "report/emva_report.hpp"

#include <cmath>
#include <fmt/core.h>

namespace clsp {

using image_io::JsonText;

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr const char *kShape[] = {"slope_x", "slope_y", "curvature_x", "twist", "curvature_y"};

// Standard deviations of section 8; NaN where the temporal noise explains more than all.
struct Deviations {
    double total = kUnknown, pixel = kUnknown, row = kUnknown, column = kUnknown;
};

Deviations deviations(const EmvaSpatial &image, const EmvaSpatial *dark, double scale) {
    if (image.sequence.empty() || (dark && dark->sequence.empty()))
        return {};
    const auto one = [&](double EmvaSpatial::*variance) {
        return scale * std::sqrt(image.*variance - (dark ? dark->*variance : 0.0)); // NaN of what is negative
    };
    return {one(&EmvaSpatial::variance), one(&EmvaSpatial::pixel_variance), one(&EmvaSpatial::row_variance),
            one(&EmvaSpatial::column_variance)};
}

Deviations dsnu(const EmvaSpatial &dark) {
    return deviations(dark, nullptr, 1.0);
}
Deviations prnu(const EmvaSpatial &flat, const EmvaSpatial &dark) {
    return deviations(flat, &dark, 100.0 / (flat.mean - dark.mean));
}

JsonText deviations_json(const Deviations &d) {
    return {{"total", d.total}, {"pixel", d.pixel}, {"row", d.row}, {"column", d.column}};
}

JsonText value_json(const NamedEmvaValue &named) {
    const EmvaValue &value = *named.value;
    if (!value.known())
        return {{"value", nullptr}, {"interval", nullptr}, {"unit", named.unit}, {"unknown", value.unknown}};
    return {{"value", value.value}, {"interval", {value.low, value.high}}, {"unit", named.unit}};
}

void add_element(std::string &xml, const char *section, const char *name, const char *text, const char *unit,
                 double value) {
    xml += fmt::format("    <{0}>\n      <section>{1}</section>\n      <short>{2}</short>\n", name, section, text);
    if (*unit)
        xml += fmt::format("      <unit>{}</unit>\n", unit);
    xml += std::isfinite(value) ? fmt::format("      <value>{:.17g}</value>\n", value) : "      <value>None</value>\n";
    xml += fmt::format("    </{}>\n", name);
}

} // namespace

JsonText emva_json(const Emva1288 &emva) {
    JsonText values = JsonText::object(), points = JsonText::array(), illumination = JsonText::array(),
             notes = JsonText::array();
    for (const NamedEmvaValue &named : named_values(emva))
        values[named.name] = value_json(named);
    for (const EmvaPoint &point : emva.points) {
        points.push_back({{"sequence", point.sequence},
                          {"level_dn", point.level_dn},
                          {"variance_dn2", point.variance_dn2},
                          {"variance_error_dn2", point.variance_error_dn2},
                          {"used", point.used}});
        if (!point.used)
            points.back()["unused"] = point.unused;
    }
    for (const EmvaIllumination &one : emva.illumination) {
        JsonText entry = {{"sequence", one.sequence}};
        for (std::size_t k = 0; k < one.percent.size(); ++k) {
            entry[kShape[k]] = one.percent[k];
            entry[std::string(kShape[k]) + "_error"] = one.error_percent[k];
        }
        illumination.push_back(entry);
    }
    for (const CaptureWarning &note : emva.notes)
        notes.push_back(
            {{"sequence", note.sequence.empty() ? JsonText(nullptr) : JsonText(note.sequence)}, {"text", note.text}});
    const auto section_8 = [](const EmvaSpatial &flat, const EmvaSpatial &dark) {
        return JsonText{{"dsnu_dn", deviations_json(dsnu(dark))}, {"prnu_percent", deviations_json(prnu(flat, dark))}};
    };
    return {{"standard", "EMVA 1288 release 4.0"},
            {"gain_method", method_name(emva.method)},
            {"values", values},
            {"defects", {{"dark", emva.defect_share_dark}, {"flat", emva.defect_share_flat}}},
            {"section_8",
             {{"dark", emva.spatial_dark.sequence},
              {"flat", emva.spatial_flat.sequence},
              {"as_recorded", section_8(emva.spatial_flat, emva.spatial_dark)},
              {"high_pass", section_8(emva.filtered_flat, emva.filtered_dark)}}},
            {"photon_transfer", points},
            {"illumination", illumination},
            {"notes", notes}};
}

std::string emva_xml(const Emva1288 &emva) {
    const auto known = [](const EmvaValue &value) { return value.known() ? value.value : kUnknown; };
    const double gain = known(emva.gain), electrons = known(emva.saturation_e),
                 threshold = known(emva.sensitivity_threshold);
    // Not below what quantization leaves (section 6.6); what is unknown stays so.
    const double noise = known(emva.dark_noise);
    const double snr = std::sqrt(electrons), range = electrons / threshold;
    const EmvaSpatial &dark = emva.spatial_dark, &flat = emva.spatial_flat;
    const Deviations own = dsnu(dark), light = prnu(flat, dark);
    const auto of = [](const EmvaSpatial &spatial, double EmvaSpatial::*member) {
        return spatial.sequence.empty() ? kUnknown : spatial.*member;
    };
    std::string xml = "<results>\n";
    struct Element {
        const char *name, *text, *unit;
        double value;
    };
    const auto section = [&](const char *name, const std::vector<Element> &elements) {
        xml += fmt::format("  <{}>\n", name);
        for (const Element &e : elements)
            add_element(xml, name, e.name, e.text, e.unit, e.value);
        xml += fmt::format("  </{}>\n", name);
    };
    section("info", {{"index_start", "Start array index", "", 0.0}});
    section("sensitivity",
            {{"K", "System gain", "$DN/e^-$", gain},
             {"inverse_K", "Inverse of overall system gain", "$e^-/DN$", 1.0 / gain},
             {"QE", "Quantum efficiency", "\\%", kUnknown},
             {"R", "Responsivity", "DN/p", kUnknown},
             {"sigma_y_dark", "Temporal dark noise", "DN", std::sqrt(noise * noise < 0.24 ? 0.24 : noise * noise)},
             {"sigma_d", "Temporal dark noise", "$e^-$", known(emva.dark_noise_e)},
             {"u_p_min", "Absolute sensitivity threshold", "$p$", kUnknown},
             {"u_p_min_area", "Sensitivity threshold", "$p/\\mu m^2$", kUnknown},
             {"u_e_min", "Sensitivity threshold", "$e^-$", threshold},
             {"u_e_min_area", "Sensitivity threshold", "$e^-/\\mu m^2$", kUnknown},
             {"u_p_sat", "Saturation capacity", "$p$", kUnknown},
             {"u_p_sat_area", "Saturation capacity", "$p/\\mu m^2$", kUnknown},
             {"u_e_sat", "Saturation capacity", "$e^-$", electrons},
             {"u_e_sat_area", "Saturation capacity", "$e^-/\\mu m^2$", kUnknown},
             {"SNR_max", "Signal-to-noise ratio", "", snr},
             {"SNR_max_dB", "Maximum signal-to-noise ratio", "dB", 20.0 * std::log10(snr)},
             {"SNR_max_bit", "Maximum signal-to-noise ratio", "bit", std::log2(snr)},
             {"inverse_SNR_max", "Inverse maximum signal-to-noise ratio", "\\%", 100.0 / snr},
             {"DR", "Dynamic range", "", range},
             {"DR_dB", "Dynamic range", "dB", 20.0 * std::log10(range)}});
    section("linearity", {{"LE_min", "Min linearity error", "\\%", known(emva.linearity_min)},
                          {"LE_max", "Max linearity error", "\\%", known(emva.linearity_max)}});
    section("dark_current", {{"u_I_mean_DN", "Dark current from mean", "$DN/s$", 1000.0 * known(emva.dark_current)},
                             {"u_I_mean", "Dark current from mean", "$e^-/s$", known(emva.dark_current_e)},
                             {"u_I_var_DN", "Dark current from variance", "$DN/s$", kUnknown},
                             {"u_I_var", "Dark current from variance", "$e^-/s$", kUnknown}});
    section(
        "spatial",
        {{"sigma_2_y_stack", "Temporal variance stack", "DN2", of(flat, &EmvaSpatial::stack_variance)},
         {"sigma_2_y_stack_dark", "Temporal variance stack dark", "DN2", of(dark, &EmvaSpatial::stack_variance)},
         {"s_2_y_measured", "Spatial variance measured", "DN2", of(flat, &EmvaSpatial::measured_variance)},
         {"s_2_y_measured_dark", "Spatial variance measured dark", "DN2", of(dark, &EmvaSpatial::measured_variance)},
         {"s_2_y", "Spatial variance", "DN2", of(flat, &EmvaSpatial::variance)},
         {"s_2_y_dark", "Spatial variance dark", "DN2", of(dark, &EmvaSpatial::variance)},
         {"s_2_y_cav", "Variance of columns' averages", "DN2", of(flat, &EmvaSpatial::column_average_variance)},
         {"s_2_y_cav_dark", "Variance of columns' averages dark", "DN2",
          of(dark, &EmvaSpatial::column_average_variance)},
         {"s_2_y_rav", "Variance of rows' averages", "DN2", of(flat, &EmvaSpatial::row_average_variance)},
         {"s_2_y_rav_dark", "Variance of rows' averages dark", "DN2", of(dark, &EmvaSpatial::row_average_variance)},
         {"s_2_y_col", "Column variance", "DN2", of(flat, &EmvaSpatial::column_variance)},
         {"s_2_y_col_dark", "Column variance dark", "DN2", of(dark, &EmvaSpatial::column_variance)},
         {"s_2_y_row", "Row variance", "DN2", of(flat, &EmvaSpatial::row_variance)},
         {"s_2_y_row_dark", "Row variance dark", "DN2", of(dark, &EmvaSpatial::row_variance)},
         {"s_2_y_pixel", "Pixel variance", "DN2", of(flat, &EmvaSpatial::pixel_variance)},
         {"s_2_y_pixel_dark", "Pixel variance dark", "DN2", of(dark, &EmvaSpatial::pixel_variance)},
         {"DSNU1288", "DSNU", "$e^-$", own.total / gain},
         {"DSNU1288_DN", "DSNU in DN", "DN", own.total},
         {"DSNU1288_row", "DSNUrow", "$e^-$", own.row / gain},
         {"DSNU1288_col", "DSNUcol", "$e^-$", own.column / gain},
         {"DSNU1288_pixel", "DSNUpixel", "$e^-$", own.pixel / gain},
         {"PRNU1288", "PRNU", "\\%", light.total},
         {"PRNU1288_row", "PRNUrow", "\\%", light.row},
         {"PRNU1288_col", "PRNUcol", "\\%", light.column},
         {"PRNU1288_pixel", "PRNUpixel", "\\%", light.pixel}});
    return xml + "</results>\n";
}

void write_emva(const DiagnosisResult &result, HtmlPage &page) {
    if (!result.emva)
        return;
    const Emva1288 &emva = *result.emva;
    page.raw("<section id=\"emva1288\">\n");
    page.heading(2, "EMVA 1288 numbers");
    page.paragraph("What a test engineer computes of the dark and flat frames before any simulation, by the standard's "
                   "release 4.0; 95 % intervals. Nothing here depends on the verdict.");
    std::vector<std::vector<std::string>> rows;
    for (const NamedEmvaValue &named : named_values(emva)) {
        const EmvaValue &value = *named.value;
        rows.push_back({named.text, value.known() ? fmt::format("{:.4g}", value.value) : "–",
                        value.known() ? fmt::format("{:.4g} to {:.4g}", value.low, value.high) : "", named.unit,
                        value.unknown});
    }
    page.table({"quantity", "value", "95 % interval", "unit", "why it is not known"}, rows, {1, 2});
    if (!emva.illumination.empty()) {
        page.heading(3, "Shape of the light");
        page.paragraph(
            "A polynomial of degree 2 of the mean frame, in % of its mean: slopes from edge to edge, curvatures with "
            "coordinates from -1/2 to 1/2 across the image, with standard errors.");
        rows.clear();
        for (const EmvaIllumination &one : emva.illumination) {
            rows.push_back({one.sequence});
            for (std::size_t k = 0; k < one.percent.size(); ++k)
                rows.back().push_back(with_uncertainty(one.percent[k], one.error_percent[k]));
        }
        page.table({"sequence", "slope x", "slope y", "curvature x", "twist", "curvature y"}, rows, {1, 2, 3, 4, 5});
    }
    std::vector<std::string> notes;
    for (const CaptureWarning &note : emva.notes)
        notes.push_back(note.sequence.empty() ? note.text : note.sequence + ": " + note.text);
    if (!notes.empty())
        page.list(notes);
    page.raw("</section>\n");
}

} // namespace clsp
