#include "capture/capture_json.hpp"

#include "capture/json_file.hpp"
#include "capture/sequence_files.hpp"
#include "io/codes.hpp"
#include "io/inside.hpp"
#include "io/json_text.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <initializer_list>
#include <limits>
#include <set>
#include <stdexcept>

namespace clsp {
namespace {

class Parser : public JsonChecks {
  public:
    using JsonChecks::JsonChecks;

    // A path that stays in the folder.
    std::string relative_path(const Json &parent, const char *key, const std::string &where,
                              const char *expected) const {
        const std::string value = text(parent, key, where, expected);
        const std::string field = where + "/" + key;
        if (value.empty() || value.find('\0') != std::string::npos)
            refuse(field, fmt::format("is {}; expected {}", shown(value), expected));
        if (image_io::leaves_folder(value))
            refuse(
                field,
                fmt::format(
                    "is {}; expected a path within the folder of capture.json, neither absolute nor with \"..\": copy "
                    "the file there, or link to it",
                    shown(value)));
        return value;
    }
    void note_unknown(const Json &object, const std::string &where, std::initializer_list<const char *> known,
                      const std::string &sequence, std::vector<CaptureWarning> &warnings) const {
        constexpr std::size_t kMostTold = 20;
        std::size_t unknown = 0;
        for (const auto &[key, value] : object.items())
            if (std::none_of(known.begin(), known.end(), [&k = key](const char *name) { return k == name; }) &&
                ++unknown <= kMostTold)
                warnings.push_back({sequence,
                                    fmt::format("{}: the key {}/{} is not known and is ignored", path(), where, key),
                                    "unknown_key"});
        if (unknown > kMostTold)
            warnings.push_back({sequence,
                                fmt::format("{}: {} further keys of {}/ are not known and are ignored", path(),
                                            unknown - kMostTold, where),
                                "unknown_key"});
    }
};

void read_camera(const Parser &parser, const Json &root, CaptureDescription &result) {
    const Json &camera = parser.object(
        root, "camera", "",
        R"({"width": 192, "height": 160, "bits": 10, "pixel_pitch_um": 2.9, "f_number": 5.6, "black_level_dn": 64.0, )"
        R"("read_noise_dn": 4.0} with the values of your camera)");
    CaptureLayout &layout = result.layout;
    layout.width = parser.integer(camera, "width", "/camera", "the number of columns");
    layout.height = parser.integer(camera, "height", "/camera", "the number of rows");
    layout.bits = parser.integer(camera, "bits", "/camera", "the number of bits of a code");
    if (camera.contains("msb_aligned")) {
        if (!camera["msb_aligned"].is_boolean())
            parser.refuse("/camera/msb_aligned", fmt::format("is {}; expected true where codes stand in the upper bits "
                                                             "of 16-bit words, or false",
                                                             shown(camera["msb_aligned"])));
        result.msb_aligned = camera["msb_aligned"].get<bool>();
    }
    layout.pixel_pitch_m =
        parser.number(camera, "pixel_pitch_um", "/camera", "the distance between pixel centres in um") * 1e-6;
    layout.f_number = parser.number(camera, "f_number", "/camera", "the f-number of the lens");
    layout.black_level_dn = parser.number(camera, "black_level_dn", "/camera", "the data sheet's black level in DN");
    layout.read_noise_dn = parser.number(camera, "read_noise_dn", "/camera", "the data sheet's read noise in DN");
    layout.principal_point_px = {(layout.width - 1.0) / 2.0, (layout.height - 1.0) / 2.0};
    if (camera.contains("principal_point_px"))
        layout.principal_point_px = parser.point(camera["principal_point_px"], "/camera/principal_point_px");
    parser.note_unknown(camera, "/camera",
                        {"width", "height", "bits", "pixel_pitch_um", "f_number", "black_level_dn", "read_noise_dn",
                         "principal_point_px", "msb_aligned"},
                        "", result.warnings);
}

void read_dots(const Parser &parser, const Json &root, CaptureDescription &result) {
    if (!root.contains("dots") || root["dots"].is_null())
        return;
    const Json &dots = parser.object(root, "dots", "", R"({"sigma_px": 2.2, "positions_px": [[10.7, 11.2]]})");
    CaptureDots value;
    value.sigma_px = parser.number(dots, "sigma_px", "/dots", "the width of a dot in pixels");
    const auto positions = dots.find("positions_px");
    if (positions == dots.end() || !positions->is_array())
        parser.refuse("/dots/positions_px", "is missing or no list; expected [[x, y], ...] in pixels");
    value.positions_px.reserve(positions->size());
    for (std::size_t i = 0; i < positions->size(); ++i)
        value.positions_px.push_back(parser.point((*positions)[i], fmt::format("/dots/positions_px/{}", i)));
    parser.note_unknown(dots, "/dots", {"sigma_px", "positions_px"}, "", result.warnings);
    result.layout.dots = std::move(value);
}

void read_sequence(const Parser &parser, const Json &entry, std::size_t index, CaptureDescription &result) {
    const std::string where = fmt::format("/sequences/{}", index);
    if (!entry.is_object())
        parser.refuse(where, fmt::format("is {}; expected an object {{...}}", shown(entry)));
    SequenceLayout sequence;
    sequence.name = parser.text(entry, "name", where, "a name");
    sequence.scene = static_cast<CaptureScene>(parser.word(entry, "scene", where, {"dark", "flat", "board", "dots"}));
    const bool speckle = is_laser(sequence.scene);
    // Nothing in the dark or under an LED shows motion.
    if (speckle || entry.contains("motion"))
        sequence.moving = parser.word(entry, "motion", where, {"static", "moving"}) == 1;
    sequence.f_number = result.layout.f_number;
    if (entry.contains("f_number"))
        sequence.f_number = parser.number(entry, "f_number", where, "the f-number of this sequence");
    if (entry.contains("exposure_ms"))
        sequence.exposure_ms = parser.number(entry, "exposure_ms", where, "the exposure time in ms");
    const std::string frames =
        fmt::format("the path of an .npy stack, or of a folder or glob of {} frames", image_io::frame_formats("or"));
    result.files.push_back(parser.relative_path(entry, "file", where, frames.c_str()));
    result.masks.push_back(
        entry.contains("mask") ? parser.relative_path(entry, "mask", where, "the path of an 8-bit image") : "");
    result.raws.emplace_back();
    if (entry.contains("raw")) {
        try {
            result.raws.back() = image_io::parse_raw(parser.text(entry, "raw", where, image_io::raw_form));
        } catch (const std::invalid_argument &error) {
            parser.refuse(where + "/raw", fmt::format("is {}", error.what()));
        }
    }
    parser.note_unknown(entry, where, {"name", "file", "scene", "motion", "exposure_ms", "f_number", "mask", "raw"},
                        sequence.name, result.warnings);
    result.layout.sequences.push_back(std::move(sequence));
}

} // namespace

CaptureDescription read_capture_json(const std::string &path) {
    const JsonDocument file = read_json_file(path);
    const Json &root = file.root();
    const Parser parser(path);
    if (!root.is_object())
        parser.refuse("/", "is no object; expected {\"format\": \"clspeckle-capture\", \"version\": 1, ...}");
    parser.word(root, "format", "", {"clspeckle-capture"});
    if (const std::uint32_t version = parser.integer(root, "version", "", "1"); version != 1)
        parser.refuse("/version", fmt::format("is {}; this release reads version 1", version));
    CaptureDescription result;
    read_camera(parser, root, result);
    read_dots(parser, root, result);
    const auto sequences = root.find("sequences");
    if (sequences == root.end() || !sequences->is_array() || sequences->empty())
        parser.refuse("/sequences", "is missing or empty; expected a list of at least one sequence, for example "
                                    R"([{"name": "dark", "file": "dark.npy", "scene": "dark"}])");
    for (std::size_t i = 0; i < sequences->size(); ++i)
        read_sequence(parser, (*sequences)[i], i, result);

    CaptureLayout &layout = result.layout;
    const auto speckle = std::find_if(layout.sequences.begin(), layout.sequences.end(),
                                      [](const SequenceLayout &s) { return is_laser(s.scene); });
    if (speckle != layout.sequences.end() || root.contains("laser")) {
        std::string example =
            R"({"wavelength_nm": 940.0, "degree_of_polarization": 1.0} with the values of your laser)";
        if (speckle != layout.sequences.end())
            example += fmt::format(": the sequence \"{}\" shows its light", speckle->name);
        const Json &laser = parser.object(root, "laser", "", example);
        layout.wavelength_m = parser.number(laser, "wavelength_nm", "/laser", "the wavelength in nm") * 1e-9;
        if (laser.contains("degree_of_polarization"))
            layout.degree_of_polarization = parser.number(laser, "degree_of_polarization", "/laser", "0 to 1");
        parser.note_unknown(laser, "/laser", {"wavelength_nm", "degree_of_polarization"}, "", result.warnings);
    } else {
        layout.wavelength_m = 940e-9;
        result.warnings.push_back(
            {"", fmt::format("{}: /laser is missing; nothing in this set depends on it, 940 nm is assumed", path),
             "no_laser"});
    }
    if (root.contains("baseline")) {
        const Json &baseline = parser.object(root, "baseline", "", R"({"field": "circular_gaussian"})");
        layout.field =
            static_cast<FieldKind>(parser.word(baseline, "field", "/baseline", {"circular_gaussian", "unit_phasor"}));
        parser.note_unknown(baseline, "/baseline", {"field"}, "", result.warnings);
    }
    parser.note_unknown(root, "", {"format", "version", "camera", "laser", "baseline", "dots", "sequences"}, "",
                        result.warnings);
    return result;
}

std::string capture_json(const CaptureLayout &layout) {
    using image_io::JsonText;
    JsonText root;
    root["format"] = "clspeckle-capture";
    root["version"] = 1;
    JsonText &camera = root["camera"];
    camera["width"] = layout.width;
    camera["height"] = layout.height;
    camera["bits"] = layout.bits;
    camera["pixel_pitch_um"] = rounded(layout.pixel_pitch_m * 1e6);
    camera["f_number"] = layout.f_number;
    camera["black_level_dn"] = layout.black_level_dn;
    camera["read_noise_dn"] = layout.read_noise_dn;
    const std::array<double, 2> centre = {(layout.width - 1.0) / 2.0, (layout.height - 1.0) / 2.0};
    if (layout.principal_point_px != centre)
        camera["principal_point_px"] = layout.principal_point_px;
    root["laser"] = {{"wavelength_nm", rounded(layout.wavelength_m * 1e9)},
                     {"degree_of_polarization", layout.degree_of_polarization}};
    root["baseline"] = {{"field", layout.field == FieldKind::kUnitPhasor ? "unit_phasor" : "circular_gaussian"}};
    if (layout.dots)
        root["dots"] = {{"sigma_px", layout.dots->sigma_px}, {"positions_px", layout.dots->positions_px}};
    for (const SequenceLayout &s : layout.sequences) {
        JsonText entry = {{"name", s.name},
                          {"file", s.name + ".npy"},
                          {"scene", scene_name(s.scene)},
                          {"motion", motion_name(s.moving)}};
        if (s.exposure_ms)
            entry["exposure_ms"] = *s.exposure_ms;
        if (s.f_number != layout.f_number)
            entry["f_number"] = s.f_number;
        if (!s.mask.empty())
            entry["mask"] = s.name + "_mask.png";
        root["sequences"].push_back(std::move(entry));
    }
    return root.text(1) + "\n";
}

} // namespace clsp
