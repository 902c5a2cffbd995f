#include "capture/json_file.hpp"

#include "io/image_io.hpp"
#include "runtime/error.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <set>
#include <vector>

namespace clsp {
namespace {

using Json = nlohmann::ordered_json;

// Deeper than anything that is meant, and far from what the stack holds.
constexpr int kMostLevels = 100;

// JSON leaves open which of two equal keys counts, so neither is taken; nor is a file of nothing but brackets.
Json::parser_callback_t refuse_bad_structure(const std::string &path) {
    return [path, levels = std::vector<std::set<std::string>>()](int depth, Json::parse_event_t event,
                                                                 Json &parsed) mutable {
        if (depth > kMostLevels)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{}: is nested more than {} levels deep; expected a file as clSpeckle writes it",
                                    path, kMostLevels));
        if (event == Json::parse_event_t::object_start)
            levels.emplace_back();
        else if (event == Json::parse_event_t::object_end)
            levels.pop_back();
        else if (event == Json::parse_event_t::key && !levels.back().insert(parsed.get<std::string>()).second)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{}: the key \"{}\" is given twice in one object; keep one of them", path,
                                    parsed.get<std::string>()));
        return true;
    };
}

// In one line; bytes that are no text (another encoding) are not shown.
std::string legible(const std::string &text) {
    std::string result;
    for (const char c : text) {
        if (c != '\n' && c != '\r' && c != '\t' && c != ' ')
            result += static_cast<unsigned char>(c) < 32 || static_cast<unsigned char>(c) > 126 ? '?' : c;
        else if (!result.empty() && result.back() != ' ')
            result += ' ';
    }
    return result;
}

// What the parser says, without its own number of the error.
std::string reason_of(const Json::exception &error) {
    std::string what = error.what();
    if (const std::size_t bracket = what.find("] "); bracket != std::string::npos)
        what = what.substr(bracket + 2);
    return legible(what);
}

// Where to look and for what. byte: where the parser noticed, from 1.
std::string advice_on_syntax(const std::string &text, std::size_t byte, const std::string &reason) {
    if (text.find('\0') != std::string::npos || reason.find("ill-formed UTF-8") != std::string::npos)
        return "; the file is no text in UTF-8: save it in that encoding";
    if (reason.find("end of input") != std::string::npos ||
        (reason.find("missing closing quote") != std::string::npos && byte >= text.size()))
        return "; the file ends before it is complete: copy it again, or close what is open with ] or }";
    const std::size_t at = std::min(byte > 0 ? byte - 1 : 0, text.size());
    const auto around = [&](std::size_t before, std::size_t after) {
        const std::size_t begin = at - std::min(before, at);
        return text.substr(begin, at + after - begin);
    };
    const std::string near = around(10, 10);
    if (near.find("NaN") != std::string::npos || near.find("Infinity") != std::string::npos)
        return " (JSON has neither NaN nor Infinity; leave what is not known out)";
    // What is wrong lies before what no longer fits it.
    return fmt::format("; correct it there, at ... {} ...: keys and texts are in double quotes, a comma is between "
                       "two entries and none behind the last, and there are no comments",
                       legible(around(40, 10)));
}

} // namespace

std::string shown(const Json &value) {
    std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text.size() > 60)
        text = text.substr(0, 57) + "...";
    return text;
}

Json read_json_file(const std::string &path, std::uint64_t most_bytes) {
    std::string text;
    try {
        image_io::detail::InputFile file(path);
        if (file.size() > most_bytes)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{}: has {} bytes; at most {} are taken", path, file.size(), most_bytes));
        text.resize(static_cast<std::size_t>(file.size()));
        file.read(text.data(), text.size());
    } catch (const image_io::ReadError &error) {
        throw Error(Status::kIo, error.what());
    }
    try {
        return Json::parse(text, refuse_bad_structure(path));
    } catch (const Json::parse_error &error) {
        const std::string reason = reason_of(error);
        throw Error(Status::kInvalidArgument, fmt::format("{}: is not valid JSON: {}{}", path, reason,
                                                          advice_on_syntax(text, error.byte, reason)));
    } catch (const Json::exception &error) {
        throw Error(Status::kInvalidArgument,
                    fmt::format("{}: is not valid JSON: {}; expected a number below 1.8e308: correct it, or leave it "
                                "out",
                                path, reason_of(error)));
    }
}

double rounded(double value) {
    char text[40];
    const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::scientific, 12).ptr;
    double result = value;
    std::from_chars(text, end, result);
    return result;
}

void JsonChecks::refuse(const std::string &field, const std::string &what) const {
    throw Error(Status::kInvalidArgument, fmt::format("{}: {} {}", path_, field, what));
}

const Json &JsonChecks::object(const Json &parent, const char *key, const std::string &where,
                               const std::string &expected) const {
    const std::string an_object = "an object, for example " + expected;
    const Json &value = member(parent, key, where, an_object.c_str());
    if (!value.is_object())
        refuse(where + "/" + key, fmt::format("is {}; expected {}", shown(value), an_object));
    return value;
}

double JsonChecks::number(const Json &parent, const char *key, const std::string &where, const char *expected) const {
    return number(member(parent, key, where, expected), where + "/" + key, expected);
}

double JsonChecks::number(const Json &value, const std::string &field, const char *expected) const {
    if (!value.is_number() || !std::isfinite(value.get<double>()))
        refuse(field, fmt::format("is {}; expected {}", shown(value), expected));
    return value.get<double>();
}

std::uint32_t JsonChecks::integer(const Json &parent, const char *key, const std::string &where,
                                  const char *expected) const {
    const Json &value = member(parent, key, where, expected);
    const double real = value.is_number() ? value.get<double>() : -1.0;
    if (!(real >= 0.0 && real <= 1e9 && real == std::floor(real)))
        refuse(where + "/" + key, fmt::format("is {}; expected {}", shown(value), expected));
    return static_cast<std::uint32_t>(real);
}

std::string JsonChecks::text(const Json &parent, const char *key, const std::string &where,
                             const char *expected) const {
    const Json &value = member(parent, key, where, expected);
    if (!value.is_string())
        refuse(where + "/" + key, fmt::format("is {}; expected {}", shown(value), expected));
    return value.get<std::string>();
}

std::uint32_t JsonChecks::word(const Json &parent, const char *key, const std::string &where,
                               std::initializer_list<const char *> words) const {
    std::string list;
    for (const char *w : words)
        list += fmt::format("{}\"{}\"", list.empty() ? "" : " or ", w);
    const std::string given = text(parent, key, where, list.c_str());
    const auto found = std::find(words.begin(), words.end(), given);
    if (found == words.end())
        refuse(where + "/" + key, fmt::format("is {}; expected {}", shown(given), list));
    return static_cast<std::uint32_t>(found - words.begin());
}

std::array<double, 2> JsonChecks::point(const Json &value, const std::string &field) const {
    if (!value.is_array() || value.size() != 2)
        refuse(field, fmt::format("is {}; expected [x, y] in pixels", shown(value)));
    return {number(value[0], field + "/0", "a number, x in pixels"),
            number(value[1], field + "/1", "a number, y in pixels")};
}

const Json &JsonChecks::member(const Json &parent, const char *key, const std::string &where,
                               const char *expected) const {
    const auto found = parent.find(key);
    if (found == parent.end())
        refuse(where + "/" + key, fmt::format("is missing; expected {}", expected));
    return *found;
}

} // namespace clsp
