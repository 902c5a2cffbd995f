// The floor of everything that streams images: copying 256 MB, by the device's own copy and by all threads of the host.
#include "bench.hpp"

#include <cstring>
#include <omp.h>

namespace {

constexpr std::size_t kBytes = std::size_t{256} << 20;

void copy_on_device(benchmark::State &state) {
    clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);
    const clspeckle::Buffer from(context, queue, std::vector<float>(kBytes / sizeof(float), 1.0f)), to(context, kBytes);
    const auto copy = [&] {
        const cl_int status = clEnqueueCopyBuffer(queue.get(), from.get(), to.get(), 0, 0, kBytes, 0, nullptr, nullptr);
        queue.finish();
        return status == CL_SUCCESS;
    };
    if (!copy()) {
        state.SkipWithError("clEnqueueCopyBuffer failed");
        return;
    }
    for (auto _ : state)
        copy();
    state.SetBytesProcessed(state.iterations() * 2 * std::int64_t(kBytes));
}
BENCHMARK(copy_on_device)->Unit(benchmark::kMillisecond)->UseRealTime();

void copy_by_threads(benchmark::State &state) {
    const std::vector<char> from(kBytes, 1);
    std::vector<char> to(kBytes);
    const std::size_t threads = std::size_t(omp_get_max_threads()), part = kBytes / threads;
    for (auto _ : state) {
#pragma omp parallel for
        for (std::size_t t = 0; t < threads; ++t)
            std::memcpy(to.data() + t * part, from.data() + t * part, part);
        benchmark::ClobberMemory();
    }
    state.SetBytesProcessed(state.iterations() * 2 * std::int64_t(part * threads));
}
BENCHMARK(copy_by_threads)->Unit(benchmark::kMillisecond)->UseRealTime();

} // namespace
