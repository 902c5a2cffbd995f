#include "command_options.hpp"

#include "examples.hpp"
#include "io/formats.hpp"
#include "number_options.hpp"
#include "table_options.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <limits>

namespace tools {

namespace {

void add_diagnose_options(CLI::App &app, DiagnoseArguments &a, bool &quiet) {
    app.add_option("--json", a.json, "Write the report as JSON; - writes it to standard output")
        ->type_name("FILE")
        ->check(has_name());
    app.add_option("--html", a.html, "Write the report with pictures and plots, for a browser")
        ->type_name("FILE")
        ->check(has_name());
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
    number("--max-effects", a.max_effects,
           "Effects in one explanation at most, 1 to 64, beside such as turn out too slight to be named", "INTEGER")
        ->check(within(1u, 64u));
    number("--threads", a.threads, "Of the host, 0 to 1024; 0: as many as the machine has", "INTEGER")
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

/** What draws and diagnoses, of gap check and gap power. result: what --json has. */
void add_generator_options(CLI::App &app, GeneratorArguments &a, const char *result, bool &quiet) {
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

} // namespace

void add_capture_check(CLI::App &app, CaptureCheckArguments &a, bool &quiet) {
    app.footer(std::string(capture_check_examples) + "\n" + exit_codes);
    app.add_option("FOLDER", a.folder, "Capture set: its folder or its capture.json")->required()->type_name("");
    app.add_option("--json", a.json, "Write the summary as JSON to this file; - is standard output")
        ->type_name("FILE")
        ->check(has_name());
    app.add_option("--write-mask", a.mask, "Write a mask that leaves out the pixels that are not like the others")
        ->type_name("FILE")
        ->check(has_name());
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_capture_init(CLI::App &app, CaptureInitArguments &a, bool &quiet) {
    app.footer(std::string(capture_init_examples) + "\n" + exit_codes);
    app.add_option("FOLDER", a.folder, "Folder of the frames")->required()->type_name("");
    const auto number = [&](const char *name, std::optional<double> &value, const Range &range, const char *what) {
        add_number(app, name, value, range, what);
    };
    number("--pixel-pitch-um", a.pixel_pitch_um, ranges::pixel_pitch_um, "Distance between pixel centres");
    number("--f-number", a.f_number, ranges::f_number, "f-number of the lens");
    number("--wavelength-nm", a.wavelength_nm, ranges::wavelength_nm, "Wavelength");
    number("--read-noise-dn", a.read_noise_dn, ranges::noise_dn, "Read noise (default: as the frames say)");
    app.add_option("--bits", a.bits, "Bits of a code, 8 to 16 (default: as the codes say)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within(8u, 16u));
    app.add_option("--dots", a.dots_file,
                   "JSON with sigma_px and positions_px, or a capture.json: the dots are not looked for")
        ->type_name("FILE");
    app.add_option("--raw", a.raw,
                   fmt::format("How frames lie in the .raw files: {} (docs/guide/files.md)", image_io::raw_form))
        ->type_name("LAYOUT");
    app.add_flag("--force", a.force, "Replace a capture.json");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_capture_emva(CLI::App &app, CaptureEmvaArguments &a, bool &quiet) {
    app.footer(std::string(capture_emva_examples) + "\n" + exit_codes);
    app.add_option("FOLDER", a.folder, "Capture set: its folder or its capture.json")->required()->type_name("");
    app.add_option("--json", a.json, "Write the numbers as JSON to this file; - is standard output")
        ->type_name("FILE")
        ->check(has_name());
    app.add_option("--xml", a.xml, "Write them as the Python package emva1288 writes its results")
        ->type_name("FILE")
        ->check(has_name());
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_capture_make(CLI::App &app, CaptureMakeArguments &a, bool &quiet) {
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
    number("--black-level-dn", a.black_level_dn, "Black level in DN, below the top code, 0 to 65535", "NUMBER")
        ->check(within(0.0, 65535.0));
    number("--read-noise-dn", a.read_noise_dn, "Standard deviation of the read noise in DN, 0 to 65535", "NUMBER")
        ->check(within(0.0, 65535.0));
    number("--field", a.field, "circular_gaussian or unit_phasor", "WORD")
        ->check(CLI::IsMember({"circular_gaussian", "unit_phasor"}));
    const auto levels = [&](const char *name, std::vector<double> &value, const char *what) {
        app.add_option(
               name, value,
               fmt::format("{} in DN above the black level; several give several sequences, with exposure_ms in "
                           "proportion (default {})",
                           what, value[0]))
            ->delimiter(',')
            ->type_name("NUMBER,...");
    };
    levels("--flat-level", a.flat_levels, "Mean of flat");
    levels("--board-level", a.board_levels, "Mean of board");
    levels("--dots-level", a.dots_levels, "Mean at the peak of a dot");
    app.add_option("--sequences", a.sequences,
                   fmt::format("Which of {} to draw (default all)", fmt::join(a.sequences, ", ")))
        ->delimiter(',')
        ->type_name("NAME,...");
    number("--dots-pitch", a.dots_pitch_px, "Distance between the dots of the jittered lattice in px, 2 to 16384",
           "NUMBER")
        ->check(within(2.0, 16384.0));
    app.add_option("--dots-count", a.dots_count, "Instead of the pitch: about so many dots, 0 to 1000000")
        ->type_name("INTEGER")
        ->check(within(no, 1000000u));
    number("--dots-jitter", a.dots_jitter_px, "Dots are moved by up to so many px along each axis, 0 to 16384",
           "NUMBER")
        ->check(within(0.0, 16384.0));
    number("--dots-sigma", a.dots_sigma_px, "Width of a dot in px, 0.01 to 16384", "NUMBER")
        ->check(within(0.01, 16384.0));
    app.add_option("--dots", a.dots_file,
                   "JSON with sigma_px and positions_px, or a capture.json, instead of a lattice")
        ->type_name("FILE");
    app.add_option(
           "--effect", a.effects,
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

void add_diagnose(CLI::App &app, DiagnoseArguments &a, bool &quiet) {
    app.footer(std::string(diagnose_examples) + "\n" + exit_codes);
    app.add_option("CAPTURE", a.folder, "Folder of the capture set, or its capture.json")->required()->type_name("");
    app.add_option("--hypothesis", a.hypotheses,
                   "An effect of your own, as JSON and OpenCL source (docs/method/diagnosis.md); may be given "
                   "several times")
        ->allow_extra_args(false)
        ->type_name("FILE")
        ->check(has_name());
    app.add_option("--tolerance", a.tolerances,
                   "What you accept of the simulator's error, as JSON (docs/method/diagnosis.md): the report "
                   "says whether it is")
        ->type_name("FILE")
        ->check(has_name());
    app.add_option("--emva", a.emva,
                   "Write EMVA 1288's numbers of the dark and flat frames, as the Python package emva1288 does")
        ->type_name("FILE")
        ->check(has_name());
    app.add_option("--profile", a.profile, "Write the camera that was found, with its effects, for render --profile")
        ->type_name("FILE")
        ->check(has_name());
    add_diagnose_options(app, a, quiet);
}

void add_gap_compare(CLI::App &app, DiagnoseArguments &a, bool &quiet) {
    app.footer(std::string(gap_compare_examples) + "\n" + exit_codes);
    app.add_option("REAL", a.folder, "Folder of the camera's capture set, or its capture.json")
        ->required()
        ->type_name("");
    app.add_option("SIM", a.sim, "Folder of the simulator's set, or its capture.json")->required()->type_name("");
    app.add_option("--profile", a.camera,
                   "Camera profile of REAL, that SIM was drawn with: its effects make both scatter, which is no gap")
        ->type_name("FILE")
        ->check(has_name());
    add_diagnose_options(app, a, quiet);
}

void add_gap_check(CLI::App &app, GapCheckArguments &a, bool &quiet) {
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

void add_gap_power(CLI::App &app, GapPowerArguments &a, bool &quiet) {
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

void add_dataset(CLI::App &app, DatasetArguments &a, bool &quiet) {
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
    app.add_option("--format", a.format, "Of shards: webdataset (default), or the arrays of a Zarr group")
        ->type_name("webdataset|zarr")
        ->take_last()
        ->check(CLI::IsMember({"webdataset", "zarr"}));
    app.add_option("--workers", a.workers, "Processes, 1 to 65535 (default 1, or one for each device)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint32_t>(1, 65535));
    app.add_option("--threads", a.threads,
                   "Of PoCL in each worker, 1 to 65535 (default the cores divided by the workers)")
        ->type_name("INTEGER")
        ->take_last()
        ->check(within<std::uint32_t>(1, 65535));
    app.add_option("--devices", a.devices, "Devices of the workers in turn: 0:0,0:1 (default the best for all)")
        ->type_name("DEVICE,...")
        ->take_last();
    app.add_option("--cluster", a.cluster,
                   "Address of a scheduler of Dask (tcp://HOST:PORT), whose workers do the work")
        ->type_name("ADDRESS")
        ->take_last();
    app.add_flag("--no-ideal", a.without_ideal, "Leave the ideal images out of the shards");
    app.add_option("--python", a.python, "Python that has the package (default python3)")
        ->type_name("PROGRAM")
        ->take_last();
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

void add_tune(CLI::App &app, TuneArguments &a, bool &quiet) {
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
        ->check(has_name());
    app.add_flag("--dry-run", a.dry_run, "Measure, but write nothing")->excludes("--output");
    app.add_flag("--quiet", quiet, "Print warnings and errors only");
}

} // namespace tools
