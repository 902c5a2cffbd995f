#include "input.hpp"

#include "errors.hpp"
#include "files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

namespace tools {

using image_io::Plane;
using image_io::Reader;
using image_io::VectorPlane;

namespace {

constexpr double no_limit = std::numeric_limits<double>::infinity();

/** All frames of one or several files, in order. */
class FileSeries {
  public:
    FileSeries() = default;
    FileSeries(std::vector<std::string> paths, image_io::ReadOptions options)
        : paths_(std::move(paths)), options_(std::move(options)) {
        for (const std::string &path : paths_) {
            const auto reader = image_io::open(path, options_);
            if (first_frames_.empty()) {
                width = reader->info().width;
                height = reader->info().height;
            }
            check_size(*reader);
            first_frames_.push_back(frame_count);
            frame_count += reader->info().frame_count;
        }
    }

    bool empty() const { return paths_.empty(); }
    const std::string &first_path() const { return paths_.front(); }
    /** Name of a frame for messages. */
    std::string name(std::uint64_t frame) const {
        const auto [file, inside] = locate(frame);
        const std::uint64_t end = file + 1 < first_frames_.size() ? first_frames_[file + 1] : frame_count;
        return end - first_frames_[file] > 1 ? fmt::format("{}[{}]", paths_[file], inside) : paths_[file];
    }
    Plane gray(std::uint64_t frame, std::vector<std::string> &warnings) {
        return image_io::read_gray(reader(frame), locate(frame).second, warnings);
    }
    VectorPlane vectors(std::uint64_t frame) { return image_io::read_vectors(reader(frame), locate(frame).second); }

    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint64_t frame_count = 0;

  private:
    std::pair<std::size_t, std::uint64_t> locate(std::uint64_t frame) const {
        const auto after = std::upper_bound(first_frames_.begin(), first_frames_.end(), frame);
        const auto file = static_cast<std::size_t>(after - first_frames_.begin()) - 1;
        return {file, frame - first_frames_[file]};
    }
    void check_size(const Reader &reader) const {
        if (reader.info().width != width || reader.info().height != height)
            throw InputError(fmt::format("{}: the image has {} x {} pixels, the first one ({}) has {} x {}",
                                         reader.path(), reader.info().width, reader.info().height, paths_.front(),
                                         width, height));
    }
    Reader &reader(std::uint64_t frame) {
        const std::size_t file = locate(frame).first;
        if (!reader_ || open_file_ != file) {
            reader_ = image_io::open(paths_[file], options_);
            open_file_ = file;
            check_size(*reader_);
        }
        return *reader_;
    }

    std::vector<std::string> paths_;
    image_io::ReadOptions options_;
    std::vector<std::uint64_t> first_frames_;
    std::unique_ptr<Reader> reader_;
    std::size_t open_file_ = 0;
};

void check_albedo(const Plane &plane, const std::string &name, std::vector<std::string> &warnings) {
    check_values(plane, name, "albedo", no_limit);
    const auto above = std::count_if(plane.values.begin(), plane.values.end(), [](float v) { return v > 1.0f; });
    if (above > 0)
        warnings.push_back(fmt::format("{}: {} pixels have an albedo above 1", name, above));
}

/** Unit normals matter where there is a surface: a longer one would brighten it. */
void check_normals(const FrameData &data, const std::string &name, std::vector<std::string> &warnings) {
    const std::size_t count = data.normal.values.size() / 3;
    std::size_t bad = 0;
    std::size_t first = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const bool surface = data.position.empty() ? data.depth.values[i] > 0 && std::isfinite(data.depth.values[i])
                                                   : std::isfinite(data.position.values[3 * i + 2]);
        const float *n = &data.normal.values[3 * i];
        const double length = std::sqrt(double{n[0]} * n[0] + double{n[1]} * n[1] + double{n[2]} * n[2]);
        // Written so that NaN counts as bad. Half precision and 8-bit steps stay well within 2 %.
        if (surface && !(std::abs(length - 1) < 0.02)) {
            if (bad++ == 0)
                first = i;
        }
    }
    if (bad > 0)
        warnings.push_back(
            fmt::format("{}: {} normals on the surface are not of unit length, the first at pixel ({}, {}); the "
                        "light there is wrong by their length",
                        name, bad, first % data.normal.width, first / data.normal.width));
}

std::vector<std::uint8_t> to_mask(const Plane &plane, const std::string &name) {
    check_values(plane, name, "refresh mask", no_limit);
    std::vector<std::uint8_t> mask(plane.values.size());
    std::transform(plane.values.begin(), plane.values.end(), mask.begin(), [](float v) { return v != 0.0f ? 1 : 0; });
    return mask;
}

/** The planes that are named one by one; each is a still or has as many frames as the input. */
class Planes {
  public:
    explicit Planes(const InputPaths &paths) {
        add("depth", paths.depth);
        add("position", paths.position);
        add("normal", paths.normal);
        add("albedo", paths.albedo);
        add("visibility", paths.visibility);
        add("refresh-mask", paths.refresh_mask);
    }

    bool empty() const { return planes_.empty(); }
    bool has(const std::string &name) const { return planes_.count(name) > 0; }
    std::uint64_t frame_count() const {
        std::uint64_t count = 1;
        for (const auto &[name, series] : planes_)
            count = std::max(count, series.frame_count);
        return count;
    }
    const FileSeries &first() const { return planes_.begin()->second; }
    const FileSeries &at(const std::string &name) const { return planes_.at(name); }

    /** Refuses planes of another size or with another number of frames. */
    void check(std::uint32_t width, std::uint32_t height, std::uint64_t frames, const std::string &reference) const {
        for (const auto &[name, series] : planes_) {
            if (series.width != width || series.height != height)
                throw InputError(fmt::format("{}: the --{} image has {} x {} pixels, {} has {} x {}",
                                             series.first_path(), name, series.width, series.height, reference, width,
                                             height));
            if (series.frame_count != 1 && series.frame_count != frames)
                throw InputError(fmt::format("{}: the --{} image has {} frames; 1 or {} are needed",
                                             series.first_path(), name, series.frame_count, frames));
        }
    }

    /** Puts what there is into a frame, over what is there. */
    void read(std::uint64_t frame, FrameData &data, std::vector<std::string> &warnings) {
        for (auto &[name, series] : planes_) {
            const std::uint64_t index = series.frame_count == 1 ? 0 : frame;
            const std::string file = series.name(index);
            if (name == "position" || name == "normal") {
                (name == "position" ? data.position : data.normal) = series.vectors(index);
                continue;
            }
            Plane plane = series.gray(index, warnings);
            if (name == "depth") {
                if (plane.full_scale > 0)
                    throw InputError(
                        fmt::format("{}: depth must be floating-point metres, not {}", file, plane.sample));
                data.depth = std::move(plane);
                continue;
            }
            plane.normalize();
            if (name == "albedo") {
                check_albedo(plane, file, warnings);
                data.albedo = std::move(plane);
            } else if (name == "visibility") {
                check_values(plane, file, "visibility", 1.0);
                data.visibility = std::move(plane);
            } else {
                data.refresh = to_mask(plane, file);
            }
        }
        if (has("normal"))
            check_normals(data, planes_.at("normal").name(0), warnings);
    }

  private:
    void add(const char *name, const std::string &path) {
        if (!path.empty())
            planes_.emplace(name, FileSeries({path}, {}));
    }
    std::map<std::string, FileSeries> planes_;
};

class IdealInput final : public Input {
  public:
    IdealInput(const std::vector<std::string> &names, const InputPaths &paths, const Config &config)
        : series_(names, {config.text("render.channel")}), planes_(paths),
          scale_(config.number("render.irradiance_scale")) {
        kind = names.size() > 1 ? fmt::format("{} ideal images", names.size()) : "ideal image";
        width = series_.width;
        height = series_.height;
        frame_count = series_.frame_count;
        first_name = names.front();
        planes_.check(width, height, frame_count, first_name);
    }

    FrameData read(std::uint64_t frame, std::vector<std::string> &warnings) override {
        FrameData data;
        data.name = series_.name(frame);
        data.irradiance = series_.gray(frame, warnings);
        check_values(data.irradiance, data.name, "ideal image", no_limit);
        data.irradiance.normalize();
        if (scale_ != 1.0) {
            for (float &value : data.irradiance.values)
                value = static_cast<float>(value * scale_);
            check_values(data.irradiance, data.name, "scaled ideal image", no_limit);
        }
        planes_.read(frame, data, warnings);
        return data;
    }

  private:
    FileSeries series_;
    Planes planes_;
    double scale_;
};

bool is_scene(const std::string &path) {
    if (!image_io::is_exr(path))
        return false;
    const image_io::ExrFile file(path);
    return file.has("Z") || file.has("P.X") || file.has("P.Y") || file.has("P.Z");
}

/** G-buffers, one EXR file per frame. */
class ExrSceneInput final : public Input {
  public:
    ExrSceneInput(std::vector<std::string> names, const InputPaths &paths) : files_(std::move(names)), planes_(paths) {
        scene = true;
        kind = files_.size() > 1 ? fmt::format("scene, {} G-buffer files", files_.size()) : "scene, one G-buffer file";
        const image_io::ExrFile first(files_.front());
        width = first.width();
        height = first.height();
        frame_count = files_.size();
        first_name = files_.front();
        // Before the first frame is rendered, not in the middle of the run.
        for (const std::string &path : files_)
            check_header(image_io::ExrFile(path));
        planes_.check(width, height, frame_count, first_name);
    }

    FrameData read(std::uint64_t frame, std::vector<std::string> &warnings) override {
        const image_io::ExrFile file(files_[frame]);
        check_header(file);
        FrameData data;
        data.name = file.path();
        // Positions need no camera model, so they are preferred where a file has both.
        const bool position = whole(file, "P");
        const bool normal = whole(file, "N");
        struct Target {
            const char *channel;
            Plane *plane;
        };
        Plane refresh;
        const Target scalars[] = {{"Z", position ? nullptr : &data.depth},
                                  {"albedo", &data.albedo},
                                  {"visibility", &data.visibility},
                                  {"refresh", &refresh}};
        std::vector<std::string> names;
        const auto add_vector = [&](const std::string &prefix, VectorPlane &plane) {
            for (const char *axis : {".X", ".Y", ".Z"})
                names.push_back(prefix + axis);
            plane.width = width;
            plane.height = height;
            plane.values.reserve(std::size_t{3} * width * height);
        };
        if (position)
            add_vector("P", data.position);
        if (normal)
            add_vector("N", data.normal);
        std::vector<Plane *> planes;
        for (const Target &target : scalars) {
            if (!target.plane || !file.has(target.channel))
                continue;
            names.emplace_back(target.channel);
            target.plane->width = width;
            target.plane->height = height;
            target.plane->values.reserve(std::size_t{width} * height);
            planes.push_back(target.plane);
        }
        const char *depth_channel = position ? "P.Z" : "Z";
        if (file.sample(depth_channel) == "float16")
            warnings.push_back(
                fmt::format("{}: channel {} is half precision: steps of 1 mm at 1 m move dots; store it as float",
                            file.path(), depth_channel));
        file.read_rows(names, [&](const float *row) {
            for (std::uint32_t x = 0; x < width; ++x) {
                for (VectorPlane *plane : {position ? &data.position : nullptr, normal ? &data.normal : nullptr}) {
                    if (plane) {
                        plane->values.insert(plane->values.end(), row, row + 3);
                        row += 3;
                    }
                }
                for (Plane *plane : planes)
                    plane->values.push_back(*row++);
            }
        });
        if (!data.albedo.empty())
            check_albedo(data.albedo, file.path(), warnings);
        if (!data.visibility.empty())
            check_values(data.visibility, file.path(), "visibility", 1.0);
        if (!refresh.empty())
            data.refresh = to_mask(refresh, file.path());
        planes_.read(frame, data, warnings);
        if (normal && !planes_.has("normal"))
            check_normals(data, file.path(), warnings);
        return data;
    }

  private:
    void check_header(const image_io::ExrFile &file) const {
        if (file.width() != width || file.height() != height)
            throw InputError(fmt::format("{}: the image has {} x {} pixels, the first one ({}) has {} x {}",
                                         file.path(), file.width(), file.height(), files_.front(), width, height));
        whole(file, "N");
        if (!whole(file, "P") && !file.has("Z"))
            throw InputError(fmt::format(
                "{}: a scene needs the channel Z (depth in m) or P.X, P.Y, P.Z (position in m)", file.path()));
    }
    /** True if all three channels of a vector are there, false if none is. */
    static bool whole(const image_io::ExrFile &file, const std::string &prefix) {
        const int count = file.has(prefix + ".X") + file.has(prefix + ".Y") + file.has(prefix + ".Z");
        if (count != 0 && count != 3)
            throw InputError(fmt::format("{}: has only some of the channels {}.X, {}.Y and {}.Z", file.path(), prefix,
                                         prefix, prefix));
        return count == 3;
    }

    std::vector<std::string> files_;
    Planes planes_;
};

/** A scene of planes that are named one by one. */
class PlaneSceneInput final : public Input {
  public:
    explicit PlaneSceneInput(const InputPaths &paths) : planes_(paths) {
        const char *geometry = paths.position.empty() ? "depth" : "position";
        const FileSeries &series = planes_.at(geometry);
        scene = true;
        kind = fmt::format("scene, planes from --{}", geometry);
        width = series.width;
        height = series.height;
        frame_count = planes_.frame_count();
        first_name = series.first_path();
        planes_.check(width, height, frame_count, first_name);
    }

    FrameData read(std::uint64_t frame, std::vector<std::string> &warnings) override {
        FrameData data;
        data.name = first_name;
        planes_.read(frame, data, warnings);
        return data;
    }

  private:
    Planes planes_;
};

template <typename T> T get(const Json &object, const char *key, const std::string &path, const char *wanted) {
    try {
        return object.at(key).get<T>();
    } catch (const Json::exception &) {
        throw InputError(fmt::format("{}: \"{}\" must be {}", path, key, wanted));
    }
}

/** Takes over what a sequence.json says and returns its frame files. */
std::vector<std::string> load_sequence(const std::string &path, Config &config) {
    const Json root = read_json(path);
    if (!root.is_object() || root.value("format", Json()) != "clspeckle-gbuffer-sequence")
        throw InputError(
            fmt::format("{}: is not a scene description (\"format\" is not \"clspeckle-gbuffer-sequence\"); a "
                        "configuration is given with --config",
                        path));
    if (root.value("version", Json()) != 1)
        throw InputError(fmt::format("{}: version {} of the format is not known, only 1", path,
                                     root.value("version", Json()).dump()));
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    const auto names = get<std::vector<std::string>>(root, "frames", path, "a list of file names");
    if (names.empty())
        throw InputError(path + ": \"frames\" is empty");
    std::vector<std::string> files;
    for (const std::string &name : names)
        files.push_back((folder / name).string());

    // Keys of the file and the options they set; any other key is refused, since a default in its place would pass
    // unnoticed.
    using Keys = std::vector<std::pair<std::string, std::string>>;
    const auto take = [&](const Json &parent, const std::string &name, const Keys &keys) {
        const Json object = parent.value(name, Json::object());
        if (!object.is_object())
            throw InputError(fmt::format("{}: \"{}\" must be an object", path, name));
        for (const auto &[key, value] : object.items()) {
            const auto known =
                std::find_if(keys.begin(), keys.end(), [&k = key](const auto &pair) { return pair.first == k; });
            if (known == keys.end()) {
                std::vector<std::string> known_keys;
                for (const auto &pair : keys)
                    known_keys.push_back(pair.first);
                throw InputError(fmt::format("{}: unknown key \"{}\" in \"{}\"; the nearest known key is \"{}\"", path,
                                             key, name, nearest(key, known_keys)));
            }
            if (known->second.empty())
                continue;
            Json setting = value;
            if (known->second == "pattern.image" && value.is_string())
                setting = (folder / value.get<std::string>()).string();
            config.set(option(known->second), setting, Layer::sequence, fmt::format("{}: \"{}\"", path, key));
        }
        return object;
    };
    take(root, "camera",
         {{"fx_px", "camera.fx_px"},
          {"fy_px", "camera.fy_px"},
          {"cx_px", "camera.cx_px"},
          {"cy_px", "camera.cy_px"},
          {"depth_kind", "camera.depth_kind"},
          {"f_number", "aperture.f_number"},
          {"pixel_pitch_m", "aperture.pixel_pitch_m"}});
    const Json laser = take(root, "laser",
                            {{"wavelength_m", "aperture.wavelength_m"},
                             {"laser_from_geometry", "pattern.laser_from_geometry"},
                             {"pattern", ""}});
    take(laser, "pattern",
         {{"file", "pattern.image"},
          {"half_extent_x", "pattern.half_extent_x"},
          {"half_extent_y", "pattern.half_extent_y"},
          {"projection", "pattern.projection"},
          {"quantity", "pattern.quantity"},
          {"power_scale", "pattern.power_scale"}});
    // A sequence may be kept packed: say so rather than "no such file".
    std::error_code ignored;
    if (!std::filesystem::exists(files.front(), ignored))
        for (const auto &entry : std::filesystem::directory_iterator(folder.empty() ? "." : folder, ignored))
            if (entry.path().filename().string().find(".tar") != std::string::npos)
                throw InputError(fmt::format("{}: does not exist; unpack the frames first: tar -xf {} -C {}",
                                             files.front(), entry.path().string(),
                                             folder.empty() ? "." : folder.string()));
    return files;
}

} // namespace

void check_values(const Plane &plane, const std::string &path, const char *what, double high) {
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
    throw InputError(fmt::format("{}: pixel ({}, {}) is {}; the {} must be {} ({} such pixel{} in all)", path,
                                 first % plane.width, first / plane.width, plane.values[first], what, range, bad,
                                 bad == 1 ? "" : "s"));
}

namespace {

std::unique_ptr<Input> open_kind(const InputPaths &paths, std::vector<std::string> &files, Config &config) {
    if (paths.inputs.empty()) {
        if (paths.depth.empty() && paths.position.empty())
            throw InputError("nothing to render: give an ideal image, a scene, or --depth or --position");
        if (!paths.depth.empty() && !paths.position.empty())
            throw InputError("give either --depth or --position, not both");
        return std::make_unique<PlaneSceneInput>(paths);
    }
    if (!paths.depth.empty() || !paths.position.empty())
        throw InputError("give either an input file or --depth or --position, not both");
    for (const std::string &input : paths.inputs)
        for (std::string &file : expand(input, Purpose::ideal_images))
            files.push_back(std::move(file));
    if (std::filesystem::path(files.front()).extension() == ".json") {
        if (files.size() > 1)
            throw InputError(
                fmt::format("{}: one scene description is rendered at a time, {} are given", files[1], files.size()));
        files = load_sequence(files.front(), config);
        if (!is_scene(files.front()))
            throw InputError(fmt::format("{}: is not an EXR file with the channel Z or P.X, P.Y, P.Z", files.front()));
    }
    if (is_scene(files.front()))
        return std::make_unique<ExrSceneInput>(files, paths);
    if (paths.any_plane())
        throw InputError(
            fmt::format("{}: is an ideal image; --normal, --albedo and --visibility belong to a scene", files.front()));
    return std::make_unique<IdealInput>(files, paths, config);
}

} // namespace

std::unique_ptr<Input> open_input(const InputPaths &paths, Config &config) {
    std::vector<std::string> files;
    std::unique_ptr<Input> input = open_kind(paths, files, config);
    for (const std::string &plane :
         {paths.depth, paths.position, paths.normal, paths.albedo, paths.visibility, paths.refresh_mask})
        if (!plane.empty())
            files.push_back(plane);
    files.insert(files.end(), paths.inputs.begin(), paths.inputs.end());
    input->files = std::move(files);
    return input;
}

} // namespace tools
