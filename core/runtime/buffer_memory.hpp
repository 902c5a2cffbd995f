// The memory behind buffers that the library makes.
#pragma once

#include "runtime/opencl.hpp"

#include <cstddef>

namespace clsp {

class Context;

// host_data: initial content, copied; nullptr leaves the memory uninitialised. On CPUs that PoCL drives, large buffers
// lie in large pages where the system has them: passes over columns touch a page of every row, more than the processor
// keeps addresses of (docs/results/performance.md). Throws what OpenCL says.
cl::Buffer allocate_buffer(const Context &context, std::size_t bytes, const void *host_data = nullptr);

} // namespace clsp
