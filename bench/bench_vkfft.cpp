// The yardstick on a GPU: forward and inverse transform by VkFFT's OpenCL back-end (single precision, in place), on the
// context that the other benchmarks use.
#include "bench.hpp"

#define VKFFT_BACKEND 3
#include <vkFFT.h>

#include <cstdint>

namespace {

void vkfft_forward_and_inverse(benchmark::State &state) {
    clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);
    const ClspContextInfo info = context.info();
    cl_device_id device = info.cl_device;
    cl_context shared = info.cl_context_handle;
    cl_command_queue commands = queue.get();
    std::uint64_t bytes = std::uint64_t(state.range(0)) * std::uint64_t(state.range(1)) * 2 * sizeof(float);
    // A zero field stays finite however often it is transformed.
    const clspeckle::Buffer field(context, queue, std::vector<float>(bytes / sizeof(float), 0.0f));
    cl_mem memory = field.get();
    VkFFTConfiguration configuration = {};
    configuration.FFTdim = 2;
    configuration.size[0] = std::uint64_t(state.range(0));
    configuration.size[1] = std::uint64_t(state.range(1));
    configuration.device = &device;
    configuration.context = &shared;
    configuration.buffer = &memory;
    configuration.bufferSize = &bytes;
    VkFFTApplication application = {};
    if (initializeVkFFT(&application, configuration) != VKFFT_SUCCESS) {
        state.SkipWithError("initializeVkFFT failed");
        return;
    }
    VkFFTLaunchParams launch = {};
    launch.commandQueue = &commands;
    const auto both = [&] {
        const bool done = VkFFTAppend(&application, -1, &launch) == VKFFT_SUCCESS &&
                          VkFFTAppend(&application, 1, &launch) == VKFFT_SUCCESS;
        queue.finish();
        return done;
    };
    if (!both())
        state.SkipWithError("VkFFTAppend failed");
    else
        for (auto _ : state)
            both();
    deleteVkFFT(&application);
}
BENCHMARK(vkfft_forward_and_inverse)->Apply(bench::sizes)->MeasureProcessCPUTime();

} // namespace
