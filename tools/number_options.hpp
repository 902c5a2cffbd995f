/**
 * @file number_options.hpp
 * @brief Options of numbers, which the parser alone would take too lightly.
 */
#ifndef CLSPECKLE_TOOLS_NUMBER_OPTIONS_HPP
#define CLSPECKLE_TOOLS_NUMBER_OPTIONS_HPP

#include "errors.hpp"
#include "ranges.hpp"

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
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

/** Refuses numbers beyond a range, and what is none. */
template <typename T> CLI::Validator within(const Range &range) {
    if constexpr (std::is_integral_v<T>)
        return within(static_cast<T>(range.low), static_cast<T>(range.high));
    else
        return within(range.low, range.high);
}

/** An option of one number. @param what with the default behind it. */
template <typename T>
CLI::Option *add_number(CLI::App &app, const char *name, T &value, const Range &range, const std::string &what) {
    constexpr bool whole = std::is_integral_v<T> || std::is_same_v<T, std::optional<std::uint32_t>>;
    return app.add_option(name, value, fmt::format("{}, {}", what, range.text()))
        ->take_last()
        ->check(within<std::conditional_t<whole, std::uint32_t, double>>(range))
        ->type_name(whole ? "INTEGER" : "NUMBER");
}

/** The same, with the value that it has before as default. */
template <typename T>
CLI::Option *add_number_with_default(CLI::App &app, const char *name, T &value, const Range &range, const char *what) {
    const std::string fallback = fmt::format(" (default {})", value);
    return add_number(app, name, value, range, what)
        ->description(fmt::format("{}, {}{}", what, range.text(), fallback));
}

/** An option of several numbers, each of the range. */
template <typename T>
CLI::Option *add_numbers(CLI::App &app, const char *name, std::vector<T> &value, const Range &range,
                         const std::string &what) {
    return app.add_option(name, value, fmt::format("{}, each {}", what, range.text()))
        ->delimiter(',')
        ->check(within<T>(range))
        ->type_name("NUMBER,...");
}

/** A seed: any number of 64 bits. */
inline CLI::Option *add_seed(CLI::App &app, std::uint64_t &value, const char *what) {
    return app.add_option("--seed", value, fmt::format("{}, 0 to 2^64 - 1 (default {})", what, value))
        ->take_last()
        ->check(unsigned_integer<std::uint64_t>())
        ->type_name("INTEGER");
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
