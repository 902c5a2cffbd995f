// Compiled OpenCL programs of a context: in memory, and on disk where that helps.
#pragma once

#include "runtime/cache_folder.hpp"
#include "runtime/opencl.hpp"

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace clsp {

class ProgramCache {
  public:
    struct Parameters {
        std::string kernel_dir; // files here replace the built-in ones; "" for none
        std::string cache_dir;  // "" turns the disk cache off
        std::function<void(const std::string &)> warn;
    };

    ProgramCache(const cl::Context &context, const cl::Device &device, Parameters parameters);

    // A header that is made at run time.
    struct GeneratedHeader {
        std::string name, source;
    };

    // The program of kernel file `file` built with `defines` ("-DNAME=VALUE ..."); built once. Throws kBuild with the
    // log. generated: a header that the file includes; nullptr for none.
    cl::Program get(const std::string &file, const std::string &defines, const GeneratedHeader *generated = nullptr);

    std::uint32_t built() const { return built_; }
    std::uint32_t from_disk() const { return from_disk_; }

  private:
    std::string source(const std::string &file, const GeneratedHeader *generated) const;
    std::string expanded(const std::string &file, const GeneratedHeader *generated, int depth) const;
    // Builds it from source, once more where it is the driver that failed.
    cl::Program build_program(const std::string &file, const std::string &text, const std::string &options) const;
    std::string head_of_file(const std::string &source_text, const std::string &options) const;
    cl::Program load(const std::string &name, const std::string &head, const std::string &options) const;
    void store(const cl::Program &program, const std::string &name, const std::string &head) const;

    cl::Context context_;
    cl::Device device_;
    Parameters parameters_;
    CacheFolder folder_;
    std::string common_options_;
    std::string device_key_;
    std::mutex mutex_;
    std::map<std::string, cl::Program> programs_;
    std::atomic<std::uint32_t> built_{0}, from_disk_{0};
};

} // namespace clsp
