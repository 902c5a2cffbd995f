#include "depth.hpp"

#include "doe_files.hpp"
#include "errors.hpp"
#include "io/formats.hpp"
#include "io/npy_header.hpp"
#include "json.hpp"
#include "output.hpp"
#include "picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <map>
#include <utility>

namespace tools {

namespace {

constexpr std::uint64_t max_list_bytes = std::uint64_t{1} << 28;

bool ends_with(const std::string &text, const std::string &end) {
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

std::vector<double> read_npy_directions(const std::string &path) {
    const auto reader = image_io::open(path);
    const image_io::Info &info = reader->info();
    if (info.width != 2 || info.channels != 1 || info.frame_count != 1)
        throw InputError(fmt::format("{}: has {} x {} values, expected n rows of 2", path, info.height, info.width));
    std::vector<double> directions;
    reader->read_rows(0, [&](const float *row) {
        directions.insert(directions.end(), {double(row[0]), double(row[1])});
    });
    return directions;
}

/** A column of the table of dots. */
struct Column {
    const char *name;
    double (*value)(const ClspDepthDot &);
};

#define COLUMN(name, expression)                                                                                       \
    Column {                                                                                                           \
        name, [](const ClspDepthDot &d) -> double { return expression; }                                               \
    }

const Column columns[] = {
    COLUMN("x_px", d.x_px),
    COLUMN("y_px", d.y_px),
    COLUMN("x_sd_px", std::sqrt(d.covariance_px2[0])),
    COLUMN("y_sd_px", std::sqrt(d.covariance_px2[2])),
    COLUMN("xy_covariance_px2", d.covariance_px2[1]),
    COLUMN("centroid_x_px", d.centroid_x_px),
    COLUMN("centroid_y_px", d.centroid_y_px),
    COLUMN("amplitude_dn", d.amplitude_dn),
    COLUMN("background_dn", d.background_dn),
    COLUMN("sigma_px", std::pow(d.shape_px2[0] * d.shape_px2[2] - d.shape_px2[1] * d.shape_px2[1], 0.25)),
    COLUMN("misfit", d.misfit),
    COLUMN("depth_m", d.depth_m),
    COLUMN("depth_sd_m", d.depth_sd_m),
    COLUMN("position_x_m", d.position_m[0]),
    COLUMN("position_y_m", d.position_m[1]),
    COLUMN("epipolar_error_px", d.epipolar_error_px),
    COLUMN("epipolar_sd_px", d.epipolar_sd_px),
    COLUMN("confidence", d.confidence),
    COLUMN("dot_index", d.dot_index == CLSP_NO_DOT ? -1.0 : double(d.dot_index)),
    COLUMN("candidate_count", d.candidate_count),
    COLUMN("saturated", (d.flags & CLSP_DOT_SATURATED) != 0),
    COLUMN("border", (d.flags & CLSP_DOT_BORDER) != 0),
    COLUMN("merged", (d.flags & CLSP_DOT_MERGED) != 0),
    COLUMN("fixed_shape", (d.flags & CLSP_DOT_FIXED_SHAPE) != 0),
    COLUMN("reason", d.reason),
};

#undef COLUMN

/** The begin of a text that may be anything, for a message. */
std::string quotation(const std::string &text) {
    constexpr std::size_t most = 40;
    std::string result;
    for (const char c : text.substr(0, most))
        result += c >= ' ' && c <= '~' ? c : '?';
    return text.size() > most ? result + "..." : result;
}

/** The numbers of a line; one that is no number comes back as NaN, and ends it. */
std::vector<double> numbers_of(const std::string &line) {
    constexpr const char *separators = " ,;\t\r";
    std::vector<double> numbers;
    for (std::size_t at = line.find_first_not_of(separators); at != std::string::npos;) {
        const std::size_t end = std::min(line.find_first_of(separators, at), line.size());
        const bool plus = line[at] == '+' && end - at > 1 && line[at + 1] != '-'; // which from_chars refuses
        double value = 0.0;
        const auto result = std::from_chars(line.data() + at + plus, line.data() + end, value);
        if (result.ec != std::errc() || result.ptr != line.data() + end) {
            numbers.push_back(std::numeric_limits<double>::quiet_NaN());
            break;
        }
        numbers.push_back(value);
        at = line.find_first_not_of(separators, end);
    }
    return numbers;
}

double number_at(const Json &json, const std::string &path, const char *section, const char *name) {
    if (!json.is_object() || !json.contains(name))
        throw InputError(fmt::format("{}: {}.{} is missing", path, section, name));
    if (!json.at(name).is_number())
        throw InputError(fmt::format("{}: {}.{} is {}, expected a number", path, section, name, shown(json.at(name))));
    return json.at(name).get<double>();
}

} // namespace

DotDirections read_directions(const std::string &path) {
    if (ends_with(path, ".npy"))
        return {read_npy_directions(path)};
    if (ends_with(path, ".json")) {
        DotDirections directions{read_direction_cosines(path), true};
        if (directions.values.empty())
            throw InputError(fmt::format("{}: has no dots", path));
        return directions;
    }
    image_io::detail::InputFile file(path);
    if (file.size() > max_list_bytes)
        throw InputError(fmt::format("{}: {} bytes are too many for a list of dots", path, file.size()));
    std::string text(static_cast<std::size_t>(file.size()), '\0');
    file.read(text.data(), text.size());
    std::vector<double> directions;
    std::uint64_t line_number = 0;
    const std::string byte_order_mark = "\xef\xbb\xbf";
    for (std::size_t begin = text.rfind(byte_order_mark, 0) == 0 ? byte_order_mark.size() : 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string whole = text.substr(begin, end - begin), line = whole.substr(0, whole.find('#'));
        begin = end + 1;
        ++line_number;
        const std::vector<double> numbers = numbers_of(line);
        if (numbers.empty())
            continue;
        if (numbers.size() != 2 || !std::isfinite(numbers[0]) || !std::isfinite(numbers[1]))
            throw InputError(
                fmt::format("{}: line {} is \"{}\", expected two finite numbers (x and y of a dot's direction)", path,
                            line_number, quotation(line)));
        directions.insert(directions.end(), numbers.begin(), numbers.end());
    }
    if (directions.empty())
        throw InputError(fmt::format("{}: has no dots; write the direction of one in each line, as x and y", path));
    return {directions};
}

std::vector<double> projected(DotDirections directions, std::uint32_t projection, const std::string &path) {
    if (!directions.direction_cosines || projection == CLSP_PROJECTION_DIRECTION_COSINES)
        return std::move(directions.values);
    for (std::size_t k = 0; k < directions.values.size(); k += 2) {
        double &u = directions.values[k], &v = directions.values[k + 1];
        const double z = std::sqrt(1.0 - u * u - v * v); // the third direction cosine
        if (!(z > 0.0))
            throw InputError(
                fmt::format("{}: dot {} has the direction cosines ({}, {}), which are 90 degrees or more off the axis",
                            path, k / 2, u, v));
        u /= z;
        v /= z;
    }
    return std::move(directions.values);
}

std::string read_geometry(const std::string &path, ClspDepthDesc &desc) {
    const JsonDocument document = read_json(path);
    const Json &root = document.root();
    if (!root.is_object() || !root.contains("camera") || !root.contains("laser"))
        throw InputError(fmt::format("{}: has no \"camera\" and \"laser\"; see clspeckle depth --help", path));
    const Json &camera = root.at("camera"), &laser = root.at("laser");
    desc.fx_px = number_at(camera, path, "camera", "fx_px");
    desc.fy_px = number_at(camera, path, "camera", "fy_px");
    desc.cx_px = number_at(camera, path, "camera", "cx_px");
    desc.cy_px = number_at(camera, path, "camera", "cy_px");
    std::vector<std::string> there, missing;
    for (const auto &[section, member, name] : {std::tuple(&camera, "f_number", "camera.f_number"),
                                                std::tuple(&camera, "pixel_pitch_m", "camera.pixel_pitch_m"),
                                                std::tuple(&laser, "wavelength_m", "laser.wavelength_m")})
        (section->is_object() && section->contains(member) ? there : missing).push_back(name);
    std::string unknown;
    if (!there.empty() && !missing.empty())
        unknown = fmt::format("{}: has {}, but no {}: the deviations leave out what speckle adds to them. Add it, or "
                              "give --relative-diameter (0: without speckle)",
                              path, fmt::join(there, " and "), fmt::join(missing, " and no "));
    if (missing.empty()) {
        const double grain_m =
            number_at(laser, path, "laser", "wavelength_m") * number_at(camera, path, "camera", "f_number");
        if (!(grain_m > 0.0))
            throw InputError(fmt::format("{}: camera.f_number and laser.wavelength_m must be above 0", path));
        desc.relative_diameter = number_at(camera, path, "camera", "pixel_pitch_m") / grain_m;
    }
    const auto numbers = [&](const Json &json, const char *name, std::size_t count) {
        const bool good = json.is_array() && json.size() == count &&
                          std::all_of(json.begin(), json.end(), [](const Json &value) { return value.is_number(); });
        if (!good)
            throw InputError(fmt::format("{}: {} must be a list of {} numbers", path, name, count));
        return json.get<std::vector<double>>();
    };
    if (!laser.is_object() || !laser.contains("laser_from_geometry"))
        throw InputError(fmt::format("{}: laser.laser_from_geometry is missing", path));
    const auto pose = numbers(laser.at("laser_from_geometry"), "laser.laser_from_geometry", 12);
    std::copy(pose.begin(), pose.end(), desc.laser_from_camera);
    if (laser.contains("pattern") && laser.at("pattern").is_object() && laser.at("pattern").contains("projection")) {
        const Json &projection = laser.at("pattern").at("projection");
        if (projection == "direction_cosines")
            desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
        else if (projection != "tangent_plane")
            throw InputError(fmt::format("{}: laser.pattern.projection is {}, expected \"tangent_plane\" or "
                                         "\"direction_cosines\"",
                                         path, shown(projection)));
    }
    if (root.contains("depth_range_m")) {
        const auto range = numbers(root.at("depth_range_m"), "depth_range_m", 2);
        desc.near_m = range[0];
        desc.far_m = range[1];
    }
    return unknown;
}

void write_depth_csv(const std::string &path, const std::vector<DepthFrame> &frames) {
    std::string text = "frame,dot";
    for (const Column &column : columns)
        text += std::string(",") + column.name;
    text += ",reason_text\n";
    for (std::size_t f = 0; f < frames.size(); ++f)
        for (std::size_t i = 0; i < frames[f].result.dots.size(); ++i) {
            const ClspDepthDot &dot = frames[f].result.dots[i];
            text += fmt::format("{},{}", f, i);
            for (const Column &column : columns)
                text += fmt::format(",{}", column.value(dot));
            text += fmt::format(",{}\n", clspeckle::Depth::reason(dot.reason));
        }
    image_io::write_text(path, text);
}

void write_depth_npy(const std::string &path, const std::vector<DepthFrame> &frames) {
    std::string types = "('frame', '<f8')";
    for (const Column &column : columns)
        types += fmt::format(", ('{}', '<f8')", column.name);
    std::size_t count = 0;
    for (const DepthFrame &frame : frames)
        count += frame.result.dots.size();
    const std::string header = image_io::npy_header(fmt::format("[{}]", types), {count});
    image_io::AtomicFile file(path);
    file.write(header.data(), header.size());
    for (std::size_t f = 0; f < frames.size(); ++f)
        for (const ClspDepthDot &dot : frames[f].result.dots) {
            std::vector<double> row{double(f)};
            for (const Column &column : columns)
                row.push_back(column.value(dot));
            file.write(row.data(), row.size() * sizeof(double));
        }
    file.commit();
}

namespace {

constexpr int least_picture_side = 900; // of a small frame, by whole pixels

struct Enlarged {
    Picture picture;
    Box box;
    int scale; ///< Picture's pixels for each of the frame's.
    int right; ///< Where legends begin.
};

/** The frame in gray, as large as eyes need it, with axes in its pixels. */
Enlarged enlarged(const image_io::Plane &plane, int legend_width) {
    const PreviewScale scale = PreviewScale::of(plane.values);
    const int width = static_cast<int>(plane.width), height = static_cast<int>(plane.height);
    const int times = std::max(1, least_picture_side / std::max(width, height));
    const Box box = {Picture::left_margin, Picture::top_margin, width * times, height * times};
    Picture picture(box.x + box.width + legend_width, std::max(box.y + box.height, 400) + Picture::bottom_margin);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            // Three fifths of the range, so that marks show on dots.
            const float value = plane.values[static_cast<std::size_t>(y) * plane.width + static_cast<std::size_t>(x)];
            const auto gray = static_cast<std::uint8_t>(
                std::lround(160.0f * std::clamp((value - scale.black) / (scale.white - scale.black), 0.0f, 1.0f)));
            picture.fill({box.x + x * times, box.y + y * times, times, times}, {gray, gray, gray});
        }
    // Pixel centres are integers.
    picture.axes(box, {-0.5, width - 0.5, "x (px)"}, {-0.5, height - 0.5, "y (px)"});
    return {std::move(picture), box, times, box.x + box.width + 20};
}

/** Where a dot lies in the picture. */
std::pair<int, int> place_of(const Enlarged &e, const ClspDepthDot &dot) {
    return {e.box.x + static_cast<int>(std::lround((dot.x_px + 0.5) * e.scale)),
            e.box.y + static_cast<int>(std::lround((dot.y_px + 0.5) * e.scale))};
}

constexpr int mark_radius = 4;

void draw_mark(Picture &picture, int x, int y, bool placed, Color color) {
    if (placed) {
        picture.fill({x - mark_radius, y, 2 * mark_radius + 1, 1}, color);
        picture.fill({x, y - mark_radius, 1, 2 * mark_radius + 1}, color);
    } else {
        picture.outline({x - mark_radius, y - mark_radius, 2 * mark_radius + 1, 2 * mark_radius + 1}, color);
    }
}

/** Every detected dot: a cross where it has a depth, else a square in the color of the reason. */
Picture overlay(const image_io::Plane &plane, const DepthFrame &frame) {
    constexpr Color colors[] = {{80, 250, 123}, {255, 85, 85},   {255, 184, 108},
                                {80, 200, 255}, {255, 121, 198}, {241, 250, 140}};
    Enlarged e = enlarged(plane, 620);
    std::map<std::uint32_t, std::size_t> counts{{CLSP_DEPTH_REASON_PLACED, 0}};
    const auto color_of = [&](std::uint32_t reason) { return colors[reason % std::size(colors)]; };
    for (const ClspDepthDot &dot : frame.result.dots) {
        ++counts[dot.reason];
        const auto [x, y] = place_of(e, dot);
        draw_mark(e.picture, x, y, dot.reason == CLSP_DEPTH_REASON_PLACED, color_of(dot.reason));
    }
    int y = e.box.y;
    const auto line = [&](const std::string &text) {
        e.picture.text(e.right, y, text);
        y += Picture::line_height;
    };
    line(fmt::format("{} dots", frame.result.dots.size()));
    for (const auto &[reason, count] : counts) {
        const bool placed = reason == CLSP_DEPTH_REASON_PLACED;
        e.picture.fill({e.right, y - 2, 18, 18}, {60, 60, 60});
        draw_mark(e.picture, e.right + 9, y + 7, placed, color_of(reason));
        e.picture.text(e.right + 28, y, fmt::format("{} {}", count, clspeckle::Depth::reason(reason)));
        y += Picture::line_height;
    }
    return std::move(e.picture);
}

/** Every dot with a depth, in the depth's color. */
Picture depth_map(const image_io::Plane &plane, const DepthFrame &frame) {
    Enlarged e = enlarged(plane, Picture::bar_width);
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const ClspDepthDot &dot : frame.result.dots)
        if (dot.reason == CLSP_DEPTH_REASON_PLACED) {
            low = std::min(low, dot.depth_m);
            high = std::max(high, dot.depth_m);
        }
    if (!(low <= high)) {
        e.picture.text(e.right, e.box.y, "no depth");
        return std::move(e.picture);
    }
    if (high - low < 1e-3 * high) { // one colour would say nothing
        low -= 0.5e-3 * high;
        high += 0.5e-3 * high;
    }
    const auto place = [&](double depth_m) { return (depth_m - low) / (high - low); };
    const int radius = std::max(3, e.scale * 2);
    for (const ClspDepthDot &dot : frame.result.dots)
        if (dot.reason == CLSP_DEPTH_REASON_PLACED) {
            const auto [x, y] = place_of(e, dot);
            for (int v = -radius; v <= radius; ++v)
                for (int u = -radius; u <= radius; ++u)
                    if (u * u + v * v <= radius * radius)
                        e.picture.set(x + u, y + v, viridis(place(dot.depth_m)));
        }
    e.picture.bar({e.right, e.box.y, 24, e.box.height}, {low, high, "depth (m)"}, place);
    return std::move(e.picture);
}

} // namespace

void write_depth_pictures(const std::string &folder, std::uint64_t number, const image_io::Plane &plane,
                          const DepthFrame &frame) {
    std::vector<float> depth(plane.values.size(), std::numeric_limits<float>::quiet_NaN());
    for (const ClspDepthDot &dot : frame.result.dots) {
        const long x = std::lround(dot.x_px), y = std::lround(dot.y_px);
        if (dot.reason == CLSP_DEPTH_REASON_PLACED && x >= 0 && y >= 0 && x < long(plane.width) &&
            y < long(plane.height))
            depth[std::size_t(y) * plane.width + std::size_t(x)] = static_cast<float>(dot.depth_m);
    }
    const auto path = [&](const char *name) {
        return (std::filesystem::path(folder) / fmt::format("{}_{:06}", name, number)).string();
    };
    overlay(plane, frame).write(path("overlay") + ".png");
    depth_map(plane, frame).write(path("depth") + ".png");
    image_io::write(path("depth") + ".npy", image_io::format_named("NPY"), plane.width, plane.height, depth.data());
}

} // namespace tools
