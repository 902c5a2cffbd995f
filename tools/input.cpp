#include "input.hpp"

#include "errors.hpp"
#include "files.hpp"
#include "io/channels.hpp"
#include "io/inside.hpp"
#include "io/series.hpp"
#include "json.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

namespace tools {

using image_io::Plane;
using image_io::Reader;
using image_io::Role;
using image_io::VectorPlane;

namespace {

constexpr double no_limit = std::numeric_limits<double>::infinity();

bool is_real(const std::string &sample) {
    return sample.rfind("float", 0) == 0 || sample == "rgbe";
}

/** Of whole numbers the unit must be told. @param automatic it is not. */
void check_unit(const std::string &sample, bool automatic, const char *what, const std::string &name) {
    if (automatic && !is_real(sample))
        throw InputError(fmt::format("{}: {} must be floating-point metres, not {}, whose unit is not known; "
                                     "--depth-scale 0.001 takes it as millimetres",
                                     name, what, sample));
}

/** All frames of one or several files, in order. */
class FileSeries {
  public:
    FileSeries() = default;
    FileSeries(std::vector<std::string> paths, image_io::ReadRequest request, image_io::Encoding encoding)
        : paths_(std::move(paths)), request_(std::move(request)), encoding_(encoding) {
        for (const std::string &path : paths_) {
            const auto reader = image_io::open(path, request_);
            if (first_frames_.empty()) {
                width = reader->info().width;
                height = reader->info().height;
                sample_ = reader->info().sample;
                if (!reader->info().warnings.empty())
                    but = ". But " + reader->info().warnings.front();
            }
            check_size(*reader);
            // Whole numbers are parts of their type's full scale: of two types they would be of two scales.
            if (reader->info().sample != sample_)
                throw InputError(fmt::format("{}: has samples of {}, the first one ({}) of {}; frames of one series "
                                             "have one type: convert them alike, or name those of one type",
                                             path, reader->info().sample, paths_.front(), sample_));
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
        // Colors may make a picture or an albedo, but no number.
        const bool picture = request_.role == Role::image || request_.role == Role::albedo;
        return image_io::read_gray(reader(frame), locate(frame).second, warnings,
                                   picture ? image_io::Colors::mean : image_io::Colors::refused,
                                   picture ? encoding_ : image_io::Encoding::as_stored);
    }
    VectorPlane normals(std::uint64_t frame) { return image_io::read_vectors(reader(frame), locate(frame).second); }
    /** @param config tells the unit of whole numbers. */
    VectorPlane positions(std::uint64_t frame, const Config &config) {
        check_unit(sample_, config.is_word("camera.depth_scale"), "position", paths_[locate(frame).first]);
        return image_io::read_vectors(reader(frame), locate(frame).second, true);
    }

    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint64_t frame_count = 0;
    std::string but; ///< What an error about the size adds: how else the first file may be meant.

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
            reader_ = image_io::open(paths_[file], request_);
            open_file_ = file;
            check_size(*reader_);
        }
        return *reader_;
    }

    std::vector<std::string> paths_;
    image_io::ReadRequest request_;
    std::string sample_;
    image_io::Encoding encoding_ = image_io::Encoding::as_stored;
    std::vector<std::uint64_t> first_frames_;
    std::unique_ptr<Reader> reader_;
    std::size_t open_file_ = 0;
};

void check_albedo(Plane &plane, const std::string &name, LightChoice choice, std::vector<std::string> &warnings) {
    check_light(plane, name, "albedo", choice, warnings);
    const auto above = std::count_if(plane.values.begin(), plane.values.end(), [](float v) { return v > 1.0f; });
    const bool codes = std::all_of(plane.values.begin(), plane.values.end(),
                                   [](float v) { return v <= 255.0f && v == std::floor(v); });
    if (above > 0)
        warnings.push_back(fmt::format("{}: {} pixels have an albedo above 1, so that more light leaves the surface "
                                       "than falls on it; save {}",
                                       name, above,
                                       codes ? "albedo / 255, if these are codes of 8 bits"
                                             : "numpy.minimum(albedo, 1), which cuts them at 1"));
}

/** Renderers write the largest half or 1e10 where they see nothing, whatever their unit is. */
constexpr float largest_half = 65504.0f, renderers_far = 1e10f;
constexpr float no_surface_m = largest_half;
/** Far beyond what a laser lights up; millimetres that are taken as metres come out above it. */
constexpr double far_m = 100.0;

/** Depths in metres. What is no surface is infinitely far. @param scale metres per unit, or auto. */
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
                                       "--depth-scale 0.001 takes the numbers as millimetres",
                                       name, middle));
}

void scale_position(VectorPlane &plane, const Config &config) {
    if (!config.is_word("camera.depth_scale"))
        for (float &value : plane.values)
            value = static_cast<float>(value * config.number("camera.depth_scale"));
}

/** Whether a pixel of positions has one: renderers write 0 or 1e10 where they see nothing. */
bool is_position(const float *p) {
    const auto near = [](float v) { return std::abs(v) < no_surface_m; }; // false for NaN
    return near(p[0]) && near(p[1]) && near(p[2]) && (p[0] != 0 || p[1] != 0 || p[2] != 0);
}

/** Whether a normal's numbers of -1 to 1 were made colors of 0 to top. */
bool looks_encoded(const float *n, double top) {
    const double x = 2.0 * n[0] / top - 1, y = 2.0 * n[1] / top - 1, z = 2.0 * n[2] / top - 1;
    return std::abs(std::sqrt(x * x + y * y + z * z) - 1) < 0.02 && n[0] >= 0 && n[1] >= 0 && n[2] >= 0;
}

/** Unit normals matter where there is a surface: a longer one would brighten it. Those of what a camera sees face it;
 * where positions are, the camera may be anywhere, and those that are lit face the laser.
 */
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

/** Material ids are numbers, whatever type a file stores them in. */
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

/** The planes that are named one by one; each is a still or has as many frames as the input. */
class Planes {
  public:
    Planes(const InputPaths &paths, const Config &config)
        : config_(config), choice_(light_choice(config)), encoding_(encoding_of(config)) {
        add("depth", paths.depth, Role::depth);
        add("position", paths.position, Role::position);
        add("normal", paths.normal, Role::normal);
        add("albedo", paths.albedo, Role::albedo);
        add("visibility", paths.visibility, Role::visibility);
        add("refresh-mask", paths.refresh_mask, Role::mask);
        add("material", paths.material, Role::material);
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
                throw InputError(fmt::format("{}: the --{} image has {} x {} pixels, {} has {} x {}{}",
                                             series.first_path(), name, series.width, series.height, reference, width,
                                             height, series.but));
            if (series.frame_count != 1 && series.frame_count != frames)
                throw InputError(fmt::format(
                    "{}: the --{} image has {} frames, {}; name one of them behind the file's name, for example {}",
                    series.first_path(), name, series.frame_count,
                    frames == 1 ? "one is needed" : fmt::format("1 or {} are needed", frames),
                    image_io::page_name(series.first_path(), 0)));
        }
    }

    /** Puts what there is into a frame, over what is there. */
    void read(std::uint64_t frame, FrameData &data, std::vector<std::string> &warnings) {
        for (auto &[name, series] : planes_) {
            const std::uint64_t index = series.frame_count == 1 ? 0 : frame;
            const std::string file = series.name(index);
            if (name == "position") {
                data.position = series.positions(index, config_);
                scale_position(data.position, config_);
                continue;
            }
            if (name == "normal") {
                data.normal = series.normals(index);
                continue;
            }
            Plane plane = series.gray(index, warnings);
            if (name == "depth") {
                settle_depth(plane, file, config_, warnings);
                data.depth = std::move(plane);
                continue;
            }
            if (name == "material") {
                data.material = to_ids(plane, file);
                continue;
            }
            if (name == "refresh-mask") {
                data.refresh = to_mask(plane, file, warnings);
                continue;
            }
            const std::string advice = check_full_scale(plane, file, series.first_path(), warnings);
            plane.normalize();
            if (name == "albedo") {
                check_albedo(plane, file, choice_, warnings);
                data.albedo = std::move(plane);
            } else {
                check_values(plane, file, "visibility", 1.0,
                             advice.empty() ? "" : advice + " divides its whole numbers");
                data.visibility = std::move(plane);
            }
        }
        if (has("normal"))
            check_normals(data, planes_.at("normal").name(0), config_, warnings);
    }

  private:
    void add(const char *name, const std::string &path, Role role) {
        image_io::ReadRequest request;
        request.role = role;
        if (!path.empty())
            planes_.emplace(name, FileSeries({path}, request, encoding_));
    }
    const Config &config_;
    LightChoice choice_;
    image_io::Encoding encoding_;
    std::map<std::string, FileSeries> planes_;
};

class IdealInput final : public Input {
  public:
    IdealInput(const std::vector<std::string> &names, const InputPaths &paths, const Config &config, bool has_depth)
        : series_(names, request_of(config.text("render.channel"), paths.raw), encoding_of(config)),
          planes_(paths, config), scale_(config.number("render.irradiance_scale")),
          full_scale_(config.is_word("render.full_scale") ? 0 : config.number("render.full_scale")),
          choice_(light_choice(config)), has_depth_(has_depth) {
        kind = names.size() > 1 ? fmt::format("{} ideal images", names.size()) : "ideal image";
        width = series_.width;
        height = series_.height;
        frame_count = series_.frame_count;
        first_name = names.front();
        planes_.check(width, height, frame_count, first_name);
    }

    FrameData read(std::uint64_t frame, std::vector<std::string> &warnings) override {
        FrameData data;
        if (has_depth_ && frame == 0)
            warnings.push_back(fmt::format("{0}: holds a picture and a depth, and is taken as an ideal image; name it "
                                           "with --depth {0} to make a scene of it, which needs a --pattern",
                                           series_.first_path()));
        data.name = series_.name(frame);
        data.irradiance = series_.gray(frame, warnings);
        check_light(data.irradiance, data.name, "ideal image", choice_, warnings);
        if (frame == 0 && full_scale_ <= 0)
            check_full_scale(data.irradiance, data.name, "", warnings);
        if (full_scale_ > 0) {
            const double named = data.irradiance.full_scale;
            if (data.irradiance.full_scale_given && named != full_scale_)
                throw InputError(fmt::format("{}: two numbers are named that mean 1, full_scale={} behind the file and "
                                             "--full-scale {}; name one",
                                             data.name, named, full_scale_));
            data.irradiance.full_scale = full_scale_;
        }
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
    double full_scale_;
    LightChoice choice_;
    bool has_depth_;
};

constexpr const char *scene_channels[] = {"Z", "P.X",    "P.Y",        "P.Z",     "N.X",      "N.Y",      "N.Z",
                                          "A", "albedo", "visibility", "refresh", "material", "motion.X", "motion.Y"};

/** What a file with named channels is as an input. */
enum class Holds { image, scene, picture_with_depth, picture_with_depth_layer };

Holds held(const std::string &name) {
    const auto [path, channel] = image_io::split_name(name);
    const auto file = channel.empty() ? image_io::open_channels(path) : nullptr;
    const auto any = [&](std::initializer_list<const char *> channels) {
        return std::any_of(channels.begin(), channels.end(), [&](const char *one) { return file->has(one); });
    };
    if (!file)
        return Holds::image;
    if (!any({"Z", "P.X", "P.Y", "P.Z"}))
        return image_io::has_picture(file->channels()) && image_io::has_depth(file->channels())
                   ? Holds::picture_with_depth_layer
                   : Holds::image;
    // Renderers add a depth to their pictures; what else a scene has no picture has.
    const bool scene = any({"P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "albedo", "visibility", "refresh", "material",
                            "motion.X", "motion.Y"});
    return !scene && image_io::has_picture(file->channels()) ? Holds::picture_with_depth : Holds::scene;
}

/** An object that moves as a whole. */
struct MovingObject {
    std::vector<std::size_t> materials;
    std::vector<std::vector<double>> geometry_from_object; ///< [R|t] in each frame.
};

/** What a sequence.json says beside the configuration. */
struct Sequence {
    std::vector<std::string> files;
    std::vector<ClspMaterial> materials;
    std::vector<MovingObject> objects;
    bool is_sequence = false;
};

/** X_previous = P C^-1 X, of two rigid poses [R|t]. */
std::vector<double> previous_from_current(const std::vector<double> &previous, const std::vector<double> &current) {
    std::vector<double> result(12);
    for (std::size_t i = 0; i < 3; ++i) {
        result[4 * i + 3] = previous[4 * i + 3];
        for (std::size_t j = 0; j < 3; ++j) {
            double &r = result[4 * i + j];
            for (std::size_t k = 0; k < 3; ++k)
                r += previous[4 * i + k] * current[4 * j + k];
            result[4 * i + 3] -= r * current[4 * j + 3];
        }
    }
    return result;
}

/** A file with the named channels of a scene. */
std::unique_ptr<image_io::ChannelFile> open_scene(const std::string &path) {
    auto file = image_io::open_channels(path);
    if (!file)
        throw InputError(fmt::format("{}: is not a file with named channels ({})", path,
                                     image_io::listed("or", &image_io::Format::has_named_channels)));
    return file;
}

/** G-buffers, one file with named channels per frame. */
class ChannelSceneInput final : public Input {
  public:
    ChannelSceneInput(Sequence sequence, const InputPaths &paths, const Config &config)
        : config_(config), files_(std::move(sequence.files)), planes_(paths, config),
          objects_(std::move(sequence.objects)) {
        materials = std::move(sequence.materials);
        rigid_ = sequence.is_sequence;
        scene = true;
        kind = files_.size() > 1 ? fmt::format("scene, {} G-buffer files", files_.size()) : "scene, one G-buffer file";
        const auto opened = open_scene(files_.front());
        const image_io::ChannelFile &first = *opened;
        for (const std::string &channel : first.channels())
            if (image_name.empty() &&
                std::find(std::begin(scene_channels), std::end(scene_channels), channel) == std::end(scene_channels))
                image_name = files_.front() + ":" + channel;
        width = first.width();
        height = first.height();
        frame_count = files_.size();
        first_name = files_.front();
        // Before the first frame is rendered, not in the middle of the run.
        for (const std::string &path : files_)
            check_header(*open_scene(path));
        planes_.check(width, height, frame_count, first_name);
        has_motion_ = first.has("motion.X") && first.has("motion.Y");
        moves = rigid_ || has_motion_;
    }

    FrameData read(std::uint64_t frame, std::vector<std::string> &warnings) override {
        const auto opened = open_scene(files_[frame]);
        const image_io::ChannelFile &file = *opened;
        check_header(file);
        FrameData data;
        data.name = file.path();
        if (rigid_ && !has_motion_ && frame > 0)
            data.previous_from_current = transforms(frame);
        // Positions need no camera model, so they are preferred where a file has both.
        const bool position = whole(file, "P");
        const bool normal = whole(file, "N");
        struct Target {
            const char *channel;
            Plane *plane;
        };
        Plane refresh, material, motion_x, motion_y;
        const Target scalars[] = {{"Z", position ? nullptr : &data.depth},
                                  {"albedo", &data.albedo},
                                  {"visibility", &data.visibility},
                                  {"refresh", &refresh},
                                  {"material", &material},
                                  {"motion.X", has_motion_ ? &motion_x : nullptr},
                                  {"motion.Y", has_motion_ ? &motion_y : nullptr}};
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
        data.depth.sample = file.sample("Z");
        if (!data.depth.empty())
            settle_depth(data.depth, file.path(), config_, warnings);
        scale_position(data.position, config_);
        if (!data.albedo.empty())
            check_albedo(data.albedo, file.path(), light_choice(config_), warnings);
        if (!data.visibility.empty())
            check_values(data.visibility, file.path(), "visibility", 1.0);
        if (!refresh.empty())
            data.refresh = to_mask(refresh, file.path(), warnings);
        if (!material.empty())
            data.material = to_ids(material, file.path());
        for (std::size_t i = 0; i < motion_x.values.size() && i < motion_y.values.size(); ++i) {
            data.motion.push_back(motion_x.values[i]);
            data.motion.push_back(motion_y.values[i]);
        }
        planes_.read(frame, data, warnings);
        if (normal && !planes_.has("normal"))
            check_normals(data, file.path(), config_, warnings);
        return data;
    }

  private:
    void check_header(const image_io::ChannelFile &file) const {
        if (file.width() != width || file.height() != height)
            throw InputError(fmt::format("{}: the image has {} x {} pixels, the first one ({}) has {} x {}",
                                         file.path(), file.width(), file.height(), files_.front(), width, height));
        whole(file, "N");
        if (has_motion_ && !(file.has("motion.X") && file.has("motion.Y")))
            throw InputError(fmt::format("{}: has not the channels motion.X and motion.Y of the first file, {}",
                                         file.path(), files_.front()));
        if (!whole(file, "P") && !file.has("Z"))
            throw InputError(fmt::format(
                "{}: a scene needs the channel Z (depth in m) or P.X, P.Y, P.Z (position in m)", file.path()));
    }
    /** True if all three channels of a vector are there, false if none is. */
    static bool whole(const image_io::ChannelFile &file, const std::string &prefix) {
        const int count = file.has(prefix + ".X") + file.has(prefix + ".Y") + file.has(prefix + ".Z");
        if (count != 0 && count != 3)
            throw InputError(fmt::format("{}: has only some of the channels {}.X, {}.Y and {}.Z", file.path(), prefix,
                                         prefix, prefix));
        return count == 3;
    }

    /** Since the frame before, for each material; what belongs to no object rests. */
    std::vector<double> transforms(std::uint64_t frame) const {
        const std::size_t count = std::max<std::size_t>(materials.size(), 1);
        std::vector<double> result;
        for (std::size_t i = 0; i < count; ++i)
            result.insert(result.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
        for (const MovingObject &object : objects_) {
            const std::vector<double> one =
                previous_from_current(object.geometry_from_object[frame - 1], object.geometry_from_object[frame]);
            for (const std::size_t id : object.materials)
                std::copy(one.begin(), one.end(), result.begin() + static_cast<std::ptrdiff_t>(12 * id));
        }
        return result;
    }

    const Config &config_;
    std::vector<std::string> files_;
    Planes planes_;
    std::vector<MovingObject> objects_;
    bool rigid_ = false;
    bool has_motion_ = false;
};

/** A scene of planes that are named one by one. */
class PlaneSceneInput final : public Input {
  public:
    PlaneSceneInput(const InputPaths &paths, const Config &config) : planes_(paths, config) {
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

const Json nothing, no = false, empty = Json::object();

/** A member of an object, not its copy. */
const Json &member_of(const Json &object, const char *key, const Json &otherwise) {
    const auto found = object.find(key);
    return found == object.end() ? otherwise : *found;
}

/** A table from a list of objects; ids that it does not name are of the defaults. */
std::vector<ClspMaterial> load_materials(const Json &list, const std::string &path) {
    struct Member {
        const char *key;
        double ClspMaterial::*value;
    };
    constexpr Member members[] = {
        {"roughness_rms_m", &ClspMaterial::roughness_rms_m},
        {"degree_of_polarization", &ClspMaterial::degree_of_polarization},
        {"correlation_time_s", &ClspMaterial::correlation_time_s},
        {"lateral_correlation_length_m", &ClspMaterial::lateral_correlation_length_m},
        {"axial_correlation_length_m", &ClspMaterial::axial_correlation_length_m},
        {"rotation_correlation_angle_rad", &ClspMaterial::rotation_correlation_angle_rad},
        {"subsurface_fraction", &ClspMaterial::subsurface_fraction},
    };
    if (!list.is_array())
        throw InputError(path + ": \"materials\" must be a list of objects");
    std::vector<ClspMaterial> table;
    std::vector<bool> named;
    for (const Json &entry : list) {
        if (!entry.is_object())
            throw InputError(path + ": \"materials\" must be a list of objects");
        const auto id = entry.find("id");
        if (id == entry.end() || !id->is_number_integer() || id->get<std::int64_t>() < 0 ||
            id->get<std::int64_t>() >= static_cast<std::int64_t>(CLSP_MAX_MATERIALS))
            throw InputError(fmt::format("{}: \"id\" of a material must be an integer from 0 to {}, got {}", path,
                                         CLSP_MAX_MATERIALS - 1, id == entry.end() ? "none" : shown(*id)));
        const auto index = id->get<std::size_t>();
        while (table.size() <= index)
            table.push_back(clspeckle::make<ClspMaterial>());
        named.resize(table.size());
        if (named[index])
            throw InputError(fmt::format("{}: the material with the id {} is given twice", path, index));
        named[index] = true;
        bool has_time = false;
        for (const auto &[key, value] : entry.items()) {
            if (key == "id" || key == "name" || key == "albedo" || key == "living")
                continue;
            const auto known = std::find_if(std::begin(members), std::end(members),
                                            [&k = key](const Member &member) { return k == member.key; });
            if (known == std::end(members)) {
                std::vector<std::string> keys = {"id", "name", "albedo", "living"};
                for (const Member &member : members)
                    keys.emplace_back(member.key);
                throw InputError(fmt::format("{}: unknown key \"{}\" in \"materials\"{}; the keys are {}", path, key,
                                             suggestion(key, keys), fmt::join(keys, ", ")));
            }
            if (!value.is_number() && value != "inf")
                throw InputError(fmt::format("{}: \"{}\" of the material {} must be a number or \"inf\", got {}", path,
                                             key, index, shown(value)));
            table[index].*(known->value) = value.is_number() ? value.get<double>() : no_limit;
            has_time |= key == "correlation_time_s";
        }
        const Json &living = member_of(entry, "living", no);
        if (!living.is_boolean())
            throw InputError(fmt::format("{}: \"living\" must be true or false, got {}", path, shown(living)));
        // Skin, hair, worn cloth and liquids keep nothing of their speckle from one frame to the next.
        if (living.get<bool>() && !has_time)
            table[index].correlation_time_s = 0.0;
    }
    return table;
}

std::vector<MovingObject> load_objects(const Json &list, std::size_t material_count, std::size_t frame_count,
                                       const std::string &path) {
    if (!list.is_array())
        throw InputError(path + ": \"moving_objects\" must be a list of objects");
    std::vector<MovingObject> objects;
    for (const Json &entry : list) {
        if (!entry.is_object())
            throw InputError(path + ": \"moving_objects\" must be a list of objects");
        MovingObject object;
        object.materials = get<std::vector<std::size_t>>(entry, "material_ids", path, "a list of ids");
        object.geometry_from_object = get<std::vector<std::vector<double>>>(entry, "geometry_from_object", path,
                                                                            "a list of poses, [R|t] row by row");
        if (object.geometry_from_object.size() != frame_count)
            throw InputError(fmt::format("{}: \"geometry_from_object\" has {} poses, the sequence {} frames", path,
                                         object.geometry_from_object.size(), frame_count));
        for (const std::size_t id : object.materials)
            if (id >= material_count)
                throw InputError(fmt::format("{}: \"material_ids\" names {}, which is not in \"materials\"", path, id));
        for (const std::vector<double> &pose : object.geometry_from_object)
            if (pose.size() != 12)
                throw InputError(fmt::format("{}: a pose in \"geometry_from_object\" has {} numbers, 12 are needed",
                                             path, pose.size()));
        objects.push_back(std::move(object));
    }
    return objects;
}

/** Takes over what a sequence.json says. */
Sequence load_sequence(const std::string &path, Config &config) {
    const JsonDocument document = read_json(path);
    const Json &root = document.root();
    if (!root.is_object() || member_of(root, "format", nothing) != "clspeckle-gbuffer-sequence")
        throw InputError(
            fmt::format("{}: is not a scene description (\"format\" is not \"clspeckle-gbuffer-sequence\"); a "
                        "configuration is given with --config",
                        path));
    if (member_of(root, "version", nothing) != 1)
        throw InputError(fmt::format("{}: version {} of the format is not known, only 1", path,
                                     shown(member_of(root, "version", nothing))));
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    const auto names = get<std::vector<std::string>>(root, "frames", path, "a list of file names");
    if (names.empty())
        throw InputError(path + ": \"frames\" is empty; name at least one file");
    Sequence sequence;
    sequence.is_sequence = true;
    std::vector<std::string> &files = sequence.files;
    const auto inside = [&](const std::string &name, const char *key) {
        if (image_io::leaves_folder(name))
            throw InputError(
                fmt::format("{}: \"{}\" names {}, outside the folder of the file: copy it there, or link to "
                            "it",
                            path, key, shown(name)));
        return (folder / name).string();
    };
    for (const std::string &name : names)
        files.push_back(inside(name, "frames"));
    if (root.contains("materials"))
        sequence.materials = load_materials(root["materials"], path);
    if (root.contains("moving_objects"))
        sequence.objects = load_objects(root["moving_objects"], sequence.materials.size(), files.size(), path);
    if (root.contains("frame_rate_hz")) {
        const double rate = get<double>(root, "frame_rate_hz", path, "a number");
        if (!(rate > 0 && std::isfinite(rate)))
            throw InputError(fmt::format("{}: \"frame_rate_hz\" must be above 0, got {}", path, rate));
        config.set(option("motion.frame_time_s"), 1.0 / rate, Layer::sequence, path + ": \"frame_rate_hz\"");
    }

    // Keys of the file and the options they set; any other key is refused, since a default in its place would pass
    // unnoticed.
    using Keys = std::vector<std::pair<std::string, std::string>>;
    const auto take = [&](const Json &parent, const char *name, const Keys &keys) -> const Json & {
        const Json &object = member_of(parent, name, empty);
        if (!object.is_object())
            throw InputError(fmt::format("{}: \"{}\" must be an object", path, name));
        for (const auto &[key, value] : object.items()) {
            const auto known =
                std::find_if(keys.begin(), keys.end(), [&k = key](const auto &pair) { return pair.first == k; });
            if (known == keys.end()) {
                std::vector<std::string> known_keys;
                for (const auto &pair : keys)
                    known_keys.push_back(pair.first);
                throw InputError(fmt::format("{}: unknown key \"{}\" in \"{}\"{}; the keys are {}", path, key, name,
                                             suggestion(key, known_keys), fmt::join(known_keys, ", ")));
            }
            if (known->second.empty())
                continue;
            Json setting = value;
            if (known->second == "pattern.image" && value.is_string())
                setting = inside(value.get<std::string>(), "pattern.file");
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
    take(root, "motion", {{"rule", "motion.rule"}, {"translate", "motion.translate"}});
    const Json &laser = take(root, "laser",
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
    return sequence;
}

} // namespace

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
    if (!(largest > 1))
        return "";
    unsigned bits = bits_of(largest);
    // The file's own word, but for codes that were brought to 16 bits, which is what the word is for.
    const bool told = plane.significant_bits > 0 && plane.significant_bits < 16 && bits < 16 &&
                      largest < std::ldexp(1.0f, static_cast<int>(plane.significant_bits));
    if (told)
        bits = plane.significant_bits;
    const double top = std::ldexp(1.0, static_cast<int>(bits)) - 1;
    const auto [path, channel] = image_io::split_name(file);
    const std::string advice = file.empty()
                                   ? fmt::format("--full-scale {}", top)
                                   : fmt::format("{}:full_scale={}{}", path, top, channel.empty() ? "" : "," + channel);
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

namespace {

std::unique_ptr<Input> open_kind(const InputPaths &paths, std::vector<std::string> &files, Config &config) {
    if (paths.inputs.empty()) {
        if (!paths.raw.empty())
            throw InputError("--raw describes the ideal images: name them, or leave it out");
        if (paths.depth.empty() && paths.position.empty())
            throw InputError("nothing to render: give an ideal image, a scene, or --depth or --position");
        if (!paths.depth.empty() && !paths.position.empty())
            throw InputError("give either --depth or --position, not both");
        const std::string channel = config.text("render.channel");
        if (!channel.empty() && config.layer("render.channel") == Layer::command_line)
            throw InputError(
                fmt::format("--channel names a channel of an ideal image; name that of a plane behind its file: "
                            "--{} {}:{}",
                            paths.depth.empty() ? "position" : "depth",
                            image_io::split_name(paths.depth + paths.position).path, channel));
        return std::make_unique<PlaneSceneInput>(paths, config);
    }
    if (!paths.depth.empty() || !paths.position.empty())
        throw InputError("give either an input file or --depth or --position, not both");
    for (const std::string &input : paths.inputs)
        for (std::string &file : expand(input, Purpose::ideal_images))
            files.push_back(std::move(file));
    // A shell makes a list of names of FOLDER/*.
    image_io::leave_previews_out(files);
    if (paths.raw.empty() && std::filesystem::path(files.front()).extension() == ".json") {
        if (files.size() > 1)
            throw InputError(
                fmt::format("{}: one scene description is rendered at a time, {} are given", files[1], files.size()));
        Sequence sequence = load_sequence(files.front(), config);
        files = sequence.files;
        if (const Holds holds = held(files.front()); holds == Holds::image || holds == Holds::picture_with_depth_layer)
            throw InputError(fmt::format("{}: is not an {} file with the channel Z or P.X, P.Y, P.Z", files.front(),
                                         image_io::listed("or", &image_io::Format::has_named_channels)));
        return std::make_unique<ChannelSceneInput>(std::move(sequence), paths, config);
    }
    const Holds holds = config.text("render.channel").empty() && paths.raw.empty() ? held(files.front()) : Holds::image;
    const bool patterned = !config.text("pattern.image").empty();
    if (holds == Holds::scene || (holds == Holds::picture_with_depth && patterned)) {
        Sequence sequence;
        sequence.files = files;
        return std::make_unique<ChannelSceneInput>(std::move(sequence), paths, config);
    }
    if (paths.any_plane())
        throw InputError(
            fmt::format("{}: is an ideal image; --normal, --albedo and --visibility belong to a scene", files.front()));
    return std::make_unique<IdealInput>(files, paths, config, holds != Holds::image);
}

} // namespace

std::unique_ptr<Input> open_input(const InputPaths &paths, Config &config) {
    std::vector<std::string> files;
    std::unique_ptr<Input> input = open_kind(paths, files, config);
    const auto of_series = [&](const std::string &oddity) {
        if (!oddity.empty())
            input->oddities.push_back(fmt::format("{}: {}", paths.inputs.front(), oddity));
    };
    of_series(image_io::counted_otherwise(files));
    if (paths.inputs.size() > 1)
        of_series(image_io::several_series(files));
    if (const std::string missing = image_io::missing_numbers(files); paths.inputs.size() == 1 && !missing.empty())
        input->oddities.push_back(fmt::format("{}: {}; the frames before and after are taken as neighbours in time",
                                              std::filesystem::path(files.front()).parent_path().string(), missing));
    if (!paths.materials.empty()) {
        const JsonDocument document = read_json(paths.materials);
        const Json &root = document.root();
        if (!root.is_object() || !root.contains("materials"))
            throw InputError(paths.materials + ": has no list \"materials\"");
        std::vector<ClspMaterial> table = load_materials(root["materials"], paths.materials);
        // The moving objects of a sequence go by its own ids.
        while (table.size() < input->materials.size())
            table.push_back(clspeckle::make<ClspMaterial>());
        input->materials = std::move(table);
    }
    for (const std::string &plane : {paths.depth, paths.position, paths.normal, paths.albedo, paths.visibility,
                                     paths.refresh_mask, paths.material, paths.materials})
        if (!plane.empty())
            files.push_back(plane);
    files.insert(files.end(), paths.inputs.begin(), paths.inputs.end());
    for (std::string &file : files)
        file = image_io::split_name(file).path;
    input->files = std::move(files);
    return input;
}

} // namespace tools
