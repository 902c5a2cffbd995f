#include "files.hpp"

#include "errors.hpp"
#include "io/formats.hpp"
#include "io/series.hpp"
#include "json.hpp"
#include "output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>

namespace tools {

namespace fs = std::filesystem;

namespace {

/** True for `prefix`, at least six digits, `suffix`: how render names the files of frames. */
bool is_numbered(const std::string &name, const std::string &prefix, const std::string &suffix) {
    if (name.size() < prefix.size() + 6 + suffix.size() || name.compare(0, prefix.size(), prefix) != 0 ||
        name.compare(name.size() - suffix.size(), suffix.size(), suffix) != 0)
        return false;
    return std::all_of(name.begin() + static_cast<std::ptrdiff_t>(prefix.size()),
                       name.end() - static_cast<std::ptrdiff_t>(suffix.size()),
                       [](unsigned char c) { return std::isdigit(c) != 0; });
}

/** How the run that left the folder stored its frames, as its config.json says; none without one. */
std::optional<FrameFormat> format_of_run(const std::string &folder) {
    const std::string path = (fs::path(folder) / "config.json").string();
    std::error_code code;
    if (!fs::is_regular_file(path, code))
        return {};
    try {
        const JsonDocument document = read_json(path);
        const Json &config = document.root();
        if (config.is_object() && config.contains("aperture") && config.contains("sensor"))
            return FrameFormat(config.at("render").at("format").get<std::string>());
    } catch (const std::exception &) {
        // A file of this name that the program did not write.
    }
    return {};
}

/** Folders within, for a refusal. */
std::string folders_of_images(const std::string &folder) {
    std::vector<std::string> names;
    std::error_code code;
    for (const fs::directory_entry &entry : fs::directory_iterator(folder, code))
        if (entry.is_directory(code))
            for (const fs::directory_entry &file : fs::directory_iterator(entry.path(), code))
                if (image_io::format_of_extension(file.path().string())) {
                    names.push_back(entry.path().string());
                    break;
                }
    std::sort(names.begin(), names.end());
    constexpr std::size_t most = 8;
    const std::size_t count = names.size();
    names.resize(std::min(count, most));
    return count == 0
               ? ""
               : fmt::format(". Folders in it do; name one: {}{}", fmt::join(names, ", "), count > most ? " ..." : "");
}

std::vector<std::string> images_of(const std::string &folder, Purpose purpose) {
    std::map<std::string, std::vector<std::string>> by_extension;
    std::error_code code;
    const auto format = purpose == Purpose::ideal_images ? format_of_run(folder) : std::nullopt;
    const auto written_by_render = [&](const std::string &name) {
        if (image_io::is_preview(name))
            return true;
        if (!format)
            return false;
        return format->storage->stack ? name == format->file_name(0)
                                      : is_numbered(name, "frame_", format->format->extension());
    };
    bool left_out = false;
    for (const fs::directory_entry &entry : fs::directory_iterator(folder, code)) {
        const std::string name = entry.path().filename().string();
        const image_io::Format *kind = image_io::format_of_extension(name);
        if (name[0] == '.' || !kind || !entry.is_regular_file())
            continue;
        if (written_by_render(name))
            left_out = true;
        else
            by_extension[kind->extension()].push_back(entry.path().string());
    }
    if (code)
        throw InputError(fmt::format("{}: cannot be read: {}", folder, code.message()));
    if (by_extension.empty() && left_out)
        throw InputError(fmt::format("{0}: the folder holds only what an earlier run wrote; if it is meant, name the "
                                     "files, for example '{0}/frame_*.png'",
                                     folder));
    if (by_extension.empty())
        throw InputError(fmt::format("{}: the folder holds neither sequence.json nor {} images{}", folder,
                                     image_io::listed("or"), folders_of_images(folder)));
    if (by_extension.size() > 1) {
        std::string kinds;
        for (const auto &[extension, files] : by_extension)
            kinds += fmt::format("{}{} {}", kinds.empty() ? "" : ", ", files.size(), extension);
        throw InputError(
            fmt::format("{}: the folder holds several kinds of images ({}); say which, for example '{}/*{}'", folder,
                        kinds, folder, by_extension.begin()->first));
    }
    const std::vector<std::string> &files = by_extension.begin()->second;
    if (const std::string why =
            image_io::why_no_series(folder, files, fmt::format("'{}/", image_io::literal_pattern(folder)), "'");
        !why.empty())
        throw InputError(why);
    return files;
}

} // namespace

image_io::ReadRequest request_of(const std::string &channel, const std::string &raw) {
    image_io::ReadRequest request;
    request.channel = channel;
    if (raw.empty())
        return request;
    if (!channel.empty())
        throw InputError("give either --channel or --raw: raw frames have one channel");
    try {
        request.raw = image_io::parse_raw(raw);
    } catch (const std::invalid_argument &error) {
        throw InputError(fmt::format("--raw {}", error.what()));
    }
    return request;
}

std::vector<std::string> expand(const std::string &argument, Purpose purpose) {
    std::error_code code;
    if (fs::is_directory(argument, code)) {
        const fs::path description = fs::path(argument) / "sequence.json";
        if (fs::exists(description, code))
            return {description.string()};
    }
    // A channel, or a page, of all files.
    const auto [several, channel] = image_io::split_several(argument);
    std::vector<std::string> files;
    if (fs::is_directory(several, code)) {
        files = images_of(several, purpose);
    } else if (fs::exists(argument, code) || !image_io::is_pattern(several)) {
        return {argument};
    } else {
        files = image_io::matches_of(several);
        if (files.empty())
            throw InputError(fmt::format("{}: no file matches", argument));
        image_io::leave_previews_out(files);
    }
    std::sort(files.begin(), files.end(), image_io::natural_less);
    for (std::string &file : files)
        file = image_io::join_name({file, channel});
    return files;
}

bool same_file(const std::string &first, const std::string &second) {
    std::error_code code;
    if (fs::equivalent(first, second, code))
        return true;
    const fs::path a = fs::weakly_canonical(fs::absolute(first), code);
    if (code)
        return false;
    const fs::path b = fs::weakly_canonical(fs::absolute(second), code);
    return !code && a == b;
}

void check_ending(const OutputFile &file) {
    std::string name = fs::path(file.path).filename().string();
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    const auto ends = [&](const std::string &ending) {
        return name.size() > ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
    };
    if (!file.endings.empty() && std::none_of(file.endings.begin(), file.endings.end(), ends))
        throw InputError(fmt::format("{} {}: the file is written as {}; choose a name that ends in it", file.option,
                                     file.path, fmt::join(file.endings, " or ")));
}

void check_output_file(const OutputFile &file, bool overwrite, const std::vector<std::string> &inputs) {
    const std::string &path = file.path;
    if (!fs::path(path).has_filename())
        throw InputError(
            fmt::format("the output \"{}\" is no name of a file; choose another one with {}", path, file.option));
    for (const std::string &input : inputs)
        if (same_file(path, image_io::split_name(input).path))
            throw InputError(fmt::format("the output would overwrite the input {}; choose another name with {}", input,
                                         file.option));
    check_ending(file);
    const fs::path folder = fs::path(path).parent_path();
    std::error_code code;
    if (!folder.empty() && !fs::is_directory(folder, code))
        throw OutputError(fmt::format("{}: the folder {} does not exist; make it first", path, folder.string()));
    if (!overwrite && fs::is_regular_file(path, code))
        throw OutputError(
            fmt::format("{} exists; choose another name with {}, or replace it with --overwrite", path, file.option));
    const image_io::AtomicFile probe(path);
}

namespace {

/** The files that texts of a description name: themselves, folders and patterns. */
void add_named(const Json &value, const fs::path &folder, std::vector<std::string> &files) {
    std::error_code code;
    for (const Json &member : value.is_structured() ? value : Json::array())
        add_named(member, folder, files);
    if (!value.is_string())
        return;
    const std::string text = value.get<std::string>(), name = (folder / text).string();
    const auto is_folder = [&](const std::string &path) { return fs::is_directory(path, code); };
    const std::string path = image_io::split_name(name, is_folder).path;
    if (is_folder(path))
        for (const fs::directory_entry &entry : fs::directory_iterator(path, code))
            files.push_back(entry.path().string());
    else if (const std::string file = image_io::split_name(name).path; fs::exists(file, code))
        files.push_back(file);
    else if (image_io::is_pattern(text))
        for (const std::string &match : image_io::matches_of(image_io::literal_pattern(folder.string()) + "/" +
                                                             image_io::split_several(text).path))
            files.push_back(match);
}

} // namespace

void check_report_file(const std::string &path, const std::string &set, const std::vector<std::string> &own) {
    if (path.empty() || path == "-")
        return;
    std::error_code code;
    const bool is_folder = fs::is_directory(set, code);
    const fs::path folder = is_folder ? fs::path(set) : fs::absolute(set, code).parent_path();
    const std::string description = is_folder ? (folder / "capture.json").string() : set;
    std::vector<std::string> files = {description, (folder / "capture.json").string()};
    try {
        add_named(read_json(description).root(), folder, files);
    } catch (const std::exception &) {
        // It is refused when it is opened, before anything is written.
    }
    const auto is_own = [&](const std::string &file) {
        return std::any_of(own.begin(), own.end(), [&](const std::string &one) { return same_file(one, file); });
    };
    for (const fs::directory_entry &entry : fs::directory_iterator(folder, code))
        if (image_io::format_of_extension(entry.path().string()) && !is_own(entry.path().string()))
            files.push_back(entry.path().string());
    for (const std::string &file : files)
        if (same_file(path, file))
            throw InputError(fmt::format("{}: belongs to the capture set; choose another file for the output", path));
}

std::vector<std::string> make_output_folder(const std::string &path, const char *option) {
    std::vector<std::string> created;
    std::error_code code;
    for (fs::path part = fs::absolute(path).lexically_normal(); !fs::exists(part, code) && part.has_relative_path();
         part = part.parent_path())
        if (part.has_filename())
            created.insert(created.begin(), part.string());
    fs::create_directories(path, code);
    if (code || !fs::is_directory(path)) {
        const std::string reason = code ? code.message() : "it is not a folder";
        throw OutputError(
            fmt::format("{}: the output folder cannot be made: {}; choose another one with {}", path, reason, option));
    }
    try {
        const image_io::AtomicFile probe((fs::path(path) / "probe").string());
    } catch (const image_io::WriteError &error) {
        throw OutputError(fmt::format("no files can be made in the output folder; choose another one with {} ({})",
                                      option, error.what()));
    }
    return created;
}

} // namespace tools
