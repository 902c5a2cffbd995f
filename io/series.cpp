#include "io/series.hpp"

#include <fmt/format.h>
#include <fnmatch.h>
#include <glob.h>
#include <limits.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>

namespace image_io {

namespace {

namespace fs = std::filesystem;

bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/** A name in turns: a text, a number, a text ... The sign that begins a name belongs to its number. */
std::vector<std::string> parts_of(const std::string &name) {
    std::vector<std::string> parts(1);
    std::size_t i = 0;
    if (name.size() > 1 && name[0] == '-' && is_digit(name[1])) {
        parts.emplace_back("-");
        i = 1;
    }
    for (; i < name.size(); ++i) {
        const bool number = parts.size() % 2 == 0;
        if (is_digit(name[i]) != number)
            parts.emplace_back();
        parts.back() += name[i];
    }
    return parts;
}

/** The texts of a name. */
std::string skeleton_of(const std::vector<std::string> &parts) {
    std::string result;
    for (std::size_t i = 0; i < parts.size(); ++i)
        result += i % 2 == 0 ? parts[i] : std::string(1, '\0');
    return result;
}

/** Names of one skeleton, by their parts. */
using Group = std::vector<std::vector<std::string>>;

std::string concatenated(const std::vector<std::string> &parts) {
    std::string result;
    for (const std::string &part : parts)
        result += part;
    return result;
}

std::set<std::string> values_of(const Group &group, std::size_t part) {
    std::set<std::string> values;
    for (const auto &parts : group)
        values.insert(parts[part]);
    return values;
}

/** The number whose values tell the series of a group apart: with another one it goes through all pairs. */
std::optional<std::size_t> number_of_series(const Group &group) {
    std::vector<std::pair<std::size_t, std::size_t>> varying; // how many values, which part
    for (std::size_t part = 1; part < group.front().size(); part += 2)
        if (const std::size_t count = values_of(group, part).size(); count > 1)
            varying.emplace_back(count, part);
    // More than two would be dates and times.
    if (varying.size() != 2 || varying[0].first * varying[1].first != group.size())
        return {};
    return std::min_element(varying.begin(), varying.end(),
                            [](const auto &a, const auto &b) { return a.first < b.first; })
        ->second;
}

std::string pattern_of(const Group &group, const std::vector<std::string> &all) {
    const auto with = [&](const auto &number) {
        std::string pattern;
        for (std::size_t part = 0; part < group.front().size(); ++part)
            pattern += part % 2 == 0 || values_of(group, part).size() == 1 ? literal_pattern(group.front()[part])
                                                                           : number(part);
        return pattern;
    };
    const auto digits = [&](std::size_t part) {
        std::string exact;
        for (std::size_t i = 0; i < group.front()[part].size(); ++i)
            exact += "[0-9]";
        return exact;
    };
    std::set<std::string> own;
    for (const auto &parts : group)
        own.insert(concatenated(parts));
    const auto fits = [&](const std::string &pattern) {
        return std::all_of(all.begin(), all.end(), [&](const std::string &name) {
            return (::fnmatch(pattern.c_str(), name.c_str(), FNM_PERIOD) == 0) == (own.count(name) > 0);
        });
    };
    const std::string any = with([](std::size_t) { return "*"; });
    for (const std::string &pattern : {any, with([](std::size_t) { return "[0-9]*"; }), with(digits)})
        if (fits(pattern))
            return pattern;
    return any;
}

} // namespace

std::string literal_pattern(const std::string &text) {
    std::string result;
    for (const char c : text)
        result += std::string("*?[").find(c) == std::string::npos ? std::string(1, c) : fmt::format("[{}]", c);
    return result;
}

bool is_pattern(const std::string &name) {
    return name.find_first_of("*?[") != std::string::npos;
}

std::vector<std::string> matches_of(const std::string &pattern) {
    // glob() goes a level deeper on the stack for each folder.
    if (pattern.size() >= PATH_MAX)
        throw ReadError(pattern.substr(0, 40) + "...",
                        fmt::format("is a pattern of {} bytes; at most {} are taken", pattern.size(), PATH_MAX - 1));
    glob_t matches{};
    const int result = ::glob(pattern.c_str(), 0, nullptr, &matches);
    std::vector<std::string> files;
    for (std::size_t i = 0; result == 0 && i < matches.gl_pathc; ++i)
        files.emplace_back(matches.gl_pathv[i]);
    ::globfree(&matches);
    return files;
}

ImageName split_several(const std::string &name) {
    std::error_code ignored;
    if (fs::exists(name, ignored) || (is_pattern(name) && !matches_of(name).empty()))
        return {name, ""};
    return split_name(name, [&](const std::string &path) {
        return fs::is_directory(path, ignored) || (is_pattern(path) && !matches_of(path).empty());
    });
}

bool natural_less(const std::string &a, const std::string &b) {
    std::size_t i = 0;
    std::size_t j = 0;
    const auto begins = [](const std::string &text, std::size_t at) { return at == 0 || text[at - 1] == '/'; };
    const auto number_at = [](const std::string &text, std::size_t at) {
        return at < text.size() && is_digit(text[at]);
    };
    bool negative = false; // the next number of both
    while (i < a.size() && j < b.size()) {
        if (begins(a, i) && begins(b, j)) {
            const bool sign_a = a[i] == '-' && number_at(a, i + 1), sign_b = b[j] == '-' && number_at(b, j + 1);
            if (sign_a != sign_b && (sign_a ? number_at(b, j) : number_at(a, i)))
                return sign_a;
            negative = sign_a && sign_b;
        }
        if (is_digit(a[i]) && is_digit(b[j])) {
            const auto run = [](const std::string &text, std::size_t &at) {
                while (at < text.size() && text[at] == '0')
                    ++at;
                const std::size_t start = at;
                while (at < text.size() && is_digit(text[at]))
                    ++at;
                return text.substr(start, at - start);
            };
            const std::string x = run(a, i);
            const std::string y = run(b, j);
            if (x != y)
                return (x.size() != y.size() ? x.size() < y.size() : x < y) != negative;
            negative = false;
            continue;
        }
        if (a[i] != b[j])
            return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
        ++i;
        ++j;
    }
    if (i < a.size() || j < b.size())
        return j < b.size();
    return a < b; // the same but for leading zeros
}

bool is_preview(const std::string &path) {
    const std::string name = fs::path(path).filename().string();
    return ::fnmatch("preview_[0-9][0-9][0-9][0-9][0-9][0-9]*.png", name.c_str(), 0) == 0 ||
           ::fnmatch("ideal_preview_[0-9][0-9][0-9][0-9][0-9][0-9]*.png", name.c_str(), 0) == 0;
}

void leave_previews_out(std::vector<std::string> &paths) {
    if (!std::all_of(paths.begin(), paths.end(), is_preview))
        paths.erase(std::remove_if(paths.begin(), paths.end(), is_preview), paths.end());
}

std::vector<Series> series_of(const std::vector<std::string> &names) {
    std::map<std::string, Group> groups; // by skeleton
    for (const std::string &name : names) {
        auto parts = parts_of(name);
        groups[skeleton_of(parts)].push_back(std::move(parts));
    }
    std::vector<Group> single;
    for (auto &[skeleton, group] : groups) {
        const auto series = number_of_series(group);
        if (!series) {
            single.push_back(std::move(group));
            continue;
        }
        std::map<std::string, Group> parted;
        for (auto &parts : group) {
            const std::string value = parts[*series];
            parted[value].push_back(std::move(parts));
        }
        for (auto &[value, part] : parted)
            single.push_back(std::move(part));
    }
    std::vector<Series> result;
    for (const Group &group : single) {
        Series series{pattern_of(group, names), {}};
        for (const auto &parts : group)
            series.names.push_back(concatenated(parts));
        std::sort(series.names.begin(), series.names.end(), natural_less);
        result.push_back(std::move(series));
    }
    std::stable_sort(result.begin(), result.end(),
                     [](const Series &a, const Series &b) { return a.names.size() > b.names.size(); });
    return result;
}

namespace {

/** The patterns of several, for messages. */
std::string told(const std::vector<Series> &found) {
    constexpr std::size_t most = 6;
    std::string list;
    for (std::size_t i = 0; i < std::min(found.size(), most); ++i)
        list += fmt::format("{}{}{}", i ? ", " : "", found[i].pattern,
                            found[i].names.size() > 1 ? fmt::format(" ({} files)", found[i].names.size()) : "");
    return found.size() > most ? fmt::format("{} and {} more", list, found.size() - most) : list;
}

} // namespace

std::string why_no_series(const std::string &folder, const std::vector<std::string> &paths, const std::string &before,
                          const std::string &behind) {
    std::vector<std::string> names;
    std::set<std::string> endings;
    for (const std::string &path : paths) {
        names.push_back(fs::path(path).filename().string());
        endings.insert(fs::path(path).extension().string());
    }
    const std::vector<Series> found = series_of(names);
    if (found.size() < 2)
        return {};
    std::string advice = fmt::format("name one, for example {}{}{}", before, found[0].pattern, behind);
    if (endings.size() == 1)
        advice += fmt::format(", or all as one series with {}*{}{}", before, *endings.begin(), behind);
    return fmt::format("{}: the names in the folder tell {} series: {}; {}", folder, found.size(), told(found), advice);
}

namespace {

/** The last number of each name that varies; empty where names differ in more than numbers, or none does. */
std::vector<std::int64_t> counted(const std::vector<std::string> &paths) {
    Group group;
    std::set<std::string> skeletons;
    for (const std::string &path : paths) {
        group.push_back(parts_of(fs::path(path).stem().string()));
        skeletons.insert(skeleton_of(group.back()));
    }
    if (skeletons.size() != 1)
        return {};
    std::size_t counter = 0; // the last number that varies
    for (std::size_t part = 1; part < group.front().size(); part += 2)
        if (values_of(group, part).size() > 1)
            counter = part;
    std::vector<std::int64_t> numbers;
    for (const auto &parts : group) {
        if (counter == 0 || parts[counter].size() > 18)
            return {};
        numbers.push_back(std::stoll(parts[counter]));
    }
    return numbers;
}

} // namespace

std::string counted_otherwise(const std::vector<std::string> &paths) {
    const std::vector<std::int64_t> numbers = counted(paths);
    std::vector<std::int64_t> sorted = numbers;
    std::sort(sorted.begin(), sorted.end());
    const auto all = [](const auto &begin, const auto &end) {
        return std::adjacent_find(begin, end, std::greater_equal<>()) == end; // rise
    };
    // Dates, times and exposures do not count through.
    if (numbers.size() < 3 || !all(sorted.begin(), sorted.end()) ||
        std::size_t(sorted.back() - sorted.front()) + 1 != sorted.size() || all(numbers.begin(), numbers.end()) ||
        all(numbers.rbegin(), numbers.rend()))
        return {};
    constexpr std::size_t most = 6;
    std::string order;
    for (std::size_t i = 0; i < std::min(most, numbers.size()); ++i)
        order += fmt::format("{}{}", i ? ", " : "", numbers[i]);
    return fmt::format("the last number of their names counts from {} to {}, but they are taken in the order {}{}: "
                       "rename them so that this number comes first",
                       sorted.front(), sorted.back(), order, numbers.size() > most ? " ..." : "");
}

std::string several_series(const std::vector<std::string> &paths) {
    std::vector<std::string> names;
    for (const std::string &path : paths)
        names.push_back(fs::path(path).filename().string());
    const std::vector<Series> found = series_of(names);
    if (found.size() < 2)
        return {};
    return fmt::format("the names of the {} files tell {} series ({}); all are taken as frames of one, in the order "
                       "given. If they are none, name those of one series",
                       paths.size(), found.size(), told(found));
}

std::string missing_numbers(const std::vector<std::string> &paths) {
    const std::vector<std::int64_t> numbers = counted(paths);
    for (std::size_t i = 1; i < numbers.size(); ++i)
        if (numbers[i] <= numbers[i - 1])
            return {};
    if (numbers.empty())
        return {};
    const std::size_t missing = std::size_t(numbers.back() - numbers.front()) + 1 - numbers.size();
    if (missing == 0 || missing > numbers.size())
        return {};
    std::int64_t first = numbers.front();
    for (const std::int64_t number : numbers)
        if (number == first)
            ++first;
    return fmt::format("{} of the numbers {} to {} {} missing, the first one is {}", missing, numbers.front(),
                       numbers.back(), missing == 1 ? "is" : "are", first);
}

} // namespace image_io
