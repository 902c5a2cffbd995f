// What a CPU's kernels need for lines of a length.
#pragma once

#include "fft/plan/line_plan.hpp"
#include "runtime/context.hpp"

#include <cstdint>
#include <memory>

namespace clsp {

struct CpuLines {
    LinePlan plan;
    ProgramCache::GeneratedHeader codelets; // in the lanes of the context's device
};

// Made once in a context and kept, as its programs are: the text takes as long as the transforms of a frame. Any
// thread.
std::shared_ptr<const CpuLines> cpu_lines(const Context &context, std::uint32_t length);

} // namespace clsp
