// The kernel sources that are built into the library.
#pragma once

#include <cstddef>

namespace clsp {

struct EmbeddedKernel {
    const char *name;
    const char *source;
};
extern const EmbeddedKernel kEmbeddedKernels[];
extern const std::size_t kEmbeddedKernelCount;

} // namespace clsp
