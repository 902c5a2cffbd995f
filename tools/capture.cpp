#include "capture.hpp"

#include "context.hpp"
#include "effects.hpp"
#include "errors.hpp"
#include "files.hpp"
#include "interrupt.hpp"
#include "io/formats.hpp"
#include "io/image_io.hpp"
#include "json.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>

namespace tools {

namespace {

namespace fs = std::filesystem;

std::string number_or_dash(const Json &value, const char *format) {
    return value.is_null() ? "-" : fmt::format(fmt::runtime(format), value.get<double>());
}

void print_summary(const Json &summary, Console &console) {
    const Json &camera = summary["camera"];
    console.print(fmt::format(
        "{} x {} pixels of {:g} um, {} bits, f/{:g}, {:g} nm: the pupil is {:.2f} cycles per pixel wide; {} dots\n",
        camera["width"].get<int>(), camera["height"].get<int>(), camera["pixel_pitch_um"].get<double>(),
        camera["bits"].get<int>(), camera["f_number"].get<double>(), camera["wavelength_nm"].get<double>(),
        camera["pupil_diameter_cycles_per_px"].get<double>(), camera["dots"].get<std::uint64_t>()));
    std::vector<std::vector<std::string>> rows = {{"sequence", "scene", "motion", "frames", "mean", "above dark",
                                                   "least", "most", "saturated", "noise", "contrast"}};
    for (const Json &s : summary["sequences"])
        rows.push_back({s["name"].get<std::string>(), s["scene"].get<std::string>(), s["motion"].get<std::string>(),
                        std::to_string(s["frames"].get<std::uint32_t>()), number_or_dash(s["mean_dn"], "{:.2f}"),
                        number_or_dash(s["level_above_dark_dn"], "{:.2f}"),
                        std::to_string(s["minimum"].get<std::uint32_t>()),
                        std::to_string(s["maximum"].get<std::uint32_t>()),
                        percent(s["saturated_fraction"].get<double>()),
                        number_or_dash(s["temporal_noise_dn"], "{:.2f}"), number_or_dash(s["contrast"], "{:.3f}")});
    console.print(table(rows) + "\n");
    console.print("Levels are in DN; noise is the standard deviation in time, in motion with the speckle in it.");
    for (const bool can : {true, false}) {
        std::string text;
        for (const Json &ability : summary["abilities"])
            if (ability["can"].get<bool>() == can) {
                text += fmt::format("  {}\n{}\n", ability["topic"].get<std::string>(),
                                    wrapped(ability["reason"].get<std::string>(), "      "));
                if (!can)
                    text += wrapped("capture: " + ability["advice"].get<std::string>(), "      ") + "\n";
            }
        if (!text.empty())
            console.print(fmt::format("\n{}\n{}", can ? "It can tell:" : "It cannot tell:", text));
    }
    std::string visible, hidden;
    for (const Json &effect : summary["effects"]) {
        if (effect["visible"].get<bool>())
            visible += (visible.empty() ? "" : ", ") + effect["id"].get<std::string>();
        else
            hidden += fmt::format("  {:<22}{}\n", effect["id"].get<std::string>(), effect["reason"].get<std::string>());
    }
    if (!visible.empty())
        console.print("Effects that can show here:\n" + wrapped(visible, "  "));
    if (!hidden.empty())
        console.print("\nEffects that cannot:\n" + hidden);
}

std::string emva_table(const Json &emva) {
    std::vector<std::vector<std::string>> rows = {{"EMVA 1288", "value", "95 % interval", "unit"}};
    for (const auto &[name, entry] : emva["values"].items()) {
        if (!entry.contains("unknown"))
            rows.push_back({name, fmt::format("{:.4g}", entry["value"].get<double>()),
                            fmt::format("{:.4g} to {:.4g}", entry["interval"][0].get<double>(),
                                        entry["interval"][1].get<double>()),
                            entry["unit"].get<std::string>()});
        else
            rows.push_back({name, "-", "", entry["unit"].get<std::string>()});
    }
    return table(rows);
}

/** Uniform in [0, 1), the same on every system. */
double uniform(std::mt19937_64 &random) {
    return static_cast<double>(random() >> 11) * 0x1p-53;
}

/** A lattice whose dots are moved a little, so that it has no period: what projectors of structured light draw. */
DotPattern jittered_lattice(const CaptureMakeArguments &a) {
    double pitch = a.dots_pitch_px;
    if (a.dots_count > 0)
        pitch = std::sqrt(static_cast<double>(a.width) * a.height / a.dots_count);
    if (!(pitch >= 2.0 && pitch <= 16384.0))
        throw InputError(
            fmt::format("the dots' pitch is {:g} px; 2 to 16384 px are taken (--dots-pitch, --dots-count)", pitch));
    const auto columns = static_cast<std::uint32_t>(std::max(1.0, std::floor(a.width / pitch)));
    const auto rows = static_cast<std::uint32_t>(std::max(1.0, std::floor(a.height / pitch)));
    std::mt19937_64 random(a.seed ^ 0x646f7473u);
    DotPattern pattern{a.dots_sigma_px, {}};
    for (std::uint32_t row = 0; row < rows; ++row)
        for (std::uint32_t column = 0; column < columns; ++column)
            for (const auto &[index, count, size] :
                 {std::tuple{column, columns, a.width}, std::tuple{row, rows, a.height}}) {
                const double jitter = std::min(a.dots_jitter_px, 0.5 * pitch) * (2.0 * uniform(random) - 1.0);
                const double place = (index + 0.5) * size / count - 0.5 + jitter;
                pattern.positions_px.push_back(std::round(place * 1000.0) / 1000.0);
            }
    return pattern;
}

/** One sequence to be drawn. */
struct Plan {
    std::string name;
    std::uint32_t scene;
    bool moving;
    double level_dn;
    double exposure_ms; ///< 0: not said.
};

std::vector<Plan> plan_sequences(const CaptureMakeArguments &a) {
    struct Known {
        const char *name;
        std::uint32_t scene;
        bool moving;
        const std::vector<double> *levels;
        const char *option;
    };
    static const std::vector<double> no_light = {0.0};
    const std::vector<Known> known = {{"dark", CLSP_SCENE_DARK, false, &no_light, ""},
                                      {"flat", CLSP_SCENE_FLAT, false, &a.flat_levels, "--flat-level"},
                                      {"board_static", CLSP_SCENE_BOARD, false, &a.board_levels, "--board-level"},
                                      {"board_moving", CLSP_SCENE_BOARD, true, &a.board_levels, "--board-level"},
                                      {"dots_static", CLSP_SCENE_DOTS, false, &a.dots_levels, "--dots-level"},
                                      {"dots_moving", CLSP_SCENE_DOTS, true, &a.dots_levels, "--dots-level"}};
    if (std::all_of(a.sequences.begin(), a.sequences.end(), [](const std::string &name) { return name.empty(); }))
        throw InputError("--sequences names none; for example --sequences dark,board_static,board_moving");
    for (const std::string &name : a.sequences)
        if (std::none_of(known.begin(), known.end(), [&](const Known &k) { return name == k.name; }))
            throw InputError(fmt::format(
                "--sequences: there is no \"{}\"; the sequences are dark, flat, board_static, board_moving, "
                "dots_static and dots_moving",
                name));
    std::vector<Plan> plans;
    for (const Known &k : known) {
        if (std::find(a.sequences.begin(), a.sequences.end(), k.name) == a.sequences.end())
            continue;
        const std::vector<double> &levels = *k.levels;
        for (std::size_t i = 0; i < levels.size(); ++i) {
            if (k.scene != CLSP_SCENE_DARK && !(levels[i] > 0.0 && levels[i] <= 1e6))
                throw InputError(fmt::format("{}: the level of {} is {:g} DN; above 0 to 1e6 are taken", k.option,
                                             k.name, levels[i]));
            const bool several = levels.size() > 1;
            // Light is proportional to the time: 10 ms for the first level.
            plans.push_back({several ? fmt::format("{}_{}", k.name, i + 1) : k.name, k.scene, k.moving, levels[i],
                             several ? 10.0 * levels[i] / levels[0] : 0.0});
        }
    }
    return plans;
}

/** Whether an effect shows with dots alone: a wall ends nowhere near the image's border, so that a lens which distorts
 * it leaves it even. */
bool needs_dots(const std::string &id) {
    return clspeckle::effect_scenes(id) == 1u << CLSP_SCENE_DOTS;
}

/** Seeds of a camera's surfaces and noise: others than those of the captures that a diagnosis simulates, whatever its
 * seed. */
constexpr std::uint64_t camera_seed(std::uint64_t seed) {
    return (seed ^ 0x63616d657261u) * 0x9e3779b97f4a7c15u;
}

constexpr double kMostSamples = 7.0; // of a pixel, along each axis: an odd number that the library has
constexpr double kPointArea = 1e-4;  // of a pixel
constexpr double kFolds =
    0.6; // a pupil's diameter from which one sample a pixel folds too much of what pixels integrate

/** Draws all frames of one sequence. A fresh pipeline for each: nothing of one sequence remains in the next. */
std::vector<std::uint16_t> draw(const CaptureMakeArguments &a, const Plan &plan, std::size_t number,
                                const DotPattern &dots, const std::vector<EffectSetting> &effects,
                                const clspeckle::Context &context, const clspeckle::Queue &queue,
                                const std::function<void()> &frame_done) {
    const bool with_dots = plan.scene == CLSP_SCENE_DOTS;
    auto phase = clspeckle::make<ClspPhaseDesc>();
    phase.width = a.width;
    phase.height = a.height;
    phase.field = a.field == "unit_phasor" ? CLSP_FIELD_UNIT_PHASOR : CLSP_FIELD_CIRCULAR_GAUSSIAN;
    phase.polarization_count = a.degree_of_polarization < 1.0 ? 2 : 1;
    phase.seed = camera_seed(a.seed);
    auto aperture = clspeckle::make<ClspApertureDesc>();
    aperture.width = a.width;
    aperture.height = a.height;
    aperture.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
    aperture.f_number = a.f_number;
    aperture.pixel_pitch_m = a.pixel_pitch_um * 1e-6;
    aperture.wavelength_m = a.wavelength_nm * 1e-9;
    aperture.degree_of_polarization = a.degree_of_polarization;
    // Pupils wider than the frequency plane of one sample a pixel: the middle ones of as many samples as the
    // intensity's band needs, an odd number, are the pixels' centres.
    const double diameter = aperture.pixel_pitch_m / (aperture.wavelength_m * aperture.f_number);
    if (diameter > 1.0) {
        const double samples = 2.0 * std::ceil(diameter - 0.5) + 1.0;
        if (samples > kMostSamples)
            throw InputError(
                fmt::format("--f-number: the pupil's diameter is {:.2f} cycles per pixel (pixel pitch over "
                            "wavelength times f-number); at most {:g} can be drawn, use a larger one",
                            diameter, 0.5 * kMostSamples));
        phase.oversampling = aperture.oversampling = static_cast<std::uint32_t>(samples);
        aperture.fill_factor = kPointArea;
    }
    // Two samples hold what pixels integrate behind a narrower pupil. Both have the light at the pixel's centre, a
    // staircase of that variance.
    auto traits = clspeckle::make<ClspCameraTraits>();
    traits.bits = a.bits;
    const bool integrates = traits_with(effects, traits).fill_factor > 0.0;
    double staircase = 0.0;
    if (integrates && diameter > kFolds && diameter <= 1.0) {
        phase.oversampling = aperture.oversampling = 2;
        staircase = 1.0 / 16.0;
    }
    // The same seed in all sequences: one sensor has one fixed pattern.
    auto sensor = clspeckle::make<ClspSensorDesc>();
    sensor.width = a.width;
    sensor.height = a.height;
    sensor.bits = a.bits;
    sensor.seed = camera_seed(a.seed);
    sensor.exposure_gain_dn = plan.scene == CLSP_SCENE_DARK ? 1.0 : plan.level_dn;
    sensor.black_level_dn = a.black_level_dn;
    sensor.read_noise_dn = a.read_noise_dn;

    const clspeckle::Phase phase_stage(context, phase);
    const clspeckle::Aperture aperture_stage(context, aperture);
    const clspeckle::Sensor sensor_stage(context, sensor);
    clspeckle::Dots dots_stage;
    auto desc = clspeckle::make<ClspPipelineDesc>();
    desc.phase = phase_stage;
    desc.aperture = aperture_stage;
    desc.sensor = sensor_stage;
    desc.seed = camera_seed(a.seed);
    if (with_dots) {
        auto pattern = clspeckle::make<ClspDotsDesc>();
        pattern.width = a.width;
        pattern.height = a.height;
        pattern.count = dots.positions_px.size() / 2;
        pattern.positions_px = dots.positions_px.data();
        pattern.sigma_px =
            std::sqrt(std::max(dots.sigma_px * dots.sigma_px - staircase, 0.25 * dots.sigma_px * dots.sigma_px));
        dots_stage = clspeckle::Dots(context, pattern);
        desc.dots = dots_stage;
    }
    const clspeckle::Pipeline pipeline(context, desc);
    for (const EffectSetting &effect : effects) {
        if (needs_dots(effect.id) && !with_dots)
            continue;
        try {
            pipeline.set_effect(effect.id, effect.values);
        } catch (const clspeckle::Error &error) {
            if (error.status() != CLSP_ERROR_INVALID_ARGUMENT)
                throw;
            throw InputError(fmt::format("--effect {}: {}", effect_text(effect), error.message()));
        }
    }

    const std::size_t pixels = std::size_t{a.width} * a.height;
    const clspeckle::Buffer ones(context, queue, std::vector<float>(pixels, 1.0f));
    const clspeckle::Buffer output(context, pixels * sizeof(std::uint16_t));
    auto frame = clspeckle::make<ClspFrame>();
    if (!with_dots)
        frame.irradiance = ones.image(a.width, a.height, CLSP_FORMAT_FLOAT32);
    frame.output = output.image(a.width, a.height, CLSP_FORMAT_UINT16);
    frame.illumination = plan.scene == CLSP_SCENE_DARK   ? CLSP_ILLUMINATION_DARK
                         : plan.scene == CLSP_SCENE_FLAT ? CLSP_ILLUMINATION_INCOHERENT
                                                         : CLSP_ILLUMINATION_LASER;
    frame.refresh = plan.moving ? CLSP_REFRESH_ALL : CLSP_REFRESH_MASK;
    std::vector<std::uint16_t> codes(pixels * a.frames);
    for (std::uint32_t i = 0; i < a.frames; ++i) {
        check_interrupt();
        // The frame index counts speckle and temporal noise: no two frames of a set have the same.
        frame.frame_index = (std::uint64_t{number} << 20) + i;
        pipeline.enqueue_frame(queue, frame);
        output.read(queue, codes.data() + i * pixels, pixels * sizeof(std::uint16_t));
        frame_done();
    }
    pipeline.check(queue);
    return codes;
}

clspeckle::Capture empty_capture(const CaptureMakeArguments &a, const DotPattern &dots, bool with_dots) {
    auto desc = clspeckle::make<ClspCaptureDesc>();
    desc.width = a.width;
    desc.height = a.height;
    desc.bits = a.bits;
    desc.field = a.field == "unit_phasor" ? CLSP_FIELD_UNIT_PHASOR : CLSP_FIELD_CIRCULAR_GAUSSIAN;
    desc.pixel_pitch_m = a.pixel_pitch_um * 1e-6;
    desc.f_number = a.f_number;
    desc.wavelength_m = a.wavelength_nm * 1e-9;
    desc.degree_of_polarization = a.degree_of_polarization;
    desc.black_level_dn = a.black_level_dn;
    desc.read_noise_dn = a.read_noise_dn;
    clspeckle::Capture capture(desc);
    if (with_dots)
        capture.set_dots(dots.sigma_px, dots.positions_px);
    return capture;
}

} // namespace

DotPattern read_dots(const std::string &file, double sigma_px) {
    const JsonDocument document = read_json(file);
    const bool inside = document.root().is_object() && document.root().contains("dots");
    const Json &root = inside ? document.root()["dots"] : document.root();
    const auto refuse = [&](const std::string &what) {
        throw InputError(fmt::format(
            "{}: {}; expected {{\"sigma_px\": 2.2, \"positions_px\": [[x, y], ...]}} or a capture.json", file, what));
    };
    if (!root.is_object() || !root.contains("positions_px") || !root["positions_px"].is_array())
        refuse("has no list positions_px");
    DotPattern pattern{sigma_px, {}};
    if (root.contains("sigma_px") && root["sigma_px"].is_number())
        pattern.sigma_px = root["sigma_px"].get<double>();
    for (const Json &point : root["positions_px"]) {
        if (!point.is_array() || point.size() != 2 || !point[0].is_number() || !point[1].is_number())
            refuse(fmt::format("the position {} is no [x, y]", shown(point)));
        pattern.positions_px.push_back(point[0].get<double>());
        pattern.positions_px.push_back(point[1].get<double>());
    }
    return pattern;
}

namespace {

/** What capture.json, or its folder, calls a file; empty: it lies elsewhere. */
std::string name_in_set(const std::string &path, const std::string &set) {
    std::error_code code;
    const fs::path folder = fs::is_directory(set, code) ? fs::path(set) : fs::absolute(set, code).parent_path();
    const fs::path inside = fs::weakly_canonical(path, code).lexically_relative(fs::weakly_canonical(folder, code));
    return inside.empty() || *inside.begin() == ".." ? "" : inside.generic_string();
}

/** 0 where a warning is about single pixels or blocks, or where the set's own masks have 0. */
void write_mask(const CaptureCheckArguments &arguments, const clspeckle::Capture &capture, const Json &summary,
                Console &console) {
    const auto width = summary["camera"]["width"].get<std::size_t>();
    const auto height = summary["camera"]["height"].get<std::size_t>();
    std::vector<std::uint8_t> mask(width * height, 255);
    for (std::uint32_t i = 0; i < summary["sequences"].size(); ++i)
        if (summary["sequences"][i]["masked_fraction"].get<double>() > 0.0) {
            const std::vector<std::uint8_t> own = capture.mask(i);
            for (std::size_t k = 0; k < mask.size(); ++k)
                mask[k] = own[k] == 0 ? 0 : mask[k];
        }
    for (const Json &warning : summary["warnings"])
        for (const Json &block : warning["pixels"])
            for (std::size_t y = block["rows"][0]; y <= block["rows"][1].get<std::size_t>(); ++y)
                for (std::size_t x = block["columns"][0]; x <= block["columns"][1].get<std::size_t>(); ++x)
                    mask[y * width + x] = 0;
    const auto left_out = std::count(mask.begin(), mask.end(), std::uint8_t{0});
    image_io::write(arguments.mask, image_io::format_named("PNG"), std::uint32_t(width), std::uint32_t(height),
                    mask.data());
    const std::string name = name_in_set(arguments.mask, arguments.folder);
    console.print(fmt::format("{}: {} of {} pixels left out; {}\"mask\": \"{}\" in a sequence of capture.json names it",
                              arguments.mask, left_out, mask.size(),
                              name.empty() ? "once it lies in the set's folder, " : "",
                              name.empty() ? fs::path(arguments.mask).filename().string() : name));
}

} // namespace

void run_capture_check(const CaptureCheckArguments &arguments, Console &console) {
    check_report_file(arguments.json, arguments.folder);
    std::error_code code;
    if (!arguments.mask.empty())
        check_ending({arguments.mask, "--write-mask", image_io::format_named("PNG").extensions});
    if (!arguments.mask.empty() && fs::exists(arguments.mask, code))
        throw InputError(fmt::format("{}: exists; choose another name with --write-mask", arguments.mask));
    const clspeckle::Capture capture = clspeckle::Capture::open(arguments.folder, progress_on(console));
    const Json summary = Json::parse(capture.summary_json());
    if (!arguments.mask.empty())
        write_mask(arguments, capture, summary, console);
    for (const Json &warning : summary["warnings"]) {
        const std::string sequence = warning["sequence"].get<std::string>();
        console.warn((sequence.empty() ? "" : sequence + ": ") + warning["text"].get<std::string>());
    }
    if (arguments.json == "-") {
        console.result(summary.dump(2));
        return;
    }
    if (!arguments.json.empty())
        image_io::write_text(arguments.json, summary.dump(2) + "\n");
    print_summary(summary, console);
}

void run_capture_emva(const CaptureEmvaArguments &arguments, Console &console) {
    for (const std::string &path : {arguments.json, arguments.xml})
        check_report_file(path, arguments.folder);
    const clspeckle::Capture capture = clspeckle::Capture::open(arguments.folder, progress_on(console));
    const Json emva = Json::parse(capture.emva1288_json());
    const auto named = [](const Json &note) {
        return (note["sequence"].is_null() ? "" : note["sequence"].get<std::string>() + ": ") +
               note["text"].get<std::string>();
    };
    for (const Json &note : emva["notes"])
        console.warn(named(note));
    if (!arguments.xml.empty())
        image_io::write_text(arguments.xml, capture.emva1288_xml());
    if (arguments.json == "-") {
        console.result(emva.dump(1));
        return;
    }
    if (!arguments.json.empty())
        image_io::write_text(arguments.json, emva.dump(1) + "\n");
    console.print(emva_table(emva));
    // Many quantities may share a reason.
    std::vector<std::pair<std::string, std::string>> reasons;
    for (const auto &[name, entry] : emva["values"].items()) {
        if (!entry.contains("unknown"))
            continue;
        const std::string why = entry["unknown"].get<std::string>();
        const auto same = std::find_if(reasons.begin(), reasons.end(), [&](const auto &r) { return r.first == why; });
        if (same == reasons.end())
            reasons.emplace_back(why, name);
        else
            same->second += ", " + name;
    }
    for (const auto &[why, names] : reasons)
        console.print("\n" + wrapped(fmt::format("Not known: {}: {}", names, why), ""));
    std::vector<std::vector<std::string>> rows = {
        {"light", "slope x", "slope y", "curvature x", "twist", "curvature y"}};
    constexpr std::size_t shown = 12;
    for (const Json &one : emva["illumination"]) {
        if (rows.size() > shown)
            break;
        rows.push_back({one["sequence"].get<std::string>()});
        for (const char *term : {"slope_x", "slope_y", "curvature_x", "twist", "curvature_y"})
            rows.back().push_back(fmt::format("{:.3f} +- {:.3f}", one[term].get<double>(),
                                              one[std::string(term) + "_error"].get<double>()));
    }
    if (rows.size() > 1)
        console.print("\n" + table(rows) + "\n  in % across the image, with standard errors" +
                      (emva["illumination"].size() > shown ? "; --json has all sequences" : ""));
}

void run_capture_make(const CaptureMakeArguments &arguments, Console &console) {
    const CaptureMakeArguments &a = arguments;
    std::error_code code;
    if (fs::exists(a.folder, code) && !a.overwrite)
        throw InputError(
            fmt::format("{}: exists; choose another folder, or replace a capture set with --overwrite", a.folder));
    std::vector<EffectSetting> effects;
    for (const std::string &text : a.effects) {
        const EffectSetting effect = parse_effect(text);
        if (std::any_of(effects.begin(), effects.end(), [&](const EffectSetting &e) { return e.id == effect.id; }))
            throw InputError(
                fmt::format("--effect {}: {} is given twice; a set has one strength of each", text, effect.id));
        effects.push_back(effect);
    }
    const std::vector<Plan> plans = plan_sequences(a);
    const bool with_dots =
        std::any_of(plans.begin(), plans.end(), [](const Plan &p) { return p.scene == CLSP_SCENE_DOTS; });
    for (const EffectSetting &effect : effects)
        if (needs_dots(effect.id) && !with_dots)
            throw InputError(
                fmt::format("--effect {}: it shows with dots alone, and --sequences names none; add dots_static "
                            "or dots_moving",
                            effect.id));
    const DotPattern dots = !with_dots            ? DotPattern{}
                            : a.dots_file.empty() ? jittered_lattice(a)
                                                  : read_dots(a.dots_file, a.dots_sigma_px);
    // Refuses a camera that cannot be before anything is drawn.
    const clspeckle::Capture capture = empty_capture(a, dots, with_dots);

    const clspeckle::Context context = make_context(a.device);
    const clspeckle::Queue queue(context);
    std::uint64_t done = 0;
    const std::uint64_t total = std::uint64_t{a.frames} * plans.size();
    for (std::size_t i = 0; i < plans.size(); ++i) {
        const auto codes =
            draw(a, plans[i], i, dots, effects, context, queue, [&] { console.progress(++done, total); });
        capture.add_sequence(plans[i].name, plans[i].scene, plans[i].moving, codes, plans[i].exposure_ms);
    }
    try {
        capture.write(a.folder, a.overwrite);
    } catch (const clspeckle::Error &error) {
        if (error.status() == CLSP_ERROR_IO)
            throw OutputError(error.message());
        if (error.status() == CLSP_ERROR_INVALID_ARGUMENT)
            throw InputError(error.message());
        throw;
    }
    if (a.key) {
        Json key = {{"effects", Json::object()}};
        for (const EffectSetting &effect : effects)
            key["effects"][effect.id] = effect_parameters(effect);
        key["in_catalogue"] = true;
        key["seed"] = a.seed;
        image_io::write_text((fs::path(a.folder) / "key.json").string(), key.dump(1) + "\n");
    }
    console.print(fmt::format(
        "{}: {} sequences of {} frames, {} x {} pixels{}", a.folder, plans.size(), a.frames, a.width, a.height,
        effects.empty() ? "" : fmt::format(", with {} effect{}", effects.size(), effects.size() == 1 ? "" : "s")));
}

} // namespace tools
