#include "json.hpp"

#include "errors.hpp"
#include "io/image_io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <set>
#include <vector>

namespace tools {

namespace {

constexpr std::uint64_t max_json_bytes = std::uint64_t{16} << 20;

/** Deeper than anything that is meant, and far from what the stack holds. */
constexpr int most_levels = 100;

/** JSON leaves open which of two equal keys counts, so neither is taken; nor is a file of nothing but brackets. */
Json::parser_callback_t refuse_bad_structure(const std::string &path) {
    struct Level {
        std::set<std::string> keys;
        std::string last;
    };
    return [path, levels = std::vector<Level>()](int depth, Json::parse_event_t event, Json &parsed) mutable {
        if (depth > most_levels)
            throw InputError(fmt::format("{}: is nested more than {} levels deep", path, most_levels));
        if (event == Json::parse_event_t::object_start) {
            levels.emplace_back();
        } else if (event == Json::parse_event_t::object_end) {
            levels.pop_back();
        } else if (event == Json::parse_event_t::key) {
            levels.back().last = parsed.get<std::string>();
            if (!levels.back().keys.insert(levels.back().last).second) {
                std::string name;
                for (const Level &level : levels)
                    name += (name.empty() ? "" : ".") + level.last;
                throw InputError(fmt::format("{}: the key \"{}\" is given twice; keep one of them", path, name));
            }
        }
        return true;
    };
}

} // namespace

Json read_json(const std::string &path) {
    image_io::detail::InputFile file(path);
    if (file.size() > max_json_bytes)
        throw InputError(fmt::format("{}: {} bytes are too many for a JSON file", path, file.size()));
    std::string text(static_cast<std::size_t>(file.size()), '\0');
    file.read(text.data(), text.size());
    try {
        return Json::parse(text, refuse_bad_structure(path));
    } catch (const Json::exception &error) {
        std::string what = error.what();
        const std::size_t bracket = what.find("] ");
        if (bracket != std::string::npos)
            what = what.substr(bracket + 2);
        // It quotes what was read, which need be no text at all.
        std::replace_if(
            what.begin(), what.end(), [](unsigned char c) { return c < 0x20 || c > 0x7e; }, '?');
        throw InputError(fmt::format("{}: is not valid JSON: {}", path, what));
    }
}

} // namespace tools
