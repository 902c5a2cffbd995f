#include "capture/capture_writer.hpp"

#include "capture/capture_json.hpp"
#include "capture/capture_validation.hpp"
#include "capture/stored_sequence.hpp"
#include "io/formats.hpp"
#include "io/temporary.hpp"
#include "runtime/error.hpp"

#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <system_error>

namespace clsp {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path &folder, const std::error_code &code) {
    throw Error(Status::kIo,
                fmt::format("{}: cannot be written: {}; choose another folder", folder.string(), code.message()));
}

// The first thing in a folder that no write_capture() made; empty if there is none. Raw frames of a camera are not to
// be lost.
std::string foreign_entry(const fs::path &folder) {
    std::error_code code;
    for (const fs::directory_entry &entry : fs::directory_iterator(folder, code)) {
        const std::string name = entry.path().filename().string();
        const std::string suffix = "_mask.png";
        const bool mask =
            name.size() > suffix.size() && name.compare(name.size() - suffix.size(), suffix.size(), suffix) == 0;
        if (!entry.is_regular_file(code) ||
            !(name == "capture.json" || name == "key.json" || entry.path().extension() == ".npy" || mask))
            return name;
    }
    if (code)
        fail(folder, code);
    return {};
}

// A folder beside the wanted one, removed unless it was put in place.
class TemporaryFolder {
  public:
    explicit TemporaryFolder(const fs::path &folder) {
        try {
            path_ = image_io::make_temporary_folder(folder.string(), lock_);
        } catch (const std::system_error &error) {
            fail(folder, error.code());
        }
    }
    ~TemporaryFolder() {
        if (!path_.empty())
            image_io::remove_temporary_folder(path_, lock_);
    }
    TemporaryFolder(const TemporaryFolder &) = delete;
    TemporaryFolder &operator=(const TemporaryFolder &) = delete;
    fs::path path() const { return path_; }

    // Renames it; what is there goes away once the new one is in place.
    void put_in_place(const fs::path &folder) {
        std::error_code code;
        fs::path old;
        // At once, where the file system can: the old one is behind the temporary name then.
        if (::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, folder.c_str(), RENAME_EXCHANGE) == 0) {
            lock_.end(); // it is that of the folder in place, which stays
            return;
        }
        if (fs::exists(folder, code)) {
            const fs::path name(path_);
            old = name.parent_path() / ("old" + name.filename().string()); // which nobody sweeps away
            fs::rename(folder, old, code);
            if (code)
                fail(folder, code);
        }
        fs::rename(path_, folder, code);
        if (code) {
            std::error_code ignored;
            if (!old.empty())
                fs::rename(old, folder, ignored);
            fail(folder, code);
        }
        path_ = old.string();
        lock_.end();
    }

  private:
    std::string path_; // one that is moved here: nothing can fail between folder and name
    image_io::TemporaryLock lock_;
};

} // namespace

void write_capture(const Capture &capture, const std::string &folder, bool overwrite) {
    validate_capture(capture);
    if (folder.empty())
        throw Error(Status::kInvalidArgument, "the path of the capture set is empty; name a folder");
    std::error_code code;
    fs::path target = fs::absolute(folder, code).lexically_normal();
    if (code)
        fail(folder, code);
    if (!target.has_filename()) // a slash at the end
        target = target.parent_path();
    if (fs::exists(target, code)) {
        if (!overwrite)
            throw Error(Status::kInvalidArgument,
                        fmt::format("{}: exists; choose another folder, or say that it is to be overwritten", folder));
        if (!fs::is_directory(target, code))
            throw Error(Status::kInvalidArgument,
                        fmt::format("{}: is not overwritten, as it is no folder; choose another name", folder));
        if (const std::string foreign = foreign_entry(target); !foreign.empty())
            throw Error(Status::kInvalidArgument, fmt::format("{}: is not overwritten, as it holds \"{}\", which is no "
                                                              "part of a written capture set; choose another "
                                                              "folder",
                                                              folder, foreign));
    }
    fs::create_directories(target.parent_path(), code);
    if (code)
        fail(folder, code);
    TemporaryFolder temporary(target);
    try {
        const CaptureLayout &layout = capture.layout;
        for (std::size_t i = 0; i < layout.sequences.size(); ++i) {
            const SequenceLayout &s = layout.sequences[i];
            const auto stack =
                image_io::create((temporary.path() / (s.name + ".npy")).string(), image_io::format_named("NPY"),
                                 {layout.width, layout.height, image_io::Sample::uint16, s.frame_count});
            std::vector<std::uint16_t> room;
            for (std::uint32_t frame = 0; frame < s.frame_count; ++frame)
                stack->append(frame_of(capture, i, frame, room));
            stack->commit();
            if (!s.mask.empty())
                image_io::write((temporary.path() / (s.name + "_mask.png")).string(), image_io::format_named("PNG"),
                                layout.width, layout.height, s.mask.data());
        }
        image_io::write_text((temporary.path() / "capture.json").string(), capture_json(layout));
    } catch (const image_io::WriteError &error) {
        throw Error(Status::kIo, error.what());
    }
    temporary.put_in_place(target);
}

} // namespace clsp
