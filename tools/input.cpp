#include "input.hpp"

#include "errors.hpp"
#include "files.hpp"
#include "io/channels.hpp"
#include "io/series.hpp"
#include "plane_checks.hpp"
#include "planes.hpp"
#include "scene_sequence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace tools {

using image_io::Plane;
using image_io::VectorPlane;

namespace {

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
            warnings.push_back(fmt::format("{}: holds a picture and a depth or positions, and is taken as an ideal "
                                           "image; --pattern IMAGE makes a scene of all its planes",
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

using image_io::ChannelFile;
using image_io::Role;
using Names = std::vector<std::string>;

/** A plane that a scene's file may hold. */
struct ScenePlane {
    Role role;
    const char *option;
    Names own;           ///< What its channels are called in scenes.
    bool by_rule = true; ///< So may others that the option would take.
};

const ScenePlane depth_plane{Role::depth, "depth", {"Z"}};
const ScenePlane position_plane{Role::position, "position", {"P.X", "P.Y", "P.Z"}};
/** What no picture has, though renderers add a depth to theirs. */
const ScenePlane surface_planes[] = {{Role::normal, "normal", {"N.X", "N.Y", "N.Z"}},
                                     {Role::albedo, "albedo", {"albedo"}},
                                     {Role::visibility, "visibility", {"visibility"}},
                                     // Renderers have masks of what is there, and ids of their own.
                                     {Role::mask, "refresh-mask", {"refresh"}, false},
                                     {Role::material, "material", {"material"}, false}};
const Names motion_channels = {"motion.X", "motion.Y"};

bool contains(const Names &names, const std::string &name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}
bool has_any(const ChannelFile &file, const Names &names) {
    return std::any_of(names.begin(), names.end(), [&](const std::string &name) { return file.has(name); });
}
bool has_all(const ChannelFile &file, const Names &names) {
    return std::all_of(names.begin(), names.end(), [&](const std::string &name) { return file.has(name); });
}

/** Z beside X and Y is a vector's third axis. */
bool has_own(const ChannelFile &file, const ScenePlane &plane) {
    return has_all(file, plane.own) && !(plane.role == Role::depth && has_all(file, {"X", "Y"}));
}

/** The channels of a plane, by the names of scenes, else by the rule for the plane's option; none: it is not there.
 * @param files of the scene, one for each frame. */
Names channels_of(const ChannelFile &file, const ScenePlane &plane, std::size_t files) {
    if (has_own(file, plane))
        return plane.own;
    if (!plane.by_rule)
        return {};
    if (plane.own.size() > 1 && has_any(file, plane.own))
        throw InputError(fmt::format("{}: has only some of the channels {}, {} and {}", file.path(), plane.own[0],
                                     plane.own[1], plane.own[2]));
    const std::vector<Names> named = image_io::named_channels(file.channels(), plane.role);
    if (named.size() < 2)
        return named.empty() ? Names{} : named.front();
    std::vector<std::string> listed;
    for (const Names &one : named)
        listed.push_back(fmt::format("{}", fmt::join(one, ",")));
    // An option's file is that of all frames.
    if (files > 1)
        throw InputError(fmt::format("{}: several of its channels may be the {}: {}; save those that are meant as {}, "
                                     "in the file of each frame",
                                     file.path(), plane.option, fmt::join(listed, "; "), fmt::join(plane.own, ",")));
    const bool geometry = plane.role == Role::depth || plane.role == Role::position;
    throw InputError(fmt::format("{0}: several of its channels may be the {1}: {2}; name one{4}: --{1} {0}:{3}",
                                 file.path(), plane.option, fmt::join(listed, "; "), listed.front(),
                                 geometry ? ", in place of the file, and the other planes likewise" : ""));
}

/** What a file with named channels is as an input. */
enum class Holds { image, scene, picture_with_depth };

Holds held(const std::string &name) {
    const auto [path, channel] = image_io::split_name(name);
    const auto file = channel.empty() ? image_io::open_channels(path) : nullptr;
    if (!file)
        return Holds::image;
    const auto named = [&](Role role) { return !image_io::named_channels(file->channels(), role).empty(); };
    if (!has_own(*file, depth_plane) && !has_any(*file, position_plane.own) && !named(Role::depth) &&
        !named(Role::position))
        return Holds::image;
    // Renderers add their planes to a picture. The names of scenes are given by who makes a scene.
    const bool picture = image_io::has_picture(file->channels());
    bool scene = !picture || has_any(*file, position_plane.own) || has_any(*file, motion_channels);
    for (const ScenePlane &plane : surface_planes)
        scene = scene || has_any(*file, plane.own);
    return scene ? Holds::scene : Holds::picture_with_depth;
}

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
    ChannelSceneInput(SceneSequence sequence, const InputPaths &paths, const Config &config)
        : config_(config), files_(std::move(sequence.files)), planes_(paths, config),
          objects_(std::move(sequence.objects)) {
        materials = std::move(sequence.materials);
        rigid_ = sequence.is_sequence;
        scene = true;
        kind = files_.size() > 1 ? fmt::format("scene, {} G-buffer files", files_.size()) : "scene, one G-buffer file";
        const auto opened = open_scene(files_.front());
        const ChannelFile &first = *opened;
        Names others = first.channels();
        others.erase(
            std::remove_if(others.begin(), others.end(),
                           [](const std::string &one) { return one == "A" || contains(motion_channels, one); }),
            others.end());
        if (const std::string image = image_io::unclaimed_channel(others, Role::image); !image.empty())
            image_name = files_.front() + ":" + image;
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
        const ChannelFile &file = *opened;
        check_header(file);
        FrameData data;
        data.name = data.albedo_name = data.visibility_name = file.path();
        if (rigid_ && !has_motion_ && frame > 0)
            data.previous_from_current = transforms(frame);
        // Positions need no camera model, so they are preferred where a file has both.
        const Names position = channels_of(file, position_plane, files_.size());
        const Names depth = position.empty() ? channels_of(file, depth_plane, files_.size()) : Names{};
        Names names;
        std::vector<VectorPlane *> vectors;
        const auto add_vector = [&](const Names &of, VectorPlane &plane) {
            if (of.empty())
                return;
            names.insert(names.end(), of.begin(), of.end());
            plane.width = width;
            plane.height = height;
            plane.values.reserve(std::size_t{3} * width * height);
            vectors.push_back(&plane);
        };
        struct Target {
            std::string option;
            Names channels;
            Plane *plane;
            bool colored = false;
        };
        std::vector<Target> targets;
        const auto add = [&](const std::string &option, const Names &of, Plane &plane) {
            if (of.empty())
                return;
            names.insert(names.end(), of.begin(), of.end());
            plane.width = width;
            plane.height = height;
            plane.values.reserve(std::size_t{width} * height);
            targets.push_back({option, of, &plane});
        };
        Plane refresh, material, motion_x, motion_y;
        add_vector(position, data.position);
        for (const ScenePlane &plane : surface_planes)
            if (plane.role == Role::normal && !planes_.has(plane.option))
                add_vector(channels_of(file, plane, files_.size()), data.normal);
        add("depth", depth, data.depth);
        for (const ScenePlane &plane : surface_planes)
            if (plane.role != Role::normal && !planes_.has(plane.option))
                add(plane.option, channels_of(file, plane, files_.size()),
                    plane.role == Role::albedo       ? data.albedo
                    : plane.role == Role::visibility ? data.visibility
                    : plane.role == Role::mask       ? refresh
                                                     : material);
        if (has_motion_) {
            add("motion", {motion_channels[0]}, motion_x);
            add("motion", {motion_channels[1]}, motion_y);
        }
        const std::string &depth_channel = position.empty() ? depth.front() : position.back();
        const std::string sample = file.sample(depth_channel);
        if (sample == "float16")
            warnings.push_back(
                fmt::format("{}: channel {} is half precision: steps of 1 mm at 1 m move dots; store it as float",
                            file.path(), depth_channel));
        if (!position.empty())
            check_unit(sample, config_.is_word("camera.depth_scale"), "position", file.path());
        file.read_rows(names, [&](const float *row) {
            for (std::uint32_t x = 0; x < width; ++x) {
                for (VectorPlane *plane : vectors) {
                    plane->values.insert(plane->values.end(), row, row + 3);
                    row += 3;
                }
                for (Target &target : targets) {
                    double sum = 0;
                    for (std::size_t c = 0; c < target.channels.size(); ++c) {
                        target.colored |= row[c] != row[0] && !(std::isnan(row[c]) && std::isnan(row[0]));
                        sum += row[c];
                    }
                    target.plane->values.push_back(
                        static_cast<float>(sum / static_cast<double>(target.channels.size())));
                    row += target.channels.size();
                }
            }
        });
        for (const Target &target : targets) {
            if (target.colored && target.plane != &data.albedo)
                throw InputError(
                    fmt::format("{0}: the color channels of its {1} ({2}) differ, one number for each pixel "
                                "is needed; save one of them as {1}",
                                file.path(), target.option, fmt::join(target.channels, ", ")));
            if (target.colored)
                warnings.push_back(fmt::format("{}: the color channels of its albedo ({}) differ; their mean is taken "
                                               "(luminance weights mean nothing in the infrared)",
                                               file.path(), fmt::join(target.channels, ", ")));
        }
        data.depth.sample = sample;
        if (!data.depth.empty())
            settle_depth(data.depth, file.path(), config_, warnings);
        scale_position(data.position, config_);
        if (!data.albedo.empty())
            check_albedo(data.albedo, file.path(), "", light_choice(config_), warnings);
        check_visibility(data.visibility, file.path(), "", "");
        if (!refresh.empty())
            data.refresh = to_mask(refresh, file.path(), warnings);
        if (!material.empty())
            data.material = to_ids(material, file.path());
        for (std::size_t i = 0; i < motion_x.values.size() && i < motion_y.values.size(); ++i) {
            data.motion.push_back(motion_x.values[i]);
            data.motion.push_back(motion_y.values[i]);
        }
        planes_.read(frame, data, warnings);
        if (!data.normal.empty() && !planes_.has("normal"))
            check_normals(data, file.path(), config_, warnings);
        return data;
    }

  private:
    void check_header(const ChannelFile &file) const {
        if (file.width() != width || file.height() != height)
            throw InputError(fmt::format("{}: the image has {} x {} pixels, the first one ({}) has {} x {}",
                                         file.path(), file.width(), file.height(), files_.front(), width, height));
        if (has_motion_ && !(file.has("motion.X") && file.has("motion.Y")))
            throw InputError(fmt::format("{}: has not the channels motion.X and motion.Y of the first file, {}",
                                         file.path(), files_.front()));
        for (const ScenePlane &plane : surface_planes)
            if (!planes_.has(plane.option))
                (void)channels_of(file, plane, files_.size());
        if (channels_of(file, position_plane, files_.size()).empty() &&
            channels_of(file, depth_plane, files_.size()).empty())
            throw InputError(fmt::format(
                "{}: a scene needs the channel Z (depth in m) or P.X, P.Y, P.Z (position in m)", file.path()));
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
        SceneSequence sequence = read_sequence(files.front(), config);
        files = sequence.files;
        if (held(files.front()) == Holds::image)
            throw InputError(fmt::format("{}: is not an {} file with the channel Z or P.X, P.Y, P.Z", files.front(),
                                         image_io::listed("or", &image_io::Format::has_named_channels)));
        return std::make_unique<ChannelSceneInput>(std::move(sequence), paths, config);
    }
    const Holds holds = config.text("render.channel").empty() && paths.raw.empty() ? held(files.front()) : Holds::image;
    const bool patterned = !config.text("pattern.image").empty();
    if (holds == Holds::scene || (holds == Holds::picture_with_depth && patterned)) {
        SceneSequence sequence;
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
        std::vector<ClspMaterial> table = read_materials(paths.materials);
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
