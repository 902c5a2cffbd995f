#include "doe_files.hpp"

#include "errors.hpp"
#include "files.hpp"
#include "io/formats.hpp"
#include "json.hpp"

#include <clspeckle/clspeckle.hpp>

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <regex>

namespace tools {

namespace {

namespace fs = std::filesystem;

std::int32_t order_number(const Json &value, const std::string &where) {
    const double found = json_number(value, where);
    if (!(std::abs(found) <= 1e6) || found != std::floor(found))
        throw InputError(fmt::format("{} is {}, an order is an integer", where, shown(value)));
    return static_cast<std::int32_t>(found);
}

double member(const Json &about, const std::string &file, const char *name) {
    const auto found = about.find(name);
    if (found == about.end())
        throw InputError(fmt::format("{}: \"{}\" is missing", file, name));
    return json_number(*found, fmt::format("{}: \"{}\"", file, name));
}

image_io::Plane read_phase(const std::string &path, Console &console) {
    {
        const auto reader = image_io::open(path);
        const image_io::Info &info = reader->info();
        if (info.axes != 2)
            throw InputError(fmt::format("{}: has {} axes, a phase has two: height x width", path, info.axes));
        if (info.full_scale > 0)
            throw InputError(fmt::format("{}: holds {}; a phase is floating-point, in radians", path, info.sample));
    }
    return read_plane(path, console);
}

} // namespace

double json_number(const Json &value, const std::string &where) {
    if (!value.is_number())
        throw InputError(fmt::format("{} is {}, a number is needed", where, shown(value)));
    return value.get<double>();
}

image_io::Plane read_plane(const std::string &path, Console &console, image_io::Encoding encoding) {
    const auto reader = image_io::open_one(path);
    std::vector<std::string> warnings;
    image_io::Plane plane = image_io::read_gray(*reader, 0, warnings, image_io::Colors::mean, encoding);
    for (const std::string &warning : warnings)
        console.warn(warning);
    return plane;
}

DotList read_dot_list(const Json &file, const std::string &path, const char *key) {
    const Json &list = file.at(key);
    if (!list.is_array())
        throw InputError(fmt::format("{}: \"{}\" is no list; [[number, number, weight], ...] is needed", path, key));
    DotList dots;
    dots.orders = std::string(key) == "orders";
    for (std::size_t k = 0; k < list.size(); ++k) {
        const std::string where = fmt::format("{}: {}[{}]", path, key, k);
        const Json &entry = list[k];
        if (!entry.is_array() || entry.size() < 2 || entry.size() > 3)
            throw InputError(
                fmt::format("{} is {}; two numbers and an optional weight are needed", where, shown(entry)));
        for (std::size_t i = 0; i < 2; ++i) {
            const std::string number = fmt::format("{}[{}]", where, i);
            if (dots.orders)
                dots.numbers.push_back(order_number(entry[i], number));
            else
                dots.directions.push_back(json_number(entry[i], number));
        }
        dots.weights.push_back(entry.size() > 2 ? json_number(entry[2], where + "[2]") : 1.0);
    }
    return dots;
}

std::string without_npy(const std::string &path) {
    const bool npy = path.size() > 4 && path.compare(path.size() - 4, 4, ".npy") == 0;
    return npy ? path.substr(0, path.size() - 4) : path;
}

Design read_design(const std::string &path, Console &console) {
    const std::string stem = without_npy(path), file = stem + ".json";
    Design design;
    design.phase = read_phase(stem + ".npy", console);
    const JsonDocument document = read_json(file);
    const Json &about = document.root();
    if (!about.is_object())
        throw InputError(fmt::format("{}: expected an object with \"pixel_pitch_m\" and \"wavelength_m\"", file));
    design.pixel_pitch_m = member(about, file, "pixel_pitch_m");
    design.wavelength_m = member(about, file, "wavelength_m");
    if (about.contains("periodic")) {
        const Json &periodic = about.at("periodic");
        if (!periodic.is_boolean())
            throw InputError(fmt::format("{}: \"periodic\" is {}, expected true or false", file, shown(periodic)));
        design.periodic = periodic.get<bool>();
    }
    if (about.contains("levels")) {
        const Json &levels = about.at("levels");
        const double most = std::numeric_limits<std::uint32_t>::max();
        if (!levels.is_number_integer() || levels.get<double>() < 0 || levels.get<double>() > most)
            throw InputError(fmt::format("{}: \"levels\" is {}, expected an integer, 0 or above", file, shown(levels)));
        design.levels = levels.get<std::uint32_t>();
    }
    const char *list = design.periodic ? "orders" : "directions", *other = design.periodic ? "directions" : "orders";
    if (about.contains(other))
        throw InputError(fmt::format("{}: has \"{}\", but a design with \"periodic\": {} has \"{}\"", file, other,
                                     design.periodic, list));
    if (about.contains(list))
        design.dots = read_dot_list(about, file, list);
    return design;
}

std::vector<double> read_direction_cosines(const std::string &path) {
    const JsonDocument document = read_json(path);
    const Json &file = document.root();
    if (file.is_object() && file.contains("directions")) // exact, where a layout has both
        return read_dot_list(file, path, "directions").directions;
    if (!file.is_object() || !file.contains("orders"))
        throw InputError(fmt::format("{}: holds neither \"directions\" nor \"orders\"; a layout of `clspeckle doe "
                                     "layout` or a design of `clspeckle doe design` is needed",
                                     path));
    const DotList dots = read_dot_list(file, path, "orders");
    const double pitch_m = member(file, path, "pixel_pitch_m"), wavelength_m = member(file, path, "wavelength_m");
    double width = 0, height = 0;
    if (file.contains("width") || file.contains("height")) {
        width = member(file, path, "width");
        height = member(file, path, "height");
    } else {
        const auto phase = image_io::open(fs::path(path).replace_extension(".npy").string());
        width = phase->info().width;
        height = phase->info().height;
    }
    for (const auto &[value, name] : {std::pair(pitch_m, "pixel_pitch_m"), std::pair(wavelength_m, "wavelength_m"),
                                      std::pair(width, "width"), std::pair(height, "height")})
        if (!(value > 0.0) || !std::isfinite(value))
            throw InputError(fmt::format("{}: \"{}\" is {}, expected a number above 0", path, name, value));
    std::vector<double> directions;
    for (std::size_t k = 0; k < dots.numbers.size(); k += 2) {
        directions.push_back(dots.numbers[k] * wavelength_m / (width * pitch_m));
        directions.push_back(dots.numbers[k + 1] * wavelength_m / (height * pitch_m));
    }
    return directions;
}

std::string checked_stem(std::string name, std::initializer_list<const char *> extensions, bool overwrite,
                         const std::vector<std::string> &inputs) {
    for (const char *extension : {".npy", ".json"}) {
        const std::size_t size = std::string(extension).size();
        if (name.size() > size && fs::path(name).extension() == extension)
            name.resize(name.size() - size);
    }
    if (!fs::path(name).has_filename() || name == "." || name == "..")
        throw InputError(fmt::format("--output is \"{}\"; a name is needed, for example {}", name,
                                     (fs::path(name) / "dots").string()));
    for (const char *extension : extensions)
        check_output_file({name + extension}, overwrite, inputs);
    return name;
}

void write_npy_with_json(const std::string &stem, std::uint32_t width, std::uint32_t height,
                         const std::vector<float> &values, const std::string &json) {
    const auto phase =
        image_io::create(stem + ".npy", image_io::format_named("NPY"), {width, height, image_io::Sample::float32, 0});
    phase->append(values.data());
    image_io::AtomicFile about(stem + ".json");
    about.write(json.data(), json.size());
    about.close();
    // The array appears first: who finds the JSON finds both.
    phase->commit();
    about.commit();
}

void with_option_names(const std::vector<std::pair<std::string, std::string>> &names,
                       const std::function<void()> &action) {
    try {
        action();
    } catch (const clspeckle::Error &error) {
        std::string message = error.message();
        for (const auto &[name, option] : names)
            message = std::regex_replace(message, std::regex("(^|[^\\w-])(?:desc->)?" + name + "\\b"), "$1" + option);
        throw clspeckle::Error(error.status(), error.opencl_code(), error.function(), message, error.build_log());
    }
}

} // namespace tools
