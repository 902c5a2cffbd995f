#include "options.hpp"

#include "errors.hpp"
#include "json.hpp"
#include "output.hpp"
#include "ranges.hpp"
#include "text.hpp"

#include <clspeckle/clspeckle.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <tuple>

namespace tools {

namespace {

constexpr double max_index = 281474976710655.0; // 2^48 - 1, the frame counter's range
constexpr double max_seed = 18446744073709551615.0;

Option boolean(const char *section, const char *key, bool fallback, const char *help) {
    Option o;
    o.section = section;
    o.key = key;
    o.kind = Kind::boolean;
    o.fallback = fallback;
    o.help = help;
    return o;
}

Option integer(const char *section, const char *key, Json fallback, double low, double high, const char *unit,
               const char *help, std::vector<std::string> words = {}) {
    Option o;
    o.section = section;
    o.key = key;
    o.kind = Kind::integer;
    o.fallback = std::move(fallback);
    o.low = low;
    o.high = high;
    o.unit = unit;
    o.help = help;
    o.words = std::move(words);
    return o;
}

Option number(const char *section, const char *key, double fallback, const Range &range, const char *help,
              std::vector<std::string> words = {}) {
    Option o;
    o.section = section;
    o.key = key;
    o.kind = Kind::number;
    o.fallback = std::isinf(fallback) ? Json("inf") : Json(fallback);
    o.low = range.low;
    o.high = range.high;
    o.unit = range.unit;
    o.help = help;
    o.words = std::move(words);
    return o;
}

/** With one of its words where nothing is said. */
Option otherwise(Option o, const char *word) {
    o.words = {word};
    o.fallback = word;
    return o;
}

Option choice(const char *section, const char *key, std::vector<std::string> words, std::size_t fallback,
              const char *help) {
    Option o;
    o.section = section;
    o.key = key;
    o.kind = Kind::choice;
    o.fallback = words.at(fallback);
    o.words = std::move(words);
    o.help = help;
    return o;
}

Option text(const char *section, const char *key, Kind kind, const std::string &help) {
    Option o;
    o.section = section;
    o.key = key;
    o.kind = kind;
    o.fallback = "";
    o.help = help;
    return o;
}

Option numbers(const char *section, const char *key, std::vector<double> fallback, std::vector<std::size_t> counts,
               const Range &range, const char *help) {
    Option o;
    o.section = section;
    o.key = key;
    o.kind = Kind::numbers;
    o.fallback = std::move(fallback);
    o.counts = std::move(counts);
    o.low = range.low;
    o.high = range.high;
    o.unit = range.unit;
    o.help = help;
    return o;
}

std::vector<Option> make_table() {
    const auto aperture = clspeckle::make<ClspApertureDesc>();
    const auto phase = clspeckle::make<ClspPhaseDesc>();
    const auto sensor = clspeckle::make<ClspSensorDesc>();
    const auto pattern = clspeckle::make<ClspPatternDesc>();
    const auto geometry = clspeckle::make<ClspGeometry>();
    const auto motion = clspeckle::make<ClspMotionDesc>();
    const auto pipeline = clspeckle::make<ClspPipelineDesc>();
    const auto frame = clspeckle::make<ClspFrame>();
    const auto &pose = pattern.laser_from_geometry;

    std::vector<Option> table = {
        number("aperture", "f_number", aperture.f_number, ranges::f_number, "f-number of the lens"),
        number("aperture", "pixel_pitch_m", aperture.pixel_pitch_m, ranges::pixel_pitch_m,
               "distance between two pixels of the sensor"),
        number("aperture", "wavelength_m", aperture.wavelength_m, ranges::wavelength_m, "wavelength of the laser"),
        number(
            "aperture", "relative_diameter", aperture.relative_diameter, ranges::relative_diameter,
            "diameter of the aperture in the frequency plane, at most the oversampling; 0: pixel_pitch / (wavelength * "
            "f_number)"),
        number("aperture", "degree_of_polarization", aperture.degree_of_polarization, ranges::part,
               "of the light that the surface returns; below 1 two independent speckle patterns add up"),
        number("aperture", "fill_factor", aperture.fill_factor, ranges::part,
               "light-sensitive part of a pixel's area; 0: the mean over its samples, a point without oversampling"),
        number("aperture", "soft_rim", aperture.soft_rim, ranges::part,
               "part of the aperture's radius over which it falls from 1 to 0"),
        text("aperture", "pupil_image", Kind::file,
             "amplitude transmission of the pupil, 0 to 1 (integers: of full scale); empty: a circle"),
        choice("aperture", "normalization", {"transmission", "unit_mean"}, aperture.normalization,
               "whether a smaller aperture passes less light (transmission) or the mean is kept (unit_mean)"),
        integer("aperture", "oversampling", aperture.oversampling, 1, 8, "",
                "field samples per pixel along each axis; the pixel integrates over them"),
        integer("aperture", "guard_px", aperture.guard_px, 0, 16384, "px",
                "padding at least this wide against light that wraps around the border"),

        numbers("lens", "principal_point_px", {}, {0, 2}, ranges::place_px,
                "where the optical axis meets the image, x, y; none: its centre"),

        choice("phase", "field", {"circular_gaussian", "unit_phasor"}, phase.field,
               "scatterers per sample: very many (circular_gaussian) or one (unit_phasor)"),
        integer("phase", "seed", "auto", 0, max_seed, "", "seed of the speckle; auto: --seed", {"auto"}),

        text("sensor", "profile", Kind::text,
             "a known sensor, for example OS04A10, whose settings replace the defaults; empty: none"),
        boolean("sensor", "enabled", true, "expose a sensor; without it the output is the intensity in front of it"),
        integer("sensor", "bits", sensor.bits, 8, 16, "", "bits of a code"),
        number("sensor", "exposure_gain_dn", sensor.exposure_gain_dn, ranges::gain,
               "codes per unit of intensity; auto: the 99.9th percentile of the first ideal image, speckled, has a "
               "mean of half of full scale, or of half of what a high black level and ambient light leave",
               {"auto"}),
        number("sensor", "saturation_dn", sensor.saturation_dn, ranges::saturation_dn,
               "the signal stops here; inf: only the converter clips"),
        number("sensor", "black_level_dn", sensor.black_level_dn, ranges::level_dn, "code without light"),
        number("sensor", "read_noise_dn", sensor.read_noise_dn, ranges::noise_dn,
               "standard deviation of the temporal noise"),
        number("sensor", "exposure_time_s", sensor.exposure_time_s, ranges::time_s,
               "for the effect dark_current only: the exposure gain is per exposure"),
        number("sensor", "hot_pixel_fraction", sensor.hot_pixel_fraction, ranges::part, "share of hot pixels"),
        number("sensor", "hot_pixel_mean_dn", sensor.hot_pixel_mean_dn, ranges::noise_dn, "mean offset of a hot pixel"),
        number("sensor", "cold_pixel_fraction", sensor.cold_pixel_fraction, ranges::part,
               "share of pixels that see no light"),
        text("sensor", "dark_frame", Kind::file, "image of the mean dark signal above the black level, in dn"),
        text("sensor", "gain_map", Kind::file, "image of the pixels' relative gains (a PRNU map), with a mean of 1"),
        boolean("sensor", "quantize", sensor.quantize != 0, "round float outputs to codes"),
        number("sensor", "float_full_scale", sensor.float_full_scale, ranges::scale,
               "value of the top code in a float output"),
        integer("sensor", "seed", "auto", 0, max_seed, "", "seed of noise and bad pixels; auto: --seed", {"auto"}),

        text("pattern", "image", Kind::file, "the projected pattern of a scene, linear in radiant intensity"),
        number("pattern", "half_extent_x", pattern.half_extent_x, ranges::half_extent,
               "half of the pattern's width in pattern coordinates"),
        number("pattern", "half_extent_y", pattern.half_extent_y, ranges::half_extent,
               "half of the pattern's height in pattern coordinates"),
        choice("pattern", "projection", {"tangent_plane", "direction_cosines"}, pattern.projection,
               "pattern coordinates: x/z, y/z or x/d, y/d"),
        choice("pattern", "quantity", {"radiant_intensity", "plane_irradiance"}, pattern.quantity,
               "what the pattern's values are: W/sr, or irradiance on a plane at unit distance"),
        choice("pattern", "filter", {"bilinear", "area"}, pattern.filter,
               "the pattern at a pixel's centre, or its mean over the pixel's footprint"),
        number("pattern", "power_scale", pattern.power_scale, ranges::gain, "factor on the pattern's values"),
        numbers("pattern", "laser_from_geometry", std::vector<double>(std::begin(pose), std::end(pose)), {12},
                ranges::pose_m, "pose of the laser, [R|t], 3 x 4 row by row"),

        number("camera", "fx_px", geometry.fx_px, ranges::focal_length_px, "focal length along x; needed with depth"),
        number("camera", "fy_px", geometry.fy_px, ranges::focal_length_px, "focal length along y; needed with depth"),
        number("camera", "cx_px", geometry.cx_px, ranges::place_px, "principal point, x; pixel centres are integers"),
        number("camera", "cy_px", geometry.cy_px, ranges::place_px, "principal point, y"),
        choice("camera", "depth_kind", {"along_axis", "along_ray"}, geometry.depth_kind,
               "whether depth is the z coordinate or the distance from the camera"),
        otherwise(number("camera", "depth_scale", 1.0, ranges::depth_unit_m,
                         "length of one unit of depths and positions: 0.001 for mm; auto: 1, and integers are refused"),
                  "auto"),

        choice(
            "motion", "rule", {"off", "correlate", "replace"}, 0,
            "what a scene's motion does to the speckle: nothing, it changes gradually with the way (correlate), or it "
            "is drawn anew where the way is too long (replace); with it the refresh mask is off unless --refresh says "
            "so"),
        boolean("motion", "translate", false, "the speckle moves with the surfaces, whole samples at a time"),
        number("motion", "frame_time_s", 0.0, ranges::time_s,
               "time between two frames, for materials that live; a sequence.json gives its own"),
        number("motion", "replace_threshold", motion.replace_threshold, ranges::way,
               "way in correlation lengths above which --motion replace draws new speckle"),

        number("surface", "subsurface_length_px", pipeline.subsurface_length_px, ranges::spread_px,
               "length over which light spreads in materials with a subsurface_fraction"),

        text("render", "device", Kind::text,
             "OpenCL device: platform:device, gpu, cpu, or a part of its name; empty: the best one (see clspeckle "
             "devices)"),
        integer("render", "seed", phase.seed, 0, max_seed, "", "seed of everything random"),
        integer("render", "frames", "auto", 1, 1e6, "",
                "frames to render; a still input is repeated: same speckle, new noise; auto: as many as the input has",
                {"auto"}),
        integer("render", "first_frame", frame.frame_index, 0, max_index - 1e6, "",
                "frame counter of the first frame (noise, refreshed speckle, file names)"),
        choice("render", "refresh", {"mask", "all", "none"}, frame.refresh,
               "new speckle where the input's refresh mask is not 0, everywhere, or nowhere"),
        choice("render", "illumination", {"laser", "incoherent", "dark"}, frame.illumination,
               "speckled laser light, a lamp's light from an ideal image without speckle, or none: a covered lens"),
        number("render", "irradiance_scale", 1.0, ranges::scale,
               "factor on an ideal image; integer images are divided by their top code first"),
        otherwise(number("render", "full_scale", 1.0, ranges::scale,
                         "number of an ideal image that means 1, for example 1023 for codes of 10 bits; auto: the top "
                         "code of its integers, and 1 for others"),
                  "auto"),
        boolean("render", "clip_negative", false,
                "set negative numbers of ideal images, albedos and the pattern to 0 and count them in a warning"),
        boolean("render", "zero_nonfinite", false,
                "set NaN and infinite numbers of ideal images, albedos and the pattern to 0 and count them in a "
                "warning"),
        choice(
            "render", "transfer", {"auto", "linear", "srgb"}, 0,
            "how numbers of ideal images, albedos and patterns stand for light: as the file says, linearly, or sRGB"),
        text(
            "render", "channel", Kind::text,
            "channel of an ideal image, three of them with commas, or a layer, as behind a file's name (FILE:CHANNEL); "
            "empty: its only one, Y, or R, G, B"),
        choice("render", "format", FrameFormat::words(), 0,
               "of the frames; 16-bit files hold the codes as they are: 1023 of 10 bits is stored as 1023"),
        boolean("render", "preview", true, "also write 8-bit PNG previews, scaled to the first frame"),
        boolean("render", "save_ideal", false, "also write the ideal images, as float NPY"),
        boolean("render", "stage_times", false, "show the time of each stage over all frames"),
    };

    for (Option &o : table) {
        const bool shared = std::any_of(table.begin(), table.end(), [&](const Option &other) {
            return other.key == o.key && other.section != o.section;
        });
        std::string name = o.key;
        // The pattern's words mean nothing alone; a key of two sections needs its section, except the program's own.
        if (o.section == "pattern")
            name = o.key == "image" ? "pattern" : "pattern_" + o.key;
        else if (o.section == "motion")
            name = o.key == "rule" ? "motion" : "motion_" + o.key;
        else if (o.key == "enabled")
            name = o.section;
        else if ((shared && o.section != "render") || o.id() == "sensor.profile") // --profile is a whole camera's
            name = o.section + "_" + o.key;
        std::replace(name.begin(), name.end(), '_', '-');
        o.name = name;
        for (const char *suffix : {"-dn", "-m", "-px", "-s"}) {
            const std::string tail = suffix;
            if (name.size() > tail.size() && name.compare(name.size() - tail.size(), tail.size(), tail) == 0)
                o.alias = name.substr(0, name.size() - tail.size());
        }
    }
    return table;
}

[[noreturn]] void refuse(const Option &o, const Json &value, const std::string &where) {
    std::string wanted = o.range();
    switch (o.kind) {
    case Kind::boolean:
        wanted = "true or false";
        break;
    case Kind::integer:
        wanted = "an integer" + (wanted.empty() ? "" : ", " + wanted);
        break;
    case Kind::number:
        wanted = "a number" + (wanted.empty() ? "" : ", " + wanted);
        break;
    case Kind::choice:
        break;
    case Kind::text:
    case Kind::file:
        wanted = "a text";
        break;
    case Kind::numbers:
        wanted = "a list of " + wanted;
        break;
    }
    throw InputError(fmt::format("{} must be {}; got {}", where, wanted, shown(value)));
}

bool in_range(const Option &o, double value) {
    return value >= o.low && value <= o.high; // NaN is neither
}

/** The value in the form in which it is kept, or an error. */
Json checked(const Option &o, const Json &value, const std::string &where) {
    if (value.is_string() && (o.kind == Kind::integer || o.kind == Kind::number || o.kind == Kind::choice)) {
        if (std::find(o.words.begin(), o.words.end(), value.get<std::string>()) != o.words.end())
            return value;
        if (o.kind == Kind::number && value == "inf" && o.fallback == "inf")
            return value;
        refuse(o, value, where);
    }
    switch (o.kind) {
    case Kind::boolean:
        if (value.is_boolean())
            return value;
        break;
    case Kind::integer:
        if (value.is_number_unsigned() && in_range(o, static_cast<double>(value.get<std::uint64_t>())))
            return value;
        // 5.0 is an integer for people and for most JSON writers.
        if (value.is_number() && value.get<double>() == std::floor(value.get<double>()) && value.get<double>() >= 0 &&
            value.get<double>() < 9007199254740992.0 && in_range(o, value.get<double>()))
            return static_cast<std::uint64_t>(value.get<double>());
        break;
    case Kind::number:
        if (value.is_number() && in_range(o, value.get<double>()))
            return value.get<double>();
        break;
    case Kind::text:
    case Kind::file:
        if (value.is_string())
            return value;
        break;
    case Kind::numbers:
        if (value.is_array() && std::find(o.counts.begin(), o.counts.end(), value.size()) != o.counts.end() &&
            std::all_of(value.begin(), value.end(),
                        [&](const Json &v) { return v.is_number() && in_range(o, v.get<double>()); }))
            return value.get<std::vector<double>>();
        break;
    case Kind::choice:
        break;
    }
    refuse(o, value, where);
}

bool parse_double(const std::string &text, double &value) {
    const char *first = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
    const auto result = std::from_chars(first, text.data() + text.size(), value);
    return result.ec == std::errc() && result.ptr == text.data() + text.size() && !text.empty();
}

/** Text of the command line as JSON; text that is no number stays text, for the message. */
Json parsed(const Option &o, const std::string &text) {
    switch (o.kind) {
    case Kind::boolean:
        return text == "true" || text == "1" ? Json(true) : text == "false" || text == "0" ? Json(false) : Json(text);
    case Kind::integer: {
        std::uint64_t value = 0;
        const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
        if (!text.empty() && result.ec == std::errc() && result.ptr == text.data() + text.size())
            return value;
        return text;
    }
    case Kind::number: {
        double value = 0;
        if (parse_double(text, value) && std::isfinite(value))
            return value;
        return text;
    }
    case Kind::numbers: {
        Json list = Json::array();
        for (std::size_t start = 0; start <= text.size();) {
            const std::size_t end = std::min(text.find(',', start), text.size());
            double value = 0;
            const std::string part = text.substr(start, end - start);
            if (!parse_double(part, value))
                return text;
            list.push_back(value);
            start = end + 1;
        }
        return list;
    }
    default:
        return text;
    }
}

std::vector<std::string> section_names() {
    std::vector<std::string> names;
    for (const Option &o : option_table())
        if (std::find(names.begin(), names.end(), o.section) == names.end())
            names.push_back(o.section);
    return names;
}

/** The known key that is meant by `key` in `section`: that of another section costs one edit more. */
std::string nearest_key(const std::string &section, const std::string &key) {
    std::string best;
    std::size_t least = ~std::size_t{0};
    for (const Option &o : option_table()) {
        const std::size_t distance = 2 * edit_distance(key, o.key) + (o.section == section ? 0 : 1);
        if (distance < least) {
            least = distance;
            best = o.id();
        }
    }
    return best;
}

} // namespace

std::string Option::range() const {
    const auto number_text = [](double v) {
        return v == std::floor(v) && std::abs(v) < 1e15 ? fmt::format("{:.0f}", v) : fmt::format("{:g}", v);
    };
    std::string text;
    switch (kind) {
    case Kind::choice:
        return joined(words, " or ");
    case Kind::integer:
    case Kind::number:
    case Kind::numbers:
        if (kind == Kind::numbers) {
            std::vector<std::string> sizes;
            for (const std::size_t count : counts)
                sizes.push_back(std::to_string(count));
            text = joined(sizes, " or ") + " numbers";
        }
        if (!text.empty())
            text += ", each ";
        text += kind == Kind::integer && high >= max_seed
                    ? "0 to 2^64 - 1"
                    : fmt::format("{} to {}", number_text(low), number_text(high));
        if (!words.empty())
            text += (text.empty() ? "" : ", or ") + joined(words, " or ");
        if (kind == Kind::number && fallback == "inf")
            text += ", or inf";
        return text;
    default:
        return text;
    }
}

std::string raw_help() {
    return fmt::format("Read the files as raw frames: {}; packings unpacked, msb, mipi, genicam, gige",
                       image_io::raw_form);
}

std::string channel_help() {
    return "Channel or layer of the files, as behind a file's name (FILE:CHANNEL)";
}

image_io::Encoding encoding_of(const Config &config) {
    constexpr image_io::Encoding words[] = {image_io::Encoding::automatic, image_io::Encoding::linear,
                                            image_io::Encoding::srgb};
    return words[config.choice("render.transfer")];
}

const std::vector<Option> &option_table() {
    static const std::vector<Option> table = make_table();
    return table;
}

const Option &option(const std::string &id) {
    for (const Option &o : option_table())
        if (o.id() == id)
            return o;
    throw std::logic_error("there is no option " + id);
}

Config::Config() {
    for (const Option &o : option_table())
        entries_[o.id()] = {o.fallback, Layer::fallback};
}

void Config::set(const Option &o, const Json &value, Layer layer, const std::string &where) {
    Json kept = checked(o, value, where);
    if (o.kind == Kind::file && kept != "")
        kept = std::filesystem::absolute(kept.get<std::string>()).lexically_normal().string();
    Entry &entry = entries_.at(o.id());
    if (layer == Layer::command_line)
        conflicts_.erase(o.id());
    if (kept != entry.value)
        contradict(o, entry, kept, layer, where);
    if (layer >= entry.layer)
        entry = {kept, layer};
}

void Config::contradict(const Option &o, const Entry &entry, const Json &value, Layer layer, const std::string &where) {
    // What the effects of a profile were measured with: with another value they mean another camera's.
    static const std::vector<std::string> fixed = {"sensor.bits", "aperture.pixel_pitch_m", "aperture.wavelength_m"};
    // Paths in full: they tell two files apart by their ends.
    const auto whole = [](const Json &one) { return one.dump(-1, ' ', false, Json::error_handler_t::replace); };
    const bool kept = layer == Layer::profile && entry.layer > Layer::fallback;
    if (entry.layer == Layer::profile && layer == Layer::command_line) {
        if (std::find(fixed.begin(), fixed.end(), o.id()) != fixed.end())
            throw InputError(
                fmt::format("{} {} contradicts {}, whose camera has {}: its effects were measured with that; "
                            "leave the option out, or diagnose a capture of the other camera",
                            where, whole(value), profile_, whole(entry.value)));
        replaced_.push_back(fmt::format("{} {} replaces {}", where, whole(value), whole(entry.value)));
    } else if (entry.layer == Layer::profile || kept) {
        const Json &profiles = kept ? value : entry.value, &others = kept ? entry.value : value;
        const std::string text =
            fmt::format("{} is {} {}, but {} in {}; give one of them, as --{} on the command line", o.id(),
                        whole(others), kept ? "in the configuration or scene" : "of " + where, whole(profiles),
                        profile_, o.name);
        if (!kept)
            throw InputError(text);
        conflicts_[o.id()] = text;
    }
}

void Config::check_conflicts() const {
    if (!conflicts_.empty())
        throw InputError(conflicts_.begin()->second);
}

void Config::set_text(const Option &o, const std::string &text, Layer layer, const std::string &where) {
    set(o, parsed(o, text), layer, where);
}

void Config::load(const std::string &path) {
    const JsonDocument document = read_json(path);
    const Json &root = document.root();
    if (!root.is_object())
        throw InputError(
            path + ": a configuration is a JSON object of sections, for example {\"aperture\": {\"f_number\": 8}}");
    std::vector<std::string> sections = section_names();
    sections.emplace_back("effects");
    const std::filesystem::path folder = std::filesystem::absolute(path).parent_path();
    for (const auto &[section, keys] : root.items()) {
        if (std::find(sections.begin(), sections.end(), section) == sections.end()) {
            // A key without its section is the likelier slip if it fits better than any section.
            const std::string as_section = nearest(section, sections);
            const std::string as_key = nearest_key("", section);
            const bool key_fits =
                edit_distance(section, as_key.substr(as_key.find('.') + 1)) < edit_distance(section, as_section);
            throw InputError(fmt::format("{}: unknown section \"{}\"; the nearest known {} is \"{}\"", path, section,
                                         key_fits ? "key" : "section", key_fits ? as_key : as_section));
        }
        if (!keys.is_object())
            throw InputError(fmt::format("{}: section \"{}\" must be an object, got {}", path, section, shown(keys)));
        if (section == "effects") {
            for (const auto &[id, parameters] : keys.items())
                set_effect(effect_from_json(id, parameters, fmt::format("{}: effects.{}", path, id)), Layer::file);
            continue;
        }
        for (const auto &[key, value] : keys.items()) {
            const std::string id = section + "." + key;
            if (entries_.find(id) == entries_.end())
                throw InputError(fmt::format("{}: unknown key \"{}\"; the nearest known key is \"{}\"", path, id,
                                             nearest_key(section, key)));
            const Option &o = option(id);
            Json resolved = value;
            if (o.kind == Kind::file && value.is_string() && value != "")
                resolved = (folder / value.get<std::string>()).string();
            set(o, resolved, Layer::file, fmt::format("{}: {}", path, id));
        }
    }
}

namespace {

// Effects and options have one list of conflicts.
std::string conflict_of(const std::string &effect) {
    return "effects." + effect;
}

} // namespace

void Config::set_effect(const EffectSetting &setting, Layer layer) {
    const auto found = effects_.find(setting.id);
    if (layer == Layer::command_line)
        conflicts_.erase(conflict_of(setting.id));
    if (found != effects_.end() && found->second.setting.values != setting.values) {
        const std::string before = effect_text(found->second.setting);
        if (layer == Layer::profile)
            conflicts_[conflict_of(setting.id)] =
                fmt::format("the configuration has the effect {}, but {} has {}; give one of them, with --effect on "
                            "the command line",
                            before, profile_, effect_text(setting));
        if (found->second.layer == Layer::profile)
            replaced_.push_back(fmt::format("--effect {} replaces {}", effect_text(setting), before));
    }
    effects_[setting.id] = {setting, layer};
}

void Config::clear_effects() {
    for (const auto &[id, effect] : effects_)
        if (effect.layer == Layer::profile)
            replaced_.push_back(fmt::format("--effect none takes {} away", effect_text(effect.setting)));
    for (const auto &[id, effect] : effects_)
        conflicts_.erase(conflict_of(id));
    effects_.clear();
}

std::vector<std::string> Config::doubled() const {
    std::vector<std::string> result;
    for (const EffectSetting &effect : effects())
        if (const auto held = held_.find(effect.id); held != held_.end() && !text(held->second).empty())
            result.push_back(fmt::format("the effect {} is drawn on top of {}, which holds a camera's own; {}",
                                         effect_text(effect), text(held->second),
                                         layer(held->second) == Layer::profile
                                             ? "--profile-maps off leaves the maps out"
                                             : "leave one of them out"));
    return result;
}

std::vector<std::string> Config::load_profile(const std::string &path, const std::string &sequence, bool maps) {
    const clspeckle::Profile profile = clspeckle::Profile::open(path);
    const ClspProfileInfo camera = profile.info();
    profile_ = path;
    profile_width_ = camera.width;
    profile_height_ = camera.height;
    const auto take = [&](const char *id, const Json &value) { set(option(id), value, Layer::profile, path); };
    if (!text("sensor.profile").empty())
        throw InputError(fmt::format("sensor.profile is {}, but {} describes a sensor, too; give one of them",
                                     text("sensor.profile"), path));
    take("aperture.f_number", camera.f_number);
    take("aperture.pixel_pitch_m", camera.pixel_pitch_m);
    take("aperture.wavelength_m", camera.wavelength_m);
    take("aperture.relative_diameter", 0.0);
    take("aperture.degree_of_polarization", camera.degree_of_polarization);
    take("aperture.normalization", "unit_mean"); // by which gains are meant
    take("aperture.oversampling", camera.oversampling);
    take("aperture.fill_factor", camera.fill_factor);
    take("phase.field", camera.field == CLSP_FIELD_UNIT_PHASOR ? "unit_phasor" : "circular_gaussian");
    take("sensor.bits", camera.bits);
    take("sensor.black_level_dn", camera.black_level_dn);
    take("sensor.read_noise_dn", camera.read_noise_dn);
    const std::vector<double> axis = {camera.principal_point_x_px, camera.principal_point_y_px};
    if (axis != std::vector<double>{(camera.width - 1.0) / 2.0, (camera.height - 1.0) / 2.0})
        take("lens.principal_point_px", axis);

    const Json root = Json::parse(profile.json());
    for (const auto &[number, name, id] : {std::tuple{CLSP_PROFILE_MAP_DARK, "dark", "sensor.dark_frame"},
                                          std::tuple{CLSP_PROFILE_MAP_GAIN, "gain", "sensor.gain_map"}}) {
        if (!(camera.maps & number))
            continue;
        for (const Json &effect : root["maps"][name]["holds"])
            held_[effect.get<std::string>()] = id;
        if (!maps)
            continue;
        profile.map_values(number); // refused if it is not as it was written
        take(id, profile.map(number).path);
    }

    std::vector<std::string> left_out;
    for (const ClspProfileEffect &effect : profile.effects()) {
        const EffectSetting setting{effect.id, {effect.values, effect.values + effect.parameter_count}};
        if (maps && held_.count(setting.id))
            continue;
        if (changes_dots(setting.id))
            left_out.push_back(
                fmt::format("{}: the effect {} is left out: it changes the dots that the library draws, and "
                            "render has an ideal image or a scene's pattern instead",
                            path, effect_text(setting)));
        else
            set_effect(setting, Layer::profile);
    }
    for (const Json &hypothesis : root["hypotheses"])
        left_out.push_back(fmt::format("{}: {} is left out: it is a hypothesis, which only diagnose can simulate", path,
                                       hypothesis["effect"].get<std::string>()));
    if (sequence.empty())
        return left_out;

    const std::vector<ClspProfileSequence> sequences = profile.sequences();
    const auto found =
        std::find_if(sequences.begin(), sequences.end(), [&](const auto &s) { return sequence == s.name; });
    if (found == sequences.end()) {
        std::vector<std::string> names;
        for (const ClspProfileSequence &s : sequences)
            names.emplace_back(s.name);
        throw InputError(fmt::format("--profile-sequence {}: {} has no such sequence{}; it has {}", sequence, path,
                                     suggestion(sequence, names), fmt::join(names, ", ")));
    }
    entries_.at("aperture.f_number") = {Json(found->f_number), Layer::profile}; // a sequence may have its own
    take("render.illumination", found->scene == CLSP_SCENE_DARK   ? "dark"
                                : found->scene == CLSP_SCENE_FLAT ? "incoherent"
                                                                  : "laser");
    take("render.refresh", found->moving ? "all" : "none");
    if (found->scene != CLSP_SCENE_DARK)
        take("sensor.exposure_gain_dn", found->gain_dn);
    if (found->exposure_ms > 0)
        take("sensor.exposure_time_s", 1e-3 * found->exposure_ms);
    for (const Json &light : root["lab"]["lights"])
        if (light["uneven"] == true &&
            std::find(light["sequences"].begin(), light["sequences"].end(), sequence) != light["sequences"].end())
            left_out.push_back(
                fmt::format("{}: the {} of {} was uneven; that is the lab's and is left out: bring it in the "
                            "ideal image",
                            path, light["light"].get<std::string>(), sequence));
    return left_out;
}

void Config::check_image(std::uint32_t width, std::uint32_t height, const std::string &name) const {
    if (!profile_.empty() && (width != profile_width_ || height != profile_height_))
        throw InputError(
            fmt::format("{} has {} x {} pixels, but the camera of {} has {} x {}: its effects were measured in "
                        "those; bring an image of that size, or diagnose a capture of the other camera",
                        name, width, height, profile_, profile_width_, profile_height_));
}

std::vector<EffectSetting> Config::effects() const {
    std::vector<EffectSetting> result;
    for (const ClspEffectInfo &effect : effect_catalogue())
        if (const auto found = effects_.find(effect.id); found != effects_.end())
            result.push_back(found->second.setting);
    return result;
}

void Config::settle_sensor() {
    const std::string name = text("sensor.profile");
    if (name.empty())
        return;
    ClspSensorDesc desc{};
    try {
        desc = clspeckle::Sensor::profile(name);
    } catch (const clspeckle::Error &error) {
        throw InputError("--sensor-profile: " + error.message());
    }
    // A full well in electrons is a saturation in dn.
    if (desc.full_well_e > 0)
        desc.saturation_dn = desc.full_well_e * desc.conversion_gain_dn_per_e;
    const std::vector<std::pair<std::string, Json>> known = {
        {"bits", desc.bits},
        {"exposure_gain_dn", desc.exposure_gain_dn},
        {"saturation_dn", std::isinf(desc.saturation_dn) ? Json("inf") : Json(desc.saturation_dn)},
        {"black_level_dn", desc.black_level_dn},
        {"read_noise_dn", desc.read_noise_dn},
        {"hot_pixel_fraction", desc.hot_pixel_fraction},
        {"hot_pixel_mean_dn", desc.hot_pixel_mean_dn},
        {"cold_pixel_fraction", desc.cold_pixel_fraction},
    };
    for (const auto &[key, value] : known)
        if (const std::string id = "sensor." + key; layer(id) < layer("sensor.profile"))
            resolve(id, value);
}

void Config::settle() {
    settle_sensor();
    if (text("motion.rule") != "off" && layer("render.refresh") == Layer::fallback)
        resolve("render.refresh", "none");
    const Layer diameter = layer("aperture.relative_diameter");
    const Layer others =
        std::max({layer("aperture.f_number"), layer("aperture.pixel_pitch_m"), layer("aperture.wavelength_m")});
    if (number("aperture.relative_diameter") == 0)
        return;
    if (diameter == Layer::command_line && others == Layer::command_line)
        throw InputError(
            "give either --relative-diameter, or --f-number, --pixel-pitch-m and --wavelength-m, not both");
    if (others > diameter)
        resolve("aperture.relative_diameter", 0.0);
}

Json Config::dump() const {
    Json root = Json::object();
    for (const Option &o : option_table())
        root[o.section][o.key] = value(o.id());
    root["effects"] = Json::object();
    for (const EffectSetting &effect : effects())
        root["effects"][effect.id] = effect_parameters(effect);
    return root;
}

double Config::number(const std::string &id) const {
    const Json &v = value(id);
    return v == "inf" ? std::numeric_limits<double>::infinity() : v.get<double>();
}

std::uint32_t Config::choice(const std::string &id) const {
    const std::vector<std::string> &words = option(id).words;
    const auto found = std::find(words.begin(), words.end(), text(id));
    return static_cast<std::uint32_t>(found - words.begin());
}

} // namespace tools
