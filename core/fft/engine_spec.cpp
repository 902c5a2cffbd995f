#include "fft/engine_spec.hpp"

#include <fmt/core.h>

namespace clsp {
namespace {

bool is_of_type(const cl::Device &device, cl_device_type type) {
    return (device.getInfo<CL_DEVICE_TYPE>() & type) != 0;
}

} // namespace

const char *engine_name(EngineKind kind) {
    switch (kind) {
    case EngineKind::kCpu:
        return "cpu";
    case EngineKind::kGpu:
        return "gpu";
    case EngineKind::kClfft:
        break;
    }
    return "clfft";
}

std::optional<EngineKind> engine_of(const std::string &name) {
    for (const EngineKind kind : {EngineKind::kCpu, EngineKind::kGpu, EngineKind::kClfft})
        if (name == engine_name(kind))
            return kind;
    if (is_old_engine_name(name))
        return name == "fused-lanes" ? EngineKind::kCpu : EngineKind::kGpu;
    return {};
}

bool is_old_engine_name(const std::string &name) {
    return name == "fused-lanes" || name == "fused-groups";
}

std::string describe(const EngineSpec &spec) {
    std::string text = engine_name(spec.kind);
    for (const auto &[name, pick] : {std::pair{"columns", spec.columns}, std::pair{"rows", spec.rows}})
        if (pick)
            text += pick->items ? fmt::format(", {} {} x {}", name, pick->lines, pick->items)
                                : fmt::format(", {} by {}", name, pick->lines);
    return text;
}

EngineKind default_engine(const cl::Device &device) {
    const EngineKind own = own_engine(device);
    return own == EngineKind::kCpu || is_of_type(device, CL_DEVICE_TYPE_GPU) ? own : EngineKind::kClfft;
}

EngineKind own_engine(const cl::Device &device) {
    // A driver without vectors (Mesa's rusticl) takes lanes apart, and minutes to compile what is left.
    const bool has_vectors = device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>() > 1;
    return is_of_type(device, CL_DEVICE_TYPE_CPU) && has_vectors ? EngineKind::kCpu : EngineKind::kGpu;
}

} // namespace clsp
