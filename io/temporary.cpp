#include "io/temporary.hpp"

#include <fmt/format.h>

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <set>
#include <string_view>
#include <system_error>
#include <tuple>

namespace image_io {
namespace {

/** Names begin so, then come 16 hexadecimal digits and ".part". */
const std::string prefix = ".clspeckle-", ending = ".part";
constexpr std::size_t digits = 16;

[[noreturn]] void fail() {
    throw std::system_error(errno, std::generic_category());
}

std::string random_name() {
    std::uint64_t number = 0;
    while (::getrandom(&number, sizeof number, 0) != sizeof number)
        if (errno != EINTR)
            fail();
    return fmt::format("{}{:0{}x}{}", prefix, number, digits, ending);
}

bool is_temporary(std::string_view name) {
    if (name.compare(0, prefix.size(), prefix) != 0 ||
        name.compare(std::min(name.size(), prefix.size() + digits), ending.size(), ending) != 0)
        return false;
    for (std::size_t i = prefix.size(); i < prefix.size() + digits; ++i)
        if (!std::isxdigit(static_cast<unsigned char>(name[i])))
            return false;
    const std::size_t end = prefix.size() + digits + ending.size(); // then the file's own ending
    return name.size() == end || name[end] == '.';
}

std::string folder_of(const std::string &path) {
    const std::size_t slash = path.find_last_of('/');
    return slash == std::string::npos ? "" : path.substr(0, slash + 1);
}

/** Removes a folder that holds files alone. */
void remove_folder(int parent, const char *name) noexcept {
    const int descriptor = ::openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor < 0)
        return;
    if (DIR *folder = ::fdopendir(descriptor)) {
        while (const dirent *entry = ::readdir(folder))
            ::unlinkat(descriptor, entry->d_name, 0); // refused for "." and ".."
        ::closedir(folder);
    } else {
        ::close(descriptor);
    }
    ::unlinkat(parent, name, AT_REMOVEDIR);
}

/** Removes what a killed program of this user left in a folder. */
void sweep(DIR *folder) noexcept {
    while (const dirent *entry = ::readdir(folder)) {
        const char *name = entry->d_name;
        if (!is_temporary(name))
            continue;
        const int one = ::openat(::dirfd(folder), name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
        struct stat status {};
        if (one < 0)
            continue;
        // Who writes holds the lock.
        if (::fstat(one, &status) == 0 && status.st_uid == ::geteuid() && ::flock(one, LOCK_EX | LOCK_NB) == 0) {
            if (S_ISREG(status.st_mode))
                ::unlinkat(::dirfd(folder), name, 0);
            else if (S_ISDIR(status.st_mode))
                remove_folder(::dirfd(folder), name);
        }
        ::close(one);
    }
}

/** Once for each folder: a program that writes many files looks through it once. */
void sweep_once(const std::string &path) {
    static std::mutex mutex;
    static std::set<std::tuple<std::string, dev_t, ino_t>> swept; // numbers are given out again
    const int descriptor = ::open(path.empty() ? "." : path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    struct stat status {};
    if (descriptor < 0)
        return;
    const std::lock_guard<std::mutex> lock(mutex);
    DIR *folder = nullptr;
    if (::fstat(descriptor, &status) != 0 || !swept.emplace(path, status.st_dev, status.st_ino).second ||
        !(folder = ::fdopendir(descriptor))) {
        ::close(descriptor);
        return;
    }
    sweep(folder);
    ::closedir(folder);
}

} // namespace

TemporaryLock::~TemporaryLock() {
    if (descriptor_ >= 0)
        ::close(descriptor_);
}

bool TemporaryLock::take(int descriptor) {
    struct stat status {};
    // Where a file system has no locks, others cannot lock it either: nothing is swept there.
    while (::flock(descriptor, LOCK_EX) != 0 && errno == EINTR) {
    }
    if (::fstat(descriptor, &status) != 0 || status.st_nlink == 0) {
        ::close(descriptor);
        return false;
    }
    descriptor_ = descriptor;
    return true;
}

std::string make_temporary_file(const std::string &path, TemporaryLock &lock, int &descriptor) {
    const std::string folder = folder_of(path);
    std::string extension = std::filesystem::path(path).extension().string();
    if (extension.size() > 16)
        extension.clear();
    sweep_once(folder);
    for (;;) {
        const std::string name = folder + random_name() + extension;
        descriptor = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
        if (descriptor < 0) {
            if (errno == EEXIST)
                continue;
            fail();
        }
        const int second = ::fcntl(descriptor, F_DUPFD_CLOEXEC, 0); // of one lock
        if (second < 0) {
            const int code = errno;
            ::close(descriptor);
            ::unlink(name.c_str());
            errno = code;
            fail();
        }
        if (lock.take(second))
            return name;
        ::close(descriptor);
    }
}

std::string make_temporary_folder(const std::string &path, TemporaryLock &lock) {
    const std::string folder = folder_of(path);
    sweep_once(folder);
    for (;;) {
        const std::string name = folder + random_name();
        if (::mkdir(name.c_str(), 0777) != 0) {
            if (errno == EEXIST)
                continue;
            fail();
        }
        const int descriptor = ::open(name.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        if (descriptor < 0) {
            const int code = errno;
            if (code == ENOENT) // swept
                continue;
            ::rmdir(name.c_str());
            errno = code;
            fail();
        }
        if (lock.take(descriptor))
            return name;
    }
}

void remove_temporary_folder(const std::string &path) noexcept {
    remove_folder(AT_FDCWD, path.c_str());
}

} // namespace image_io
