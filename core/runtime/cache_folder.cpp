#include "runtime/cache_folder.hpp"

#include <cerrno>
#include <fcntl.h>
#include <filesystem>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

namespace clsp {
namespace {

namespace fs = std::filesystem;

bool others_may_write(const struct stat &status) {
    return (status.st_mode & (S_IWGRP | S_IWOTH)) != 0;
}

void make_folders(const fs::path &path) {
    if (path.empty() || ::mkdir(path.c_str(), 0700) == 0 || errno != ENOENT)
        return;
    make_folders(path.parent_path());
    ::mkdir(path.c_str(), 0700);
}

} // namespace

// A descriptor of the folder, or -1.
int CacheFolder::trusted_folder() const {
    const int folder = ::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0)
        return -1;
    struct stat status {};
    std::string why;
    if (::fstat(folder, &status) != 0)
        why = "its owner cannot be found out";
    else if (status.st_uid != ::geteuid())
        why = fmt::format("it belongs to the user {}, not to {}; choose another one", status.st_uid, ::geteuid());
    else if ((status.st_mode & S_ISVTX) && others_may_write(status))
        why = "it is a folder for everybody; choose another one";
    else if (others_may_write(status))
        why = fmt::format("others may write into it (mode {:03o}); `chmod go-w '{}'` forbids it", status.st_mode & 0777,
                          path_);
    if (why.empty())
        return folder;
    ::close(folder);
    if (!warned_)
        warn_(fmt::format("the cache folder {} is not used: {}", path_, why));
    warned_ = true;
    return -1;
}

CacheFolder::File CacheFolder::open(const std::string &name) const {
    File result;
    const int folder = trusted_folder();
    if (folder < 0)
        return result;
    const int file = ::openat(folder, name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    ::close(folder);
    struct stat status {};
    if (file < 0)
        return result;
    if (::fstat(file, &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == ::geteuid() &&
        !others_may_write(status))
        result.stream_.reset(::fdopen(file, "rb"));
    if (!result.stream_)
        ::close(file);
    result.size_ = static_cast<std::uint64_t>(status.st_size);
    return result;
}

bool CacheFolder::write(const std::string &name, const std::function<void(image_io::AtomicFile &)> &fill) const {
    make_folders(fs::path(path_));
    const int folder = trusted_folder();
    if (folder < 0)
        return false;
    ::close(folder);
    try {
        image_io::AtomicFile file((fs::path(path_) / name).string());
        if (::fchmod(::fileno(file.stream()), 0600) != 0)
            return false;
        fill(file);
        file.commit();
        return true;
    } catch (const image_io::WriteError &) {
        return false;
    }
}

} // namespace clsp
