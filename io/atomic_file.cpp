#include "io/atomic_file.hpp"

#include <fmt/format.h>

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

namespace image_io {

namespace {

/** What is replaced keeps its owner, its group and its rights. Where the group cannot be kept, the new one gets no more
 * than everybody has. @return whether nobody may write into it, once it is complete. */
bool take_rights(int descriptor, const std::string &replaced) {
    struct stat was {};
    struct stat is {};
    // A link is replaced itself, and has no rights of its own.
    if (::lstat(replaced.c_str(), &was) != 0 || !S_ISREG(was.st_mode) || ::fstat(descriptor, &is) != 0)
        return false;
    mode_t mode = was.st_mode & 0777;
    const bool same = is.st_uid == was.st_uid && is.st_gid == was.st_gid;
    if (!same && ::fchown(descriptor, was.st_uid, was.st_gid) != 0 && is.st_gid != was.st_gid &&
        ::fchown(descriptor, static_cast<uid_t>(-1), was.st_gid) != 0)
        mode &= 0707 | (mode & 07) << 3;
    // Writers open it again by its name. File systems without rights have none to keep.
    return ::fchmod(descriptor, mode | S_IWUSR) == 0 && (mode & S_IWUSR) == 0;
}

} // namespace

AtomicFile::AtomicFile(std::string path) : path_(std::move(path)) {
    check_target();
    int descriptor = -1;
    try {
        temporary_path_ = make_temporary_file(path_, lock_, descriptor);
    } catch (const std::system_error &error) {
        throw WriteError(path_, std::string("cannot be written: ") + std::strerror(error.code().value()));
    }
    read_only_ = take_rights(descriptor, path_);
    stream_ = ::fdopen(descriptor, "wb");
    if (!stream_) {
        const int code = errno;
        ::close(descriptor);
        std::remove(temporary_path_.c_str());
        throw WriteError(path_, std::string("cannot be written: ") + std::strerror(code));
    }
}

AtomicFile::~AtomicFile() {
    if (stream_)
        std::fclose(stream_);
    if (!done_)
        std::remove(temporary_path_.c_str());
}

void AtomicFile::fail(const char *what, int code) const {
    throw WriteError(path_, fmt::format("{}: {}", what, std::strerror(code)));
}

void AtomicFile::check_target() const {
    struct stat status {};
    if (::stat(path_.c_str(), &status) != 0 || S_ISREG(status.st_mode))
        return;
    if (S_ISDIR(status.st_mode))
        throw WriteError(path_, "is a folder; name a file");
    throw WriteError(path_, "is a pipe, a device or a socket, which the file would replace; name a regular file");
}

void AtomicFile::write(const void *data, std::size_t size_bytes) {
    if (size_bytes > 0 && std::fwrite(data, 1, size_bytes, stream_) != size_bytes)
        fail("cannot be written", errno);
}

void AtomicFile::close() {
    if (!stream_)
        return;
    std::FILE *stream = stream_;
    const bool flushed = std::fflush(stream) == 0;
    const int flush_error = errno;
    stream_ = nullptr;
    const bool closed = std::fclose(stream) == 0;
    if (!flushed || !closed)
        fail("cannot be written", flushed ? errno : flush_error);
}

void AtomicFile::commit() {
    close();
    check_target();
    struct stat status {};
    if (read_only_ && ::stat(temporary_path_.c_str(), &status) == 0)
        (void)::chmod(temporary_path_.c_str(), status.st_mode & 0577);
    if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0)
        fail("cannot be put in place", errno);
    done_ = true;
}

void write_text(const std::string &path, const std::string &text) {
    AtomicFile file(path);
    file.write(text.data(), text.size());
    file.commit();
}

} // namespace image_io
