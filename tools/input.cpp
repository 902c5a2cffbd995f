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
        if (const Holds holds = held(files.front()); holds == Holds::image || holds == Holds::picture_with_depth_layer)
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
