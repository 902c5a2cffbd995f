#include "fft/engine.hpp"

#include <fmt/core.h>

namespace clsp {
namespace {

constexpr Engine kEngines[] = {Engine::kClfft, Engine::kFusedLanes, Engine::kFusedGroups};

bool is_of_type(const cl::Device &device, cl_device_type type) {
    return (device.getInfo<CL_DEVICE_TYPE>() & type) != 0;
}

} // namespace

const char *engine_name(Engine engine) {
    switch (engine) {
    case Engine::kFusedLanes:
        return "fused-lanes";
    case Engine::kFusedGroups:
        return "fused-groups";
    case Engine::kClfft:
        break;
    }
    return "clfft";
}

std::optional<Engine> engine_of(const std::string &name) {
    for (const Engine engine : kEngines)
        if (name == engine_name(engine))
            return engine;
    return {};
}

std::string describe(const EngineSpec &spec) {
    std::string text = engine_name(spec.engine);
    for (const auto &[name, pick] : {std::pair{"columns", spec.columns}, std::pair{"rows", spec.rows}})
        if (pick)
            text += pick->items ? fmt::format(", {} {} x {}", name, pick->lines, pick->items)
                                : fmt::format(", {} by {}", name, pick->lines);
    return text;
}

Engine default_engine(const cl::Device &device) {
    return is_of_type(device, CL_DEVICE_TYPE_CPU)   ? Engine::kFusedLanes
           : is_of_type(device, CL_DEVICE_TYPE_GPU) ? Engine::kFusedGroups
                                                     : Engine::kClfft;
}

Engine fused_engine_for(const cl::Device &device) {
    return is_of_type(device, CL_DEVICE_TYPE_CPU) ? Engine::kFusedLanes : Engine::kFusedGroups;
}

} // namespace clsp
