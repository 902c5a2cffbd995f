#include "plane_checks.hpp"

#include "errors.hpp"
#include "io/formats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>

namespace tools {

using image_io::Plane;
using image_io::VectorPlane;

namespace {

/** Renderers write the largest half or 1e10 where they see nothing, whatever their unit is. */
constexpr float largest_half = 65504.0f, renderers_far = 1e10f;
constexpr float no_surface_m = largest_half;
/** Far beyond what a laser lights up; millimetres that are taken as metres come out above it. */
constexpr double far_m = 100.0;

bool is_real(const std::string &sample) {
    return sample.rfind("float", 0) == 0 || sample == "rgbe";
}

/** Whether a pixel of positions has one: renderers write 0 or 1e10 where they see nothing. */
bool is_position(const float *p) {
    const auto near = [](float v) { return std::abs(v) < no_surface_m; }; // false for NaN
    return near(p[0]) && near(p[1]) && near(p[2]) && (p[0] != 0 || p[1] != 0 || p[2] != 0);
}

constexpr char full_scale_key[] = "full_scale=";

/** The file's name, with the number that means 1 in place of what is named there. */
std::string with_full_scale(const std::string &file, double top) {
    const auto [path, channel] = image_io::split_name(file);
    std::string name = fmt::format("{}:{}{}", path, full_scale_key, top);
    std::istringstream parts(channel);
    for (std::string part; std::getline(parts, part, ',');)
        if (part.rfind(full_scale_key, 0) != 0)
            name += "," + part;
    return name;
}

/** The number that a file's name says means 1. */
double named_full_scale(const std::string &file) {
    std::istringstream parts(image_io::split_name(file).channel);
    for (std::string part; std::getline(parts, part, ',');)
        if (part.rfind(full_scale_key, 0) == 0)
            return std::strtod(part.c_str() + sizeof(full_scale_key) - 1, nullptr);
    return 1;
}

/** How parts of light that are above 1 come below it; empty: none are. Numbers of another scale are divided: cutting
 * would make all of them 1. Those of which few are above 1, or all by little, are cut.
 * @param file what an option may follow; empty: none. */
std::string way_to_parts(const Plane &plane, const char *what, const std::string &file) {
    const double given = file.empty() ? 1 : named_full_scale(file);
    double largest = 0;
    std::size_t above = 0, lit = 0;
    bool whole = true;
    for (const float value : plane.values)
        if (std::isfinite(value)) {
            const double stored = value * given;
            largest = std::max(largest, stored);
            whole = whole && stored == std::floor(stored);
            above += value > 1;
            lit += value > 0;
        }
    if (above == 0)
        return "";
    // Filters of renderers go a little beyond the top; a quarter of it is what dark scenes have.
    constexpr double beyond = 1.02, percent = 100;
    double top = 255;
    if (whole ? largest == percent : largest <= beyond * percent)
        top = percent;
    while (top < largest && (whole || beyond * top < largest))
        top = 4 * top + 3;
    if (2 * above <= lit || !(whole || 4 * largest > top))
        return fmt::format("save numpy.minimum({}, 1), which cuts them at 1", what);
    if (largest > top)
        return fmt::format("save numpy.minimum({0} / {1}, 1), if {1} stands for 1", what, top);
    return file.empty() ? fmt::format("save {0} / {1}, if {1} stands for 1", what, top)
                        : fmt::format("if {} stands for 1, {} divides them", top, with_full_scale(file, top));
}

/** Whether a normal's numbers of -1 to 1 were made colors of 0 to top. */
bool looks_encoded(const float *n, double top) {
    const double x = 2.0 * n[0] / top - 1, y = 2.0 * n[1] / top - 1, z = 2.0 * n[2] / top - 1;
    return std::abs(std::sqrt(x * x + y * y + z * z) - 1) < 0.02 && n[0] >= 0 && n[1] >= 0 && n[2] >= 0;
}

} // namespace

void check_unit(const std::string &sample, bool automatic, const char *what, const std::string &name) {
    if (automatic && !is_real(sample))
        throw InputError(fmt::format("{}: {} must be floating-point metres, not {}, whose unit is not known; "
                                     "--depth-scale 0.001 takes it as millimetres",
                                     name, what, sample));
}

LightChoice light_choice(const Config &config) {
    return {config.flag("render.clip_negative"), config.flag("render.zero_nonfinite")};
}

void check_light(Plane &plane, const std::string &path, const char *what, LightChoice choice,
                 std::vector<std::string> &warnings) {
    std::size_t negative = 0, nonfinite = 0, lit = 0, odd = 0;
    float least = 0;
    for (const float value : plane.values)
        if (value != 0 && std::isfinite(value)) {
            ++lit;
            odd += std::abs(value) < 1e-30f || std::abs(value) > 1e30f ? 1 : 0;
        }
    if (2 * odd > lit)
        warnings.push_back(fmt::format("{}: {} of the {} numbers of the {} that are not 0 are closer to 0 than 1e-30 "
                                       "or beyond 1e30, as no light is: were numbers of another type stored as such?",
                                       path, odd, lit, what));
    for (float &value : plane.values) {
        if (choice.clip_negative && value < 0 && std::isfinite(value)) {
            ++negative;
            least = std::min(least, value);
            value = 0;
        } else if (choice.zero_nonfinite && !std::isfinite(value)) {
            ++nonfinite;
            value = 0;
        }
    }
    if (negative > 0)
        warnings.push_back(fmt::format("{}: {} of {} pixels of the {} were negative, down to {:g}, and were set to 0",
                                       path, negative, plane.values.size(), what, least));
    if (nonfinite > 0)
        warnings.push_back(fmt::format("{}: {} of {} pixels of the {} were NaN or infinite and were set to 0", path,
                                       nonfinite, plane.values.size(), what));
    const bool any_negative = std::any_of(plane.values.begin(), plane.values.end(),
                                          [](float value) { return value < 0 && std::isfinite(value); });
    const bool any_nonfinite =
        std::any_of(plane.values.begin(), plane.values.end(), [](float value) { return !std::isfinite(value); });
    std::string advice = any_negative ? "--clip-negative sets negative numbers to 0" : "";
    if (any_nonfinite)
        advice += (advice.empty() ? "" : ", and ") + std::string("--zero-nonfinite sets NaN and infinite ones to 0");
    check_values(plane, path, what, no_limit, advice);
}

std::string check_full_scale(const Plane &plane, const std::string &name, const std::string &file,
                             std::vector<std::string> &warnings) {
    const bool integers = plane.sample.rfind("int", 0) == 0 || plane.sample.rfind("uint", 0) == 0;
    if (plane.full_scale_given || !integers || plane.empty())
        return "";
    const auto [low, high] = std::minmax_element(plane.values.begin(), plane.values.end());
    // One of the bits of signed numbers is the sign.
    const bool is_signed = plane.sample[0] == 'i';
    const unsigned most = static_cast<unsigned>(std::stoul(plane.sample.substr(is_signed ? 3 : 4))) - is_signed;
    const auto bits_of = [&](float number) {
        unsigned bits = 8;
        while (bits < most && static_cast<double>(number) >= std::ldexp(1.0, static_cast<int>(bits)))
            bits += 2;
        return std::min(bits, most);
    };
    if (plane.white_is_zero && plane.full_scale == 65535)
        if (const float stored = 65535 - *low; stored > 1 && bits_of(stored) < 16) {
            const double white = std::ldexp(1.0, static_cast<int>(bits_of(stored))) - 1;
            warnings.push_back(
                fmt::format("{0}: its photometric interpretation says that 0 is white, and the largest number stored "
                            "is {1}: counted from 65535, all of it is bright. If its codes have {2} bits, save "
                            "tifffile.imwrite(new_path, {3} - image, photometric=\"minisblack\") and take {4}",
                            name, stored, bits_of(stored), white,
                            file.empty() ? fmt::format("that with --full-scale {}", white)
                                         : fmt::format("new_path:full_scale={}", white)));
            return "";
        }
    const float largest = *high;
    const auto advice_of = [&](double top) {
        return file.empty() ? fmt::format("--full-scale {}", top) : with_full_scale(file, top);
    };
    if (largest == 1 && plane.full_scale > 1)
        warnings.push_back(fmt::format("{}: its largest number is 1 of {}; if its numbers are 0 and 1, {} makes 1 mean "
                                       "1",
                                       name, plane.full_scale, advice_of(1)));
    if (!(largest > 1))
        return "";
    unsigned bits = bits_of(largest);
    // The file's own word, but for codes that were brought to 16 bits, which is what the word is for.
    const bool told = plane.significant_bits > 0 && plane.significant_bits < 16 && bits < 16 &&
                      largest < std::ldexp(1.0f, static_cast<int>(plane.significant_bits));
    if (told)
        bits = plane.significant_bits;
    const double top = std::ldexp(1.0, static_cast<int>(bits)) - 1;
    const std::string advice = advice_of(top);
    if (plane.full_scale <= 0) {
        warnings.push_back(fmt::format("{}: its numbers are of type {}, which tells no full scale; they are taken as "
                                       "they are, and the largest is {}. {} makes that of {} bits 1",
                                       name, plane.sample, largest, advice, bits));
        return advice;
    }
    if (plane.full_scale == 65535 && bits < 16)
        warnings.push_back(fmt::format("{}: its largest number is {} of 65535; if its codes have {} bits{}, {} makes "
                                       "their top code 1",
                                       name, largest, bits, told ? ", as its chunk sBIT says" : "", advice));
    return "";
}

void check_values(const Plane &plane, const std::string &path, const char *what, double high,
                  const std::string &advice) {
    std::size_t bad = 0;
    std::size_t first = 0;
    for (std::size_t i = 0; i < plane.values.size(); ++i) {
        const float value = plane.values[i];
        if (!(value >= 0 && value <= high && std::isfinite(value)) && bad++ == 0)
            first = i;
    }
    if (bad == 0)
        return;
    const std::string range = std::isfinite(high) ? fmt::format("between 0 and {:g}", high) : "finite and not negative";
    throw InputError(fmt::format("{}: pixel ({}, {}) is {}; the {} must be {} ({} such pixel{} in all){}{}", path,
                                 first % plane.width, first / plane.width, plane.values[first], what, range, bad,
                                 bad == 1 ? "" : "s", advice.empty() ? "" : "; ", advice));
}

void check_visibility(const Plane &plane, const std::string &name, const std::string &file, const std::string &advice) {
    if (plane.empty())
        return;
    const std::string out =
        advice.empty() ? way_to_parts(plane, "visibility", file) : advice + " divides its whole numbers";
    check_values(plane, name, "visibility", 1.0, out);
}

void check_albedo(Plane &plane, const std::string &name, const std::string &file, LightChoice choice,
                  std::vector<std::string> &warnings) {
    check_light(plane, name, "albedo", choice, warnings);
    const auto above = std::count_if(plane.values.begin(), plane.values.end(), [](float v) { return v > 1.0f; });
    if (above > 0)
        warnings.push_back(fmt::format("{}: {} pixels have an albedo above 1, so that more light leaves the surface "
                                       "than falls on it; {}",
                                       name, above, way_to_parts(plane, "albedo", file)));
}

void settle_depth(Plane &plane, const std::string &name, const Config &config, std::vector<std::string> &warnings) {
    const bool automatic = config.is_word("camera.depth_scale");
    const double scale = automatic ? 1.0 : config.number("camera.depth_scale");
    const bool integers = !is_real(plane.sample);
    check_unit(plane.sample, automatic, "depth", name);
    std::vector<float> depths;
    std::size_t negative = 0;
    for (float &value : plane.values) {
        const bool nothing = value == largest_half || value >= renderers_far;
        value = static_cast<float>(value * scale);
        if (!integers && (nothing || value >= no_surface_m))
            value = std::numeric_limits<float>::infinity();
        if (value > 0 && std::isfinite(value))
            depths.push_back(value);
        negative += value < 0;
    }
    plane.full_scale = 0;
    if (depths.empty()) {
        warnings.push_back(fmt::format("{}: no pixel has a surface: {}", name,
                                       negative > 0 ? "depths are negative; they count from the camera into the scene"
                                                    : "all depths are 0, infinite or beyond 65504 m; "
                                                      "--depth-scale gives the unit of the numbers"));
        return;
    }
    const auto median = [&depths] {
        const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
        std::nth_element(depths.begin(), middle, depths.end());
        return *middle;
    };
    float middle = median();
    // What most share and nothing is beyond is a far plane, not a surface.
    if (const float last = *std::max_element(depths.begin(), depths.end()); middle == last && middle > far_m) {
        depths.erase(std::remove(depths.begin(), depths.end(), last), depths.end());
        if (!depths.empty())
            middle = median();
    }
    if (middle > far_m)
        warnings.push_back(fmt::format("{}: the surfaces are {:g} m away in the median, which no laser lights up; "
                                       "--depth-scale 0.001 takes the numbers as millimetres, 0.01 as centimetres",
                                       name, middle));
}

void scale_position(VectorPlane &plane, const Config &config) {
    if (!config.is_word("camera.depth_scale"))
        for (float &value : plane.values)
            value = static_cast<float>(value * config.number("camera.depth_scale"));
}

void check_normals(const FrameData &data, const std::string &name, const Config &config,
                   std::vector<std::string> &warnings) {
    const std::size_t count = data.normal.values.size() / 3, width = data.normal.width;
    const double fx = config.number("camera.fx_px"), fy = config.number("camera.fy_px");
    const double cx = config.number("camera.cx_px"), cy = config.number("camera.cy_px");
    const std::vector<double> pose = config.numbers("pattern.laser_from_geometry"); // [R|t]: the laser is at -R^T t
    double laser[3] = {};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            laser[i] -= pose[4 * j + i] * pose[4 * j + 3];
    std::size_t surfaces = 0, away = 0, encoded = 0, encoded_8 = 0, longer = 0;
    std::size_t bad = 0;
    std::size_t first = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const bool surface = data.position.empty() ? data.depth.values[i] > 0 && std::isfinite(data.depth.values[i])
                                                   : is_position(&data.position.values[3 * i]);
        const float *n = &data.normal.values[3 * i];
        const double length = std::sqrt(double{n[0]} * n[0] + double{n[1]} * n[1] + double{n[2]} * n[2]);
        // Written so that NaN counts as bad. Half precision and 8-bit steps stay well within 2 %.
        if (surface && !(std::abs(length - 1) < 0.02)) {
            if (bad++ == 0)
                first = i;
            encoded += looks_encoded(n, 1.0);
            encoded_8 += looks_encoded(n, 255.0);
            longer += length > 1;
        }
        if (surface) {
            const double x = data.position.empty() ? (fx > 0 ? (static_cast<double>(i % width) - cx) / fx : 0)
                                                   : data.position.values[3 * i] - laser[0];
            const double y = data.position.empty() ? (fy > 0 ? (static_cast<double>(i / width) - cy) / fy : 0)
                                                   : data.position.values[3 * i + 1] - laser[1];
            const double z = data.position.empty() ? 1 : data.position.values[3 * i + 2] - laser[2];
            ++surfaces;
            away += n[0] * x + n[1] * y + n[2] * z > 0;
        }
    }
    // At silhouettes some do, where a renderer's pixels mix what is near and far.
    if (encoded > surfaces / 2) {
        warnings.push_back(fmt::format("{}: {} of {} normals look encoded as colors, 0 to 1 for -1 to 1: then save "
                                       "2 * normals[..., :3] - 1",
                                       name, encoded, surfaces));
        return;
    }
    if (encoded_8 > surfaces / 2) {
        warnings.push_back(fmt::format("{}: {} of {} normals look encoded as colors of 8 bits: then save "
                                       "normals[..., :3] / 255 * 2 - 1",
                                       name, encoded_8, surfaces));
        return;
    }
    if (away > surfaces / 2)
        warnings.push_back(fmt::format(
            "{}: {} of {} normals face away from the {}, so that there is no light there; normals point out of the "
            "surface, x to the right, y down, z away from the camera. Many renderers have y up and z towards the "
            "camera: then save normals[..., :3] * [1, -1, -1]",
            name, away, surfaces, data.position.empty() ? "camera" : "laser"));
    if (bad > 0)
        warnings.push_back(
            fmt::format("{}: {} normals on the surface are not of unit length, the first at pixel ({}, {}); the "
                        "light there is wrong by their length{}",
                        name, bad, first % data.normal.width, first / data.normal.width,
                        longer > 0 ? "; save normals[..., :3] / "
                                     "numpy.maximum(numpy.linalg.norm(normals[..., :3], axis=-1, keepdims=True), 1)"
                                   : ""));
}

std::vector<std::uint8_t> to_mask(const Plane &plane, const std::string &name, std::vector<std::string> &warnings) {
    check_values(plane, name, "refresh mask", no_limit);
    if (const std::string soft = image_io::told_soft(plane.values); !soft.empty())
        warnings.push_back(name + ": " + soft);
    std::vector<std::uint8_t> mask(plane.values.size());
    std::transform(plane.values.begin(), plane.values.end(), mask.begin(), [](float v) { return v != 0.0f ? 1 : 0; });
    return mask;
}

std::vector<std::uint8_t> to_ids(const Plane &plane, const std::string &name) {
    std::vector<std::uint8_t> ids(plane.values.size());
    for (std::size_t i = 0; i < ids.size(); ++i) {
        const float value = plane.values[i];
        if (!(value >= 0.0f && value <= 255.0f && value == std::floor(value)))
            throw InputError(fmt::format("{}: pixel ({}, {}) is {}; a material must be an integer from 0 to 255", name,
                                         i % plane.width, i / plane.width, value));
        ids[i] = static_cast<std::uint8_t>(value);
    }
    return ids;
}

} // namespace tools
