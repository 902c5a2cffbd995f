#include "scene_sequence.hpp"

#include "errors.hpp"
#include "io/inside.hpp"
#include "json.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

namespace tools {
namespace {

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
            table[index].*(known->value) =
                value.is_number() ? value.get<double>() : std::numeric_limits<double>::infinity();
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

} // namespace

std::vector<ClspMaterial> read_materials(const std::string &path) {
    const JsonDocument document = read_json(path);
    const Json &root = document.root();
    if (!root.is_object() || !root.contains("materials"))
        throw InputError(path + ": has no list \"materials\"");
    return load_materials(root["materials"], path);
}

SceneSequence read_sequence(const std::string &path, Config &config) {
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
    SceneSequence sequence;
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

} // namespace tools
