/**
 * @file planes.hpp
 * @brief Frames of files in order, and the planes of a scene that the command line names one by one.
 */
#ifndef CLSPECKLE_TOOLS_PLANES_HPP
#define CLSPECKLE_TOOLS_PLANES_HPP

#include "frame_data.hpp"
#include "io/read_request.hpp"
#include "plane_checks.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace tools {

/** All frames of one or several files, in order. */
class FileSeries {
  public:
    FileSeries() = default;
    FileSeries(std::vector<std::string> paths, image_io::ReadRequest request, image_io::Encoding encoding);

    const std::string &first_path() const { return paths_.front(); }
    /** Name of a frame for messages. */
    std::string name(std::uint64_t frame) const;
    image_io::Plane gray(std::uint64_t frame, std::vector<std::string> &warnings);
    image_io::VectorPlane normals(std::uint64_t frame);
    /** @param config tells the unit of whole numbers. */
    image_io::VectorPlane positions(std::uint64_t frame, const Config &config);

    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint64_t frame_count = 0;
    std::string but; ///< What an error about the size adds: how else the first file may be meant.

  private:
    std::pair<std::size_t, std::uint64_t> locate(std::uint64_t frame) const;
    void check_size(const image_io::Reader &reader) const;
    image_io::Reader &reader(std::uint64_t frame);

    std::vector<std::string> paths_;
    image_io::ReadRequest request_;
    std::string sample_;
    image_io::Encoding encoding_ = image_io::Encoding::as_stored;
    std::vector<std::uint64_t> first_frames_;
    std::unique_ptr<image_io::Reader> reader_;
    std::size_t open_file_ = 0;
};

/** The planes that are named one by one; each is a still or has as many frames as the input. */
class Planes {
  public:
    Planes(const InputPaths &paths, const Config &config);

    bool has(const std::string &name) const { return planes_.count(name) > 0; }
    std::uint64_t frame_count() const;
    const FileSeries &at(const std::string &name) const { return planes_.at(name); }

    /** Refuses planes of another size or with another number of frames. */
    void check(std::uint32_t width, std::uint32_t height, std::uint64_t frames, const std::string &reference) const;
    /** Puts what there is into a frame, over what is there. */
    void read(std::uint64_t frame, FrameData &data, std::vector<std::string> &warnings);

  private:
    void add(const char *name, const std::string &path, image_io::Role role);

    const Config &config_;
    LightChoice choice_;
    image_io::Encoding encoding_;
    std::map<std::string, FileSeries> planes_;
};

} // namespace tools

#endif // CLSPECKLE_TOOLS_PLANES_HPP
