#include "diagnose.hpp"

#include "context.hpp"
#include "effects.hpp"
#include "errors.hpp"
#include "files.hpp"
#include "hypothesis_file.hpp"
#include "interrupt.hpp"
#include "io/image_io.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>

namespace tools {

namespace {

namespace fs = std::filesystem;

/** A report that cannot be written is known before a minute of work, not after it. */
void check_writable(const std::string &path) {
    std::error_code code;
    if (fs::is_directory(path, code))
        throw OutputError(fmt::format("{}: is a folder; name a file", path));
    if (fs::exists(path, code) && !fs::is_regular_file(path, code))
        throw OutputError(fmt::format("{}: is no regular file; name another one", path));
    const fs::path parent = fs::path(path).parent_path();
    const std::string folder = parent.empty() ? "." : parent.string();
    if (!fs::is_directory(folder, code))
        throw OutputError(fmt::format("{}: the folder {} does not exist; make it first", path, folder));
    if (::access(folder.c_str(), W_OK) != 0)
        throw OutputError(fmt::format("{}: cannot be written: {}", path, std::strerror(errno)));
}

/** What the library says of a file that it cannot write is a matter of the output, not of the input. */
template <typename Write> void write_output(Write write) {
    try {
        write();
    } catch (const clspeckle::Error &error) {
        if (error.status() == CLSP_ERROR_IO)
            throw OutputError(error.message());
        throw;
    }
}

/** Ids of "a, b", each a known effect. */
std::vector<std::string> effect_ids(const std::vector<std::string> &texts,
                                    const std::vector<clspeckle::Hypothesis> &hypotheses) {
    std::vector<std::string> known, result;
    for (const clspeckle::Hypothesis &hypothesis : hypotheses)
        known.push_back(hypothesis.id);
    for (const ClspEffectInfo &effect : effect_catalogue())
        known.emplace_back(effect.id);
    for (const std::string &text : texts)
        for (std::size_t start = 0; start <= text.size();) {
            const std::size_t end = std::min(text.find(',', start), text.size());
            std::string id = text.substr(start, end - start);
            start = end + 1;
            id.erase(0, std::min(id.find_first_not_of(" \t"), id.size()));
            id.erase(id.find_last_not_of(" \t") + 1);
            if (id.empty())
                throw InputError(fmt::format("--without {}: one of the names is empty; the effects are {}",
                                             text.empty() ? "\"\"" : text, fmt::join(known, ", ")));
            if (std::find(known.begin(), known.end(), id) == known.end())
                throw InputError(fmt::format("--without: there is no effect \"{}\"{}. The effects are {}", id,
                                             suggestion(id, known), fmt::join(known, ", ")));
            result.push_back(std::move(id));
        }
    return result;
}

/** "X,Y,WIDTH,HEIGHT" or "whole". */
void set_window(const std::string &text, clspeckle::DiagnoseOptions &options) {
    if (text.empty())
        return;
    options.whole_image = text == "whole";
    if (options.whole_image)
        return;
    std::array<std::uint32_t, 4> window{};
    const char *at = text.data(), *const end = text.data() + text.size();
    for (std::size_t i = 0; i < window.size(); ++i) {
        const auto result = std::from_chars(at, end, window[i]);
        const bool last = i + 1 == window.size();
        if (result.ec != std::errc() || (last ? result.ptr != end : result.ptr == end || *result.ptr != ','))
            throw InputError(fmt::format("--window {}: expected \"whole\", or X,Y,WIDTH,HEIGHT in whole pixels, for "
                                         "example --window 480,300,320,200",
                                         text));
        at = result.ptr + (last ? 0 : 1);
    }
    options.window = window;
}

void warn_of_capture(const clspeckle::Capture &capture, Console &console) {
    const Json summary = Json::parse(capture.summary_json());
    for (const Json &warning : summary["warnings"]) {
        const std::string sequence = warning["sequence"].is_string() ? warning["sequence"].get<std::string>() : "";
        console.warn((sequence.empty() ? "" : sequence + ": ") + warning["text"].get<std::string>());
    }
}

clspeckle::Diagnosis diagnose_or_compare(const clspeckle::Context &context, const clspeckle::Capture &capture,
                                         const clspeckle::Capture &sim, const clspeckle::DiagnoseOptions &options) {
    try {
        return sim ? clspeckle::compare(context, capture, sim, options)
                   : clspeckle::diagnose(context, capture, options);
    } catch (const clspeckle::Error &error) {
        // Source that does not compile is the user's input, not a fault of the device.
        if (error.status() != CLSP_ERROR_BUILD || options.hypotheses.empty())
            throw;
        constexpr std::size_t most = 4000;
        const std::string log = error.build_log();
        throw InputError(error.message() + (log.empty() ? "" : "\n" + log.substr(0, most)) +
                         (log.size() > most ? " ..." : ""));
    }
}

/** Files of a profile's maps, as the library names them. */
std::vector<std::string> map_files(const std::string &profile) {
    if (profile.empty())
        return {};
    const fs::path path(profile);
    const fs::path stem = path.parent_path() / (path.extension() == ".json" ? path.stem() : path.filename());
    return {stem.string() + ".dark.npy", stem.string() + ".gain.npy"};
}

/** The maps of a profile that is there already. */
std::vector<std::string> maps_to_replace(const std::string &profile) {
    std::error_code code;
    std::vector<std::string> files;
    if (!fs::is_regular_file(profile, code))
        return files;
    try {
        const auto before = clspeckle::Profile::open(profile);
        for (const std::uint32_t map : {CLSP_PROFILE_MAP_DARK, CLSP_PROFILE_MAP_GAIN})
            if (before.info().maps & map)
                files.push_back(before.map(map).path);
    } catch (const clspeckle::Error &) {
        // Another file, which has none.
    }
    return files;
}

/** What was written, and why less than there could be. */
std::vector<std::string> profile_lines(const std::string &path) {
    const auto profile = clspeckle::Profile::open(path);
    std::vector<std::string> lines = {"Camera profile, for render --profile: " + path};
    const auto tell = [&](std::uint32_t map, const char *what) {
        if (!(profile.info().maps & map))
            return;
        const ClspProfileMap about = profile.map(map);
        lines.push_back(fmt::format("  {}: {} of {} frames, noise left {:.3g}{}", about.path, what, about.frame_count,
                                    about.standard_error, map == CLSP_PROFILE_MAP_DARK ? " DN" : ""));
    };
    tell(CLSP_PROFILE_MAP_DARK, "offsets of the pixels");
    tell(CLSP_PROFILE_MAP_GAIN, "gains of the pixels");
    const Json root = Json::parse(profile.json());
    if (const auto maps = root.find("maps"); maps != root.end())
        for (const Json &note : (*maps)["notes"])
            lines.push_back("  " + note.get<std::string>());
    return lines;
}

} // namespace

void run_diagnose(const DiagnoseArguments &arguments, Console &console) {
    const bool to_file = !arguments.json.empty() && arguments.json != "-";
    if (!arguments.html.empty() && arguments.html == arguments.json)
        throw InputError("--json and --html name the same file; give each its own");
    if (arguments.html == "-")
        throw InputError(
            "--html -: the page is written to a file, for a browser to open; name one, for example --html report.html");
    if (arguments.profile == "-")
        throw InputError("--profile -: the profile is written to a file, for render to read; name one, for example "
                         "--profile camera.json");
    for (const std::string &other : {arguments.json, arguments.html, arguments.emva})
        if (!arguments.profile.empty() && arguments.profile == other)
            throw InputError(fmt::format("--profile {}: another option names the same file; give each its own", other));
    std::vector<std::string> files = {arguments.json, arguments.html, arguments.emva, arguments.profile};
    for (const std::string &path : map_files(arguments.profile)) {
        for (const std::string &other : {arguments.json, arguments.html, arguments.emva})
            if (path == other)
                throw InputError(
                    fmt::format("--profile {}: its map {} is what another option names, too; give each file a "
                                "name of its own",
                                arguments.profile, path));
        files.push_back(path);
    }
    const std::vector<std::string> own = maps_to_replace(arguments.profile);
    for (const std::string &path : files)
        for (const std::string &set : {arguments.folder, arguments.sim})
            if (!set.empty())
                check_report_file(path, set, own);
    std::vector<std::string> inputs = arguments.hypotheses;
    inputs.insert(inputs.end(), {arguments.tolerances, arguments.camera});
    for (const std::string &path : files)
        for (const std::string &input : inputs)
            if (!path.empty() && !input.empty() && path != "-" && same_file(path, input))
                throw InputError(fmt::format("{}: is read, too; choose another file for the output", path));
    if (to_file)
        check_writable(arguments.json);
    for (const std::string &path : files)
        if (!path.empty() && path != "-" && path != arguments.json)
            check_writable(path);
    std::vector<clspeckle::Hypothesis> hypotheses;
    for (const std::string &path : arguments.hypotheses)
        hypotheses.push_back(read_hypothesis(path));
    std::vector<std::string> without = effect_ids(arguments.without, hypotheses);
    clspeckle::DiagnoseOptions options;
    set_window(arguments.window, options);
    options.frames = arguments.frames;
    const auto capture = clspeckle::Capture::open(arguments.folder, progress_on(console));
    warn_of_capture(capture, console);
    clspeckle::Capture sim;
    if (!arguments.sim.empty()) {
        sim = clspeckle::Capture::open(arguments.sim, progress_on(console));
        if (!arguments.camera.empty())
            options.profile = clspeckle::Profile::open(arguments.camera);
        warn_of_capture(sim, console);
    }
    check_interrupt();
    options.seed = arguments.seed;
    options.level = arguments.level;
    options.null_replicates = arguments.replicates;
    options.max_effects = arguments.max_effects;
    options.threads = arguments.threads;
    options.evidence = !arguments.html.empty();
    options.tolerance_file = arguments.tolerances;
    options.without = std::move(without);
    options.hypotheses = std::move(hypotheses);
    options.progress = progress_on(console);
    const clspeckle::Context context = make_context(arguments.device);
    const auto diagnosis = diagnose_or_compare(context, capture, sim, options);
    if (to_file)
        write_output([&] { diagnosis.write_report(arguments.json); });
    if (!arguments.html.empty())
        write_output([&] { diagnosis.write_html(arguments.html); });
    if (!arguments.emva.empty())
        image_io::write_text(arguments.emva, capture.emva1288_xml());
    if (!arguments.profile.empty())
        write_output([&] { diagnosis.profile().write(arguments.profile); });
    if (arguments.json == "-")
        console.result(diagnosis.report_json());
    console.print(diagnosis_summary(diagnosis));
    if (to_file)
        console.print("\nReport: " + arguments.json);
    if (!arguments.html.empty())
        console.print("For a browser: " + arguments.html);
    if (!arguments.profile.empty())
        for (const std::string &line : profile_lines(arguments.profile))
            console.print(line);
}

} // namespace tools
