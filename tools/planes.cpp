#include "planes.hpp"

#include "errors.hpp"
#include "io/channels.hpp"
#include "io/formats.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tools {

using image_io::Plane;
using image_io::Reader;
using image_io::Role;
using image_io::VectorPlane;

FileSeries::FileSeries(std::vector<std::string> paths, image_io::ReadRequest request, image_io::Encoding encoding)
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

std::string FileSeries::name(std::uint64_t frame) const {
    const auto [file, inside] = locate(frame);
    const std::uint64_t end = file + 1 < first_frames_.size() ? first_frames_[file + 1] : frame_count;
    return end - first_frames_[file] > 1 ? fmt::format("{}[{}]", paths_[file], inside) : paths_[file];
}

Plane FileSeries::gray(std::uint64_t frame, std::vector<std::string> &warnings) {
    // Colors may make a picture or an albedo, but no number.
    const bool picture = request_.role == Role::image || request_.role == Role::albedo;
    return image_io::read_gray(reader(frame), locate(frame).second, warnings,
                               picture ? image_io::Colors::mean : image_io::Colors::refused,
                               picture ? encoding_ : image_io::Encoding::as_stored);
}

VectorPlane FileSeries::normals(std::uint64_t frame) {
    return image_io::read_vectors(reader(frame), locate(frame).second);
}

VectorPlane FileSeries::positions(std::uint64_t frame, const Config &config) {
    check_unit(sample_, config.is_word("camera.depth_scale"), "position", paths_[locate(frame).first]);
    return image_io::read_vectors(reader(frame), locate(frame).second, true);
}

std::pair<std::size_t, std::uint64_t> FileSeries::locate(std::uint64_t frame) const {
    const auto after = std::upper_bound(first_frames_.begin(), first_frames_.end(), frame);
    const auto file = static_cast<std::size_t>(after - first_frames_.begin()) - 1;
    return {file, frame - first_frames_[file]};
}

void FileSeries::check_size(const Reader &reader) const {
    if (reader.info().width != width || reader.info().height != height)
        throw InputError(fmt::format("{}: the image has {} x {} pixels, the first one ({}) has {} x {}", reader.path(),
                                     reader.info().width, reader.info().height, paths_.front(), width, height));
}

Reader &FileSeries::reader(std::uint64_t frame) {
    const std::size_t file = locate(frame).first;
    if (!reader_ || open_file_ != file) {
        reader_ = image_io::open(paths_[file], request_);
        open_file_ = file;
        check_size(*reader_);
    }
    return *reader_;
}

Planes::Planes(const InputPaths &paths, const Config &config)
    : config_(config), choice_(light_choice(config)), encoding_(encoding_of(config)) {
    add("depth", paths.depth, Role::depth);
    add("position", paths.position, Role::position);
    add("normal", paths.normal, Role::normal);
    add("albedo", paths.albedo, Role::albedo);
    add("visibility", paths.visibility, Role::visibility);
    add("refresh-mask", paths.refresh_mask, Role::mask);
    add("material", paths.material, Role::material);
}

std::uint64_t Planes::frame_count() const {
    std::uint64_t count = 1;
    for (const auto &[name, series] : planes_)
        count = std::max(count, series.frame_count);
    return count;
}

void Planes::check(std::uint32_t width, std::uint32_t height, std::uint64_t frames,
                   const std::string &reference) const {
    for (const auto &[name, series] : planes_) {
        if (series.width != width || series.height != height)
            throw InputError(fmt::format("{}: the --{} image has {} x {} pixels, {} has {} x {}{}", series.first_path(),
                                         name, series.width, series.height, reference, width, height, series.but));
        if (series.frame_count != 1 && series.frame_count != frames)
            throw InputError(fmt::format(
                "{}: the --{} image has {} frames, {}; name one of them behind the file's name, for example {}",
                series.first_path(), name, series.frame_count,
                frames == 1 ? "one is needed" : fmt::format("1 or {} are needed", frames),
                image_io::page_name(series.first_path(), 0)));
    }
}

void Planes::read(std::uint64_t frame, FrameData &data, std::vector<std::string> &warnings) {
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
            check_albedo(plane, file, series.first_path(), choice_, warnings);
            data.albedo = std::move(plane);
            data.albedo_name = file;
        } else {
            check_visibility(plane, file, series.first_path(), advice);
            data.visibility = std::move(plane);
            data.visibility_name = file;
        }
    }
    if (has("normal"))
        check_normals(data, planes_.at("normal").name(0), config_, warnings);
}

void Planes::add(const char *name, const std::string &path, Role role) {
    image_io::ReadRequest request;
    request.role = role;
    if (!path.empty())
        planes_.emplace(name, FileSeries({path}, request, encoding_));
}

} // namespace tools
