#include "measure/acceptance.hpp"

#include "capture/json_file.hpp"
#include "runtime/error.hpp"
#include "statistics/distributions.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <set>

namespace clsp {
namespace {

constexpr const char *kSections[] = {"quantities", "statistics"};
constexpr const char *kLimit = "a number of at least 0, alone or with a unit: 0.2, \"0.2 DN\", \"3 %\"";

Tolerance tolerance_of(const JsonChecks &checks, const std::string &where, bool of_statistic, const std::string &key,
                       const Json &value) {
    Tolerance result{of_statistic, key, 0.0, ""};
    if (value.is_string()) {
        const std::string &text = value.get_ref<const std::string &>();
        const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), result.limit);
        result.unit.assign(end, text.data() + text.size());
        result.unit.erase(0, std::min(result.unit.find_first_not_of(' '), result.unit.size()));
        if (code != std::errc() || !std::isfinite(result.limit))
            checks.refuse(where, fmt::format("is {}; expected {}", shown(value), kLimit));
    } else {
        result.limit = checks.number(value, where, kLimit);
    }
    if (result.limit < 0.0)
        checks.refuse(where, fmt::format("is {}; expected {}", shown(value), kLimit));
    return result;
}

std::size_t parts_of(const std::string &key) {
    return 1 + std::size_t(std::count(key.begin(), key.end(), '/'));
}

// "flat/temporal_noise"; of several sequences together the name alone.
std::string key_of(const Measurable &what, std::size_t parts) {
    return parts == 1   ? what.name
           : parts == 2 ? what.sequence + '/' + what.name
                        : what.sequence + '/' + what.name + '/' + what.region;
}

[[noreturn]] void refuse_unknown(const JsonChecks &checks, const Tolerance &tolerance,
                                 const std::vector<Measurable> &there) {
    const std::size_t parts = parts_of(tolerance.key), slash = tolerance.key.find('/');
    const std::string section = kSections[tolerance.of_statistic], sequence = tolerance.key.substr(0, slash);
    const bool has_sequence = parts > 1 && std::any_of(there.begin(), there.end(), [&](const Measurable &m) {
                                  return m.is_statistic == tolerance.of_statistic && m.sequence == sequence;
                              });
    std::set<std::string> names;
    for (const Measurable &m : there)
        if (m.is_statistic == tolerance.of_statistic && (!has_sequence || m.sequence == sequence))
            names.insert(has_sequence ? key_of(m, std::clamp<std::size_t>(parts, 1, 3)) : m.name);
    checks.refuse(
        fmt::format("/{}/{}", section, tolerance.key),
        fmt::format(
            "is for something that the camera's frames do not tell; expected NAME or SEQUENCE/NAME{}. There {}: {}",
            tolerance.of_statistic ? " or SEQUENCE/NAME/REGION" : "", names.empty() ? "is nothing" : "are",
            fmt::join(names, ", ")));
}

} // namespace

Tolerances read_tolerances(const std::string &path) {
    const JsonDocument file = read_json_file(path);
    const Json &root = file.root();
    const JsonChecks checks(path);
    const std::string example = R"({"quantities": {"temporal_noise": "0.2 DN", "flat/mean_signal": "1 %"}})";
    if (!root.is_object() || root.empty())
        checks.refuse("/", "is no object with tolerances; expected for example " + example);
    Tolerances result{path, {}};
    for (const auto &[section, limits] : root.items()) {
        const auto found = std::find(std::begin(kSections), std::end(kSections), section);
        if (found == std::end(kSections))
            checks.refuse("/" + section, "is not known; expected \"quantities\" or \"statistics\": " + example);
        if (!limits.is_object())
            checks.refuse("/" + section, fmt::format("is {}; expected an object: {}", shown(limits), example));
        for (const auto &[key, value] : limits.items())
            result.entries.push_back(
                tolerance_of(checks, fmt::format("/{}/{}", section, key), found != std::begin(kSections), key, value));
    }
    if (result.entries.empty())
        checks.refuse("/", "has no tolerances; expected for example " + example);
    return result;
}

const char *acceptance_name(Acceptance acceptance) {
    constexpr const char *kNames[] = {"accepted", "not accepted", "undecided"};
    return kNames[static_cast<std::size_t>(acceptance)];
}

JudgedDifference judge_difference(double real, double mean, double deviation, double captures, double tolerance) {
    JudgedDifference result;
    result.difference = mean - real;
    if (captures < 2.0 || !std::isfinite(result.difference) || !std::isfinite(deviation))
        return result;
    const double reach =
        student_two_sided_quantile(0.05, captures - 1.0) * deviation * std::sqrt(1.0 + 1.0 / captures);
    result.interval_95 = {result.difference - reach, result.difference + reach};
    const auto [low, high] = result.interval_95;
    if (low >= -tolerance && high <= tolerance)
        result.acceptance = Acceptance::kAccepted;
    else if (low > tolerance || high < -tolerance)
        result.acceptance = Acceptance::kNotAccepted;
    return result;
}

std::vector<AcceptanceRow> acceptance_rows(const Tolerances &tolerances, const std::vector<Measurable> &there) {
    const JsonChecks checks(tolerances.path);
    std::vector<AcceptanceRow> rows;
    std::vector<std::size_t> parts; // of the key that a row is by
    for (const Tolerance &tolerance : tolerances.entries) {
        bool any = false;
        for (const Measurable &what : there) {
            const std::size_t own = parts_of(tolerance.key);
            if (what.is_statistic != tolerance.of_statistic || own > (what.is_statistic ? 3u : 2u) ||
                key_of(what, own) != tolerance.key)
                continue;
            any = true;
            const bool relative = tolerance.unit == "%" && what.unit != "%";
            if (!tolerance.unit.empty() && tolerance.unit != what.unit && !relative)
                checks.refuse(fmt::format("/{}/{}", kSections[tolerance.of_statistic], tolerance.key),
                              fmt::format("is in \"{}\"; expected \"{}\", or \"%\" of the camera's value",
                                          tolerance.unit, what.unit));
            const AcceptanceRow row{
                what, relative ? 0.01 * tolerance.limit * std::abs(what.real) : tolerance.limit, {}};
            const auto same = std::find_if(rows.begin(), rows.end(), [&](const AcceptanceRow &other) {
                return other.of.is_statistic == what.is_statistic && other.of.index == what.index;
            });
            if (same == rows.end()) {
                rows.push_back(row);
                parts.push_back(own);
            } else if (std::size_t &by = parts[std::size_t(same - rows.begin())]; own > by) {
                *same = row;
                by = own;
            }
        }
        if (!any)
            refuse_unknown(checks, tolerance, there);
    }
    return rows;
}

} // namespace clsp
