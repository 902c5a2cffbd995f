// The engines that an aperture's transforms may have, and how one is named.
#pragma once

#include "runtime/opencl.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace clsp {

enum class EngineKind { kCpu, kGpu, kClfft };

// Of the engine for GPUs: lines in a work-group, and work-items for each of them. items 0: as many as
// choose_shape()'s rule takes for so many lines.
struct WorkGroup {
    std::uint32_t lines = 0, items = 0;

    bool operator==(const WorkGroup &other) const { return lines == other.lines && items == other.items; }
};

// An engine; that for GPUs with the work-groups of the columns' pass and of both rows' passes. None: what
// choose_shape() takes.
struct EngineSpec {
    EngineKind kind = EngineKind::kClfft;
    std::optional<WorkGroup> columns, rows;

    bool operator==(const EngineSpec &other) const {
        return kind == other.kind && columns == other.columns && rows == other.rows;
    }
};

// One of the engines that a context would take for a grid, and why.
struct EngineChoice {
    EngineSpec spec;
    std::string source; // "CLSPECKLE_FFT is clfft", "the tuning record /home/..", ..
};

// "cpu", "gpu", "clfft".
const char *engine_name(EngineKind kind);
// Also of the old names, which tuning records may have: "fused-lanes" (cpu) and "fused-groups" (gpu).
std::optional<EngineKind> engine_of(const std::string &name);
bool is_old_engine_name(const std::string &name);
// With the work-groups, if they are given: "gpu, columns 8 x 64, rows 1 x 64" (lines x work-items).
std::string describe(const EngineSpec &spec);

// What devices get that no record speaks of.
EngineKind default_engine(const cl::Device &device);
// The library's own engine that is made for a device.
EngineKind own_engine(const cl::Device &device);

} // namespace clsp
