#include "report/paste.hpp"

#include "effects/effects.hpp"
#include "report/profile_json.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <utility>
#include <vector>

namespace clsp {
namespace {

using Settings = std::vector<std::pair<std::string, std::string>>; // names and values

bool draws_dots(const ProfileEffect &effect) {
    return (find_effect(effect.id).sets & kSetsDots) != 0;
}

bool is_centered(const CameraProfile &p) {
    return p.principal_point_px == std::array<double, 2>{(p.width - 1.0) / 2.0, (p.height - 1.0) / 2.0};
}

const char *field_name(const CameraProfile &p) {
    return p.field == FieldKind::kUnitPhasor ? "unit_phasor" : "circular_gaussian";
}

// Settings of the optics and the sensor that all three have under one name.
Settings shared_settings(const CameraProfile &p) {
    Settings settings = {{"f_number", fmt::to_string(p.f_number)},
                         {"pixel_pitch_m", fmt::to_string(p.pixel_pitch_m)},
                         {"wavelength_m", fmt::to_string(p.wavelength_m)},
                         {"degree_of_polarization", fmt::to_string(p.degree_of_polarization)},
                         {"oversampling", fmt::to_string(p.oversampling)}};
    if (p.fill_factor > 0.0)
        settings.emplace_back("fill_factor", fmt::to_string(p.fill_factor));
    settings.insert(settings.end(), {{"bits", fmt::to_string(p.bits)},
                                     {"black_level_dn", fmt::to_string(p.black_level_dn)},
                                     {"read_noise_dn", fmt::to_string(p.read_noise_dn)}});
    return settings;
}

std::string named_values(const ProfileEffect &effect, const char *format) {
    std::vector<std::string> values;
    for (const ProfileParameter &parameter : effect.parameters)
        values.push_back(fmt::format(fmt::runtime(format), parameter.name, parameter.value));
    return fmt::format("{}", fmt::join(values, format[0] == '{' ? "," : ", "));
}

std::string command_line(const CameraProfile &p) {
    std::string text;
    for (const ProfileSequence &s : p.sequences) {
        const char *illumination = s.scene == CaptureScene::kDark   ? "dark"
                                   : s.scene == CaptureScene::kFlat ? "incoherent"
                                                                    : "laser";
        text += fmt::format("# {}: --illumination {} --refresh {}", s.name, illumination, s.moving ? "all" : "none");
        if (s.scene != CaptureScene::kDark)
            text += fmt::format(" --exposure-gain-dn {}", s.gain_dn);
        text += "\n";
    }
    for (const ProfileEffect &effect : p.effects)
        if (draws_dots(effect))
            text += fmt::format("# left out, as the image has the pattern: {}:{}\n", effect.id,
                                named_values(effect, "{}={}"));
    text += "clspeckle render ideal.npy -o frames";
    const auto option = [&](const std::string &words) { text += " \\\n    " + words; };
    option(fmt::format("--normalization unit_mean --field {}", field_name(p)));
    for (auto [name, value] : shared_settings(p)) {
        std::replace(name.begin(), name.end(), '_', '-');
        option(fmt::format("--{} {}", name, value));
    }
    if (!is_centered(p))
        option(fmt::format("--principal-point-px {},{}", p.principal_point_px[0], p.principal_point_px[1]));
    for (const ProfileEffect &effect : p.effects)
        if (!draws_dots(effect))
            option(fmt::format("--effect {}:{}", effect.id, named_values(effect, "{}={}")));
    return text + "\n";
}

std::string python(const CameraProfile &p) {
    std::string text = "import clspeckle\n\n";
    for (const ProfileSequence &s : p.sequences)
        if (s.scene != CaptureScene::kDark)
            text += fmt::format("# {}: exposure_gain_dn={}\n", s.name, s.gain_dn);
    text +=
        fmt::format("camera = clspeckle.Pipeline.from_parameters(\n    ({}, {}),\n    normalization=\"unit_mean\",\n"
                    "    field=\"{}\",\n",
                    p.height, p.width, field_name(p));
    if (p.degree_of_polarization < 1.0)
        text += "    polarization_count=2,\n";
    for (const auto &[name, value] : shared_settings(p))
        text += fmt::format("    {}={},\n", name, value);
    if (!is_centered(p))
        text += fmt::format("    principal_point_px=({}, {}),\n", p.principal_point_px[0], p.principal_point_px[1]);
    text += "    effects={\n";
    for (const ProfileEffect &effect : p.effects)
        text +=
            fmt::format("        {}\"{}\": {{{}}},\n", draws_dots(effect) ? "# with dots=clspeckle.Dots(...): " : "",
                        effect.id, named_values(effect, "\"{}\": {}"));
    return text + "    },\n)\n";
}

// Names of sequences hold no end of a comment (kMaxSequenceName and its letters).
std::string c(const CameraProfile &p) {
    std::string text = "#include <clspeckle/clspeckle.h>\n\n";
    for (const ProfileSequence &s : p.sequences)
        if (s.scene != CaptureScene::kDark)
            text += fmt::format("/* {}: sensor->exposure_gain_dn = {} */\n", s.name, s.gain_dn);
    text +=
        fmt::format("/* Descriptions as their Init functions make them. */\n"
                    "static void describe_camera(ClspPhaseDesc *phase, ClspApertureDesc *aperture, ClspLensDesc *lens, "
                    "ClspSensorDesc *sensor) {{\n"
                    "    phase->width = aperture->width = lens->width = sensor->width = {};\n"
                    "    phase->height = aperture->height = lens->height = sensor->height = {};\n"
                    "    phase->field = {};\n"
                    "    phase->polarization_count = {};\n"
                    "    phase->oversampling = aperture->oversampling = {};\n"
                    "    aperture->normalization = CLSP_NORMALIZATION_UNIT_MEAN;\n",
                    p.width, p.height,
                    p.field == FieldKind::kUnitPhasor ? "CLSP_FIELD_UNIT_PHASOR" : "CLSP_FIELD_CIRCULAR_GAUSSIAN",
                    p.degree_of_polarization < 1.0 ? 2 : 1, p.oversampling);
    for (const auto &[name, value] : shared_settings(p)) {
        const bool sensor = name == "bits" || name == "black_level_dn" || name == "read_noise_dn";
        if (name != "oversampling")
            text += fmt::format("    {}->{} = {};\n", sensor ? "sensor" : "aperture", name, value);
    }
    text += fmt::format("    lens->principal_point_given = 1;\n    lens->principal_point_x_px = {};\n"
                        "    lens->principal_point_y_px = {};\n}}\n\n",
                        p.principal_point_px[0], p.principal_point_px[1]);
    std::string arrays, settings;
    std::size_t count = 0;
    for (const ProfileEffect &effect : p.effects) {
        if (draws_dots(effect)) {
            arrays += fmt::format("    /* {} needs a pipeline with dots. */\n", effect.id);
            continue;
        }
        std::vector<std::string> values;
        for (const ProfileParameter &parameter : effect.parameters)
            values.push_back(fmt::format("{} /* {} */", parameter.value, parameter.name));
        arrays += fmt::format("    const double {}[] = {{{}}};\n", effect.id, fmt::join(values, ", "));
        settings += fmt::format("        {{\"{0}\", {0}, {1}, 0}},\n", effect.id, values.size());
        ++count;
    }
    text += "static ClspStatus set_camera_effects(ClspPipeline pipeline) {\n" + arrays;
    if (count == 0)
        return text + "    (void)pipeline;\n    return CLSP_SUCCESS;\n}\n";
    return text + fmt::format("    const ClspEffectSetting effects[] = {{\n{}    }};\n"
                              "    return clspPipelineSetEffects(pipeline, {}, effects);\n}}\n",
                              settings, count);
}

} // namespace

PasteTexts paste_texts(const CameraProfile &profile) {
    return {command_line(profile), python(profile), c(profile)};
}

void write_paste(const CameraProfile &profile, HtmlPage &page) {
    const PasteTexts texts = paste_texts(profile);
    CameraProfile bare = profile; // maps are files of their own
    bare.dark_map.reset();
    bare.gain_map.reset();
    bare.map_notes.clear();
    const std::string file = profile_json(bare);
    page.raw("<section id=\"paste\">\n");
    page.heading(2, "To paste");
    page.paragraph(
        "The camera that was found, with all effects of the last model. diagnose --profile writes it as a file, "
        "which render --profile and all interfaces load, with the maps of its own pixels beside it; below it stands "
        "without them. Gains are those of the capture's light, a condition of "
        "the lab.");
    for (const auto &[name, text] : {std::pair{"Command line", &texts.command_line},
                                     {"Python", &texts.python},
                                     {"C", &texts.c},
                                     {"Profile", &file}}) {
        page.raw(fmt::format("<details{}><summary>{}</summary>\n", text == &texts.command_line ? " open" : "", name));
        std::string lines;
        for (std::size_t begin = 0; begin < text->size();) {
            const std::size_t end = std::min(text->find('\n', begin), text->size());
            lines += escaped(text->substr(begin, end - begin)) + "\n";
            begin = end + 1;
        }
        page.raw("<pre>" + lines + "</pre>\n</details>\n");
    }
    page.raw("</section>\n");
}

} // namespace clsp
