#include "hypothesis_file.hpp"

#include "errors.hpp"
#include "io/inside.hpp"
#include "json.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

namespace tools {

namespace {

namespace fs = std::filesystem;

struct Point {
    const char *name;
    std::uint32_t value;
};
constexpr Point points[] = {{"irradiance", CLSP_HYPOTHESIS_IRRADIANCE},
                            {"intensity", CLSP_HYPOTHESIS_INTENSITY},
                            {"codes", CLSP_HYPOTHESIS_CODES}};

constexpr std::size_t most_letters = sizeof(ClspDiagnosisRanked::effect) - 1;
constexpr std::size_t most_name = sizeof(ClspEffectParameter::name) - 1;
constexpr std::size_t most_unit = sizeof(ClspEffectParameter::unit) - 1;
constexpr std::uintmax_t most_source_bytes = 1 << 20;

const std::vector<std::string> file_keys = {"id", "stage", "summary", "point", "parameters", "opencl"};
const std::vector<std::string> parameter_keys = {"weak", "strong", "minimum", "maximum", "unit"};

void check_keys(const Json &object, const std::vector<std::string> &known, const std::string &where) {
    if (!object.is_object())
        throw InputError(fmt::format("{} must be an object, got {}", where, shown(object)));
    for (const auto &[key, value] : object.items())
        if (std::find(known.begin(), known.end(), key) == known.end())
            throw InputError(fmt::format("{}: unknown key \"{}\"{}; the keys are {}", where, key,
                                         suggestion(key, known), fmt::join(known, ", ")));
}

/** A text; `otherwise` where there is none, which is refused if that is null. */
std::string text_of(const Json &object, const char *key, const char *otherwise, const std::string &where) {
    const auto found = object.find(key);
    if (found == object.end() && otherwise)
        return otherwise;
    if (found == object.end())
        throw InputError(fmt::format("{}: \"{}\" is missing", where, key));
    const std::string text = found->is_string() ? found->get<std::string>() : "";
    if (!found->is_string() || std::any_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }))
        throw InputError(
            fmt::format("{}: \"{}\" must be text without control characters, got {}", where, key, shown(*found)));
    return text;
}

double number_of(const Json &object, const char *key, const std::string &where) {
    const auto found = object.find(key);
    if (found == object.end())
        throw InputError(fmt::format("{}: \"{}\" is missing", where, key));
    if (!found->is_number())
        throw InputError(fmt::format("{}: \"{}\" must be a number, got {}", where, key, shown(*found)));
    return found->get<double>();
}

clspeckle::HypothesisParameter parameter_of(const std::string &name, const Json &object, const std::string &where) {
    check_keys(object, parameter_keys, where);
    clspeckle::HypothesisParameter result;
    result.name = name;
    result.unit = text_of(object, "unit", "1", where);
    if (name.size() > most_name || result.unit.size() > most_unit)
        throw InputError(fmt::format("{}: its name has {} bytes and its unit {}, they may have {} and {}", where,
                                     name.size(), result.unit.size(), most_name, most_unit));
    result.weak = number_of(object, "weak", where);
    result.strong = number_of(object, "strong", where);
    // Without a range it ends twice the difference beyond weak and strong, or at 0 if both lie on one side of it.
    const double low = std::min(result.weak, result.strong), high = std::max(result.weak, result.strong);
    const double span = high > low ? high - low : std::abs(high);
    const double least = low >= 0.0 ? std::max(0.0, low - 2.0 * span) : low - 2.0 * span;
    const double most = high <= 0.0 ? std::min(0.0, high + 2.0 * span) : high + 2.0 * span;
    result.minimum = object.contains("minimum") ? number_of(object, "minimum", where) : least;
    result.maximum = object.contains("maximum") ? number_of(object, "maximum", where) : most;
    return result;
}

std::string source_of(const fs::path &path, const std::string &where) {
    const auto complain = [&](const std::string &why) {
        throw InputError(fmt::format("{}: the OpenCL source {} cannot be read: {}", where, path.string(), why));
    };
    std::error_code code;
    if (!fs::exists(path, code))
        complain("it does not exist");
    if (!fs::is_regular_file(path, code))
        complain("it is no file");
    if (fs::file_size(path, code) > most_source_bytes)
        complain(fmt::format("it has more than {} bytes", most_source_bytes));
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    std::string text(std::istreambuf_iterator<char>(file), {});
    if (!file.is_open() || file.bad())
        complain(errno ? std::strerror(errno) : "the system gives no reason");
    if (text.find('\0') != std::string::npos)
        complain("it is no text");
    if (text.empty())
        complain("it is empty");
    return text;
}

} // namespace

clspeckle::Hypothesis read_hypothesis(const std::string &path) {
    const JsonDocument document = read_json(path);
    const Json &root = document.root();
    check_keys(root, file_keys, path);
    clspeckle::Hypothesis result;
    result.id = text_of(root, "id", nullptr, path);
    const auto allowed = [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == '.'; };
    if (result.id.empty() || result.id.size() > most_letters ||
        !std::all_of(result.id.begin(), result.id.end(), allowed))
        throw InputError(fmt::format("{}: \"id\" is \"{}\", it must be 1 to {} letters, digits, '_', '-' and '.'", path,
                                     result.id, most_letters));
    result.stage = text_of(root, "stage", nullptr, path);
    result.summary = text_of(root, "summary", "", path);
    const std::string point = text_of(root, "point", "intensity", path);
    const auto known =
        std::find_if(std::begin(points), std::end(points), [&](const Point &p) { return p.name == point; });
    if (known == std::end(points))
        throw InputError(
            fmt::format("{}: \"point\" is \"{}\", it must be irradiance, intensity or codes", path, point));
    result.point = known->value;
    const auto parameters = root.find("parameters");
    if (parameters == root.end() || !parameters->is_object() || parameters->empty() ||
        parameters->size() > CLSP_MAX_EFFECT_PARAMETERS)
        throw InputError(
            fmt::format("{}: \"parameters\" must be an object with 1 to {} entries, by name: without one there "
                        "is nothing to fit",
                        path, CLSP_MAX_EFFECT_PARAMETERS));
    for (const auto &[name, value] : parameters->items())
        result.parameters.push_back(parameter_of(name, value, fmt::format("{}: the parameter \"{}\"", path, name)));
    const std::string source = text_of(root, "opencl", nullptr, path);
    if (image_io::leaves_folder(source))
        throw InputError(fmt::format(
            "{}: \"opencl\" is {}, outside the folder of the file: copy it there, or link to it", path, shown(source)));
    result.opencl_source = source_of(fs::path(path).parent_path() / source, path);
    return result;
}

} // namespace tools
