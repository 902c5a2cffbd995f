#include "diagnose.hpp"

#include "commands.hpp"
#include "errors.hpp"
#include "options.hpp"

#include <fmt/format.h>

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

namespace tools {

namespace {

namespace fs = std::filesystem;

/** A report that cannot be written is known before a minute of work, not after it. */
void check_writable(const std::string &path) {
    std::error_code code;
    if (fs::is_directory(path, code))
        throw OutputError(fmt::format("{}: is a folder; name a file for the report", path));
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

void warn_of_capture(const clspeckle::Capture &capture, Console &console) {
    const Json summary = Json::parse(capture.summary_json());
    for (const Json &warning : summary["warnings"]) {
        const std::string sequence = warning["sequence"].is_string() ? warning["sequence"].get<std::string>() : "";
        console.warn((sequence.empty() ? "" : sequence + ": ") + warning["text"].get<std::string>());
    }
}

} // namespace

void run_diagnose(const DiagnoseArguments &arguments, Console &console) {
    const bool to_file = !arguments.json.empty() && arguments.json != "-";
    if (to_file)
        check_writable(arguments.json);
    if (!arguments.html.empty() && arguments.html == arguments.json)
        throw InputError("--json and --html name the same file; give each its own");
    if (!arguments.html.empty())
        check_writable(arguments.html);
    const auto capture = clspeckle::Capture::open(arguments.folder);
    warn_of_capture(capture, console);
    check_interrupt();
    clspeckle::DiagnoseOptions options;
    options.seed = arguments.seed;
    options.level = arguments.level;
    options.null_replicates = arguments.replicates;
    options.max_effects = arguments.max_effects;
    options.threads = arguments.threads;
    options.evidence = !arguments.html.empty();
    for (const std::string &id : arguments.without)
        if (!id.empty())
            options.without.push_back(id);
    options.progress = [&](const std::string &what, double fraction) {
        check_interrupt();
        console.progress(fraction, what);
        return true;
    };
    const auto diagnosis = clspeckle::diagnose(make_context(arguments.device), capture, options);
    if (to_file)
        write_output([&] { diagnosis.write_report(arguments.json); });
    if (!arguments.html.empty())
        write_output([&] { diagnosis.write_html(arguments.html); });
    if (arguments.json == "-")
        console.result(diagnosis.report_json());
    console.print(diagnosis_summary(diagnosis));
    if (to_file)
        console.print("\nReport: " + arguments.json);
    if (!arguments.html.empty())
        console.print("For a browser: " + arguments.html);
}

} // namespace tools
