// The yardstick on a CPU: forward and inverse transform by FFTW (single precision, as many threads as cores, in place).
#include "bench.hpp"

#include <fftw3.h>
#include <memory>
#include <thread>

namespace {

void fftw_forward_and_inverse(benchmark::State &state) {
    const int width = static_cast<int>(state.range(0)), height = static_cast<int>(state.range(1));
    static const int threads_ready = fftwf_init_threads();
    if (!threads_ready) {
        state.SkipWithError("fftwf_init_threads failed");
        return;
    }
    fftwf_plan_with_nthreads(static_cast<int>(std::thread::hardware_concurrency()));
    const std::size_t pixels = std::size_t(width) * std::size_t(height);
    const std::unique_ptr<fftwf_complex[], decltype(&fftwf_free)> field(fftwf_alloc_complex(pixels), fftwf_free);
    const fftwf_plan forward = fftwf_plan_dft_2d(height, width, field.get(), field.get(), FFTW_FORWARD, FFTW_MEASURE);
    const fftwf_plan inverse = fftwf_plan_dft_2d(height, width, field.get(), field.get(), FFTW_BACKWARD, FFTW_MEASURE);
    for (std::size_t i = 0; i < pixels; ++i)
        field[i][0] = field[i][1] = 0.0f; // a zero field stays finite however often it is transformed
    for (auto _ : state) {
        fftwf_execute(forward);
        fftwf_execute(inverse);
        benchmark::ClobberMemory();
    }
    fftwf_destroy_plan(forward);
    fftwf_destroy_plan(inverse);
}
BENCHMARK(fftw_forward_and_inverse)->Apply(bench::sizes);

} // namespace
