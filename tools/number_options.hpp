/**
 * @file number_options.hpp
 * @brief Options of numbers, which the parser alone would take too lightly.
 */
#ifndef CLSPECKLE_TOOLS_NUMBER_OPTIONS_HPP
#define CLSPECKLE_TOOLS_NUMBER_OPTIONS_HPP

#include "errors.hpp"

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

namespace tools {

/** Refuses a sign, which the parser would take for a large number, and what does not fit. */
template <typename T> CLI::Validator unsigned_integer() {
    return CLI::Validator(
        [](std::string &text) {
            T value = 0;
            const char *const end = text.data() + text.size();
            const auto result = std::from_chars(text.data(), end, value);
            if (result.ec == std::errc() && result.ptr == end && !text.empty())
                return std::string();
            return fmt::format("is \"{}\"; expected an integer from 0 to {}", text, std::numeric_limits<T>::max());
        },
        "");
}

/** Says which words an option takes, for completion; who reads the option refuses others. */
inline CLI::Validator known_words(const std::vector<std::string> &words) {
    return CLI::Validator([](std::string &) { return std::string(); }, fmt::format("{{{}}}", fmt::join(words, ",")));
}

/** An option of one number; its range is checked by the library. */
template <typename T> CLI::Option *add_number(CLI::App &app, const char *name, T &value, const std::string &what) {
    CLI::Option *option = app.add_option(name, value, what)->take_last();
    if constexpr (std::is_integral_v<T>)
        option->check(unsigned_integer<T>());
    return option->type_name(std::is_integral_v<T> ? "INTEGER" : "NUMBER");
}

/** The same, with the value that it has before as default. */
template <typename T>
CLI::Option *add_number_with_default(CLI::App &app, const char *name, T &value, const char *what) {
    return add_number(app, name, value, fmt::format("{} (default {})", what, value));
}

/** Takes one number for both axes, or one for each; nothing where none is given. */
inline void take_pair(const std::vector<double> &given, double factor, double &x, double &y, const char *option) {
    if (given.empty())
        return;
    if (given.size() > 2)
        throw InputError(fmt::format("{} takes one number, or two: along x and y", option));
    x = given.front() * factor;
    y = given.back() * factor;
}

/** The same of lengths: a square or a ratio would hide a wrong sign from the library. */
inline void take_positive_pair(const std::vector<double> &given, double factor, double &x, double &y,
                               const char *option) {
    for (const double value : given)
        if (!(value > 0.0) || !std::isfinite(value))
            throw InputError(fmt::format("{} is {}; expected a number above 0", option, value));
    take_pair(given, factor, x, y, option);
}

} // namespace tools

#endif // CLSPECKLE_TOOLS_NUMBER_OPTIONS_HPP
