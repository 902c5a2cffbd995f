#include "commands.hpp"

#include "context.hpp"
#include "errors.hpp"
#include "text.hpp"

#include <fmt/format.h>

namespace tools {

namespace {

std::string kind_of(const ClspDeviceInfo &info) {
    std::string kind;
    for (const auto &[bit, name] : {std::pair<std::uint64_t, const char *>{CL_DEVICE_TYPE_GPU, "gpu"},
                                    {CL_DEVICE_TYPE_CPU, "cpu"},
                                    {CL_DEVICE_TYPE_ACCELERATOR, "accelerator"},
                                    {CL_DEVICE_TYPE_CUSTOM, "custom"}})
        if (info.type & bit)
            kind += (kind.empty() ? "" : ", ") + std::string(name);
    return kind.empty() ? "other" : kind;
}

std::string gibibytes(std::uint64_t bytes) {
    return fmt::format("{:.1f} GiB", static_cast<double>(bytes) / (1024.0 * 1024.0 * 1024.0));
}

Json to_json(const ClspDeviceInfo &info) {
    return {{"selector", info.selector},
            {"name", info.name},
            {"vendor", info.vendor},
            {"platform", info.platform_name},
            {"version", info.version},
            {"driver_version", info.driver_version},
            {"type", kind_of(info)},
            {"usable", info.usable != 0},
            {"reason", info.reason},
            {"rank", info.rank},
            {"compute_units", info.compute_units},
            {"global_memory_bytes", info.global_memory_bytes},
            {"max_allocation_bytes", info.max_allocation_bytes},
            {"local_memory_bytes", info.local_memory_bytes},
            {"max_work_group_size", info.max_work_group_size}};
}

constexpr std::uint32_t example_side = 1024;

/** The engine of an aperture for images of example_side x example_side, and why; or why there is none. */
std::string engine_of(const ClspDeviceInfo &info) {
    try {
        return clspeckle::Tuning::explain(make_context(info.selector), example_side, example_side);
    } catch (const clspeckle::Error &error) {
        return error.message();
    }
}

} // namespace

int run_devices(const std::string &device, Console &console) {
    const std::vector<ClspDeviceInfo> devices = clspeckle::devices();
    const std::string explanation = clspeckle::explain_devices(device);
    bool any = false;
    for (const ClspDeviceInfo &info : devices)
        any |= info.usable != 0;
    if (console.json()) {
        Json root;
        root["devices"] = Json::array();
        for (const ClspDeviceInfo &info : devices) {
            root["devices"].push_back(to_json(info));
            if (info.usable)
                root["devices"].back()["engine"] = engine_of(info);
        }
        root["explanation"] = explanation;
        console.result(root.dump(2));
    } else {
        if (!devices.empty()) {
            std::vector<std::vector<std::string>> rows = {
                {"device", "type", "units", "memory", "usable", "name", "platform", "OpenCL"}};
            for (const ClspDeviceInfo &info : devices)
                rows.push_back({info.selector, kind_of(info), std::to_string(info.compute_units),
                                gibibytes(info.global_memory_bytes), info.usable ? "yes" : "no", info.name,
                                info.platform_name, info.version});
            console.result(table(rows) + "\n");
            for (const ClspDeviceInfo &info : devices)
                if (info.usable)
                    console.result(fmt::format("{}  engine at {} x {}: {}", info.selector, example_side, example_side,
                                               engine_of(info)));
        }
        std::string text = explanation;
        while (!text.empty() && text.back() == '\n')
            text.pop_back();
        console.result(text);
    }
    return any ? exit_ok : exit_device;
}

} // namespace tools
