#include "command_options.hpp"
#include "commands.hpp"
#include "completion.hpp"
#include "doe.hpp"
#include "errors.hpp"
#include "examples.hpp"
#include "help.hpp"
#include "interrupt.hpp"
#include "io/formats.hpp"
#include "io/openexr.hpp"
#include "json.hpp"
#include "manual.hpp"
#include "options.hpp"
#include "table_options.hpp"
#include "text.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <fcntl.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <cstdio>
#include <map>
#include <new>

namespace {

/** The formats, as the registry knows them. */
std::string render_inputs() {
    std::string images, stacks;
    for (const image_io::Format &format : image_io::formats()) {
        images += (images.empty() ? "" : ", ") + format.name + (format.samples.empty() ? "" : " " + format.samples);
        if (!format.stacks.empty())
            stacks += (stacks.empty() ? "" : ", ") + format.stacks;
    }
    return fmt::format(
        "INPUT is an ideal infrared image ({}), a stack of them ({}), a folder or a quoted glob pattern; "
        "or a scene: {} files, a sequence.json or its folder.\n\n",
        images, stacks, image_io::listed("or", &image_io::Format::has_named_channels));
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
        for (const std::string &text :
             config.load_profile(arguments.profile, arguments.profile_sequence, arguments.profile_maps != "off"))
            console.warn(text);
    else if (!arguments.profile_maps.empty())
        throw tools::InputError(
            fmt::format("--profile-maps {}: name the profile, too: --profile FILE", arguments.profile_maps));
    else if (!arguments.profile_sequence.empty())
        throw tools::InputError(
            fmt::format("--profile-sequence {}: name the profile, too: --profile FILE", arguments.profile_sequence));
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
    config.check_conflicts();
    for (const std::string &text : config.doubled())
        console.warn(text);
    const bool has_input =
        !arguments.input.inputs.empty() || !arguments.input.depth.empty() || !arguments.input.position.empty();
    std::unique_ptr<tools::Input> input;
    if (has_input || !arguments.dump_config)
        input = tools::open_input(arguments.input, config);
    config.settle();
    if (arguments.dump_config) {
        console.result(tools::json_document(config.dump(), 2));
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

int run(int argc, char **argv) {
    CLI::App app("clSpeckle: what a laser-dot depth camera records of a perfect infrared image, computed with OpenCL.",
                 "clspeckle");
    app.footer(std::string(tools::main_examples) + "\n" + tools::exit_codes);
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
    devices.footer(tools::devices_examples);
    devices.add_option("--device", arguments.device, "Explain the choice for this selector instead of the default")
        ->type_name("TEXT");
    add_json(devices, "Print JSON");

    CLI::App &effects = *app.add_subcommand("effects", "List the effects of a real camera");
    effects.footer(tools::effects_examples);
    add_json(effects, "Print JSON");

    CLI::App &render_command = *app.add_subcommand("render", "Render speckled infrared frames");
    render_command.footer(render_inputs() + tools::render_examples);
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
        .add_option(
            "--profile", arguments.profile,
            "Camera profile that diagnose --profile wrote; options of the command line replace its values, which "
            "is told, but for bits, pixel pitch and wavelength")
        ->type_name("FILE")
        ->check(tools::has_name());
    render_command
        .add_option(
            "--profile-sequence", arguments.profile_sequence,
            "With the light, scene and motion of this sequence of the profile: a lab's conditions, not the camera's")
        ->type_name("NAME");
    render_command
        .add_option("--profile-maps", arguments.profile_maps,
                    "on: the profile's maps, where it has any, are the patterns of the camera's own pixels (default); "
                    "off: such "
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
    tools::add_table(render_command, arguments.options);

    CLI::App &statistics = *app.add_subcommand("statistics", "Measure speckle statistics of images");
    statistics.footer(tools::statistics_examples);
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
        tools::capture_examples);
    capture.require_subcommand(1);
    CLI::App &capture_check = *capture.add_subcommand("check", "Tell what is in a capture set");
    tools::add_capture_check(capture_check, arguments.capture_check, arguments.quiet);
    CLI::App &capture_init = *capture.add_subcommand("init", "Write a first capture.json from frames");
    tools::add_capture_init(capture_init, arguments.capture_init, arguments.quiet);
    CLI::App &capture_emva = *capture.add_subcommand("emva", "Compute EMVA 1288's numbers of dark and flat frames");
    tools::add_capture_emva(capture_emva, arguments.capture_emva, arguments.quiet);
    CLI::App &capture_make = *capture.add_subcommand("make", "Draw a capture set of the simulator");
    tools::add_capture_make(capture_make, arguments.capture_make, arguments.quiet);

    tools::add_doe(app, arguments.doe, arguments.json, arguments.quiet);

    CLI::App &diagnose = *app.add_subcommand("diagnose", "Find the gap between camera and simulator, and its cause");
    tools::add_diagnose(diagnose, arguments.diagnose, arguments.quiet);

    CLI::App &gap = *app.add_subcommand("gap", "Compare other simulators with a camera; check the diagnosis");
    gap.footer(std::string(tools::gap_examples) + "\n" + tools::exit_codes);
    gap.require_subcommand(1);
    CLI::App &gap_compare =
        *gap.add_subcommand("compare", "Find where a simulator's frames differ from a camera's, and what would help");
    tools::add_gap_compare(gap_compare, arguments.diagnose, arguments.quiet);
    CLI::App &gap_check =
        *gap.add_subcommand("check", "Count how often the diagnosis is right, on sets with known gaps");
    tools::add_gap_check(gap_check, arguments.gap_check, arguments.quiet);
    CLI::App &gap_power = *gap.add_subcommand("power", "Find how weak an effect may be and still be seen and named");
    tools::add_gap_power(gap_power, arguments.gap_power, arguments.quiet);

    CLI::App &dataset = *app.add_subcommand("dataset", "Write pairs of ideal and recorded images, to train with");
    tools::add_dataset(dataset, arguments.dataset, arguments.quiet);

    CLI::App &tune = *app.add_subcommand("tune", "Measure which engine is the fastest on a device, and keep that");
    tools::add_tune(tune, arguments.tune, arguments.quiet);
    add_json(tune, "Print what was measured as JSON on standard output, everything else on standard error");

    CLI::App &completion = *app.add_subcommand("completion", "Print what makes a shell complete commands and options");
    completion.footer(tools::completion_examples);
    completion.add_option("SHELL", arguments.shell, fmt::format("{}", fmt::join(tools::completion_shells(), ", ")))
        ->required()
        ->check(CLI::IsMember(tools::completion_shells()))
        ->type_name("WORD");
    CLI::App &man = *app.add_subcommand("man", "Print the manual page");
    man.footer(tools::man_examples);

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
        return complain(tools::exit_input, tools::usage_message(app, error, argc, argv));
    }
    if (!stats.histogram_range.empty() && !(stats.histogram_range[0] < stats.histogram_range[1]))
        throw tools::InputError("--histogram-range LOW,HIGH: the first number must be below the second");

    int code = tools::exit_ok;
    const bool json = (arguments.json && !arguments.dump_config) || arguments.capture_check.json == "-" ||
                      arguments.capture_emva.json == "-" || arguments.diagnose.json == "-" ||
                      arguments.gap_check.json == "-" || arguments.gap_power.json == "-";
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

// Frames and buffers of a long run come and go between small things that stay. glibc puts them among those once the
// first of them was freed, and its heaps grow to twice the size: above a megabyte, each is to have pages of its own.
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
