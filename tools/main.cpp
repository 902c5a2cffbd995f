#include "commands.hpp"
#include "completion.hpp"
#include "doe.hpp"
#include "errors.hpp"
#include "help.hpp"
#include "interrupt.hpp"
#include "io/formats.hpp"
#include "io/openexr.hpp"
#include "manual.hpp"
#include "number_options.hpp"
#include "options.hpp"
#include "text.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <fcntl.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <new>
#include <type_traits>

namespace {

constexpr const char *exit_codes = R"(Exit codes:
  0  success
  1  wrong usage, configuration or input file
  2  no usable OpenCL device, or the device, the library or the memory failed
  3  a file, a folder or standard output cannot be written
  130  interrupted; finished files stay, half ones are removed)";

constexpr const char *main_examples = R"(Examples:
  clspeckle devices
  clspeckle render ideal.png -o out
  clspeckle render examples/office/gbuffers -o out --f-number 8 \
      --exposure-gain auto
  clspeckle statistics out/frame_000000.png --bits 10
  clspeckle effects
  clspeckle diagnose my-camera

Help on a command: clspeckle render --help
)";

constexpr const char *render_examples =
    R"(A scene has the channels Z (depth in m) or P.X P.Y P.Z (position in m), and optionally N.X N.Y N.Z (normal), albedo,
visibility, refresh, material (ids) and motion.X motion.Y (where a point was in the frame before, minus where it is, in
pixels). Without INPUT a scene comes from planes: --depth or --position, and --normal, --albedo, --visibility,
--material. Any image may be named as FILE:CHANNEL, by a channel, three with commas, or a layer: --depth
render.exr:ViewLayer.Depth.Z. Without, the channels' names tell which are meant; where several may, they are listed.
Values are linear; integer images are divided by their top code, so 1 is full scale. A scene needs --pattern
IMAGE. Of a folder, what render itself wrote is left out: previews, and the frames of the run whose config.json lies
there; not ideal_*.npy.

Configuration: the options in the groups "Configuration" are also the keys of a JSON file, grouped as here:
  {"aperture": {"f_number": 8},
   "sensor": {"bits": 10, "exposure_gain_dn": "auto"}}
A key is the option's name with underscores, without the name of its group: --pattern-quantity is pattern.quantity (and
--pattern is pattern.image, --sensor is sensor.enabled). --dump-config prints all of them. The command line beats the
configuration file, which beats sequence.json, which beats the defaults.

With --motion the speckle moves and changes with the surfaces: by the poses of the moving_objects in sequence.json, or
by the motion channels. What surfaces are made of says the list "materials" of sequence.json or of --materials FILE:
  {"materials": [{"id": 1, "name": "paper", "roughness_rms_m": 5e-6,
                  "degree_of_polarization": 0}]}
with the members of ClspMaterial (material.h); "living": true means a correlation_time_s of 0.

Effects (clspeckle effects lists them) are switched on by --effect, or in the configuration:
  {"effects": {"defocus": {"waves": 0.8}, "glare": {}}}

Written to the output folder: frame_000000.png ... (or frames.npy for a stack), preview_000000.png ..., ideal_000000.npy
... with --save-ideal, and config.json, with which --config repeats the run. 16-bit files hold the codes as they are.

Examples:
  clspeckle render ideal.png -o out --f-number 4 --seed 7
  clspeckle render ideal.npy -o out --sensor-profile OS04A10 \
      --effect defocus:waves=0.8 --effect dsnu
  clspeckle render ideal.npy -o out --frames 100 --format npy-stack \
      --no-preview --stage-times
  clspeckle render 'gbuffers/*.exr' -o out --pattern dots.png \
      --pattern-half-extent-x 0.7 --pattern-half-extent-y 0.48 --fx 560 \
      --fy 560 --cx 319.5 --cy 239.5
  clspeckle render examples/office/gbuffers -o out --exposure-gain auto \
      --save-ideal
  clspeckle render ideal.png --f-number 8 --dump-config > camera.json
  clspeckle render ideal.png -o out --config camera.json
  clspeckle render ideal.npy -o out --profile profile.json \
      --profile-sequence board_moving
)";

/** The formats, as the registry knows them. */
std::string render_inputs() {
    std::string images, stacks;
    for (const image_io::Format &format : image_io::formats()) {
        images += (images.empty() ? "" : ", ") + format.name + (format.samples.empty() ? "" : " " + format.samples);
        if (!format.stacks.empty())
            stacks += (stacks.empty() ? "" : ", ") + format.stacks;
    }
    return fmt::format("INPUT is an ideal infrared image ({}), a stack of them ({}), a folder or a quoted glob pattern; "
                       "or a scene: {} files, a sequence.json or its folder.\n\n",
                       images, stacks, image_io::listed("or", &image_io::Format::has_named_channels));
}

constexpr const char *statistics_examples =
    R"(Per frame: mean, standard deviation, contrast (their ratio), skewness, least and greatest value, share at the top code
(of --bits, else of the file's integer type) and at 0, and the size of a speckle: full width at half maximum of the
autocovariance along x and y (not with --mask, whose outline would be measured). Values are as stored. Of a folder, the
previews that render wrote are left out.

Examples:
  clspeckle statistics out/frame_*.png --bits 10
  clspeckle statistics out/frames.npy --temporal --region 100,100,64,64
  clspeckle statistics frame.png --histogram 32 --json
)";

constexpr const char *effects_examples =
    R"(Lists what makes a camera's picture differ from the ideal one, in the order in which light meets it, with the parameters
of each effect: a weak and a strong value as cameras show them, and the range that is accepted.

Examples:
  clspeckle effects
  clspeckle effects --json
  clspeckle render ideal.png -o out --effect defocus:waves=0.8 \
      --effect shot_noise
)";

constexpr const char *capture_examples =
    R"(Examples:
  clspeckle capture init my-camera --pixel-pitch-um 2.9 --f-number 5.6 \
      --wavelength-nm 940
  clspeckle capture make demo --effect defocus:waves=0.8 --seed 7
  clspeckle capture check demo

Help on a command: clspeckle capture make --help
)";

constexpr const char *capture_check_examples =
    R"(Reads a capture set and tells what is in it, what it can and cannot tell apart and why, and which effects of the
catalogue can show in it. Wrong sets are refused: the message names file, frame and field.

Examples:
  clspeckle capture check my-camera
  clspeckle capture check my-camera --json summary.json
)";

constexpr const char *capture_init_examples =
    R"(Writes a first capture.json from the frames in a folder, to be edited: sequences by the names of files and folders, bits
by the largest code, black level and read noise by dark frames, dots by where their light is. What frames do not tell
gets a usual value and is listed. Names begin with dark, flat, board or dots; those of board and dots say static (or
rest) or moving. A time in a name ("flat_5ms") is the exposure, NAME_mask.png the mask of sequence NAME.

Examples:
  clspeckle capture init my-camera
  clspeckle capture init my-camera --pixel-pitch-um 2.9 --f-number 5.6 \
      --wavelength-nm 940 --force
)";

constexpr const char *capture_emva_examples =
    R"(Computes EMVA 1288's numbers of the dark and flat frames, without a simulation: system gain, dark noise, fixed
patterns, linearity, saturation, dark current, each with a 95 % interval, or why it is not known. Of a resting laser
scene it is the gain.

Examples:
  clspeckle capture emva my-camera
  clspeckle capture emva my-camera --json emva.json --xml emva.xml
)";

constexpr const char *capture_make_examples =
    R"(Draws a capture set of the simulator: a dark, a flat, and board and dots at rest and in motion. Static sequences have the
same speckle and new noise in each frame, moving ones new speckle too; fixed patterns of the sensor are the same in all.

Examples:
  clspeckle capture make demo
  clspeckle capture make demo --frames 40 \
      --effect shot_noise:dn_per_electron=0.2 --effect prnu --seed 7 --key
  clspeckle capture make bench --sequences dark,flat \
      --flat-level 100,200,400,800
)";

constexpr const char *diagnose_examples =
    R"(CAPTURE is the folder of a capture set: what a camera recorded (docs/guide/captures.md). The simulator draws
the same sequences again and again, calibrated to the camera's light levels, black level and read noise. Statistics of
both are compared.

Verdicts:
  none       no gap between camera and simulator at the level
  named      one effect, or the smallest set that is needed, explains the gap
  ambiguous  two or more effects explain it equally well; the advice says which
             capture would tell
  unknown    a significant part of the gap is explained by no effect of the
             catalogue (clspeckle effects)

The exit code is 0 whenever a report was made, whatever it says. The same seed gives the same report. What the numbers
mean: docs/method/diagnosis.md.

Examples:
  clspeckle diagnose my-camera
  clspeckle diagnose my-camera --json report.json --html report.html \
      --without gamma,full_well
  clspeckle diagnose my-camera --hypothesis shading.json
  clspeckle diagnose my-camera --json - --quiet > report.json
)";

constexpr const char *gap_examples =
    R"(Examples:
  clspeckle gap compare my-camera my-simulator
  clspeckle gap check --plan small --out check

Help on a command: clspeckle gap compare --help
)";

constexpr const char *gap_compare_examples =
    R"(REAL and SIM are the folders of two capture sets (docs/guide/captures.md), the second from any simulator. Sequences
are paired by name, else by scene and motion, brought to the same light, and compared with the statistics of clspeckle
diagnose. Then the catalogue's effects are put on SIM's frames, as far as that can be done with finished frames, to say
which of them would close how much. Verdicts and exit code are those of diagnose. The method: docs/guide/gap-compare.md.

Examples:
  clspeckle gap compare my-camera my-simulator
  clspeckle gap compare my-camera my-simulator --json report.json \
      --html report.html
)";

constexpr const char *gap_check_examples =
    R"(How often is the diagnosis right? An independent generator, Python with NumPy and SciPy, draws capture sets with
known gaps; this program diagnoses them without the keys; a scorer counts (docs/results/gap-check.md). A stopped run goes
on where it was. The table, the wrong sets and, with Matplotlib, figures lie in FOLDER/score.

Examples:
  clspeckle gap check --plan small --out check
  clspeckle gap check --plan full --out full --jobs 2
  clspeckle gap check --plan small --out check --command "other-tool --fast"
)";

constexpr const char *gap_power_examples =
    R"(How weak an effect is still seen, and named? The generator of `gap check` draws effects at 0.05 to 1 times the
catalogue's weakest strength, for several numbers of frames; this program diagnoses them without the keys. A stopped
run goes on where it was. Table and, with Matplotlib, figure lie in FOLDER (docs/results/gap-check.md).

Examples:
  clspeckle gap power --out power --jobs 2
  clspeckle gap power --out power --frames 8 --frames 32 --effect defocus \
      --effect shot_noise --repeats 10
)";

constexpr const char *dataset_examples =
    R"(Training data: each pair has a scene, a camera and effects, drawn from the ranges of a recipe (JSON) by its seed and the
pair's number alone. FOLDER gets WebDataset shards. A stopped run goes on where it was; so does one with a larger --count.
This is `python -m clspeckle.dataset`, of the Python package. Recipe and files: docs/guide/datasets.md.

Examples:
  clspeckle dataset recipe.json --out set --count 10000 --workers 2
  clspeckle dataset recipe.json --out set --count 10 --python .venv/bin/python
)";

constexpr const char *tune_examples =
    R"(An aperture's Fourier transforms are made by clFFT or by the library's own engine, in vector lanes or in work-groups.
This measures all of them on a device (lanes not on GPUs), in turn, and keeps medians and choice in the tuning record,
a JSON file that later runs of the program and the library follow (docs/guide/runtime.md). What runs beside it spoils
the measurement. The fastest is chosen, or the device's default where that is not slower by more than the noise.
Ctrl-C stops without writing. CLSPECKLE_FFT overrides the record; CLSPECKLE_TUNING names another one, or is off.

Examples:
  clspeckle tune
  clspeckle tune --device gpu --size 1280x800 --size 640x400 --frames 50
  clspeckle tune --size 1920x1080 --dry-run --json
)";

constexpr const char *completion_examples =
    R"(An installed program brings these scripts to where the shells look for them. From a build folder:

Examples:
  source <(clspeckle completion bash)
  source <(clspeckle completion zsh)
  clspeckle completion fish | source
)";

constexpr const char *man_examples =
    R"(The page holds the help of all commands. An installed program brings it along: man clspeckle.

Examples:
  clspeckle man | man -l -
  clspeckle man > clspeckle.1
)";

constexpr const char *devices_examples =
    R"(Lists the OpenCL devices, best first, says which one is taken and why, why others are refused, and how to install one.

Examples:
  clspeckle devices
  clspeckle devices --device cpu
  CLSPECKLE_DEVICE=0:0 clspeckle render ideal.png -o out
)";

/** What an option takes, for the help. */
std::string type_name(const tools::Option &option) {
    switch (option.kind) {
    case tools::Kind::integer:
        return option.words.empty() ? "INTEGER" : "INTEGER|" + option.words.front();
    case tools::Kind::number:
        return option.words.empty() ? "NUMBER" : "NUMBER|" + option.words.front();
    case tools::Kind::choice:
        return "WORD";
    case tools::Kind::file:
        return "IMAGE";
    case tools::Kind::numbers:
        return "NUMBER,...";
    default:
        return "TEXT";
    }
}

/** A default as the command line would take it. */
std::string default_text(const tools::Option &option) {
    const tools::Json &value = option.fallback;
    if (value.is_string())
        return value.get<std::string>();
    if (value.is_boolean())
        return value.get<bool>() ? "on" : "off";
    if (!value.is_array())
        return value.is_number_float() ? fmt::format("{}", value.get<double>()) : value.dump();
    std::string text;
    for (const double number : value.get<std::vector<double>>())
        text += fmt::format("{}{}", text.empty() ? "" : ",", number);
    return text;
}

std::string description(const tools::Option &option) {
    std::string facts = option.range();
    if (!option.unit.empty())
        facts += (facts.empty() ? "" : ", ") + std::string("in ") + option.unit;
    const std::string fallback = default_text(option);
    if (!fallback.empty())
        facts += (facts.empty() ? "" : "; ") + std::string("default ") + fallback;
    return facts.empty() ? option.help : option.help + " (" + facts + ")";
}

/** Refuses what is no number of the range; CLI11 puts the option's name in front. */
template <typename T> CLI::Validator within(T low, T high) {
    const auto check = [low, high](const std::string &text) -> std::string {
        const char *first = text.data(), *last = text.data() + text.size();
        T value{};
        const auto result = std::from_chars(first, last, value);
        if (result.ec == std::errc() && result.ptr == last && value >= low && value <= high) // NaN is neither
            return {};
        return fmt::format("is \"{}\"; expected {} from {} to {}", text,
                           std::is_integral_v<T> ? "an integer" : "a number", low, high);
    };
    return CLI::Validator([check](std::string &text) { return check(text); }, "");
}

/** Refuses an empty name of a file. */
CLI::Validator named() {
    return CLI::Validator(
        [](std::string &text) { return text.empty() ? std::string("is empty; name a file") : std::string(); }, "");
}

/** The options of the table on the command line; what was given is collected as text. */
void add_table(CLI::App &app, std::map<std::string, std::string> &given) {
    for (const tools::Option &option : tools::option_table()) {
        const std::string id = option.id();
        const auto keep = [&given, id](const std::string &text) { given[id] = text; };
        const std::string group = "Configuration: " + option.section;
        if (option.kind == tools::Kind::boolean) {
            app.add_flag_function(
                   "--" + option.name + ",!--no-" + option.name,
                   [keep](std::int64_t count) { keep(count > 0 ? "true" : "false"); }, description(option))
                ->group(group)
                ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
            continue;
        }
        std::string names = "--" + option.name;
        if (!option.alias.empty())
            names += ",--" + option.alias;
        CLI::Option *added = app.add_option_function<std::string>(names, keep, description(option))
                                 ->group(group)
                                 ->type_name(type_name(option))
                                 ->take_last();
        if (option.kind == tools::Kind::choice)
            added->check(tools::known_words(option.words));
    }
}

std::vector<std::string> option_names(const CLI::App &app) {
    std::vector<std::string> names;
    for (const CLI::Option *option : app.get_options()) {
        for (const std::string &name : option->get_lnames())
            names.push_back("--" + name);
        for (const std::string &name : option->get_snames())
            names.push_back("-" + name);
    }
    return names;
}

/** What CLI11 says, with the nearest known name for an unknown option or command. */
std::string usage_message(const CLI::App &app, const CLI::ParseError &error, int argc, char **argv) {
    const CLI::App *command = &app;
    std::string path = "clspeckle"; // and the commands so far
    const auto known = [](const CLI::App &in, const std::string &name) {
        const auto names = option_names(in);
        return std::find(names.begin(), names.end(), name) != names.end();
    };
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (word == "--")
            break;
        std::vector<std::string> names;
        for (const CLI::App *sub : command->get_subcommands([](const CLI::App *) { return true; }))
            names.push_back(sub->get_name());
        if (!names.empty() && !word.empty() && word[0] != '-') {
            if (std::find(names.begin(), names.end(), word) == names.end())
                return fmt::format("there is no command \"{}\"; the nearest one is \"{}\" (see {} --help)", word,
                                   tools::nearest(word, names), path);
            command = command->get_subcommand(word);
            path += " " + word;
            continue;
        }
        const std::string name = word.substr(0, word.find('='));
        if (word.rfind("--", 0) == 0 && !known(*command, name))
            return fmt::format("there is no option {}; the nearest one is {} (see {} --help)", name,
                               tools::nearest(name, option_names(*command)), path);
    }
    return fmt::format("{} (see {} --help)", error.what(), path);
}

int exit_code_of(ClspStatus status) {
    // The only files that the library reads are the user's own kernels.
    return status == CLSP_ERROR_INVALID_ARGUMENT || status == CLSP_ERROR_INVALID_DATA || status == CLSP_ERROR_IO
               ? tools::exit_input
               : tools::exit_device;
}

int complain(int code, const std::string &message) {
    std::fflush(stdout);
    std::fputs(("clspeckle: " + tools::harmless(message) + "\n").c_str(), stderr);
    return code;
}

struct Arguments {
    bool json = false;
    bool quiet = false;
    // devices
    std::string device;
    // render
    tools::InputPaths input;
    std::string output;
    std::string config;
    std::string profile;
    std::string profile_sequence;
    std::string profile_maps;
    bool dump_config = false;
    std::map<std::string, std::string> options;
    std::vector<std::string> effects;
    // statistics
    tools::StatisticsArguments statistics;
    // depth
    tools::DepthArguments depth;
    // capture
    tools::CaptureCheckArguments capture_check;
    tools::CaptureInitArguments capture_init;
    tools::CaptureEmvaArguments capture_emva;
    tools::CaptureMakeArguments capture_make;
    // diagnose, gap compare
    tools::DiagnoseArguments diagnose;
    // gap check, gap power
    tools::GapCheckArguments gap_check;
    tools::GapPowerArguments gap_power;
    tools::DatasetArguments dataset;
    // doe
    tools::DoeCommands doe;
    // tune
    tools::TuneArguments tune;
    // completion
    std::string shell;
};

int render(Arguments &arguments, tools::Console &console) {
    tools::Config config;
    if (!arguments.config.empty())
        config.load(arguments.config);
    if (!arguments.profile.empty())
        for (const std::string &text : config.load_profile(arguments.profile, arguments.profile_sequence, arguments.profile_maps != "off"))
            console.warn(text);
    else if (!arguments.profile_maps.empty())
        throw tools::InputError(fmt::format("--profile-maps {}: name the profile, too: --profile FILE", arguments.profile_maps));
    else if (!arguments.profile_sequence.empty())
        throw tools::InputError(fmt::format("--profile-sequence {}: name the profile, too: --profile FILE",
                                            arguments.profile_sequence));
    for (const auto &[id, text] : arguments.options) {
        const tools::Option &option = tools::option(id);
        config.set_text(option, text, tools::Layer::command_line, "--" + option.name);
    }
    for (const std::string &effect : arguments.effects) {
        if (effect == "none")
            config.clear_effects();
        else
            config.set_effect(tools::parse_effect(effect), tools::Layer::command_line);
    }
    for (const std::string &text : config.doubled())
        console.warn(text);
    const bool has_input =
        !arguments.input.inputs.empty() || !arguments.input.depth.empty() || !arguments.input.position.empty();
    std::unique_ptr<tools::Input> input;
    if (has_input || !arguments.dump_config)
        input = tools::open_input(arguments.input, config);
    config.settle();
    if (arguments.dump_config) {
        console.result(config.dump().dump(2));
        return tools::exit_ok;
    }
    if (arguments.output.empty())
        throw tools::InputError("name the folder for the frames with -o FOLDER");
    config.check_image(input->width, input->height, input->first_name);
    for (const std::string &file : {arguments.config, arguments.profile})
        if (!file.empty())
            input->files.push_back(file);
    tools::run_render(config, *input, arguments.output, console);
    return tools::exit_ok;
}

void add_capture_check(CLI::App &app, tools::CaptureCheckArguments &a, bool &quiet) {
    app.footer(std::string(capture_check_examples) + "\n" + exit_codes);
    app.add_option("FOLDER", a.folder, "Capture set: its folder or its capture.json")->required()->type_name("");
    app.add_option("--json", a.json, "Write the summary as JSON to this file; - is standard output")
        ->type_name("FILE")
        ->check(named());
    app.add_option("--write-mask", a.mask, "Write a mask that leaves out the pixels that are not like the others")
        ->type_name("FILE")
        ->check(named());
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_capture_init(CLI::App &app, tools::CaptureInitArguments &a, bool &quiet) {
    app.footer(std::string(capture_init_examples) + "\n" + exit_codes);
    app.add_option("FOLDER", a.folder, "Folder of the frames")->required()->type_name("");
    const auto number = [&](const char *name, std::optional<double> &value, const char *what, double low, double high) {
        app.add_option(name, value, fmt::format("{}, {:g} to {:g}", what, low, high))
            ->type_name("NUMBER")
            ->take_last()
            ->check(within(low, high));
    };
    number("--pixel-pitch-um", a.pixel_pitch_um, "Distance between pixel centres in um", 0.01, 1000.0);
    number("--f-number", a.f_number, "f-number of the lens", 0.1, 1000.0);
    number("--wavelength-nm", a.wavelength_nm, "Wavelength in nm", 100.0, 20000.0);
    number("--read-noise-dn", a.read_noise_dn, "Read noise in DN (default: as the frames say)", 0.0, 65535.0);
    app.add_option("--bits", a.bits, "Bits of a code, 8 to 16 (default: as the codes say)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within(8u, 16u));
    app.add_option("--dots", a.dots_file, "JSON with sigma_px and positions_px, or a capture.json: the dots are not looked for")
        ->type_name("FILE");
    app.add_option("--raw", a.raw, fmt::format("How frames lie in the .raw files: {} (docs/guide/files.md)", image_io::raw_form))
        ->type_name("LAYOUT");
    app.add_flag("--force", a.force, "Replace a capture.json");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_capture_emva(CLI::App &app, tools::CaptureEmvaArguments &a, bool &quiet) {
    app.footer(std::string(capture_emva_examples) + "\n" + exit_codes);
    app.add_option("FOLDER", a.folder, "Capture set: its folder or its capture.json")->required()->type_name("");
    app.add_option("--json", a.json, "Write the numbers as JSON to this file; - is standard output")
        ->type_name("FILE")
        ->check(named());
    app.add_option("--xml", a.xml, "Write them as the Python package emva1288 writes its results")
        ->type_name("FILE")
        ->check(named());
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_capture_make(CLI::App &app, tools::CaptureMakeArguments &a, bool &quiet) {
    app.footer(std::string(capture_make_examples) + "\n" + exit_codes);
    app.add_option("FOLDER", a.folder, "Folder of the set; made, and refused if it exists")->required()->type_name("");
    const auto number = [&](const char *name, auto &value, const char *what, const char *type) {
        return app.add_option(name, value, fmt::format("{} (default {})", what, value))->type_name(type)->take_last();
    };
    constexpr std::uint32_t no = 0;
    number("--width", a.width, "Columns, 8 to 16384", "INTEGER")->check(within(8u, 16384u));
    number("--height", a.height, "Rows, 8 to 16384", "INTEGER")->check(within(8u, 16384u));
    number("--frames", a.frames, "Frames of each sequence, 1 to 65535", "INTEGER")->check(within(1u, 65535u));
    number("--bits", a.bits, "Bits of a code, 8 to 16", "INTEGER")->check(within(8u, 16u));
    number("--pixel-pitch-um", a.pixel_pitch_um, "Distance between pixel centres in um, 0.01 to 1000", "NUMBER")
        ->check(within(0.01, 1000.0));
    number("--f-number", a.f_number, "f-number of the lens, 0.1 to 1000", "NUMBER")->check(within(0.1, 1000.0));
    number("--wavelength-nm", a.wavelength_nm, "Wavelength in nm, 100 to 20000", "NUMBER")
        ->check(within(100.0, 20000.0));
    number("--degree-of-polarization", a.degree_of_polarization, "Of the returned light, 0 to 1", "NUMBER")
        ->check(within(0.0, 1.0));
    number("--black-level-dn", a.black_level_dn, "Black level in DN, 0 to below the top code", "NUMBER")
        ->check(within(0.0, 65535.0));
    number("--read-noise-dn", a.read_noise_dn, "Standard deviation of the read noise in DN, 0 to 65535", "NUMBER")
        ->check(within(0.0, 65535.0));
    number("--field", a.field, "circular_gaussian or unit_phasor", "WORD")
        ->check(CLI::IsMember({"circular_gaussian", "unit_phasor"}));
    const auto levels = [&](const char *name, std::vector<double> &value, const char *what) {
        app.add_option(name, value,
                       fmt::format("{} in DN above the black level; several give several sequences, with exposure_ms in "
                                   "proportion (default {})",
                                   what, value[0]))
            ->delimiter(',')
            ->type_name("NUMBER,...");
    };
    levels("--flat-level", a.flat_levels, "Mean of flat");
    levels("--board-level", a.board_levels, "Mean of board");
    levels("--dots-level", a.dots_levels, "Mean at the peak of a dot");
    app.add_option("--sequences", a.sequences, fmt::format("Which of {} to draw (default all)", fmt::join(a.sequences, ", ")))
        ->delimiter(',')
        ->type_name("NAME,...");
    number("--dots-pitch", a.dots_pitch_px, "Distance between the dots of the jittered lattice in px, 2 to 16384",
           "NUMBER")
        ->check(within(2.0, 16384.0));
    app.add_option("--dots-count", a.dots_count, "Instead of the pitch: about so many dots, at most 1000000")
        ->type_name("INTEGER")
        ->check(within(no, 1000000u));
    number("--dots-jitter", a.dots_jitter_px, "Dots are moved by up to so many px along each axis, 0 to 16384",
           "NUMBER")
        ->check(within(0.0, 16384.0));
    number("--dots-sigma", a.dots_sigma_px, "Width of a dot in px, 0.01 to 16384", "NUMBER")
        ->check(within(0.01, 16384.0));
    app.add_option("--dots", a.dots_file, "JSON with sigma_px and positions_px, or a capture.json, instead of a lattice")
        ->type_name("FILE");
    app.add_option("--effect", a.effects,
                   "Switch an effect of the catalogue on, as for render, for example defocus:waves=0.8. May be given several "
                   "times")
        ->allow_extra_args(false)
        ->type_name("EFFECT");
    number("--seed", a.seed, "Seed of everything random, 0 to 2^64 - 1", "INTEGER")
        ->check(within(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max()));
    app.add_option("--device", a.device, "OpenCL device, as for render")->type_name("TEXT");
    app.add_flag("--key", a.key, "Write the effects to key.json beside the set");
    app.add_flag("--overwrite", a.overwrite, "Replace a folder that holds nothing but a capture set");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_diagnose_options(CLI::App &app, tools::DiagnoseArguments &a, bool &quiet) {
    app.add_option("--json", a.json, "Write the report as JSON; - writes it to standard output")
        ->type_name("FILE")
        ->check(named());
    app.add_option("--html", a.html, "Write the report with pictures and plots, for a browser")
        ->type_name("FILE")
        ->check(named());
    app.add_option("--without", a.without, "Effects that are no candidates; may be given several times")
        ->allow_extra_args(false)
        ->type_name("ID,...");
    const auto number = [&](const char *name, auto &value, const char *what, const char *type) {
        return app.add_option(name, value, fmt::format("{} (default {})", what, value))->type_name(type)->take_last();
    };
    number("--seed", a.seed, "Seed of the simulated captures, 0 to 2^64 - 1", "INTEGER")
        ->check(within(std::uint64_t{0}, std::numeric_limits<std::uint64_t>::max()));
    number("--level", a.level, "Probability of seeing a gap where there is none, 1e-6 to 0.5", "NUMBER")
        ->check(within(1e-6, 0.5));
    number("--null-replicates,--replicates", a.replicates, "Simulated captures without effects, 12 to 100000",
           "INTEGER")
        ->check(within(12u, 100000u));
    number("--max-effects", a.max_effects, "Effects in one explanation at most, 1 to 64, beside such as turn out too slight to be named", "INTEGER")
        ->check(within(1u, 64u));
    number("--threads", a.threads, "Of the host, at most 1024; 0: as many as the machine has", "INTEGER")
        ->check(within(0u, 1024u));
    app.add_option("--window", a.window,
                   "Part of the image that is judged, or whole; default: all of a small capture, a strip through the "
                   "optical axis of a large one")
        ->type_name("X,Y,W,H|whole")
        ->take_last();
    app.add_option("--frames", a.frames,
                   "Frames of each sequence that are judged, at most; 0: all; default: what takes minutes")
        ->check(within(0u, 65535u))
        ->type_name("INTEGER")
        ->take_last();
    app.add_option("--device", a.device, "OpenCL device, as for render")->type_name("TEXT");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_diagnose(CLI::App &app, tools::DiagnoseArguments &a, bool &quiet) {
    app.footer(std::string(diagnose_examples) + "\n" + exit_codes);
    app.add_option("CAPTURE", a.folder, "Folder of the capture set, or its capture.json")->required()->type_name("");
    app.add_option("--hypothesis", a.hypotheses,
                   "An effect of your own, as JSON and OpenCL source (docs/method/diagnosis.md); may be given "
                   "several times")
        ->allow_extra_args(false)
        ->type_name("FILE")
        ->check(named());
    app.add_option("--tolerance", a.tolerances,
                   "What you accept of the simulator's error, as JSON (docs/method/diagnosis.md): the report "
                   "says whether it is")
        ->type_name("FILE")
        ->check(named());
    app.add_option("--emva", a.emva,
                   "Write EMVA 1288's numbers of the dark and flat frames, as the Python package emva1288 does")
        ->type_name("FILE")
        ->check(named());
    app.add_option("--profile", a.profile, "Write the camera that was found, with its effects, for render --profile")
        ->type_name("FILE")
        ->check(named());
    add_diagnose_options(app, a, quiet);
}

void add_gap_compare(CLI::App &app, tools::DiagnoseArguments &a, bool &quiet) {
    app.footer(std::string(gap_compare_examples) + "\n" + exit_codes);
    app.add_option("REAL", a.folder, "Folder of the camera's capture set, or its capture.json")
        ->required()
        ->type_name("");
    app.add_option("SIM", a.sim, "Folder of the simulator's set, or its capture.json")->required()->type_name("");
    app.add_option("--profile", a.camera,
                   "Camera profile of REAL, that SIM was drawn with: its effects make both scatter, which is no gap")
        ->type_name("FILE")
        ->check(named());
    add_diagnose_options(app, a, quiet);
}

/** What draws and diagnoses, of gap check and gap power. result: what --json has. */
void add_generator_options(CLI::App &app, tools::GeneratorArguments &a, const char *result, bool &quiet) {
    app.add_option("--out", a.folder, "Folder of sets, reports and results; made if it does not exist")
        ->required()
        ->type_name("FOLDER");
    const auto text = [&](const char *name, std::string &value, const std::string &what, const char *type) {
        app.add_option(name, value, what)->type_name(type)->take_last();
    };
    text("--generator", a.generator,
         "Folder of the generator; default: validation/gap_check of the checkout, or what was installed", "FOLDER");
    text("--python", a.python, "Python that runs the generator (default python3)", "PROGRAM");
    text("--command", a.command,
         "The diagnosis that is checked, to which CAPTURE --json REPORT [--without IDS] is appended (default: this "
         "program's)",
         "TEXT");
    text("--device", a.device, "OpenCL device, as for render", "TEXT");
    text("--json", a.json, std::string("Write the ") + result + " as JSON; - writes it to standard output", "FILE");
    app.add_option("--jobs", a.jobs, "Diagnoses at once, 1 to 256 (default 1)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint32_t>(1, 256));
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_gap_check(CLI::App &app, tools::GapCheckArguments &a, bool &quiet) {
    app.footer(std::string(gap_check_examples) + "\n" + exit_codes);
    add_generator_options(app, a, "score", quiet);
    app.add_option("--plan", a.plan,
                   "small (12 sets), medium, full (hours), or a JSON file with the members of a plan (default small)")
        ->type_name("PLAN")
        ->take_last();
    const auto number = [&](const char *name, auto &value, const char *what) {
        return app.add_option(name, value, what)->type_name("INTEGER")->take_last();
    };
    number("--frames", a.frames, "Another number of frames than the plan's")->check(within<std::uint32_t>(2, 65535));
    number("--seed", a.seed, "Another seed than the plan's")
        ->check(within<std::uint64_t>(0, std::numeric_limits<std::uint64_t>::max()));
}

void add_gap_power(CLI::App &app, tools::GapPowerArguments &a, bool &quiet) {
    app.footer(std::string(gap_power_examples) + "\n" + exit_codes);
    add_generator_options(app, a, "table", quiet);
    app.add_option("--frames", a.frames, "Number of frames; may be given several times (default 4, 8, 16, 32)")
        ->allow_extra_args(false)
        ->delimiter(',')
        ->type_name("INTEGER")
        ->check(within<std::uint32_t>(2, 65535));
    app.add_option("--effect", a.effects, "Effect of the catalogue; may be given several times (default eight of them)")
        ->allow_extra_args(false)
        ->delimiter(',')
        ->type_name("ID");
    app.add_option("--repeats", a.repeats, "Sets of each effect, strength and number of frames, 1 to 10000 (default 3)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint32_t>(1, 10000));
    app.add_option("--seed", a.seed, "Of the sets (default 1)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint64_t>(0, std::numeric_limits<std::uint64_t>::max()));
}

void add_dataset(CLI::App &app, tools::DatasetArguments &a, bool &quiet) {
    app.footer(std::string(dataset_examples) + "\n" + exit_codes);
    app.add_option("RECIPE", a.recipe, "JSON file with scenes, cameras, effects, effects_per_image and seed")
        ->required()
        ->type_name("");
    app.add_option("--out", a.folder, "Folder of the set; made if it does not exist")->required()->type_name("FOLDER");
    app.add_option("--count", a.count, "Pairs, 1 to 999999999")
        ->required()
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint64_t>(1, 999999999));
    app.add_option("--shard-size", a.shard_size, "Pairs of a shard (default 1000)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint32_t>(1, std::numeric_limits<std::uint32_t>::max()));
    app.add_option("--workers", a.workers, "Processes, each with its share of the cores, 1 to 65535 (default 1)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint32_t>(1, 65535));
    app.add_flag("--no-ideal", a.without_ideal, "Leave the ideal images out of the shards");
    app.add_option("--python", a.python, "Python that has the package (default python3)")
        ->type_name("PROGRAM")
        ->take_last();
    app.add_flag("--quiet", quiet, "Print errors only");
}

void add_tune(CLI::App &app, tools::TuneArguments &a, bool &quiet) {
    app.footer(std::string(tune_examples) + "\n" + exit_codes);
    app.add_option("--device", a.device, "OpenCL device, as for render")->type_name("TEXT");
    app.add_option("--size", a.sizes,
                   "Images to measure, in pixels; may be given several times (default 640x480, 512x512, 1024x1024, "
                   "1920x1080, 2048x2048)")
        ->allow_extra_args(false)
        ->delimiter(',')
        ->type_name("WIDTHxHEIGHT");
    app.add_option("--frames", a.frames, "Measurements of each engine, 1 to 10000 (default 15)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint32_t>(1, 10000));
    app.add_option("--output", a.output,
                   "Write this tuning record instead of the one that the program reads (CLSPECKLE_TUNING, else "
                   "tuning.json in the cache folder)")
        ->type_name("FILE")
        ->check(named());
    app.add_flag("--dry-run", a.dry_run, "Measure, but write nothing")->excludes("--output");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

int run(int argc, char **argv) {
    CLI::App app("clSpeckle: what a laser-dot depth camera records of a perfect infrared image, computed with OpenCL.",
                 "clspeckle");
    app.footer(std::string(main_examples) + "\n" + exit_codes);
    app.require_subcommand(1);
    app.formatter(std::make_shared<tools::Formatter>());
    const auto version = clspeckle::version();
    app.set_version_flag("--version", fmt::format("clspeckle {}.{}.{}", version.major, version.minor, version.patch),
                         "Print the version and end");
    app.set_help_flag("-h,--help", "Print this help and end");

    Arguments arguments;
    const auto add_json = [&](CLI::App &command, const char *what) {
        command.add_flag("--json", arguments.json, what);
    };

    CLI::App &devices = *app.add_subcommand("devices", "List the OpenCL devices and explain the choice");
    devices.footer(devices_examples);
    devices.add_option("--device", arguments.device, "Explain the choice for this selector instead of the default")
        ->type_name("TEXT");
    add_json(devices, "Print JSON");

    CLI::App &effects = *app.add_subcommand("effects", "List the effects of a real camera");
    effects.footer(effects_examples);
    add_json(effects, "Print JSON");

    CLI::App &render_command = *app.add_subcommand("render", "Render speckled infrared frames");
    render_command.footer(render_inputs() + render_examples);
    render_command
        .add_option("INPUT", arguments.input.inputs, "Ideal image, scene, folder, glob pattern or sequence.json")
        ->type_name("");
    render_command.add_option("--raw", arguments.input.raw, tools::raw_help())->type_name("LAYOUT");
    render_command.add_option("-o,--output", arguments.output, "Folder for the frames; made if it does not exist")
        ->type_name("FOLDER");
    render_command
        .add_option("--depth", arguments.input.depth,
                    "Depth in m (floating-point " +
                        image_io::listed("or", [](const image_io::Format &f) { return f.real; }) + ")")
        ->type_name("IMAGE");
    render_command.add_option("--position", arguments.input.position, "Positions in m, height x width x 3")
        ->type_name("IMAGE");
    render_command.add_option("--normal", arguments.input.normal, "Unit normals, height x width x 3")
        ->type_name("IMAGE");
    render_command.add_option("--albedo", arguments.input.albedo, "Albedo, 0 to 1")->type_name("IMAGE");
    render_command.add_option("--visibility", arguments.input.visibility, "Whether the laser sees the point, 0 to 1")
        ->type_name("IMAGE");
    render_command.add_option("--material", arguments.input.material, "Material ids, 0 to 255")->type_name("IMAGE");
    render_command.add_option("--materials", arguments.input.materials, "JSON with the list of materials")
        ->type_name("FILE");
    render_command
        .add_option("--refresh-mask", arguments.input.refresh_mask, "New speckle in each frame where this is not 0")
        ->type_name("IMAGE");
    render_command.add_option("--config", arguments.config, "JSON configuration")->type_name("FILE");
    render_command
        .add_option("--profile", arguments.profile,
                    "Camera profile that diagnose --profile wrote; options of the command line replace its values, which "
                    "is told, but for bits, pixel pitch and wavelength")
        ->type_name("FILE")
        ->check(named());
    render_command
        .add_option("--profile-sequence", arguments.profile_sequence,
                    "With the light, scene and motion of this sequence of the profile: a lab's conditions, not the camera's")
        ->type_name("NAME");
    render_command
        .add_option("--profile-maps", arguments.profile_maps,
                    "on: the profile's maps, where it has any, are the patterns of the camera's own pixels (default); off: such "
                    "patterns are drawn anew from its effects")
        ->type_name("WORD")
        ->check(CLI::IsMember({"on", "off"}));
    render_command
        .add_option(
            "--effect", arguments.effects,
            "Switch an effect of the catalogue on (see clspeckle effects): its id, then a colon and parameters as "
            "name=value with commas, for example defocus:waves=0.8; those left out lie between weak and strong. May be "
            "given several times; none: those before it, and the configuration's, are off")
        ->allow_extra_args(false)
        ->group("Configuration: effects")
        ->type_name("EFFECT");
    render_command.add_flag("--dump-config", arguments.dump_config,
                            "Print the effective configuration as JSON and end");
    add_json(render_command, "Print a summary as JSON on standard output, everything else on standard error");
    render_command.add_flag("--quiet", arguments.quiet, "Print warnings and errors only");
    add_table(render_command, arguments.options);

    CLI::App &statistics = *app.add_subcommand("statistics", "Measure speckle statistics of images");
    statistics.footer(statistics_examples);
    tools::StatisticsArguments &stats = arguments.statistics;
    statistics.add_option("FILE", stats.files, "Images, stacks, folders or glob patterns")->required()->type_name("");
    statistics.add_option("--mask", stats.mask, "Count only the pixels where this image is not 0")->type_name("IMAGE");
    statistics.add_option("--region", stats.region, "Count only this rectangle, in pixels")
        ->delimiter(',')
        ->expected(4)
        ->type_name("X,Y,W,H");
    statistics.add_option("--bits", stats.bits, "Bits of a code, which give the top code (1 to 32)")
        ->type_name("INTEGER")
        ->check(CLI::Range(1, 32));
    statistics.add_option("--histogram", stats.histogram_bins, "Count a histogram of so many bins (1 to 65536)")
        ->type_name("BINS")
        ->check(CLI::Range(1, 65536));
    statistics
        .add_option("--histogram-range", stats.histogram_range, "Range of the histogram; the values' own without it")
        ->delimiter(',')
        ->expected(2)
        ->type_name("LOW,HIGH");
    statistics.add_flag("--temporal", stats.temporal, "Also tell each pixel's standard deviation over all frames");
    statistics.add_option("--channel", stats.channel, tools::channel_help())->type_name("TEXT");
    statistics.add_option("--raw", stats.raw, tools::raw_help())->type_name("LAYOUT");
    statistics.add_option("--device", stats.device, "OpenCL device, as for render")->type_name("TEXT");
    add_json(statistics, "Print JSON");

    CLI::App &depth = *app.add_subcommand("depth", "Measure the depth of the dots of frames");
    tools::add_depth(depth, arguments.depth);
    depth.add_flag("--quiet", arguments.quiet, "Print warnings, errors and results only");
    add_json(depth, "Print JSON");

    CLI::App &capture = *app.add_subcommand("capture", "Describe, check, measure and make capture sets");
    const std::string frames =
        image_io::listed("or", [](const image_io::Format &f) { return f.codes == image_io::Codes::frames; });
    capture.footer(
        fmt::format("A capture set is what a camera recorded: a folder with a capture.json and .npy stacks, or {} "
                    "frames\n(docs/guide/captures.md).\n\n",
                    frames) +
        capture_examples);
    capture.require_subcommand(1);
    CLI::App &capture_check = *capture.add_subcommand("check", "Tell what is in a capture set");
    add_capture_check(capture_check, arguments.capture_check, arguments.quiet);
    CLI::App &capture_init = *capture.add_subcommand("init", "Write a first capture.json from frames");
    add_capture_init(capture_init, arguments.capture_init, arguments.quiet);
    CLI::App &capture_emva = *capture.add_subcommand("emva", "Compute EMVA 1288's numbers of dark and flat frames");
    add_capture_emva(capture_emva, arguments.capture_emva, arguments.quiet);
    CLI::App &capture_make = *capture.add_subcommand("make", "Draw a capture set of the simulator");
    add_capture_make(capture_make, arguments.capture_make, arguments.quiet);

    tools::add_doe(app, arguments.doe, arguments.json, arguments.quiet);

    CLI::App &diagnose = *app.add_subcommand("diagnose", "Find the gap between camera and simulator, and its cause");
    add_diagnose(diagnose, arguments.diagnose, arguments.quiet);

    CLI::App &gap = *app.add_subcommand("gap", "Compare other simulators with a camera; check the diagnosis");
    gap.footer(std::string(gap_examples) + "\n" + exit_codes);
    gap.require_subcommand(1);
    CLI::App &gap_compare =
        *gap.add_subcommand("compare", "Find where a simulator's frames differ from a camera's, and what would help");
    add_gap_compare(gap_compare, arguments.diagnose, arguments.quiet);
    CLI::App &gap_check =
        *gap.add_subcommand("check", "Count how often the diagnosis is right, on sets with known gaps");
    add_gap_check(gap_check, arguments.gap_check, arguments.quiet);
    CLI::App &gap_power = *gap.add_subcommand("power", "Find how weak an effect may be and still be seen and named");
    add_gap_power(gap_power, arguments.gap_power, arguments.quiet);

    CLI::App &dataset = *app.add_subcommand("dataset", "Write pairs of ideal and recorded images, to train with");
    add_dataset(dataset, arguments.dataset, arguments.quiet);

    CLI::App &tune = *app.add_subcommand("tune", "Measure which engine is the fastest on a device, and keep that");
    add_tune(tune, arguments.tune, arguments.quiet);
    add_json(tune, "Print what was measured as JSON on standard output, everything else on standard error");

    CLI::App &completion = *app.add_subcommand("completion", "Print what makes a shell complete commands and options");
    completion.footer(completion_examples);
    completion.add_option("SHELL", arguments.shell, fmt::format("{}", fmt::join(tools::completion_shells(), ", ")))
        ->required()
        ->check(CLI::IsMember(tools::completion_shells()))
        ->type_name("WORD");
    CLI::App &man = *app.add_subcommand("man", "Print the manual page");
    man.footer(man_examples);

    // What those scripts ask. No command: the words behind it are no arguments.
    if (argc > 2 && argv[1] == std::string("complete") && argv[2] == std::string("--")) {
        for (const std::string &line : tools::completions(app, {argv + 3, argv + argc}))
            std::puts(line.c_str());
        return tools::exit_ok;
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::Success &success) {
        const int code = app.exit(success);
        if (std::fflush(stdout) != 0 || std::ferror(stdout))
            return complain(tools::exit_output, "standard output cannot be written");
        return code == 0 ? tools::exit_ok : tools::exit_input;
    } catch (const CLI::ParseError &error) {
        return complain(tools::exit_input, usage_message(app, error, argc, argv));
    }
    if (!stats.histogram_range.empty() && !(stats.histogram_range[0] < stats.histogram_range[1]))
        throw tools::InputError("--histogram-range LOW,HIGH: the first number must be below the second");

    int code = tools::exit_ok;
    const bool json = (arguments.json && !arguments.dump_config) || arguments.capture_check.json == "-" ||
                      arguments.capture_emva.json == "-" ||
                      arguments.diagnose.json == "-" || arguments.gap_check.json == "-" ||
                      arguments.gap_power.json == "-";
    tools::Console console(json, arguments.quiet);
    if (devices.parsed())
        code = tools::run_devices(arguments.device, console);
    else if (effects.parsed())
        tools::run_effects(console);
    else if (render_command.parsed())
        code = render(arguments, console);
    else if (depth.parsed())
        tools::run_depth(arguments.depth, console);
    else if (capture_check.parsed())
        tools::run_capture_check(arguments.capture_check, console);
    else if (capture_init.parsed())
        tools::run_capture_init(arguments.capture_init, console);
    else if (capture_emva.parsed())
        tools::run_capture_emva(arguments.capture_emva, console);
    else if (capture_make.parsed())
        tools::run_capture_make(arguments.capture_make, console);
    else if (diagnose.parsed() || gap_compare.parsed())
        tools::run_diagnose(arguments.diagnose, console);
    else if (gap_check.parsed())
        tools::run_gap_check(arguments.gap_check, console);
    else if (gap_power.parsed())
        tools::run_gap_power(arguments.gap_power, console);
    else if (dataset.parsed())
        tools::run_dataset(arguments.dataset, arguments.quiet);
    else if (tune.parsed())
        tools::run_tune(arguments.tune, console);
    else if (completion.parsed())
        console.result(tools::completion_script(arguments.shell));
    else if (man.parsed())
        console.result(tools::manual(app, fmt::format("{}.{}.{}", version.major, version.minor, version.patch)));
    else if (!tools::run_doe(arguments.doe, console))
        tools::run_statistics(stats, console);
    console.finish();
    return code;
}

/** The message and the exit code of what ended the program. The library's errors without the names of C functions. */
int explain(const std::exception &ended) {
    try {
        throw;
    } catch (const tools::OutputError &error) {
        return complain(tools::exit_output, error.what());
    } catch (const image_io::WriteError &error) {
        return complain(tools::exit_output, error.what());
    } catch (const tools::InputError &error) {
        return complain(tools::exit_input, error.what());
    } catch (const image_io::ReadError &error) {
        return complain(tools::exit_input, error.what());
    } catch (const clspeckle::Error &error) {
        const std::string log = error.build_log().empty() ? "" : "\n" + error.build_log();
        return complain(exit_code_of(error.status()), error.message() + log);
    } catch (const std::bad_alloc &) {
        return complain(tools::exit_device, "there is not enough memory");
    } catch (const std::exception &) {
        return complain(tools::exit_device, ended.what());
    }
}

int run_guarded(int argc, char **argv) {
    try {
        return run(argc, argv);
    } catch (const tools::Interrupted &error) {
        return complain(tools::exit_interrupted, error.what());
    } catch (const std::exception &error) {
        // Ctrl-C also reaches the compiler that a driver runs: what fails then fails because of it.
        return tools::stop_requested() ? complain(tools::exit_interrupted, tools::Interrupted().what())
                                       : explain(error);
    }
}

/** clFFT complains at exit that nobody tore it down, which a library must not do: the plans are gone, nothing is lost.
 */
void silence_exit() {
    std::fflush(stdout);
    std::fflush(stderr);
#if !defined(__SANITIZE_ADDRESS__)
    const int nowhere = ::open("/dev/null", O_WRONLY);
    if (nowhere >= 0)
        ::dup2(nowhere, STDERR_FILENO);
#endif
}

// Frames and buffers of a long run come and go between small things that stay. glibc puts them among those once the first
// of them was freed, and its heaps grow to twice the size: above a megabyte, each is to have pages of its own.
void keep_heaps_small() {
#ifdef __GLIBC__
    ::mallopt(M_MMAP_THRESHOLD, 1 << 20);
#endif
}

} // namespace

int main(int argc, char **argv) {
    keep_heaps_small();
    tools::handle_signals();
    image_io::add_openexr();
    const int code = run_guarded(argc, argv);
    silence_exit();
    return code;
}
