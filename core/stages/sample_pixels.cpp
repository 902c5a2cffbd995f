#include "stages/sample_pixels.hpp"

#include "fft/cpu/lanes.hpp"
#include "runtime/kernel_arguments.hpp"

#include <fmt/core.h>

namespace clsp {

SamplePixels::SamplePixels(const std::shared_ptr<Context> &context, const FieldGrid &grid,
                           const std::vector<float> &taps, bool of_powers)
    : grid_(grid) {
    if (!taps.empty())
        taps_ = DeviceBuffer(context, taps.size() * sizeof(float), taps.data());
    // In vectors where a row's sums have room.
    if (of_powers && !taps.empty() && works_in_lanes(*context))
        row_bytes_ = (std::uint64_t{grid.grid_width} + taps.size() + simd_lanes(*context)) * sizeof(float);
    if (row_bytes_ > context->device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>())
        row_bytes_ = 0;
    const std::string options = row_bytes_ > 0
                                    ? fmt::format("-DPIXEL_TAPS={} -DLANES={}", taps.size(), simd_lanes(*context))
                                    : fmt::format("-DPIXEL_TAPS={} -DSAMPLE_POWERS={}", taps.size(), of_powers ? 1 : 0);
    for (const bool adds : {false, true})
        (adds ? add_ : write_) = context->kernel(row_bytes_ > 0 ? "stages/aperture_lanes.cl" : "stages/aperture.cl",
                                                 row_bytes_ > 0 ? "aperture_pixels_lanes" : "aperture_intensity",
                                                 fmt::format("{} -DACCUMULATE={}", options, adds ? 1 : 0));
}

void SamplePixels::enqueue(CommandChain &chain, const cl::Buffer &samples, cl_float weight, const ImageView &before,
                           const ImageView &intensity) {
    cl::Kernel &kernel = before ? add_ : write_;
    KernelArguments arguments(kernel);
    arguments.add(samples)
        .add(cl_uint{grid_.grid_width})
        .add(cl_uint{grid_.grid_height})
        .add(cl_uint{grid_.oversampling})
        .add(weight);
    if (taps_)
        arguments.add(taps_.get());
    if (before)
        arguments.add(before);
    arguments.add(intensity).add(cl_uint{grid_.width}).add(cl_uint{grid_.height});
    if (row_bytes_ > 0) {
        arguments.add(cl::Local(row_bytes_));
        chain.run("intensity", kernel, grid_.grid_height, 1, 1, 1);
    } else {
        chain.run("intensity", kernel, grid_.width, grid_.height);
    }
}

} // namespace clsp
