#include "report/profile_files.hpp"

#include "io/formats.hpp"
#include "io/npy_header.hpp"
#include "report/profile_json.hpp"
#include "runtime/error.hpp"

#include <filesystem>
#include <fmt/core.h>
#include <utility>

namespace clsp {
namespace {

namespace fs = std::filesystem;

constexpr std::pair<ProfileMapKind, const char *> kKinds[] = {{kDarkMap, "dark"}, {kGainMap, "gain"}};

const char *name_of(ProfileMapKind kind) {
    return kind == kDarkMap ? "dark" : "gain";
}

std::optional<ProfileMap> &map_of(CameraProfile &profile, ProfileMapKind kind) {
    return kind == kDarkMap ? profile.dark_map : profile.gain_map;
}
const ProfileMap &map_of(const CameraProfile &profile, ProfileMapKind kind) {
    return *(kind == kDarkMap ? profile.dark_map : profile.gain_map);
}

// What the frames of NAME.json have for a name.
std::string stem_of(const fs::path &path) {
    return (path.extension() == ".json" ? path.stem() : path.filename()).string();
}

[[noreturn]] void refuse(const CameraProfile &profile, ProfileMapKind kind, Status status, const std::string &what) {
    throw Error(status,
                fmt::format("the {} map of {}: {}; put the file back that was written with the profile, diagnose the "
                            "capture again, or leave the maps out (render --profile-maps off), which draws such "
                            "patterns anew",
                            name_of(kind), profile.path, what));
}

} // namespace

// Beside the profile; of a link to a profile also beside what it leads to.
std::string map_path(const CameraProfile &profile, ProfileMapKind kind) {
    const fs::path path(profile.path), beside = path.parent_path() / map_of(profile, kind).file;
    std::error_code none;
    if (fs::exists(beside, none) || !fs::is_symlink(path, none))
        return beside.string();
    return (fs::weakly_canonical(path, none).parent_path() / map_of(profile, kind).file).string();
}

std::shared_ptr<const std::vector<float>> map_values(const CameraProfile &profile, ProfileMapKind kind) {
    const ProfileMap &map = map_of(profile, kind);
    if (map.values)
        return map.values;
    const std::string path = map_path(profile, kind);
    auto values = std::make_shared<std::vector<float>>();
    try {
        const auto reader = image_io::open(path);
        const image_io::Info &info = reader->info();
        if (info.width != profile.width || info.height != profile.height)
            refuse(profile, kind, Status::kInvalidData,
                   fmt::format("{} has {} x {} pixels, expected the camera's {} x {}", path, info.width, info.height,
                               profile.width, profile.height));
        if (info.sample != "float32" || info.channels != 1 || info.frame_count != 1)
            refuse(
                profile, kind, Status::kInvalidData,
                fmt::format("{} holds {} frame{} of {} channel{} of {}, expected one number of float32 for each pixel",
                            path, info.frame_count, info.frame_count == 1 ? "" : "s", info.channels,
                            info.channels == 1 ? "" : "s", info.sample));
        values->reserve(std::size_t{profile.width} * profile.height);
        reader->read_rows(0, [&](const float *row) { values->insert(values->end(), row, row + profile.width); });
    } catch (const image_io::ReadError &error) {
        refuse(profile, kind, Status::kIo, error.what());
    }
    if (const std::uint64_t found = hash_of(*values); found != map.hash)
        refuse(profile, kind, Status::kInvalidData,
               fmt::format("{} is not as it was written: its values have the hash {:016x}, expected {:016x}", path,
                           found, map.hash));
    return values;
}

void write_profile(const CameraProfile &profile, const std::string &path) {
    CameraProfile written = profile;
    const fs::path target(path);
    std::vector<std::unique_ptr<image_io::AtomicFile>> files;
    try {
        for (const auto &[kind, name] : kKinds) {
            std::optional<ProfileMap> &map = map_of(written, kind);
            if (!map)
                continue;
            map->values = map_values(profile, kind);
            map->file = fmt::format("{}.{}.npy", stem_of(target), name);
            files.push_back(std::make_unique<image_io::AtomicFile>((target.parent_path() / map->file).string()));
            const std::string header = image_io::npy_header("'<f4'", {profile.height, profile.width});
            files.back()->write(header.data(), header.size());
            files.back()->write(map->values->data(), map->values->size() * sizeof(float));
            files.back()->close();
        }
        const std::string text = profile_json(written);
        files.push_back(std::make_unique<image_io::AtomicFile>(path));
        files.back()->write(text.data(), text.size());
        files.back()->close();
        for (const auto &file : files)
            file->commit();
    } catch (const image_io::WriteError &error) {
        throw Error(Status::kIo, error.what());
    }
}

} // namespace clsp
