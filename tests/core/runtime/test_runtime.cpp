// Versions and errors, devices, contexts, program cache, kernel folder, queues, buffers, events.
#include "test_support.hpp"

#include <dlfcn.h>
#include <fstream>
#include <iterator>
#include <set>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>

namespace {

bool failed_events_pass = false; // as with NVIDIA's driver
std::string build_log;           // instead of the driver's, if not empty

} // namespace

// In the place of the driver's, which they call.
extern "C" cl_int clWaitForEvents(cl_uint count, const cl_event *events) {
    static const auto real =
        reinterpret_cast<cl_int (*)(cl_uint, const cl_event *)>(dlsym(RTLD_NEXT, "clWaitForEvents"));
    const cl_int code = real(count, events);
    return failed_events_pass && code == CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST ? CL_SUCCESS : code;
}

extern "C" cl_int clGetProgramBuildInfo(cl_program program, cl_device_id device, cl_program_build_info what,
                                        size_t size, void *value, size_t *size_ret) {
    using Function = cl_int (*)(cl_program, cl_device_id, cl_program_build_info, size_t, void *, size_t *);
    static const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "clGetProgramBuildInfo"));
    if (what != CL_PROGRAM_BUILD_LOG || build_log.empty())
        return real(program, device, what, size, value, size_ret);
    if (value)
        std::memcpy(value, build_log.c_str(), std::min(size, build_log.size() + 1));
    if (size_ret)
        *size_ret = build_log.size() + 1;
    return CL_SUCCESS;
}

namespace {

using test::DeviceTest;
namespace fs = std::filesystem;

TEST(Status, NamesAndVersion) {
    EXPECT_STREQ("CLSP_SUCCESS", clspStatusString(CLSP_SUCCESS));
    std::set<std::string> names;
    for (ClspStatus status = CLSP_ERROR_INVALID_ARGUMENT; status >= CLSP_ERROR_CANCELLED; --status) {
        const std::string name = clspStatusString(status);
        EXPECT_EQ(0u, name.rfind("CLSP_ERROR_", 0)) << status << " is " << name;
        EXPECT_TRUE(names.insert(name).second) << name << " appears twice";
    }
    EXPECT_STREQ("CLSP_ERROR_NO_DEVICE", clspStatusString(CLSP_ERROR_NO_DEVICE));
    for (ClspStatus status : {1, -18, 1000000, std::numeric_limits<ClspStatus>::min()})
        EXPECT_STREQ("unknown status", clspStatusString(status));
    std::uint32_t major = 99, minor = 99, patch = 99, abi = 99;
    EXPECT_CLSP_OK(clspGetVersion(&major, &minor, &patch, &abi));
    EXPECT_EQ(static_cast<std::uint32_t>(CLSP_VERSION_MAJOR), major);
    EXPECT_EQ(static_cast<std::uint32_t>(CLSP_VERSION_MINOR), minor);
    EXPECT_EQ(static_cast<std::uint32_t>(CLSP_VERSION_PATCH), patch);
    EXPECT_EQ(static_cast<std::uint32_t>(CLSP_ABI_VERSION), abi);
    EXPECT_CLSP_OK(clspGetVersion(nullptr, nullptr, nullptr, nullptr));
    minor = 99;
    EXPECT_CLSP_OK(clspGetVersion(nullptr, &minor, nullptr, nullptr));
    EXPECT_EQ(static_cast<std::uint32_t>(CLSP_VERSION_MINOR), minor);
}

TEST(LastError, IsKeptPerThread) {
    std::thread([] {
        ClspErrorInfo info = test::last_error();
        EXPECT_EQ(CLSP_SUCCESS, info.status) << "a fresh thread has no error";
        ASSERT_NE(nullptr, info.function);
        ASSERT_NE(nullptr, info.message);
        ASSERT_NE(nullptr, info.build_log);
        EXPECT_STREQ("", info.message);
    }).join();
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspFieldGridCompute(nullptr));
    std::thread([] { EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspQueueFinish(nullptr)); }).join();
    EXPECT_STREQ("clspFieldGridCompute", test::last_error().function);
    // A success does not erase it.
    ClspFieldGrid grid{8, 8, 1, 0, 0, 0};
    EXPECT_CLSP_OK(clspFieldGridCompute(&grid));
    EXPECT_STREQ("clspFieldGridCompute", test::last_error().function);
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, test::last_error().status);
    // Asking wrongly neither crashes nor overwrites it.
    EXPECT_EQ(CLSP_ERROR_INVALID_ARGUMENT, clspGetLastError(nullptr));
    ClspErrorInfo small{};
    small.struct_size = 8;
    EXPECT_EQ(CLSP_ERROR_INVALID_STRUCT_SIZE, clspGetLastError(&small));
    EXPECT_STREQ("clspFieldGridCompute", test::last_error().function);
}

TEST(LastError, LongerStructOfANewerCallerIsFilledAsFarAsKnown) {
    struct Longer {
        ClspErrorInfo info;
        unsigned char tail[32];
    } longer;
    std::memset(&longer, 0x5A, sizeof(longer));
    longer.info.struct_size = sizeof(longer);
    clspFieldGridCompute(nullptr);
    EXPECT_EQ(CLSP_SUCCESS, clspGetLastError(&longer.info));
    EXPECT_EQ(sizeof(longer), longer.info.struct_size);
    EXPECT_STREQ("clspFieldGridCompute", longer.info.function);
}

TEST(Devices, ListBestFirst) {
    std::uint32_t count = 0;
    ASSERT_CLSP_OK(clspDeviceList(0, nullptr, &count));
    ASSERT_GT(count, 0u) << "the tests need an OpenCL device: " << clspeckle::explain_devices();
    const auto devices = clspeckle::devices();
    ASSERT_EQ(count, devices.size());
    for (std::uint32_t i = 0; i < count; ++i) {
        const ClspDeviceInfo &info = devices[i];
        EXPECT_EQ(sizeof(ClspDeviceInfo), info.struct_size);
        EXPECT_EQ(i, info.rank);
        EXPECT_NE(nullptr, info.platform_id);
        EXPECT_NE(nullptr, info.device_id);
        EXPECT_STRNE("", info.name);
        EXPECT_STRNE("", info.platform_name);
        EXPECT_NE(nullptr, std::strchr(info.selector, ':'));
        EXPECT_EQ(info.usable == 1, info.reason[0] == '\0') << info.reason;
        cl_ulong memory = 0;
        clGetDeviceInfo(info.device_id, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof(memory), &memory, nullptr);
        EXPECT_EQ(memory, info.global_memory_bytes);
        if (i > 0) {
            EXPECT_GE(devices[i - 1].usable, info.usable) << "usable devices come first";
        }
    }
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "count", clspDeviceList(0, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "devices", clspDeviceList(1, nullptr, &count));
    ClspDeviceInfo info{};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspDeviceList(1, &info, &count));
    // A newer caller's elements are larger; the first one says how large.
    struct Longer {
        ClspDeviceInfo info;
        unsigned char tail[40];
    };
    std::vector<Longer> longer(count + 1);
    std::memset(static_cast<void *>(longer.data()), 0x33, longer.size() * sizeof(Longer));
    longer[0].info.struct_size = sizeof(Longer);
    ASSERT_CLSP_OK(clspDeviceList(count, &longer[0].info, &count));
    EXPECT_STREQ(devices[count - 1].name, longer[count - 1].info.name);
    EXPECT_EQ(0x33, *reinterpret_cast<unsigned char *>(&longer[count])) << "written beyond the capacity";
}

TEST(Devices, ExplanationNamesTheChoiceAndTheReason) {
    const auto devices = clspeckle::devices();
    const std::string text = clspeckle::explain_devices();
    for (const ClspDeviceInfo &info : devices) {
        EXPECT_NE(std::string::npos, text.find(info.name)) << text;
        EXPECT_NE(std::string::npos, text.find(info.reason)) << text;
    }
    const std::string refused = clspeckle::explain_devices("no such device");
    EXPECT_NE(std::string::npos, refused.find("no such device")) << refused;
    EXPECT_NE(std::string::npos, refused.find("pocl-opencl-icd")) << "it does not say how to install one: " << refused;

    std::uint64_t length = 0;
    EXPECT_CLSP_OK(clspDeviceExplain(nullptr, 0, nullptr, &length));
    EXPECT_EQ(text.size() + 1, length);
    char cut[10];
    std::memset(cut, 'x', sizeof(cut));
    EXPECT_CLSP_OK(clspDeviceExplain(nullptr, 8, cut, nullptr));
    EXPECT_EQ(text.substr(0, 7), cut);
    EXPECT_EQ('x', cut[8]) << "written beyond the capacity";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "text", clspDeviceExplain(nullptr, 8, nullptr, &length));
}

TEST(Devices, Selectors) {
    const auto devices = clspeckle::devices();
    const auto usable =
        std::find_if(devices.begin(), devices.end(), [](const ClspDeviceInfo &d) { return d.usable == 1; });
    ASSERT_NE(devices.end(), usable);
    const auto device_of = [](const char *selector) {
        auto desc = clspeckle::make<ClspContextDesc>();
        desc.device = selector;
        return clspeckle::Context(desc).info().cl_device;
    };
    EXPECT_EQ(usable->device_id, device_of(nullptr));
    EXPECT_EQ(usable->device_id, device_of(usable->selector));
    const std::string name = usable->name;
    std::string shouted = test::lower(name.substr(0, 6));
    std::transform(shouted.begin(), shouted.end(), shouted.begin(),
                   [](char c) { return static_cast<char>(std::toupper(c)); });
    EXPECT_EQ(usable->device_id, device_of(shouted.c_str())) << "a part of the name, in any case";
    EXPECT_EQ(usable->device_id, device_of(test::lower(usable->platform_name).c_str()));
    for (const auto &[selector, type] : {std::pair{"cpu", CL_DEVICE_TYPE_CPU}, std::pair{"gpu", CL_DEVICE_TYPE_GPU},
                                         std::pair{"accelerator", CL_DEVICE_TYPE_ACCELERATOR}}) {
        const auto first =
            std::find_if(devices.begin(), devices.end(), [type = static_cast<std::uint64_t>(type)](const auto &d) {
                return d.usable == 1 && (d.type & type) != 0;
            });
        auto desc = clspeckle::make<ClspContextDesc>();
        desc.device = selector;
        ClspContext context = nullptr;
        if (first == devices.end()) {
            EXPECT_CLSP_FAILS(CLSP_ERROR_NO_DEVICE, selector, clspContextCreate(&desc, &context));
            EXPECT_EQ(nullptr, context);
        } else {
            EXPECT_EQ(first->device_id, device_of(selector));
        }
    }
    auto desc = clspeckle::make<ClspContextDesc>();
    ClspContext context = nullptr;
    for (const char *selector : {"no such device", "99:0", "0:99", "0:", "-1:0"}) {
        desc.device = selector;
        EXPECT_CLSP_FAILS(CLSP_ERROR_NO_DEVICE, selector, clspContextCreate(&desc, &context));
        EXPECT_NE(nullptr, std::strstr(test::last_error().message, usable->name)) << "it does not list what there is";
    }
    // The environment names the default; a selector in the description comes before it.
    ASSERT_EQ(0, setenv("CLSPECKLE_DEVICE", "no such device", 1));
    desc.device = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_NO_DEVICE, "no such device", clspContextCreate(&desc, &context));
    EXPECT_CLSP_FAILS(CLSP_ERROR_NO_DEVICE, "no such device", clspContextCreate(nullptr, &context));
    EXPECT_EQ(usable->device_id, device_of(usable->selector));
    ASSERT_EQ(0, setenv("CLSPECKLE_DEVICE", usable->selector, 1));
    EXPECT_EQ(usable->device_id, device_of(nullptr));
    unsetenv("CLSPECKLE_DEVICE");
}

class Context : public DeviceTest {};

TEST_F(Context, DescInit) {
    test::check_init<ClspContextDesc>("clspContextDescInit", clspContextDescInit);
    ClspContextDesc desc;
    ASSERT_CLSP_OK(clspContextDescInit(&desc, sizeof(desc)));
    EXPECT_EQ(CLSP_DISK_CACHE_AUTO, desc.disk_cache);
    EXPECT_EQ(nullptr, desc.cl_context_handle);
    EXPECT_EQ(nullptr, desc.cl_device);
    EXPECT_EQ(nullptr, desc.device);
    EXPECT_EQ(nullptr, desc.kernel_dir);
    EXPECT_EQ(nullptr, desc.cache_dir);
}

TEST_F(Context, CreateRefusesBadArguments) {
    const auto valid = clspeckle::make<ClspContextDesc>();
    ClspContext made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "context", clspContextCreate(&valid, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "context", clspContextCreate(nullptr, nullptr));
    test::check_struct_size<ClspContextDesc>("clspContextCreate", valid, [](ClspContextDesc *desc) {
        ClspContext result = nullptr;
        const ClspStatus status = clspContextCreate(desc, &result);
        clspContextRelease(result);
        return status;
    });
    auto desc = valid;
    desc.disk_cache = 3;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CLSP_DISK_CACHE_OFF (1) or CLSP_DISK_CACHE_ON (2)",
                      clspContextCreate(&desc, &made));
    const test::HostContext host;
    desc = valid;
    desc.cl_context_handle = host.context;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "cl_device", clspContextCreate(&desc, &made));
    desc = valid;
    desc.cl_device = host.device;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "cl_context_handle", clspContextCreate(&desc, &made));
    desc.cl_context_handle = host.context;
    desc.device = "cpu";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "device", clspContextCreate(&desc, &made));
    desc = valid;
    desc.kernel_dir = "/no/such/folder";
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "/no/such/folder", clspContextCreate(&desc, &made));
    EXPECT_EQ(nullptr, made);
}

TEST_F(Context, RetainAndRelease) {
    ClspContext made = nullptr;
    auto info = clspeckle::make<ClspContextInfo>();
    ASSERT_CLSP_OK(clspContextCreate(nullptr, &made));
    EXPECT_CLSP_OK(clspContextRetain(made));
    EXPECT_CLSP_OK(clspContextRelease(made));
    EXPECT_CLSP_OK(clspContextGetInfo(made, &info));
    EXPECT_CLSP_OK(clspContextRelease(made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspContextGetInfo(made, &info));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspContextRetain(made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspContextRelease(made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspContextRetain(nullptr));
    EXPECT_CLSP_OK(clspContextRelease(nullptr));
}

TEST_F(Context, InfoTellsWhatItHolds) {
    const clspeckle::Context own;
    ClspContextInfo info = own.info();
    EXPECT_EQ(0u, info.programs_built);
    EXPECT_EQ(0u, info.programs_from_cache);
    EXPECT_EQ(0u, info.allocation_count);
    EXPECT_EQ(0u, info.allocated_bytes);
    EXPECT_STRNE("", info.device_name);
    EXPECT_STRNE("", info.platform_name);
    {
        auto desc = clspeckle::make<ClspPhaseDesc>();
        desc.width = 100;
        desc.height = 50;
        const clspeckle::Phase phase(own, desc);
        info = own.info();
        EXPECT_GT(info.allocation_count, 0u);
        EXPECT_GE(info.allocated_bytes, 100u * 50u * 4u);
        EXPECT_GT(info.programs_built + info.programs_from_cache, 0u);
    }
    info = own.info();
    EXPECT_EQ(0u, info.allocation_count);
    EXPECT_EQ(0u, info.allocated_bytes);
    const clspeckle::Buffer host_buffer(own, 4096);
    EXPECT_EQ(0u, own.info().allocation_count) << "the host's buffers do not count";
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspContextGetInfo(nullptr, &info));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "info", clspContextGetInfo(own, nullptr));
    info.struct_size = 0;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_STRUCT_SIZE, "struct_size", clspContextGetInfo(own, &info));
}

TEST_F(Context, HostContextIsRetainedAndNotOwned) {
    test::HostContext host;
    const auto references = [&] {
        cl_uint count = 0;
        clGetContextInfo(host.context, CL_CONTEXT_REFERENCE_COUNT, sizeof(count), &count, nullptr);
        return count;
    };
    const cl_uint before = references();
    {
        const auto context_of_host = clspeckle::Context::from_host(host.context, host.device);
        EXPECT_GT(references(), before);
        EXPECT_EQ(host.context, context_of_host.info().cl_context_handle);
    }
    EXPECT_EQ(before, references());
}

// Program cache and kernel folder. Philox is one small program: fill an image and look at the words.
class Programs : public DeviceTest {
  protected:
    test::TemporaryFolder folder;

    ClspContextDesc cached() const {
        auto desc = clspeckle::make<ClspContextDesc>();
        desc.disk_cache = CLSP_DISK_CACHE_ON;
        desc.cache_dir = folder.path().c_str();
        return desc;
    }
    struct Outcome {
        std::vector<std::uint32_t> words;
        std::uint32_t built, from_cache;
    };
    Outcome fill(const ClspContextDesc &desc) {
        const clspeckle::Context own(desc);
        auto image = make_image(16, 16, CLSP_FORMAT_UINT32);
        auto philox = clspeckle::make<ClspPhiloxDesc>();
        philox.distribution = CLSP_DISTRIBUTION_BITS;
        clspeckle::philox::enqueue_fill(own, queue, philox, image.view);
        Outcome outcome;
        outcome.words = download<std::uint32_t>(image);
        outcome.built = own.info().programs_built;
        outcome.from_cache = own.info().programs_from_cache;
        return outcome;
    }
    std::vector<fs::path> cache_files() const {
        std::vector<fs::path> files;
        for (const auto &entry : fs::recursive_directory_iterator(folder.path()))
            if (entry.is_regular_file())
                files.push_back(entry.path());
        return files;
    }
    static std::string read(const fs::path &path) {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    static void write(const fs::path &path, const std::string &content) {
        std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
    }
    // A kernel of the source tree with one text replaced, in a folder of its own.
    static void edit_kernel(const fs::path &to, const std::string &name, const std::string &from,
                            const std::string &by) {
        std::string source = read(fs::path(CLSP_KERNEL_SOURCE_DIR) / name);
        const std::size_t at = source.find(from);
        ASSERT_NE(std::string::npos, at) << name << " has no " << from;
        fs::create_directories((to / name).parent_path());
        write(to / name, source.replace(at, from.size(), by));
    }
};

TEST_F(Programs, SecondContextLoadsFromTheDisk) {
    const Outcome first = fill(cached()), second = fill(cached());
    EXPECT_GT(first.built, 0u);
    EXPECT_EQ(0u, first.from_cache);
    EXPECT_EQ(0u, second.built);
    EXPECT_EQ(first.built, second.from_cache);
    EXPECT_EQ(first.words, second.words);
    for (const fs::path &path : cache_files())
        EXPECT_EQ(".clbin", path.extension()) << "left over: " << path;
    auto off = cached();
    off.disk_cache = CLSP_DISK_CACHE_OFF;
    EXPECT_EQ(0u, fill(off).from_cache);
}

TEST_F(Programs, CacheFolderFromTheEnvironment) {
    const fs::path deep = folder.path() / "made" / "when" / "needed";
    ASSERT_EQ(0, setenv("CLSPECKLE_CACHE_DIR", deep.c_str(), 1));
    auto desc = cached();
    desc.cache_dir = nullptr;
    EXPECT_GT(fill(desc).built, 0u);
    EXPECT_EQ(0u, fill(desc).built);
    unsetenv("CLSPECKLE_CACHE_DIR");
    EXPECT_FALSE(fs::is_empty(deep));
    ASSERT_EQ(0, setenv("XDG_CACHE_HOME", (folder.path() / "xdg").c_str(), 1));
    EXPECT_GT(fill(desc).built, 0u);
    unsetenv("XDG_CACHE_HOME");
    EXPECT_TRUE(fs::exists(folder.path() / "xdg" / "clspeckle"));
}

TEST_F(Programs, DiskCacheFromTheEnvironment) {
    auto desc = cached();
    desc.disk_cache = CLSP_DISK_CACHE_AUTO;
    ASSERT_EQ(0, setenv("CLSPECKLE_DISK_CACHE", "off", 1));
    EXPECT_EQ(0u, fill(desc).from_cache);
    EXPECT_TRUE(cache_files().empty());
    ASSERT_EQ(0, setenv("CLSPECKLE_DISK_CACHE", "on", 1)); // on PoCL, too
    EXPECT_GT(fill(desc).built, 0u);
    EXPECT_EQ(0u, fill(desc).built);
    ASSERT_EQ(0, setenv("CLSPECKLE_DISK_CACHE", "off", 1)); // a context that asks for it itself has its way
    EXPECT_GT(fill(cached()).from_cache, 0u);
    ASSERT_EQ(0, setenv("CLSPECKLE_DISK_CACHE", "always", 1));
    ClspContext made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "CLSPECKLE_DISK_CACHE is \"always\"; set it to auto, off or on",
                      clspContextCreate(&desc, &made));
    unsetenv("CLSPECKLE_DISK_CACHE");
}

TEST_F(Programs, CorruptedCacheFilesAreIgnoredAndReplaced) {
    const Outcome first = fill(cached());
    const auto files = cache_files();
    ASSERT_FALSE(files.empty());
    std::vector<std::string> good;
    for (const fs::path &path : files)
        good.push_back(read(path));
    const auto ruin = [&](const char *how, const std::function<std::string(std::string)> &change) {
        for (std::size_t i = 0; i < files.size(); ++i)
            write(files[i], change(good[i]));
        const Outcome after = fill(cached());
        EXPECT_EQ(first.words, after.words) << how;
        EXPECT_EQ(first.built, after.built) << how;
        EXPECT_EQ(0u, fill(cached()).built) << how << ": the file was not replaced";
    };
    ruin("empty", [](const std::string &) { return std::string(); });
    ruin("text", [](const std::string &) { return std::string("not a program\n"); });
    ruin("cut in half", [](const std::string &s) { return s.substr(0, s.size() / 2); });
    ruin("cut in the header", [](const std::string &s) { return s.substr(0, 30); });
    ruin("one byte short", [](const std::string &s) { return s.substr(0, s.size() - 1); });
    ruin("one byte longer", [](const std::string &s) { return s + 'x'; });
    ruin("one bit flipped at the end", [](std::string s) { return s.back() = static_cast<char>(s.back() ^ 1), s; });
    ruin("one bit flipped in the middle",
         [](std::string s) { return s[s.size() / 2] = static_cast<char>(s[s.size() / 2] ^ 8), s; });
    ruin("one bit flipped at the start", [](std::string s) { return s[0] = static_cast<char>(s[0] ^ 1), s; });
    // A folder where the file should be.
    fs::remove(files[0]);
    fs::create_directory(files[0]);
    EXPECT_EQ(first.words, fill(cached()).words);
}

TEST_F(Programs, AFileOfAnotherSourceIsNotLoaded) {
    const Outcome built_in = fill(cached());
    const auto files = cache_files();
    ASSERT_EQ(1u, files.size());
    const std::string of_built_in = read(files[0]);
    fs::remove(files[0]);
    const fs::path kernels = folder.path() / "kernels";
    edit_kernel(kernels, "common/philox.h", "0x9E3779B9u", "0x9E3779BBu");
    auto desc = cached();
    desc.kernel_dir = kernels.c_str();
    const Outcome edited = fill(desc);
    EXPECT_NE(built_in.words, edited.words);
    fs::remove_all(kernels / "common");
    for (const fs::path &path : cache_files())
        if (path.extension() == ".clbin")
            fs::rename(path, files[0]); // under the name of the other one
    const Outcome again = fill(cached());
    EXPECT_EQ(built_in.words, again.words);
    EXPECT_EQ(0u, again.from_cache);
    EXPECT_EQ(of_built_in.size(), read(files[0]).size());
}

// Whoever can write there runs code of his own here.
TEST_F(Programs, WhatOthersMayWriteIsNotLoaded) {
    const Outcome first = fill(cached());
    const auto files = cache_files();
    ASSERT_EQ(1u, files.size());
    std::vector<std::string> lines;
    const auto log = [](void *data, std::uint32_t, const char *message) {
        static_cast<std::vector<std::string> *>(data)->emplace_back(message);
    };
    const auto loaded = [&] {
        auto desc = cached();
        desc.log = log;
        desc.log_data = &lines;
        lines.clear();
        const Outcome outcome = fill(desc);
        EXPECT_EQ(first.words, outcome.words);
        return outcome.from_cache > 0;
    };
    EXPECT_TRUE(loaded());
    EXPECT_TRUE(lines.empty());
    for (const int mode : {0770, 0707, 0777}) {
        fs::permissions(folder.path(), fs::perms(mode));
        EXPECT_FALSE(loaded()) << mode;
        ASSERT_EQ(1u, lines.size());
        const std::string advice = "`chmod go-w '" + folder.path().string() + "'`";
        EXPECT_NE(std::string::npos, lines[0].find("others may write into it")) << lines[0];
        ASSERT_NE(std::string::npos, lines[0].find(advice)) << lines[0];
        ASSERT_EQ(0, std::system(advice.substr(1, advice.size() - 2).c_str()));
        EXPECT_TRUE(loaded()) << "the advice did not help";
    }
    for (const int mode : {0660, 0606}) {
        fs::permissions(files[0], fs::perms(mode));
        EXPECT_FALSE(loaded()) << mode;
        EXPECT_TRUE(loaded()) << "it was not replaced";
    }
    const fs::path elsewhere = folder.path() / "elsewhere";
    fs::rename(files[0], elsewhere);
    fs::create_symlink(elsewhere, files[0]);
    EXPECT_FALSE(loaded()) << "through a link";
    EXPECT_TRUE(loaded()) << "it was not replaced";
    if (::geteuid() == 0) { // only root can give files away
        ASSERT_EQ(0, ::chown(files[0].c_str(), 65534, 65534));
        EXPECT_FALSE(loaded());
        ASSERT_EQ(0, ::chown(folder.path().c_str(), 65534, 65534));
        EXPECT_FALSE(loaded());
        ASSERT_EQ(1u, lines.size());
        EXPECT_NE(std::string::npos, lines[0].find("it belongs to the user 65534, not to 0")) << lines[0];
        ASSERT_EQ(0, ::chown(folder.path().c_str(), 0, 0));
    }
    // A folder that the library makes is nobody else's, whatever the umask says.
    const mode_t before = ::umask(0);
    auto desc = cached();
    const std::string made = folder.path() / "made" / "here";
    desc.cache_dir = made.c_str();
    fill(desc);
    ::umask(before);
    EXPECT_EQ(fs::perms(0700), fs::status(made).permissions());
    EXPECT_GT(fill(desc).from_cache, 0u);
}

TEST_F(Programs, AFolderThatCannotBeWrittenIsFine) {
    const Outcome plain = fill(clspeckle::make<ClspContextDesc>());
    write(folder.path() / "file", "in the way");
    const std::string below = folder.path() / "file" / "cache";
    for (const std::string &bad : {below, std::string("/proc/clspeckle"), std::string(5000, 'x')}) {
        auto desc = cached();
        desc.cache_dir = bad.c_str();
        const Outcome outcome = fill(desc);
        EXPECT_EQ(plain.words, outcome.words);
        EXPECT_EQ(0u, outcome.from_cache);
    }
    EXPECT_EQ("in the way", read(folder.path() / "file"));
}

TEST_F(Programs, EditedKernelTakesEffectAndHasItsOwnCacheKey) {
    const Outcome built_in = fill(cached());
    const fs::path kernels = folder.path() / "kernels";
    fs::create_directory(kernels);
    edit_kernel(kernels, "common/philox.h", "0x9E3779B9u", "0x9E3779BBu");
    auto desc = cached();
    desc.kernel_dir = kernels.c_str();
    const Outcome edited = fill(desc);
    EXPECT_NE(built_in.words, edited.words) << "the edited kernel was not used";
    EXPECT_GT(edited.built, 0u) << "it was loaded from the cache of another source";
    EXPECT_EQ(edited.words, fill(desc).words);
    EXPECT_EQ(0u, fill(desc).built);
    EXPECT_EQ(built_in.words, fill(cached()).words);
    // The same by the environment.
    ASSERT_EQ(0, setenv("CLSPECKLE_KERNEL_DIR", kernels.c_str(), 1));
    EXPECT_EQ(edited.words, fill(cached()).words);
    unsetenv("CLSPECKLE_KERNEL_DIR");
    // An empty folder replaces nothing.
    const fs::path empty = folder.path() / "empty";
    fs::create_directory(empty);
    desc.kernel_dir = empty.c_str();
    EXPECT_EQ(built_in.words, fill(desc).words);
    // Where it replaces nothing, it says so.
    write(empty / "philox.h", "");
    ClspContext misplaced = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "the built-in kernel is common/philox.h", clspContextCreate(&desc, &misplaced));
    fs::remove(empty / "philox.h");
    fs::create_directory(empty / "stages");
    write(empty / "stages/columns.cl", "");
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "fft/cpu/columns.cl or fft/gpu/columns.cl", clspContextCreate(&desc, &misplaced));
    fs::remove(empty / "stages/columns.cl");
    // A link is known by its own name, also behind a path with a final slash.
    write(folder.path() / "mine.txt", read(fs::path(CLSP_KERNEL_SOURCE_DIR) / "stages/philox.cl"));
    fs::create_symlink(folder.path() / "mine.txt", empty / "stages/philox.cl");
    const std::string slash = empty.string() + "/";
    desc.kernel_dir = slash.c_str();
    EXPECT_EQ(built_in.words, fill(desc).words);
    desc.kernel_dir = empty.c_str();
    write(empty / "fused_columns.cl", "");
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "fused_columns.cl, which is the path of no built-in kernel",
                      clspContextCreate(&desc, &misplaced));
}

TEST_F(Programs, BrokenKernelGivesTheBuildLog) {
    edit_kernel(folder.path(), "stages/philox.cl", "__kernel",
                "__kernel void broken() { this_is_not_declared = 1; }\n__kernel");
    auto desc = clspeckle::make<ClspContextDesc>();
    desc.kernel_dir = folder.path().c_str();
    const clspeckle::Context own(desc);
    auto image = make_image(8, 8, CLSP_FORMAT_FLOAT32);
    const auto philox = clspeckle::make<ClspPhiloxDesc>();
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUILD, "stages/philox.cl",
                      clspPhiloxEnqueueFill(own, queue, &philox, &image.view, 0, nullptr, nullptr));
    const ClspErrorInfo info = test::last_error();
    EXPECT_NE(nullptr, std::strstr(info.build_log, "this_is_not_declared")) << info.build_log;
    EXPECT_NE(0, info.opencl_code);
    try {
        clspeckle::philox::enqueue_fill(own, queue, philox, image.view);
        FAIL() << "no exception";
    } catch (const clspeckle::Error &error) {
        EXPECT_EQ(CLSP_ERROR_BUILD, error.status());
        EXPECT_NE(std::string::npos, error.build_log().find("this_is_not_declared"));
    }
    // A compiler that counts lines of the whole program: a directive, the file's first line, a directive,
    // common/philox.h.
    build_log = "<kernel>:4:25: error: this_is_not_declared";
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUILD, "stages/philox.cl",
                      clspPhiloxEnqueueFill(own, queue, &philox, &image.view, 0, nullptr, nullptr));
    build_log.clear();
    EXPECT_STREQ("common/philox.h:1:25: error: this_is_not_declared", test::last_error().build_log);
    // The next failure has no build log.
    clspFieldGridCompute(nullptr);
    EXPECT_STREQ("", test::last_error().build_log);
    // Once it is repaired, a new context works.
    fs::remove(folder.path() / "stages/philox.cl");
    const clspeckle::Context repaired(desc);
    EXPECT_CLSP_OK(clspPhiloxEnqueueFill(repaired, queue, &philox, &image.view, 0, nullptr, nullptr));
    // A file that includes itself ends with an error, not with a full stack.
    fs::create_directory(folder.path() / "common");
    write(folder.path() / "common/philox.h", "#include \"common/philox.h\"\n");
    const clspeckle::Context endless(desc);
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUILD, "common/philox.h",
                      clspPhiloxEnqueueFill(endless, queue, &philox, &image.view, 0, nullptr, nullptr));
    fs::remove(folder.path() / "common/philox.h");
    fs::create_directory(folder.path() / "common/philox.h");
    const clspeckle::Context unreadable(desc);
    EXPECT_CLSP_FAILS(CLSP_ERROR_IO, "common/philox.h",
                      clspPhiloxEnqueueFill(unreadable, queue, &philox, &image.view, 0, nullptr, nullptr));
    fs::remove(folder.path() / "common/philox.h");
    write(folder.path() / "common/philox.h", "#include \"missing.h\"\n");
    const clspeckle::Context incomplete(desc);
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUILD, "missing.h",
                      clspPhiloxEnqueueFill(incomplete, queue, &philox, &image.view, 0, nullptr, nullptr));
}

class Buffers : public DeviceTest {};

TEST_F(Buffers, QueueFlags) {
    for (std::uint32_t flags = 0; flags < 4; ++flags) {
        if ((flags & CLSP_QUEUE_OUT_OF_ORDER) != 0 && test::out_of_order(context) == 0) {
            cl_command_queue none = nullptr;
            EXPECT_CLSP_FAILS(CLSP_ERROR_UNSUPPORTED, "in-order", clspQueueCreate(context, flags, &none));
            continue;
        }
        const clspeckle::Queue made(context, flags);
        cl_command_queue_properties properties = 0;
        clGetCommandQueueInfo(made, CL_QUEUE_PROPERTIES, sizeof(properties), &properties, nullptr);
        EXPECT_EQ((flags & CLSP_QUEUE_PROFILING) != 0, (properties & CL_QUEUE_PROFILING_ENABLE) != 0);
        EXPECT_EQ((flags & CLSP_QUEUE_OUT_OF_ORDER) != 0, (properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) != 0);
    }
    cl_command_queue made = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspQueueCreate(nullptr, 0, &made));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspQueueCreate(context, 0, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "flags", clspQueueCreate(context, 4, &made));
    EXPECT_EQ(nullptr, made);
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspQueueFinish(nullptr));
    EXPECT_CLSP_OK(clspQueueRelease(nullptr));
}

TEST_F(Buffers, CopiesThereAndBack) {
    cl_mem mem = nullptr;
    ASSERT_CLSP_OK(clspBufferCreate(context, 1000, &mem));
    std::vector<unsigned char> data(1000);
    for (std::size_t i = 0; i < data.size(); ++i)
        data[i] = static_cast<unsigned char>(i * 7);
    EXPECT_CLSP_OK(clspBufferWrite(queue, data.data(), 1000, mem, 0));
    std::vector<unsigned char> part(10);
    EXPECT_CLSP_OK(clspBufferRead(queue, mem, 990, 10, part.data()));
    EXPECT_TRUE(std::equal(part.begin(), part.end(), data.end() - 10));
    const std::vector<unsigned char> patch(5, 0xFF);
    cl_event written = nullptr, read = nullptr;
    EXPECT_CLSP_OK(clspBufferEnqueueWrite(queue, patch.data(), 5, mem, 500, 0, nullptr, &written));
    EXPECT_CLSP_OK(clspBufferEnqueueRead(queue, mem, 0, 1000, data.data(), 1, &written, &read));
    const cl_event both[] = {written, read};
    EXPECT_CLSP_OK(clspEventWait(2, both));
    EXPECT_EQ(0xFF, data[500]);
    EXPECT_EQ(0xFF, data[504]);
    EXPECT_EQ(static_cast<unsigned char>(505 * 7), data[505]);
    EXPECT_CLSP_OK(clspEventRelease(written));
    EXPECT_CLSP_OK(clspEventRelease(read));
    EXPECT_CLSP_OK(clspEventRelease(nullptr));
    EXPECT_CLSP_OK(clspBufferRelease(mem));
    EXPECT_CLSP_OK(clspBufferRelease(nullptr));
}

// Equal places of buffers that begin alike share a cache's few sets: an image's pixel and its phase would drive each
// other out.
TEST_F(Buffers, LargeOnesBeginAtDifferentPlacesOfTheirPages) {
    constexpr std::size_t bytes = std::size_t{4} << 20, page = std::size_t{2} << 20;
    std::set<std::size_t> places;
    std::vector<clspeckle::Buffer> buffers;
    for (int i = 0; i < 8; ++i) {
        buffers.emplace_back(context, bytes);
        void *memory = nullptr;
        ASSERT_EQ(CL_SUCCESS, clGetMemObjectInfo(buffers.back(), CL_MEM_HOST_PTR, sizeof memory, &memory, nullptr));
        if (memory) // PoCL's CPU; others have memory of their own
            places.insert(reinterpret_cast<std::size_t>(memory) % page);
    }
    EXPECT_TRUE(places.empty() || places.size() == 8u) << places.size();
    for (const std::size_t place : places)
        EXPECT_EQ(0u, place % 64) << "vectors are aligned";
}

TEST_F(Buffers, RefuseBadArguments) {
    cl_mem mem = nullptr;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_HANDLE, "context", clspBufferCreate(nullptr, 64, &mem));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "size_bytes", clspBufferCreate(context, 0, &mem));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "mem", clspBufferCreate(context, 64, nullptr));
    for (std::uint64_t huge : {std::uint64_t{1} << 60, ~std::uint64_t{0}})
        EXPECT_CLSP_FAILS(CLSP_ERROR_OUT_OF_MEMORY, std::to_string(huge), clspBufferCreate(context, huge, &mem));
    EXPECT_EQ(nullptr, mem);

    const clspeckle::Buffer buffer(context, 64);
    const test::Foreign foreign;
    unsigned char data[64] = {};
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspBufferWrite(nullptr, data, 64, buffer, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "data", clspBufferWrite(queue, nullptr, 64, buffer, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "size_bytes", clspBufferWrite(queue, data, 0, buffer, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "mem", clspBufferWrite(queue, data, 64, nullptr, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUFFER_TOO_SMALL, "64", clspBufferWrite(queue, data, 64, buffer, 1));
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUFFER_TOO_SMALL, "64", clspBufferWrite(queue, data, 2, buffer, ~std::uint64_t{0}));
    EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "mem", clspBufferWrite(queue, data, 64, foreign.buffer, 0));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "queue", clspBufferRead(nullptr, buffer, 0, 64, data));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "data", clspBufferRead(queue, buffer, 0, 64, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "size_bytes", clspBufferRead(queue, buffer, 0, 0, data));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "mem", clspBufferRead(queue, nullptr, 0, 64, data));
    EXPECT_CLSP_FAILS(CLSP_ERROR_BUFFER_TOO_SMALL, "64", clspBufferRead(queue, buffer, 32, 33, data));
    EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "mem", clspBufferRead(queue, foreign.buffer, 0, 64, data));

    const cl_event none = nullptr, other = foreign.event;
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "event_wait_list",
                      clspBufferEnqueueWrite(queue, data, 64, buffer, 0, 1, nullptr, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "event_wait_list",
                      clspBufferEnqueueWrite(queue, data, 64, buffer, 0, 0, &other, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "event_wait_list",
                      clspBufferEnqueueRead(queue, buffer, 0, 64, data, 1, &none, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_WRONG_CONTEXT, "event_wait_list",
                      clspBufferEnqueueRead(queue, buffer, 0, 64, data, 1, &other, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "num_events", clspEventWait(0, &other));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "events", clspEventWait(1, nullptr));
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "events", clspEventWait(1, &none));

    // An event that ended with an error.
    const auto failed = clspeckle::Event::adopt(foreign.host.user_event());
    clSetUserEventStatus(failed, -42);
    const auto complete = clspeckle::Event::adopt(foreign.host.user_event());
    clSetUserEventStatus(complete, CL_COMPLETE);
    const cl_event both[] = {complete, failed};
    for (const bool passes : {false, true}) {
        failed_events_pass = passes;
        EXPECT_CLSP_OK(clspEventWait(1, both));
        EXPECT_CLSP_FAILS(CLSP_ERROR_OPENCL, "CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST",
                          clspEventWait(1, both + 1));
        EXPECT_EQ(CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST, test::last_error().opencl_code);
        EXPECT_CLSP_FAILS(CLSP_ERROR_OPENCL, "clWaitForEvents", clspEventWait(2, both));
    }
    failed_events_pass = false;
}

TEST_F(Buffers, ImagesAreRefused) {
    cl_bool has_images = CL_FALSE;
    clGetDeviceInfo(context.info().cl_device, CL_DEVICE_IMAGE_SUPPORT, sizeof(has_images), &has_images, nullptr);
    ASSERT_TRUE(has_images);
    const cl_image_format format{CL_R, CL_FLOAT};
    cl_image_desc desc{};
    desc.image_type = CL_MEM_OBJECT_IMAGE2D;
    desc.image_width = desc.image_height = 16;
    cl_int code = CL_SUCCESS;
    const auto picture = clspeckle::Buffer::adopt(
        clCreateImage(context.info().cl_context_handle, CL_MEM_READ_WRITE, &format, &desc, nullptr, &code),
        16 * 16 * 4);
    ASSERT_EQ(CL_SUCCESS, code);
    const ClspImage view = picture.image(16, 16, CLSP_FORMAT_FLOAT32);
    const auto philox = clspeckle::make<ClspPhiloxDesc>();
    EXPECT_CLSP_FAILS(CLSP_ERROR_INVALID_ARGUMENT, "cl_image",
                      clspPhiloxEnqueueFill(context, queue, &philox, &view, 0, nullptr, nullptr));
}

} // namespace
