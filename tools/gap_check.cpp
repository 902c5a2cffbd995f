#include "gap_check.hpp"

#include "errors.hpp"
#include "files.hpp"
#include "io/image_io.hpp"
#include "json.hpp"
#include "python.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

namespace tools {

namespace {

namespace fs = std::filesystem;

const fs::path generator_file = fs::path("validation") / "gap_check" / "plan.py";

bool is_generator(const fs::path &folder) {
    std::error_code code;
    return fs::is_regular_file(folder / "__main__.py", code) && fs::is_regular_file(folder / "plan.py", code);
}

/** The folder of the Python package. */
fs::path find_generator(const std::string &given) {
    if (!given.empty()) {
        for (const fs::path &folder :
             {fs::path(given), fs::path(given) / "gap_check", fs::path(given) / "validation" / "gap_check"})
            if (is_generator(folder))
                return fs::absolute(folder).lexically_normal();
        throw InputError(
            fmt::format("--generator {}: holds no generator (a Python package with __main__.py and plan.py); it is "
                        "validation/gap_check of a checkout of clSpeckle",
                        given));
    }
    std::vector<fs::path> roots;
    const fs::path program = this_program();
    if (!program.empty()) {
        const fs::path installed = program.parent_path().parent_path() / "share" / "clspeckle" / "gap_check";
        if (is_generator(installed))
            return installed;
        roots.push_back(program.parent_path());
    }
    std::error_code code;
    roots.push_back(fs::current_path(code));
    for (const fs::path &root : roots)
        if (const fs::path checkout = folder_above(root, generator_file); !checkout.empty())
            return checkout / "validation" / "gap_check";
    throw InputError(
        "the generator of the check was not found: it is the Python package validation/gap_check of a checkout of "
        "clSpeckle, installed as share/clspeckle/gap_check; run this within the checkout, or name the package with "
        "--generator FOLDER");
}

std::string quoted(const std::string &word) {
    std::string text = "'";
    for (const char letter : word)
        text += letter == '\'' ? std::string("'\\''") : std::string(1, letter);
    return text + "'";
}

/** What the generator needs; @return whether figures can be drawn. */
bool check_python(const GeneratorArguments &a, const fs::path &generator) {
    const std::string needs = fmt::format(
        "the generator of the check needs Python 3.9 or newer with NumPy and SciPy: {} -m pip install -r {}; "
        "another Python is named with --python",
        a.python, (generator / "requirements.txt").string());
    need_modules(a.python, "numpy, scipy", needs);
    return run_program({a.python, "-c", "import matplotlib"}, "/dev/null", true) == 0;
}

std::string percent(const Json &value) {
    return value.is_number() ? fmt::format("{:.1f} %", 100.0 * value.get<double>()) : "-";
}

/** Section 4 of the protocol, line by line. */
std::string score_table(const Json &score) {
    std::vector<std::vector<std::string>> rows = {{"figure", "on", "value", "95 % (Wilson)", "count", "aim"}};
    for (const Json &f : score["figures"]) {
        if (f["value"].is_null())
            continue;
        const bool share = !f["successes"].is_null();
        std::string aim;
        if (!f["target"].is_null()) {
            const double low = f["target"][0].get<double>(), high = f["target"][1].get<double>();
            aim = high >= 1.0  ? fmt::format("at least {:.0f} %", 100.0 * low)
                  : low <= 0.0 ? fmt::format("at most {:.0f} %", 100.0 * high)
                               : fmt::format("{:.0f} to {:.0f} %", 100.0 * low, 100.0 * high);
            aim += f["met"].get<bool>() ? ": met" : ": missed";
        }
        const std::string count = f["count"].dump() + " " + f["unit"].get<std::string>();
        rows.push_back({f["text"].get<std::string>(), f["on"].get<std::string>(),
                        share ? percent(f["value"]) : fmt::format("{:.3g}", f["value"].get<double>()),
                        share ? fmt::format("{} to {}", percent(f["low"]), percent(f["high"])) : "",
                        share ? f["successes"].dump() + " of " + count : count, aim});
    }
    std::string text = table(rows);
    if (!score["wrong"].empty()) {
        std::vector<std::vector<std::string>> wrong = {{"set", "kind", "truth", "said"}};
        for (const Json &w : score["wrong"]) {
            std::string truth, said = w["verdict"].get<std::string>();
            for (const auto &[effect, parameters] : w["truth"].items())
                truth += (truth.empty() ? "" : ", ") + effect;
            std::string named;
            for (const Json &effect : w["effects"])
                named += (named.empty() ? ": " : ", ") + effect.get<std::string>();
            wrong.push_back({w["set"].get<std::string>(), w["kind"].get<std::string>(),
                             truth.empty() ? "nothing" : truth, said + named});
        }
        text += "\n\nSets that did not come out right\n" + table(wrong, "  ");
    }
    return text;
}

/** Noticed and named, a row for each part of the weak amplitude, columns for each number of frames. */
std::string power_table(const Json &power) {
    std::vector<std::vector<std::string>> rows = {{"frames", "part of the weak amplitude", "sets", "noticed",
                                                   "95 % (Wilson)", "named, or among the equivalents",
                                                   "95 % (Wilson)"}};
    for (const Json &row : power["rows"]) {
        rows.push_back({row["frames"].dump(), fmt::format("{:.2f}", 1.0 + row["strength"].get<double>()),
                        row["sets"].dump()});
        for (const char *what : {"detected", "included"}) {
            rows.back().push_back(percent(row[what]["share"]));
            rows.back().push_back(
                fmt::format("{} to {}", percent(row[what]["wilson95"][0]), percent(row[what]["wilson95"][1])));
        }
    }
    return table(rows);
}

struct Generator {
    bool figures = false; // whether they can be drawn
    std::string log;      // what it printed
};

/** Runs an action of the generator to its end; its words beside those of both commands. what: for messages. */
Generator run_generator(const GeneratorArguments &a, const char *action, const std::vector<std::string> &more,
                        const char *what, Console &console) {
    const fs::path package = find_generator(a.generator);
    Generator result;
    result.figures = check_python(a, package);
    if (!result.figures)
        console.warn(fmt::format("Matplotlib is not installed for {}: the {} will have no figures", a.python, what));
    make_output_folder(a.folder);
    std::string command = a.command;
    if (command.empty()) {
        const fs::path program = this_program();
        command = quoted(program.empty() ? "clspeckle" : program.string()) + " diagnose --quiet";
        if (!a.device.empty())
            command += " --device " + quoted(a.device);
    }
    std::vector<std::string> words = {a.python,  "-m",      package.filename().string(), action,
                                      "--out",   a.folder,  "--command",                 command,
                                      "--jobs",  fmt::format("{}", a.jobs)};
    if (a.seed)
        words.insert(words.end(), {"--seed", fmt::format("{}", *a.seed)});
    if (!result.figures)
        words.emplace_back("--no-figures");
    words.insert(words.end(), more.begin(), more.end());
    prepend_python_path(package.parent_path());
    ::setenv("PYTHONDONTWRITEBYTECODE", "1", 1); // the package may lie where nobody may write
    result.log = (fs::path(a.folder) / fmt::format("{}.log", what)).string();
    const int code = run_program(words, result.log, console.quiet());
    if (code == 2)
        throw InputError(
            fmt::format("the {} could not be run; what the generator said is above (or in {})", what, result.log));
    if (code != 0)
        throw std::runtime_error(fmt::format("the {} ended with exit code {}; {} has more", what, code, result.log));
    return result;
}

void give_json(const GeneratorArguments &a, const Json &result, Console &console) {
    if (a.json == "-")
        console.result(result.dump(1));
    else if (!a.json.empty())
        image_io::write_text(a.json, result.dump(1) + "\n");
}

} // namespace

void run_gap_check(const GapCheckArguments &arguments, Console &console) {
    std::vector<std::string> more = {"--plan", arguments.plan};
    if (arguments.frames)
        more.insert(more.end(), {"--frames", fmt::format("{}", *arguments.frames)});
    const Generator generator = run_generator(arguments, "all", more, "check", console);
    const fs::path folder = fs::path(arguments.folder) / "score";
    const JsonDocument document = read_json((folder / "score.json").string());
    const Json &score = document.root();
    give_json(arguments, score, console);
    console.print(score_table(score));
    console.print(
        fmt::format("\nScore{}: {}", generator.figures ? " with figures" : "", (folder / "score.md").string()));
}

void run_gap_power(const GapPowerArguments &arguments, Console &console) {
    std::vector<std::string> more;
    if (!arguments.frames.empty())
        more.emplace_back("--frames");
    for (const std::uint32_t frames : arguments.frames)
        more.push_back(fmt::format("{}", frames));
    if (!arguments.effects.empty())
        more.emplace_back("--effects");
    more.insert(more.end(), arguments.effects.begin(), arguments.effects.end());
    if (arguments.repeats)
        more.insert(more.end(), {"--repeats", fmt::format("{}", *arguments.repeats)});
    const Generator generator = run_generator(arguments, "power", more, "study", console);
    const fs::path folder = arguments.folder;
    const JsonDocument document = read_json((folder / "power.json").string());
    const Json &power = document.root();
    give_json(arguments, power, console);
    std::uint64_t sets = 0, failed = 0;
    for (const Json &row : power["rows"]) {
        sets += row["sets"].get<std::uint64_t>();
        failed += row["failed"].get<std::uint64_t>();
    }
    if (failed > 0)
        console.warn(fmt::format("{} of {} diagnoses wrote no valid report and count as nothing noticed; {} and the "
                                 "logs in frames_*/reports say why",
                                 failed, sets, generator.log));
    console.print(power_table(power));
    console.print(fmt::format("\nTable{}: {}", generator.figures ? " and figure power.png beside it" : "",
                              (folder / "power.md").string()));
}

} // namespace tools
