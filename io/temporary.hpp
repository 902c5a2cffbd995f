/**
 * @file temporary.hpp
 * @brief What lies beside a file or a folder until it is complete: under a name that nobody can foretell, never in the
 * place of something, and removed by the next program that writes there where the one that made it was killed.
 */
#ifndef CLSPECKLE_IO_TEMPORARY_HPP
#define CLSPECKLE_IO_TEMPORARY_HPP

#include <string>

namespace image_io {

/** The lock by which others see that what it stands for is still being written; it goes with the process. */
class TemporaryLock {
  public:
    TemporaryLock() = default;
    ~TemporaryLock() { end(); }
    TemporaryLock(const TemporaryLock &) = delete;
    TemporaryLock &operator=(const TemporaryLock &) = delete;
    /** @param descriptor is taken over. False: it has been swept away before it was locked. */
    bool take(int descriptor);
    /** What was taken over, which is the caller's from now on; -1: nothing. */
    int release() noexcept;
    void end() noexcept;

  private:
    int descriptor_ = -1;
};

/** Makes an empty file in the folder of `path`, with its ending, and opens it for writing. @return its name. Throws
 * std::system_error. */
std::string make_temporary_file(const std::string &path, TemporaryLock &lock, int &descriptor);
/** Makes an empty folder beside `path`. @return its name. Throws std::system_error. */
std::string make_temporary_folder(const std::string &path, TemporaryLock &lock);

/** Removes a folder that make_temporary_folder() made, and the files in it. @param lock its own, which ends: with it
 * nothing need be opened, which may be what has failed. An empty one stands for a folder that took the other's
 * place. */
void remove_temporary_folder(const std::string &path, TemporaryLock &lock) noexcept;

} // namespace image_io

#endif // CLSPECKLE_IO_TEMPORARY_HPP
