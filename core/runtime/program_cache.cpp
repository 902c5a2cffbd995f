#include "runtime/program_cache.hpp"

#include "runtime/build_log.hpp"
#include "runtime/embedded_kernels.hpp"
#include "runtime/error.hpp"
#include "runtime/hash.hpp"
#include "runtime/program_file.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fmt/core.h>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

namespace clsp {
namespace {

namespace fs = std::filesystem;

bool read_file(const fs::path &path, std::string &content) {
    std::error_code ignored;
    if (!fs::is_regular_file(path, ignored)) // a folder opens as a stream, too
        return false;
    std::ifstream file(path, std::ios::binary);
    if (!file)
        return false;
    content.assign(std::istreambuf_iterator<char>(file), {});
    return !file.bad();
}

// Where nobody looks, an edited kernel would do nothing in silence. A header of any other name may be a replaced
// kernel's own; one with a built-in name may not.
void check_kernel_dir(const std::string &folder) {
    std::error_code ignored;
    const auto options = fs::directory_options::skip_permission_denied;
    // Step by step: a range's ++ would throw where a folder cannot be read.
    for (fs::recursive_directory_iterator at(folder, options, ignored), last; at != last; at.increment(ignored)) {
        const fs::directory_entry &entry = *at;
        const std::string name = entry.path().lexically_relative(folder).generic_string(); // a link has its own name
        const auto is_it = [&](const EmbeddedKernel &kernel) { return name == kernel.name; };
        const EmbeddedKernel *end = kEmbeddedKernels + kEmbeddedKernelCount;
        if (!entry.is_regular_file(ignored) || std::any_of(kEmbeddedKernels, end, is_it))
            continue;
        std::string places;
        for (const EmbeddedKernel *kernel = kEmbeddedKernels; kernel != end; ++kernel)
            if (fs::path(kernel->name).filename() == entry.path().filename())
                places += fmt::format("{}{}", places.empty() ? "" : " or ", kernel->name);
        if (!places.empty())
            throw Error(Status::kIo,
                        fmt::format("kernel_dir \"{}\" holds {}, but the built-in kernel is {}; put it there", folder,
                                    name, places));
        if (entry.path().extension() == ".cl")
            throw Error(Status::kIo, fmt::format("kernel_dir \"{}\" holds {}, which is the path of no built-in kernel; "
                                                 "kernels/ of the sources has their paths",
                                                 folder, name));
    }
}

constexpr char kCacheMagic[] = "clspeckle-program-2\n";

} // namespace

ProgramCache::ProgramCache(const cl::Context &context, const cl::Device &device, Parameters parameters)
    : context_(context), device_(device), parameters_(std::move(parameters)),
      folder_(parameters_.cache_dir, parameters_.warn) {
    if (!parameters_.kernel_dir.empty() && !fs::is_directory(parameters_.kernel_dir))
        throw Error(Status::kIo,
                    fmt::format("kernel_dir \"{}\" is not a folder; it should hold .cl and .h files that replace "
                                "built-in kernels",
                                parameters_.kernel_dir));
    if (!parameters_.kernel_dir.empty())
        check_kernel_dir(parameters_.kernel_dir);
    common_options_ = "-cl-std=CL1.2";
    // With square roots rounded right, random numbers have the same bits on every device.
    if (device_.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>() & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT)
        common_options_ += " -cl-fp32-correctly-rounded-divide-sqrt";
    const cl::Platform platform(device_.getInfo<CL_DEVICE_PLATFORM>());
    device_key_ = platform.getInfo<CL_PLATFORM_NAME>() + '\n' + platform.getInfo<CL_PLATFORM_VERSION>() + '\n' +
                  device_.getInfo<CL_DEVICE_NAME>() + '\n' + device_.getInfo<CL_DEVICE_VERSION>() + '\n' +
                  device_.getInfo<CL_DRIVER_VERSION>() + '\n';
}

std::string ProgramCache::source(const std::string &file, const GeneratedHeader *generated) const {
    if (generated && file == generated->name)
        return generated->source;
    if (!parameters_.kernel_dir.empty()) {
        const fs::path path = fs::path(parameters_.kernel_dir) / file;
        std::error_code ignored;
        if (fs::exists(path, ignored)) {
            std::string content;
            if (!read_file(path, content))
                throw Error(Status::kIo,
                            fmt::format("cannot read {}; kernel_dir must hold readable files", path.string()));
            return content;
        }
    }
    for (std::size_t i = 0; i < kEmbeddedKernelCount; ++i)
        if (file == kEmbeddedKernels[i].name)
            return kEmbeddedKernels[i].source;
    throw Error(Status::kBuild,
                fmt::format("there is no kernel file \"{}\", neither built in nor in kernel_dir", file));
}

// Replaces #include "file" lines by the file: embedded sources have no folder for the compiler to look in. Include
// guards do the rest.
std::string ProgramCache::expanded(const std::string &file, const GeneratedHeader *generated, int depth) const {
    if (depth > 8)
        throw Error(Status::kBuild, fmt::format("kernel file \"{}\" includes itself", file));
    // By hand: a stream takes an allocation that fails for the text's end.
    const std::string whole = source(file, generated);
    std::string text = fmt::format("#line 1 \"{}\"\n", file);
    int number = 1;
    for (std::size_t begin = 0, end; begin < whole.size(); begin = end + 1, ++number) {
        end = std::min(whole.find('\n', begin), whole.size());
        const std::string line = whole.substr(begin, end - begin);
        constexpr const char *kInclude = "#include \"";
        if (line.rfind(kInclude, 0) == 0) {
            const std::size_t first = std::strlen(kInclude), last = line.find('"', first);
            text += expanded(line.substr(first, last - first), generated, depth + 1);
            text += fmt::format("#line {} \"{}\"\n", number + 1, file);
        } else {
            text += line + '\n';
        }
    }
    return text;
}

cl::Program ProgramCache::get(const std::string &file, const std::string &defines, const GeneratedHeader *generated) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string key = file + ' ' + defines + (generated ? '\n' + generated->source : std::string());
    if (const auto found = programs_.find(key); found != programs_.end())
        return found->second;

    const std::string text = expanded(file, generated, 0);
    const std::string options = common_options_ + ' ' + defines;
    const bool on_disk = !parameters_.cache_dir.empty();
    const std::string head = on_disk ? head_of_file(text, options) : "";
    const std::string name = fmt::format("{:016x}.clbin", fnv1a(head));
    cl::Program program;
    if (on_disk)
        program = load(name, head, options);
    if (program()) {
        ++from_disk_;
    } else {
        program = build_program(file, text, options);
        ++built_;
        if (on_disk)
            store(program, name, head);
    }
    programs_.emplace(key, program);
    return program;
}

cl::Program ProgramCache::build_program(const std::string &file, const std::string &text,
                                        const std::string &options) const {
    for (bool again = false;; again = true) {
        const cl::Program program(context_, text);
        const cl_int code = clBuildProgram(program(), 1, &device_(), options.c_str(), nullptr, nullptr);
        if (code == CL_SUCCESS)
            return program;
        std::string log = "(the driver gave no build log)";
        try {
            log = with_files_and_lines(program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device_), text);
        } catch (const cl::Error &) {
        }
        if (again || names_an_error(log))
            throw Error(Status::kBuild,
                        fmt::format("kernel file \"{}\" does not build with \"{}\": {}; the build log tells where",
                                    file, options, opencl_code_name(code)),
                        code, log);
    }
}

// What a program's file begins with: magic, the device key and options in full, the source's hash. Anything that does
// not fit makes the program be built anew.
std::string ProgramCache::head_of_file(const std::string &source_text, const std::string &options) const {
    WideHash source;
    source.add(source_text.data(), source_text.size());
    const auto digest = source.digest();
    return kCacheMagic + device_key_ + options + '\n' + fmt::format("{:016x}{:016x}\n", digest[0], digest[1]);
}

cl::Program ProgramCache::load(const std::string &name, const std::string &head, const std::string &options) const {
    CacheFolder::File file = folder_.open(name);
    const std::optional<std::string> binary = read_program_file(file, head);
    if (!binary)
        return {};
    try {
        std::vector<cl_int> status;
        cl::Program program(context_, {device_}, cl::Program::Binaries{{binary->begin(), binary->end()}}, &status);
        program.build({device_}, options.c_str());
        return program;
    } catch (const cl::Error &) {
        return {};
    }
}

// A cache that cannot be written costs time, not correctness.
void ProgramCache::store(const cl::Program &program, const std::string &name, const std::string &head) const {
    try {
        const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
        const auto devices = program.getInfo<CL_PROGRAM_DEVICES>();
        for (std::size_t i = 0; i < devices.size(); ++i) {
            if (devices[i]() != device_() || binaries[i].empty())
                continue;
            const std::string binary(binaries[i].begin(), binaries[i].end());
            folder_.write(name, [&](image_io::AtomicFile &file) { write_program_file(file, head, binary); });
        }
    } catch (const cl::Error &) {
    }
}

} // namespace clsp
