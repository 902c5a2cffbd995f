// Finding, ranking, choosing and explaining OpenCL devices.
#pragma once

#include "runtime/opencl.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace clsp {

struct DeviceRecord {
    cl::Platform platform;
    cl::Device device;
    std::string selector; // "platform:device"
    std::string name, vendor, version, driver_version, platform_name;
    std::uint64_t type = 0;
    std::uint64_t global_memory_bytes = 0, max_allocation_bytes = 0, local_memory_bytes = 0, max_work_group_size = 0;
    std::uint32_t compute_units = 0;
    bool usable = false;
    std::string reason; // why not
};

// Every device of every platform, best first: usable before unusable, GPU before accelerator before CPU, then by
// compute units.
std::vector<DeviceRecord> list_devices();

// The device that a selector names (see ClspContextDesc::device); "" means CLSPECKLE_DEVICE or the best one. Throws
// kNoDevice with an explanation.
DeviceRecord select_device(const std::string &selector);

// Text of a driver without its spaces and final zeros.
std::string trimmed(std::string text);

// What was seen, what is taken and why, what to install.
std::string explain_devices(const std::string &selector);

} // namespace clsp
