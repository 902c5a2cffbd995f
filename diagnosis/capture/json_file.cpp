#include "capture/json_file.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace clsp {
JsonDocument read_json_file(const std::string &path) {
    try {
        return image_io::read_json(path);
    } catch (const image_io::JsonError &error) {
        throw Error(Status::kInvalidArgument, error.what());
    } catch (const image_io::ReadError &error) {
        throw Error(Status::kIo, error.what());
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
    const auto &given = value.get_ref<const std::string &>();
    // Names and words are shorter; what the system does with a longer one, as a pattern of folders, is its own affair.
    constexpr std::size_t kMostBytes = 4095;
    if (given.size() > kMostBytes)
        refuse(where + "/" + key, fmt::format("has {} bytes; at most {} are taken", given.size(), kMostBytes));
    return given;
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
