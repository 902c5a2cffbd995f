// Setting kernel arguments in order, images as (mem, offset, pitch).
#pragma once

#include "runtime/image_view.hpp"
#include "runtime/opencl.hpp"

namespace clsp {

class KernelArguments {
  public:
    explicit KernelArguments(cl::Kernel &kernel) : kernel_(kernel) {}

    template <typename T> KernelArguments &add(const T &value) {
        kernel_.setArg(index_++, value);
        return *this;
    }
    KernelArguments &add(cl_mem mem) {
        kernel_.setArg(index_++, sizeof mem, &mem);
        return *this;
    }
    KernelArguments &add(const ImageView &image) { return add(image.mem).add(image.offset).add(image.pitch); }

  private:
    cl::Kernel &kernel_;
    cl_uint index_ = 0;
};

} // namespace clsp
