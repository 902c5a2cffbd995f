// Line transforms in lanes behind the Fft interface: columns and rows one after the other.
#include "fft/cpu/lanes.hpp"
#include "fft/cpu/lines.hpp"
#include "fft/fft.hpp"
#include "fft/plan/line_plan.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/device_buffer.hpp"
#include "runtime/kernel_arguments.hpp"

#include <algorithm>
#include <fmt/core.h>
#include <mutex>
#include <vector>

namespace clsp {
namespace {

// Transforms along one axis.
class Axis {
  public:
    Axis(const std::shared_ptr<Context> &context, std::uint32_t length, std::uint32_t lines, bool along_rows)
        : length_(length), lines_(lines), lanes_(simd_lanes(*context)) {
        const std::shared_ptr<const CpuLines> kept = cpu_lines(*context, length);
        const LinePlan &plan = kept->plan;
        for (const bool inverse : {false, true})
            kernels_[inverse] = context->kernel(
                "fft/cpu/line_transforms.cl", "line_transform",
                fmt::format("-DLANES={} -DALONG_ROWS={} -DINVERSE={}", lanes_, along_rows ? 1 : 0, inverse ? 1 : 0),
                &kept->codelets);
        std::vector<cl_uint> positions(length);
        for (std::uint32_t position = 0; position < length; ++position)
            positions[plan.frequencies[position]] = position;
        positions_ = DeviceBuffer(context, positions.size() * sizeof(cl_uint), positions.data());
        const std::vector<float> twiddles = plan.twiddles.empty() ? std::vector<float>(1) : plan.twiddles;
        twiddles_ = DeviceBuffer(context, twiddles.size() * sizeof(float), twiddles.data());
    }

    void enqueue(CommandChain &chain, FftDirection direction, const char *stage, const cl::Buffer &field,
                 std::uint32_t width, double scale) {
        cl::Kernel &kernel = kernels_[direction == FftDirection::kInverse];
        KernelArguments(kernel)
            .add(field)
            .add(cl_uint{width})
            .add(cl_uint{lines_})
            .add(static_cast<cl_float>(scale))
            .add(twiddles_.get())
            .add(positions_.get())
            .add(cl::Local(cpu_tile_bytes(length_, lanes_)));
        chain.run(stage, kernel, (lines_ + lanes_ - 1) / lanes_, 1, 1, 1);
    }

  private:
    std::uint32_t length_, lines_, lanes_;
    cl::Kernel kernels_[2]; // forward, inverse
    DeviceBuffer positions_, twiddles_;
};

class LineTransforms final : public Fft {
  public:
    LineTransforms(const std::shared_ptr<Context> &context, std::uint32_t width, std::uint32_t height)
        : width_(width), height_(height), rows_(context, width, height, true), columns_(context, height, width, false) {
    }

    std::size_t scratch_bytes() const override { return 0; }

    void enqueue(CommandChain &chain, FftDirection direction, const char *stage, const cl::Buffer &field,
                 const cl::Buffer &) override {
        const bool inverse = direction == FftDirection::kInverse;
        const std::lock_guard<std::mutex> lock(mutex_); // a kernel's arguments are state
        rows_.enqueue(chain, direction, stage, field, width_, inverse ? 1.0 / width_ : 1.0);
        columns_.enqueue(chain, direction, stage, field, width_, inverse ? 1.0 / height_ : 1.0);
    }

  private:
    std::uint32_t width_, height_;
    std::mutex mutex_;
    Axis rows_, columns_;
};

} // namespace

std::shared_ptr<Fft> make_line_transforms(Context &context, std::uint32_t width, std::uint32_t height) {
    const std::uint64_t local = context.device().getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    if (!works_in_lanes(context) || !plan_exists(width) || !plan_exists(height) ||
        cpu_tile_bytes(std::max(width, height), simd_lanes(context)) > local)
        return nullptr;
    return std::make_shared<LineTransforms>(context.shared_from_this(), width, height);
}

} // namespace clsp
