// clFFT behind the Fft interface.
//
// clFFT is one process-wide singleton. It is set up once and never torn down (clfftTeardown() would break a host that
// uses clFFT too); plans are made, baked and destroyed under one lock, because baking from several threads at once
// aborts.
#include "fft/fft.hpp"
#include "runtime/command_chain.hpp"
#include "runtime/context.hpp"
#include "runtime/error.hpp"

#include <clFFT.h>
#include <fmt/core.h>
#include <mutex>

namespace clsp {
namespace {

std::mutex &clfft_mutex() {
    static auto *mutex = new std::mutex; // outlives static destructors, like clFFT's own state
    return *mutex;
}

void check_clfft(clfftStatus status, const char *call, std::uint32_t width, std::uint32_t height) {
    if (status == CLFFT_SUCCESS)
        return;
    if (status == CLFFT_NOTIMPLEMENTED)
        throw Error(
            Status::kUnsupported,
            fmt::format("clFFT does not take a transform of {} x {} ({}: CLFFT_NOTIMPLEMENTED)", width, height, call),
            status);
    if (status >= CLFFT_BUGCHECK)
        throw Error(Status::kUnsupported,
                    fmt::format("clFFT failed in {} for a transform of {} x {} with status {}", call, width, height,
                                static_cast<int>(status)),
                    status);
    throw from_opencl(status, call);
}

class ClFft final : public Fft {
  public:
    ClFft(const cl::Context &context, const cl::Device &device, std::uint32_t width, std::uint32_t height)
        : context_(context), width_(width), height_(height) {
        const std::lock_guard<std::mutex> lock(clfft_mutex());
        static const clfftStatus setup = [] {
            clfftSetupData data{};
            clfftInitSetupData(&data);
            return clfftSetup(&data);
        }();
        check_clfft(setup, "clfftSetup", width, height);
        const std::size_t lengths[2] = {width, height};
        check_clfft(clfftCreateDefaultPlan(&plan_, context(), CLFFT_2D, lengths), "clfftCreateDefaultPlan", width,
                    height);
        try {
            check_clfft(clfftSetPlanPrecision(plan_, CLFFT_SINGLE), "clfftSetPlanPrecision", width, height);
            check_clfft(clfftSetLayout(plan_, CLFFT_COMPLEX_INTERLEAVED, CLFFT_COMPLEX_INTERLEAVED), "clfftSetLayout",
                        width, height);
            check_clfft(clfftSetResultLocation(plan_, CLFFT_INPLACE), "clfftSetResultLocation", width, height);
            // Baking needs a queue only to learn the device.
            cl::CommandQueue queue(context, device);
            cl_command_queue raw = queue();
            check_clfft(clfftBakePlan(plan_, 1, &raw, nullptr, nullptr), "clfftBakePlan", width, height);
            check_clfft(clfftGetTmpBufSize(plan_, &scratch_bytes_), "clfftGetTmpBufSize", width, height);
        } catch (...) {
            clfftDestroyPlan(&plan_);
            throw;
        }
    }
    ClFft(const ClFft &) = delete;
    ClFft &operator=(const ClFft &) = delete;
    ~ClFft() override {
        const std::lock_guard<std::mutex> lock(clfft_mutex());
        clfftDestroyPlan(&plan_);
    }

    std::size_t scratch_bytes() const override { return scratch_bytes_; }

    void enqueue(CommandChain &chain, FftDirection direction, const char *stage, const cl::Buffer &field,
                 const cl::Buffer &scratch) override {
        chain.run_foreign(stage, [&](cl_uint num_waits, const cl_event *waits, cl_event *event) {
            cl_command_queue queue = chain.queue();
            cl_mem buffer = field();
            check_clfft(clfftEnqueueTransform(plan_,
                                              direction == FftDirection::kForward ? CLFFT_FORWARD : CLFFT_BACKWARD, 1,
                                              &queue, num_waits, waits, event, &buffer, nullptr, scratch()),
                        "clfftEnqueueTransform", width_, height_);
        });
    }

  private:
    cl::Context context_;
    std::uint32_t width_, height_;
    clfftPlanHandle plan_ = 0;
    std::size_t scratch_bytes_ = 0;
};

} // namespace

std::shared_ptr<Fft> make_clfft(Context &context, std::uint32_t width, std::uint32_t height) {
    return std::make_shared<ClFft>(context.cl_context(), context.device(), width, height);
}

} // namespace clsp
