// A kernel that not every run needs, built when it first does: a program costs a start some 40 ms on PoCL, even one
// that it has compiled before (docs/results/performance.md, first start).
#pragma once

#include "runtime/context.hpp"

#include <string>
#include <utility>

namespace clsp {

class LazyKernel {
  public:
    LazyKernel() = default;
    // generated: outlives this object.
    LazyKernel(std::string file, std::string name, std::string defines,
               const ProgramCache::GeneratedHeader *generated = nullptr)
        : file_(std::move(file)), name_(std::move(name)), defines_(std::move(defines)), generated_(generated) {}

    // To be called before the first commands of a frame that needs it, so that a failure leaves no frame half done.
    cl::Kernel &get(Context &context) {
        if (!kernel_())
            kernel_ = context.kernel(file_, name_, defines_, generated_);
        return kernel_;
    }

  private:
    std::string file_, name_, defines_;
    const ProgramCache::GeneratedHeader *generated_ = nullptr;
    cl::Kernel kernel_;
};

} // namespace clsp
