#include "report/profile_json.hpp"

#include "capture/json_file.hpp"
#include "effects/effects.hpp"
#include "io/json_text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <initializer_list>
#include <set>

namespace clsp {

using image_io::JsonText;

namespace {

constexpr const char *kFormat = "clspeckle-camera-profile";
// 2: with maps. What has none is written as 1, which older releases read.
constexpr std::uint32_t kFirstVersion = 1, kVersion = 2;
constexpr std::size_t kMostEntries = 4096; // of a list

// Puts the members of one object into JSON.
class ProfileWriter {
  public:
    explicit ProfileWriter(JsonText &to) : to_(to) {}

    void format(const char *key, const char *text) { to_[key] = text; }
    std::uint32_t version(const char *key, std::uint32_t number) {
        to_[key] = number;
        return number;
    }
    void number(const char *key, double value, double, double, const char *) { to_[key] = value; }
    void given_number(const char *key, const std::optional<double> &value, double, double, const char *) {
        if (value)
            to_[key] = *value;
    }
    void count(const char *key, std::uint32_t value, std::uint32_t, std::uint32_t, const char *) { to_[key] = value; }
    void seed(const char *key, std::uint64_t value) { to_[key] = value; }
    void flag(const char *key, bool value, const char *) { to_[key] = value; }
    void text(const char *key, const std::string &value, const char *) { to_[key] = value; }
    void texts(const char *key, const std::vector<std::string> &values, const char *) { to_[key] = values; }
    void pair(const char *key, const std::array<double, 2> &value, const char *) { to_[key] = value; }
    template <typename Enum> void word(const char *key, Enum value, std::initializer_list<const char *> words) {
        to_[key] = words.begin()[static_cast<std::size_t>(value)];
    }
    template <typename Visit> void object(const char *key, const char *, Visit visit) {
        JsonText object = JsonText::object();
        ProfileWriter inner(object);
        visit(inner);
        to_[key] = std::move(object);
    }
    template <typename T, typename Visit>
    void given_object(const char *key, std::optional<T> &value, const char *what, Visit visit) {
        if (value)
            object(key, what, [&](ProfileWriter &inner) { visit(inner, *value); });
    }
    void hash(const char *key, std::uint64_t value) { to_[key] = fmt::format("{:016x}", value); }
    void file(const char *key, const std::string &name) { to_[key] = name; }
    void shape(const char *key, const CameraProfile &profile) { to_[key] = {profile.height, profile.width}; }
    template <typename Entry, typename Visit>
    void list(const char *key, std::vector<Entry> &entries, const char *, Visit visit) {
        JsonText list = JsonText::array();
        for (Entry &entry : entries) {
            list.push_back(JsonText::object());
            ProfileWriter inner(list.back());
            visit(inner, entry);
        }
        to_[key] = std::move(list);
    }
    void parameters(const char *key, const char *intervals_key, ProfileEffect &effect, bool) {
        JsonText values = JsonText::object(), intervals = JsonText::object();
        for (const ProfileParameter &parameter : effect.parameters) {
            values[parameter.name] = parameter.value;
            if (parameter.interval && std::isfinite((*parameter.interval)[0]) &&
                std::isfinite((*parameter.interval)[1]))
                intervals[parameter.name] = *parameter.interval;
        }
        to_[key] = std::move(values);
        to_[intervals_key] = std::move(intervals);
    }

  private:
    JsonText &to_;
};

// Takes the members of one object out of JSON. A key that is none of them is refused: a value that nobody reads would
// make another camera than its writer meant.
class ProfileReader {
  public:
    ProfileReader(const JsonChecks &checks, const Json &from, std::string where)
        : checks_(checks), from_(from), where_(std::move(where)) {}

    void finish() const {
        for (const auto &[key, value] : from_.items())
            if (!keys_.count(key)) {
                std::string known;
                for (const std::string &name : keys_)
                    known += (known.empty() ? "" : ", ") + name;
                refuse(key, fmt::format("is {}; no such key is known here, expected {}: correct its name, or leave it "
                                        "out",
                                        shown(value), known));
            }
    }
    void format(const char *key, const char *text) {
        keys_.insert(key);
        // Not as JSON: the library's comparison allocates, and ends the program where that fails.
        if (const auto found = from_.find(key);
            found == from_.end() || !found->is_string() || found->get_ref<const std::string &>() != text)
            refuse(key, fmt::format("is {}; expected \"{}\": name a file that clspeckle diagnose --profile wrote",
                                    found == from_.end() ? "missing" : shown(*found), text));
    }
    std::uint32_t version(const char *key, std::uint32_t) {
        std::uint32_t given = 0;
        count(key, given, 1, 1000000, "the format's number");
        if (given > kVersion)
            refuse(key,
                   fmt::format("is {}; clSpeckle {} reads versions {} to {}: use a newer clSpeckle, or diagnose the "
                               "capture again with this one",
                               given, CLSP_PROJECT_VERSION, kFirstVersion, kVersion));
        return given;
    }
    template <typename T, typename Visit>
    void given_object(const char *key, std::optional<T> &value, const char *what, Visit visit) {
        keys_.insert(key);
        if (from_.contains(key))
            object(key, what, [&](ProfileReader &inner) { visit(inner, value.emplace()); });
    }
    void hash(const char *key, std::uint64_t &value) {
        const char *expected = "16 hexadecimal digits, the FNV-1a hash of the map's values";
        const Json &given = take(key, expected);
        const std::string text = given.is_string() ? given.get<std::string>() : "";
        const auto result = std::from_chars(text.data(), text.data() + text.size(), value, 16);
        if (text.size() != 16 || result.ec != std::errc() || result.ptr != text.data() + text.size())
            refuse(key, fmt::format("is {}; expected {}", shown(given), expected));
    }
    // In the profile's folder: what it leads to is part of the camera.
    void file(const char *key, std::string &name) {
        const char *expected = "the name of a file beside the profile, without a folder";
        text(key, name, expected);
        if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos)
            refuse(key, fmt::format("is \"{}\"; expected {}", name, expected));
    }
    void shape(const char *key, const CameraProfile &profile) {
        const Json expected = {profile.height, profile.width};
        if (const Json &given = take(key, "[height, width]"); given != expected)
            refuse(key,
                   fmt::format("is {}; expected {}, the camera's height and width", shown(given), shown(expected)));
    }
    void number(const char *key, double &value, double low, double high, const char *what) {
        const std::string expected = fmt::format("a number from {} to {}, {}", low, high, what);
        value = checks_.number(take(key, expected), path(key), expected.c_str());
        if (!(value >= low && value <= high))
            refuse(key, fmt::format("is {}; expected {}", value, expected));
    }
    void given_number(const char *key, std::optional<double> &value, double low, double high, const char *what) {
        keys_.insert(key);
        if (from_.contains(key))
            number(key, value.emplace(), low, high, what);
    }
    void count(const char *key, std::uint32_t &value, std::uint32_t low, std::uint32_t high, const char *what) {
        const std::string expected = fmt::format("a whole number from {} to {}, {}", low, high, what);
        const Json &given = take(key, expected);
        const double number = given.is_number() ? given.get<double>() : -1.0;
        if (!(number >= low && number <= high && number == std::floor(number)))
            refuse(key, fmt::format("is {}; expected {}", shown(given), expected));
        value = static_cast<std::uint32_t>(number);
    }
    void seed(const char *key, std::uint64_t &value) {
        const Json &given = take(key, "a whole number from 0 to 2^64 - 1, the diagnosis's seed");
        if (!given.is_number_unsigned())
            refuse(key, fmt::format("is {}; expected a whole number from 0 to 2^64 - 1", shown(given)));
        value = given.get<std::uint64_t>();
    }
    void flag(const char *key, bool &value, const char *what) {
        const Json &given = take(key, fmt::format("true or false, {}", what));
        if (!given.is_boolean())
            refuse(key, fmt::format("is {}; expected true or false, {}", shown(given), what));
        value = given.get<bool>();
    }
    void text(const char *key, std::string &value, const char *what) { value = text_of(take(key, what), key, what); }
    void texts(const char *key, std::vector<std::string> &values, const char *what) {
        for (const Json &entry : array(key, what))
            values.push_back(text_of(entry, key, what));
    }
    void pair(const char *key, std::array<double, 2> &value, const char *what) {
        value = pair_of(take(key, what), path(key), what);
    }
    template <typename Enum> void word(const char *key, Enum &value, std::initializer_list<const char *> words) {
        keys_.insert(key);
        value = static_cast<Enum>(checks_.word(from_, key, where_, words));
    }
    template <typename Visit> void object(const char *key, const char *what, Visit visit) {
        const Json &given = take(key, what);
        if (!given.is_object())
            refuse(key, fmt::format("is {}; expected {}", shown(given), what));
        ProfileReader inner(checks_, given, path(key));
        visit(inner);
        inner.finish();
    }
    template <typename Entry, typename Visit>
    void list(const char *key, std::vector<Entry> &entries, const char *what, Visit visit) {
        const Json &given = array(key, what);
        for (std::size_t i = 0; i < given.size(); ++i) {
            const std::string where = fmt::format("{}/{}", path(key), i);
            if (!given[i].is_object())
                checks_.refuse(where, fmt::format("is {}; expected an object", shown(given[i])));
            ProfileReader inner(checks_, given[i], where);
            visit(inner, entries.emplace_back());
            inner.finish();
        }
    }
    // catalogue: the effect is one of its.
    void parameters(const char *key, const char *intervals_key, ProfileEffect &effect, bool catalogue) {
        const char *what = "an object with a number for each of the effect's parameters";
        const Json &values = take(key, what), &intervals = take(intervals_key, "an object of [low, high]");
        for (const auto &[name, given] : {std::pair{key, &values}, std::pair{intervals_key, &intervals}})
            if (!given->is_object())
                refuse(name, fmt::format("is {}; expected an object", shown(*given)));
        if (catalogue)
            check_effect(values, key, effect);
        else
            for (const auto &[name, value] : values.items())
                effect.parameters.push_back({name, checks_.number(value, path(key) + "/" + name, what), {}});
        for (const auto &[name, limits] : intervals.items()) {
            const auto parameter = std::find_if(effect.parameters.begin(), effect.parameters.end(),
                                                [&n = name](const ProfileParameter &p) { return p.name == n; });
            const std::string where = path(intervals_key) + "/" + name;
            if (parameter == effect.parameters.end())
                checks_.refuse(where,
                               fmt::format("is an interval of no parameter that {} has; leave it out", effect.id));
            parameter->interval = pair_of(limits, where, "[low, high], the interval of 95 %");
            if (!((*parameter->interval)[0] <= (*parameter->interval)[1]))
                checks_.refuse(where,
                               fmt::format("is {}; expected [low, high] with low not above high", shown(limits)));
        }
    }

  private:
    std::string path(const std::string &key) const { return where_ + "/" + key; }
    [[noreturn]] void refuse(const std::string &key, const std::string &what) const { checks_.refuse(path(key), what); }
    const Json &take(const char *key, const std::string &expected) {
        keys_.insert(key);
        return checks_.member(from_, key, where_, expected.c_str());
    }
    const Json &array(const char *key, const char *what) {
        const Json &given = take(key, what);
        if (!given.is_array() || given.size() > kMostEntries)
            refuse(key, fmt::format("is {}; expected {}, at most {} of them", shown(given), what, kMostEntries));
        return given;
    }
    std::string text_of(const Json &given, const char *key, const char *what) const {
        const std::string text = given.is_string() ? given.get<std::string>() : "";
        if (!given.is_string() || text.size() > 255 ||
            std::any_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
            refuse(key,
                   fmt::format("is {}; expected {}, at most 255 bytes without control characters", shown(given), what));
        return text;
    }
    std::array<double, 2> pair_of(const Json &given, const std::string &field, const char *what) const {
        if (!given.is_array() || given.size() != 2)
            checks_.refuse(field, fmt::format("is {}; expected {}", shown(given), what));
        return {checks_.number(given[0], field + "/0", what), checks_.number(given[1], field + "/1", what)};
    }
    void check_effect(const Json &values, const char *key, ProfileEffect &effect) {
        if (!in_catalogue(effect.id)) {
            std::string ids;
            for (const Effect &known : effect_catalogue())
                ids += fmt::format("{}{}", ids.empty() ? "" : ", ", known.id);
            refuse("effect", fmt::format("is \"{}\"; clSpeckle {} has no such effect, expected one of {}", effect.id,
                                         CLSP_PROJECT_VERSION, ids));
        }
        const Effect &known = find_effect(effect.id);
        std::string names;
        for (const EffectParameter &p : known.parameters)
            names += fmt::format("{}{}", names.empty() ? "" : ", ", p.name);
        for (const auto &[name, value] : values.items())
            if (std::none_of(known.parameters.begin(), known.parameters.end(),
                             [&n = name](const EffectParameter &p) { return n == p.name; }))
                checks_.refuse(path(key) + "/" + name, fmt::format("is {}; {} has no such parameter, expected {}",
                                                                   shown(value), effect.id, names));
        for (const EffectParameter &p : known.parameters) {
            const std::string expected =
                fmt::format("a {} from {} to {}{}", p.whole ? "whole number" : "number", p.minimum, p.maximum,
                            std::string(p.unit) == "1" ? "" : std::string(" ") + p.unit);
            const std::string where = path(key);
            // What the catalogue does not vary came later than some profiles.
            const double value = p.weak == p.strong && !values.contains(p.name)
                                     ? p.weak
                                     : checks_.number(values, p.name, where, expected.c_str());
            if (!(value >= p.minimum && value <= p.maximum) || (p.whole && value != std::round(value)))
                checks_.refuse(where + "/" + p.name, fmt::format("is {}; expected {}", value, expected));
            effect.parameters.push_back({p.name, value, {}});
        }
    }

    const JsonChecks &checks_;
    const Json &from_;
    std::string where_;
    std::set<std::string> keys_;
};

template <typename Io> void visit_effect(Io &io, ProfileEffect &effect, bool catalogue) {
    io.text("effect", effect.id, "the id of an effect");
    io.parameters("parameters", "intervals", effect, catalogue);
    io.flag("named", effect.named, "whether the verdict names it");
    io.flag("conditional", effect.conditional, "whether it rests on a scene in which something unknown remains");
}

template <typename Io> void visit_map(Io &io, const CameraProfile &profile, ProfileMap &map, const char *error_key) {
    io.file("file", map.file);
    io.shape("shape", profile);
    io.hash("fnv1a", map.hash);
    io.texts("holds", map.holds, "a list of effects of the catalogue");
    io.texts("sequences", map.sequences, "a list of names of sequences");
    io.count("frames", map.frame_count, 1, 4294967295u, "how many frames it is of");
    io.number(error_key, map.standard_error, 0.0, 65535.0, "the noise that is left in a pixel's value");
    io.object("pattern_kept", "an object, by what the pattern was multiplied", [&](auto &parts) {
        parts.number("pixels", map.pixel_part, 0.0, 1.0, "the factor of single pixels");
        parts.number("rows", map.row_part, 0.0, 1.0, "the factor of whole rows");
        parts.number("columns", map.column_part, 0.0, 1.0, "the factor of whole columns");
    });
}

// The one list of keys.
template <typename Io> void visit(Io &io, CameraProfile &p) {
    io.format("format", kFormat);
    const std::uint32_t version =
        io.version("version", p.maps() || !p.map_notes.empty() ? kVersion : kFirstVersion);
    io.object("camera", "an object, the simulator's settings", [&](auto &camera) {
        camera.count("width", p.width, 8, 16384, "columns of an image");
        camera.count("height", p.height, 8, 16384, "rows of an image");
        camera.count("bits", p.bits, 8, 16, "bits of a code");
        camera.number("pixel_pitch_m", p.pixel_pitch_m, 1e-8, 1e-3, "the distance between pixel centres in m");
        camera.number("f_number", p.f_number, 0.1, 1000.0, "the nominal f-number");
        camera.number("wavelength_m", p.wavelength_m, 1e-7, 2e-5, "the laser's wavelength in m");
        camera.number("degree_of_polarization", p.degree_of_polarization, 0.0, 1.0, "of the returned light");
        camera.word("field", p.field, {"circular_gaussian", "unit_phasor"});
        camera.pair("principal_point_px", p.principal_point_px,
                    "[x, y] in pixels, where the optical axis meets the image");
        camera.number("black_level_dn", p.black_level_dn, -65535.0, 65535.0, "the code without light");
        camera.number("read_noise_dn", p.read_noise_dn, 0.0, 65535.0, "the standard deviation of the read noise in DN");
        camera.count("oversampling", p.oversampling, 1, 8, "samples of the field for each pixel along an axis");
        camera.number("fill_factor", p.fill_factor, 0.0, 1.0, "the part of a pixel that is sampled; 0: all");
    });
    io.list("effects", p.effects, "a list of effects of the catalogue",
            [](auto &entry, ProfileEffect &effect) { visit_effect(entry, effect, true); });
    io.list("hypotheses", p.hypotheses, "a list of the user's own effects",
            [](auto &entry, ProfileEffect &effect) { visit_effect(entry, effect, false); });
    if (version > kFirstVersion)
        io.object("maps", "an object, the patterns of the camera's own pixels", [&](auto &maps) {
            maps.given_object("dark", p.dark_map, "an object, the map of offsets", [&](auto &map, ProfileMap &of) {
                visit_map(map, p, of, "standard_error_dn");
            });
            maps.given_object("gain", p.gain_map, "an object, the map of gains", [&](auto &map, ProfileMap &of) {
                visit_map(map, p, of, "standard_error");
            });
            maps.texts("notes", p.map_notes, "a list of words on maps that are missing");
        });
    io.object("lab", "an object, the conditions that the capture was recorded in", [&](auto &lab) {
        lab.list("sequences", p.sequences, "a list of sequences", [](auto &entry, ProfileSequence &s) {
            entry.text("name", s.name, "a sequence's name");
            entry.word("scene", s.scene, {"dark", "flat", "board", "dots"});
            entry.flag("moving", s.moving, "whether the surface moves between frames");
            entry.number("f_number", s.f_number, 0.1, 1000.0, "the nominal f-number of the sequence");
            entry.given_number("exposure_ms", s.exposure_ms, 0.0, 1e9, "the exposure time in ms");
            entry.number("mean_dn", s.mean_dn, -65535.0, 65535.0, "the mean of the camera's frames");
            entry.number("light_dn", s.light_dn, 0.0, 1e9, "the simulator's light above black in DN");
            entry.number("gain_dn", s.gain_dn, 0.0, 1e12, "DN per unit of the ideal image");
        });
        lab.list("lights", p.lights, "a list of lamp and laser", [](auto &entry, ProfileLight &light) {
            entry.text("light", light.name, "\"lamp\" or \"laser\"");
            entry.texts("sequences", light.sequences, "a list of names of sequences");
            entry.flag("uneven", light.uneven, "whether it was found uneven, which was calibrated away");
            entry.pair("slope", light.slope, "[x, y], of the light from the axis to the farthest corner");
            entry.number("corner_loss", light.corner_loss, -1e6, 1e6, "the part of the light that the corners lack");
        });
        lab.list("lamp_drifts", p.lamp_drifts, "a list of lamps that drift", [](auto &entry, ProfileDrift &drift) {
            entry.text("sequence", drift.sequence, "a sequence's name");
            entry.number("deviation", drift.deviation, 0.0, 1e6, "of a frame's light over its mean");
        });
        lab.flag("lens_or_light", p.lens_or_light, "whether a fall-off may be the lens's as well as the light's");
    });
    io.object("provenance", "an object, where the profile is from", [&](auto &from) {
        from.text("capture", p.capture, "the capture's name");
        from.text("clspeckle", p.version, "the version that wrote it");
        from.word("verdict", p.verdict, {"none", "named", "ambiguous", "unknown"});
        from.texts("equivalent", p.equivalent, "a list of effects that explain the capture as well");
        from.flag("residual_detected", p.residual_detected, "whether a gap remains with the effects");
        from.number("level", p.level, 0.0, 1.0, "the diagnosis's level of false alarms");
        from.seed("seed", p.seed);
    });
}

void check_twice(const JsonChecks &checks, const char *list, const std::vector<std::string> &names) {
    std::set<std::string> seen;
    for (std::size_t i = 0; i < names.size(); ++i)
        if (!seen.insert(names[i]).second)
            checks.refuse(
                fmt::format("{}/{}", list, i),
                fmt::format("is \"{}\", which stands in the list before; expected each once: keep one", names[i]));
}

} // namespace

std::string profile_json(const CameraProfile &profile) {
    JsonText root = JsonText::object();
    ProfileWriter writer(root);
    CameraProfile copy = profile; // what visits also reads into
    visit(writer, copy);
    return root.text(1) + "\n";
}

CameraProfile read_profile(const std::string &path) {
    const JsonDocument file = read_json_file(path);
    const Json &root = file.root();
    const JsonChecks checks(path);
    if (!root.is_object())
        checks.refuse("/", fmt::format("is {}; expected {{\"format\": \"{}\", ...}}", shown(root), kFormat));
    CameraProfile profile;
    ProfileReader reader(checks, root, "");
    visit(reader, profile);
    reader.finish();
    profile.path = path;
    for (const auto &[name, map] : {std::pair{"dark", &profile.dark_map}, std::pair{"gain", &profile.gain_map}})
        for (std::size_t i = 0; *map && i < (*map)->holds.size(); ++i)
            if (!in_catalogue((*map)->holds[i]))
                checks.refuse(fmt::format("/maps/{}/holds/{}", name, i),
                              fmt::format("is \"{}\"; clSpeckle {} has no such effect: use the clSpeckle that wrote it",
                                          (*map)->holds[i], CLSP_PROJECT_VERSION));
    const auto names = [](const auto &list, auto member) {
        std::vector<std::string> result;
        for (const auto &entry : list)
            result.push_back(entry.*member);
        return result;
    };
    check_twice(checks, "/effects", names(profile.effects, &ProfileEffect::id));
    check_twice(checks, "/hypotheses", names(profile.hypotheses, &ProfileEffect::id));
    check_twice(checks, "/lab/sequences", names(profile.sequences, &ProfileSequence::name));
    return profile;
}

} // namespace clsp
