#include "runtime/device.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <fmt/core.h>
#include <fmt/format.h>

namespace clsp {
namespace {

constexpr const char *kInstallHint =
    "To install a device: on Debian and Ubuntu `apt install pocl-opencl-icd` runs OpenCL on any CPU; for a GPU install "
    "its "
    "driver's OpenCL part (nvidia-opencl-icd, intel-opencl-icd, mesa-opencl-icd or rocm-opencl-runtime). OpenCL finds "
    "drivers through /etc/OpenCL/vendors/*.icd, or the folder in the environment variable OCL_ICD_VENDORS.";

std::string lowered(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return text;
}

// What clSpeckle needs of a device; "" if it is all there.
std::string why_unusable(const cl::Device &device) {
    if (!device.getInfo<CL_DEVICE_AVAILABLE>())
        return "the driver says that the device is not available";
    if (!device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>())
        return "the driver has no OpenCL C compiler";
    if (!device.getInfo<CL_DEVICE_ENDIAN_LITTLE>())
        return "the device is big-endian";
    int major = 0, minor = 0;
    const std::string version = device.getInfo<CL_DEVICE_VERSION>();
    if (std::sscanf(version.c_str(), "OpenCL %d.%d", &major, &minor) != 2 || major * 10 + minor < 12)
        return fmt::format("it offers {}, at least OpenCL 1.2 is needed", trimmed(version));
    return {};
}

DeviceRecord inspect(const cl::Platform &platform, const cl::Device &device, std::size_t p, std::size_t d) {
    DeviceRecord record;
    record.platform = platform;
    record.device = device;
    record.selector = fmt::format("{}:{}", p, d);
    try {
        record.platform_name = trimmed(platform.getInfo<CL_PLATFORM_NAME>());
        record.name = trimmed(device.getInfo<CL_DEVICE_NAME>());
        record.vendor = trimmed(device.getInfo<CL_DEVICE_VENDOR>());
        record.version = trimmed(device.getInfo<CL_DEVICE_VERSION>());
        record.driver_version = trimmed(device.getInfo<CL_DRIVER_VERSION>());
        record.type = device.getInfo<CL_DEVICE_TYPE>();
        record.global_memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
        record.max_allocation_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
        record.local_memory_bytes = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
        record.max_work_group_size = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
        record.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
        record.reason = why_unusable(device);
    } catch (const cl::Error &error) {
        record.reason =
            fmt::format("the driver failed to describe it: {} in {}", opencl_code_name(error.err()), error.what());
    }
    record.usable = record.reason.empty();
    return record;
}

// A driver without devices, or one that does not tell them: one that cannot be used, so that it is told why.
DeviceRecord silent_platform(const cl::Platform &platform, std::size_t p, cl_int code) {
    DeviceRecord record;
    record.platform = platform;
    record.selector = fmt::format("{}:0", p);
    record.name = "no device";
    try {
        record.platform_name = trimmed(platform.getInfo<CL_PLATFORM_NAME>());
    } catch (const cl::Error &) {
        record.platform_name = "a platform without a name";
    }
    if (code != CL_DEVICE_NOT_FOUND)
        record.reason = fmt::format("the driver failed to list its devices: {}", opencl_code_name(code));
    else if (record.platform_name == "Portable Computing Language")
        record.reason = "PoCL offers no device where it cannot write its cache. Let POCL_CACHE_DIR (without it "
                        "XDG_CACHE_HOME, then HOME) name a folder that can be written";
    else
        record.reason = "the driver offers no device on this machine";
    return record;
}

int kind_rank(const DeviceRecord &record) {
    if (record.type & CL_DEVICE_TYPE_GPU)
        return 0;
    if (record.type & CL_DEVICE_TYPE_ACCELERATOR)
        return 1;
    return 2;
}

std::string effective_selector(const std::string &selector) {
    if (!selector.empty())
        return selector;
    const char *variable = ::secure_getenv("CLSPECKLE_DEVICE");
    return variable ? variable : "";
}

bool matches(const DeviceRecord &record, const std::string &selector) {
    const std::string wanted = lowered(selector);
    if (wanted.empty() || record.selector == wanted)
        return true;
    if (wanted == "gpu")
        return (record.type & CL_DEVICE_TYPE_GPU) != 0;
    if (wanted == "cpu")
        return (record.type & CL_DEVICE_TYPE_CPU) != 0;
    if (wanted == "accelerator")
        return (record.type & CL_DEVICE_TYPE_ACCELERATOR) != 0;
    return lowered(record.name).find(wanted) != std::string::npos ||
           lowered(record.platform_name).find(wanted) != std::string::npos;
}

const DeviceRecord *find(const std::vector<DeviceRecord> &records, const std::string &selector) {
    for (const DeviceRecord &record : records)
        if (record.usable && matches(record, selector))
            return &record;
    return nullptr;
}

std::string explanation(const std::vector<DeviceRecord> &records, const std::string &selector) {
    const DeviceRecord *chosen = find(records, selector);
    std::string text;
    if (records.empty())
        text += "No OpenCL device was found: no platform (driver) is installed.\n";
    for (const DeviceRecord &record : records) {
        std::string verdict;
        if (!record.usable)
            verdict = "refused: " + record.reason;
        else if (&record == chosen)
            verdict = selector.empty() ? "taken: the best usable device (GPU before CPU)"
                                       : fmt::format("taken: the best usable device that matches \"{}\"", selector);
        else
            verdict = matches(record, selector) ? "usable" : fmt::format("usable, but does not match \"{}\"", selector);
        text += fmt::format("{}  {} ({}, {}, driver {}): {}\n", record.selector, record.name, record.platform_name,
                            record.version, record.driver_version, verdict);
    }
    if (!records.empty() && !chosen)
        text += selector.empty()
                    ? "None of the devices is usable.\n"
                    : fmt::format("No usable device matches \"{}\". A device is named by \"platform:device\" as listed "
                                  "above, \"gpu\", \"cpu\", \"accelerator\", or a part of its name.\n",
                                  selector);
    if (!chosen)
        text += std::string(kInstallHint) + "\n";
    return text;
}

} // namespace

std::string trimmed(std::string text) {
    while (!text.empty() && (text.back() == '\0' || std::isspace(static_cast<unsigned char>(text.back()))))
        text.pop_back();
    const auto first = std::find_if(text.begin(), text.end(), [](unsigned char c) { return !std::isspace(c); });
    return {first, text.end()};
}

std::vector<DeviceRecord> list_devices() {
    std::vector<cl::Platform> platforms;
    try {
        cl::Platform::get(&platforms);
    } catch (const cl::Error &error) {
        // The loader reports "no platform" as an error; to us it is an empty list.
        constexpr cl_int kNoPlatform = -1001; // CL_PLATFORM_NOT_FOUND_KHR
        if (error.err() != kNoPlatform)
            throw from_opencl(error.err(), "clGetPlatformIDs");
    }
    std::vector<DeviceRecord> records;
    for (std::size_t p = 0; p < platforms.size(); ++p) {
        std::vector<cl::Device> devices;
        cl_int code = CL_DEVICE_NOT_FOUND; // for which the wrapper throws nothing
        try {
            platforms[p].getDevices(CL_DEVICE_TYPE_ALL, &devices);
        } catch (const cl::Error &error) {
            code = error.err();
        }
        if (devices.empty())
            records.push_back(silent_platform(platforms[p], p, code));
        for (std::size_t d = 0; d < devices.size(); ++d)
            records.push_back(inspect(platforms[p], devices[d], p, d));
    }
    std::stable_sort(records.begin(), records.end(), [](const DeviceRecord &a, const DeviceRecord &b) {
        if (a.usable != b.usable)
            return a.usable;
        if (kind_rank(a) != kind_rank(b))
            return kind_rank(a) < kind_rank(b);
        return a.compute_units > b.compute_units;
    });
    return records;
}

DeviceRecord select_device(const std::string &selector) {
    const std::string wanted = effective_selector(selector);
    const std::vector<DeviceRecord> records = list_devices();
    if (const DeviceRecord *chosen = find(records, wanted))
        return *chosen;
    throw Error(Status::kNoDevice, explanation(records, wanted));
}

std::string explain_devices(const std::string &selector) {
    return explanation(list_devices(), effective_selector(selector));
}

} // namespace clsp
