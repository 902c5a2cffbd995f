/**
 * @file atomic_file.hpp
 * @brief Files that are never seen half-written: everything goes to a temporary name in the same folder, which is
 * renamed when it is complete.
 */
#ifndef CLSPECKLE_IO_ATOMIC_FILE_HPP
#define CLSPECKLE_IO_ATOMIC_FILE_HPP

#include "io/temporary.hpp"

#include <cstddef>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace image_io {

/** A file that cannot be written: the message begins with its name. */
class WriteError : public std::runtime_error {
  public:
    WriteError(const std::string &path, const std::string &what) : std::runtime_error(path + ": " + what) {}
};

/** A file that appears under its name only when it is complete. A pipe, a device or a folder of that name is refused:
 * the file would take its place. A file that it replaces leaves it its rights. */
class AtomicFile {
  public:
    explicit AtomicFile(std::string path);
    ~AtomicFile();
    AtomicFile(const AtomicFile &) = delete;
    AtomicFile &operator=(const AtomicFile &) = delete;

    std::FILE *stream() const { return stream_; }
    const std::string &temporary_path() const { return temporary_path_; }
    void write(const void *data, std::size_t size_bytes);
    /** Closes the stream for writers that open the temporary name themselves. */
    void close();
    /** Flushes, closes and renames. Without it the destructor removes the file. */
    void commit();

  private:
    [[noreturn]] void fail(const char *what, int code) const;
    void check_target() const;
    std::string path_;
    std::string temporary_path_;
    TemporaryLock lock_;
    std::FILE *stream_ = nullptr;
    bool read_only_ = false; ///< Once it is complete, as what it replaces.
    bool done_ = false;
};

void write_text(const std::string &path, const std::string &text);

} // namespace image_io

#endif // CLSPECKLE_IO_ATOMIC_FILE_HPP
