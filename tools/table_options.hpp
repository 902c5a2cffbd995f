/**
 * @file table_options.hpp
 * @brief The options of the table on the command line, checks of what they take, and words for what is none of them.
 */
#ifndef CLSPECKLE_TOOLS_TABLE_OPTIONS_HPP
#define CLSPECKLE_TOOLS_TABLE_OPTIONS_HPP

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <charconv>
#include <map>
#include <string>
#include <type_traits>

namespace tools {

/** Refuses what is no number of the range; CLI11 puts the option's name in front. */
template <typename T> CLI::Validator within(T low, T high) {
    const auto check = [low, high](const std::string &text) -> std::string {
        const char *first = text.data(), *last = text.data() + text.size();
        T value{};
        const auto result = std::from_chars(first, last, value);
        if (result.ec == std::errc() && result.ptr == last && value >= low && value <= high) // NaN is neither
            return {};
        return fmt::format("is \"{}\"; expected {} from {} to {}", text,
                           std::is_integral_v<T> ? "an integer" : "a number", low, high);
    };
    return CLI::Validator([check](std::string &text) { return check(text); }, "");
}

/** Refuses an empty name of a file. */
CLI::Validator has_name();

/** The options of the table on the command line; what was given is collected as text. */
void add_table(CLI::App &app, std::map<std::string, std::string> &given);

/** What CLI11 says, with the nearest known name for an unknown option or command. */
std::string usage_message(const CLI::App &app, const CLI::ParseError &error, int argc, char **argv);

} // namespace tools

#endif // CLSPECKLE_TOOLS_TABLE_OPTIONS_HPP
