// Folders of files that are believed as they are: compiled programs, patterns. Whoever may write there runs code of his
// own here, so that nobody but this user may.
#pragma once

#include "io/atomic_file.hpp"

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace clsp {

class CacheFolder {
  public:
    // An open file and its size.
    class File {
      public:
        explicit operator bool() const { return stream_ != nullptr; }
        std::uint64_t size() const { return size_; }
        // False where it ends before.
        bool read(void *data, std::size_t bytes) { return std::fread(data, 1, bytes, stream_.get()) == bytes; }

      private:
        friend class CacheFolder;
        struct Close {
            void operator()(std::FILE *stream) const { std::fclose(stream); }
        };
        std::unique_ptr<std::FILE, Close> stream_;
        std::uint64_t size_ = 0;
    };

    // warn: is told once why a folder that there is is not used.
    CacheFolder(std::string path, std::function<void(const std::string &)> warn)
        : path_(std::move(path)), warn_(std::move(warn)) {}

    // None unless folder and file belong to this user, and nobody else may write into them. Links are not followed to a
    // file.
    File open(const std::string &name) const;
    // Makes the folder, for this user alone. False, with nothing left, where that fails or where open() would not read.
    bool write(const std::string &name, const std::function<void(image_io::AtomicFile &)> &fill) const;

  private:
    int trusted_folder() const;
    std::string path_;
    std::function<void(const std::string &)> warn_;
    mutable bool warned_ = false;
};

} // namespace clsp
