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
#include <map>
#include <mutex>
#include <string_view>
#include <system_error>
#include <utility>

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

/** Removes a folder that holds files alone. @param descriptor of it, which is closed; -1: it is opened. */
void remove_folder(int parent, const char *name, int descriptor = -1) noexcept {
    if (descriptor < 0)
        descriptor = ::openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
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

/** So many folders are remembered: the memory of a long run does not grow with those that it has written to. */
constexpr std::size_t most_swept = 64;

/** Notes what a path leads to. @return whether that is another folder than before. */
bool is_new(std::map<std::string, std::pair<dev_t, ino_t>> &known, const std::string &path,
            std::pair<dev_t, ino_t> place) {
    const auto found = known.find(path);
    if (found != known.end())
        return std::exchange(found->second, place) != place;
    if (known.size() == most_swept)
        known.clear();
    known.emplace(path, place);
    return true;
}

/** Once for each folder: a program that writes many files looks through it once. */
void sweep_once(const std::string &path) {
    static std::mutex mutex;
    static std::map<std::string, std::pair<dev_t, ino_t>> swept; // numbers are given out again
    const char *name = path.empty() ? "." : path.c_str();
    struct stat status {};
    const std::lock_guard<std::mutex> lock(mutex);
    if (::stat(name, &status) != 0 || !is_new(swept, path, {status.st_dev, status.st_ino}))
        return;
    if (DIR *folder = ::opendir(name)) {
        sweep(folder);
        ::closedir(folder);
    }
}

} // namespace

void TemporaryLock::end() noexcept {
    if (descriptor_ >= 0)
        ::close(release());
}

int TemporaryLock::release() noexcept {
    return std::exchange(descriptor_, -1);
}

bool TemporaryLock::take(int descriptor) {
    struct stat status {};
    // Where a file system has no locks, others cannot lock it either: nothing is swept there.
    while (::flock(descriptor, LOCK_EX) != 0 && errno == EINTR) {
    }
    descriptor_ = descriptor;
    if (::fstat(descriptor, &status) != 0)
        fail();
    if (status.st_nlink > 0)
        return true;
    end();
    return false;
}

std::string make_temporary_file(const std::string &path, TemporaryLock &lock, int &descriptor) {
    const std::string folder = folder_of(path);
    std::string extension = std::filesystem::path(path).extension().string();
    if (extension.size() > 16)
        extension.clear();
    // A temporary folder is this program's own.
    if (!is_temporary(std::filesystem::path(path).parent_path().filename().string()))
        sweep_once(folder);
    for (;;) {
        const std::string name = folder + random_name() + extension;
        descriptor = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
        if (descriptor < 0) {
            if (errno == EEXIST)
                continue;
            fail();
        }
        try {
            const int second = ::fcntl(descriptor, F_DUPFD_CLOEXEC, 0); // of one lock
            if (second < 0)
                fail();
            if (lock.take(second))
                return name;
        } catch (...) {
            ::close(descriptor);
            ::unlink(name.c_str());
            throw;
        }
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
        if (descriptor < 0 && errno == ENOENT) // swept
            continue;
        try {
            if (descriptor < 0)
                fail();
            if (lock.take(descriptor))
                return name;
        } catch (...) {
            ::rmdir(name.c_str());
            throw;
        }
    }
}

void remove_temporary_folder(const std::string &path, TemporaryLock &lock) noexcept {
    remove_folder(AT_FDCWD, path.c_str(), lock.release());
}

} // namespace image_io
