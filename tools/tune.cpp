#include "commands.hpp"

#include "context.hpp"
#include "errors.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <charconv>

namespace tools {

namespace {

ClspTuningSize size_of(const std::string &text) {
    ClspTuningSize size{};
    const char *const end = text.data() + text.size();
    const auto width = std::from_chars(text.data(), end, size.width);
    if (width.ec == std::errc() && width.ptr != end && *width.ptr == 'x') {
        const auto height = std::from_chars(width.ptr + 1, end, size.height);
        if (height.ec == std::errc() && height.ptr == end && size.width > 0 && size.height > 0)
            return size;
    }
    throw InputError(fmt::format("--size is \"{}\"; expected WIDTHxHEIGHT in pixels, for example 1920x1080", text));
}

/** "gpu, columns 8 x 64 (lines x work-items)". */
std::string engine_text(const Json &spec) {
    std::string text = spec["engine"].get<std::string>();
    for (const char *name : {"columns", "rows"})
        if (spec.contains(name))
            text +=
                fmt::format(", {} {} x {}", name, spec[name]["lines"].get<int>(), spec[name]["work_items"].get<int>());
    return text;
}

bool same_engine(const Json &candidate, const Json &chosen) {
    for (const char *name : {"engine", "columns", "rows"})
        if (candidate.value(name, Json()) != chosen.value(name, Json()))
            return false;
    return true;
}

std::string candidates_table(const Json &size) {
    double clfft = 0;
    for (const Json &candidate : size["candidates"])
        if (candidate["engine"] == "clfft" && candidate.contains("median_ms"))
            clfft = candidate["median_ms"].get<double>();
    std::vector<std::vector<std::string>> rows = {{"engine", "ms", "+-", "of clFFT's", ""}};
    for (const Json &candidate : size["candidates"]) {
        if (!candidate.contains("median_ms")) {
            rows.push_back(
                {engine_text(candidate), "-", "", "", "left out: " + candidate["refusal"].get<std::string>()});
            continue;
        }
        const double median = candidate["median_ms"].get<double>();
        rows.push_back({engine_text(candidate), fmt::format("{:.4g}", median),
                        fmt::format("{:.2g}", candidate["spread_ms"].get<double>()),
                        clfft > 0 ? fmt::format("{:.3f}", median / clfft) : std::string("-"),
                        same_engine(candidate, size["chosen"]) ? "chosen: " + size["reason"].get<std::string>() : ""});
    }
    return table(rows, "  ");
}

/** The library's only input-output error here is about the file that is to be written. */
clspeckle::Tuning measure(const clspeckle::Context &context, const ClspTuningDesc &desc, Console &console) {
    try {
        return {context, desc, progress_on(console)};
    } catch (const clspeckle::Error &error) {
        if (error.status() == CLSP_ERROR_IO)
            throw OutputError(error.message());
        throw;
    }
}

} // namespace

void run_tune(const TuneArguments &a, Console &console) {
    auto desc = clspeckle::make<ClspTuningDesc>();
    std::vector<ClspTuningSize> sizes;
    for (const std::string &text : a.sizes)
        sizes.push_back(size_of(text));
    desc.sizes = sizes.empty() ? nullptr : sizes.data();
    desc.size_count = static_cast<std::uint32_t>(sizes.size());
    if (a.frames > 0)
        desc.frames = a.frames;
    desc.path = a.output.empty() ? nullptr : a.output.c_str();
    desc.keep = a.dry_run ? 0 : 1;
    const clspeckle::Context context = make_context(a.device);
    const clspeckle::Tuning tuning = measure(context, desc, console);
    const Json record = Json::parse(tuning.json())["records"][0];
    if (console.json()) {
        Json result = record;
        result["path"] = tuning.path();
        result["warnings"] = console.warnings();
        console.result(result.dump(2, ' ', false, Json::error_handler_t::replace));
    }
    console.print(fmt::format("{}, driver {}\n", record["device"]["name"].get<std::string>(),
                              record["device"]["driver_version"].get<std::string>()));
    for (const Json &size : record["sizes"])
        console.print(fmt::format("field grid {} x {}, D = {:g}, medians of {}\n{}\n", size["width"].get<int>(),
                                  size["height"].get<int>(), size["relative_diameter"].get<double>(),
                                  size["frames"].get<int>(), candidates_table(size)));
    console.print(tuning.path().empty() ? std::string("not written: --dry-run") : "written to " + tuning.path());
}

} // namespace tools
