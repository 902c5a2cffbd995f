// The fused engine beside clFFT: from stored phases and an ideal image to the intensity, no sensor. fftw_forward_and_inverse (the
// transforms alone) runs over the same sizes.
#include "bench.hpp"

#include <cstdlib>
#include <utility>

namespace {

// relative_diameter in hundredths, degree of polarization in tenths.
void intensity(benchmark::State &state, const char *engine) {
    const auto width = static_cast<std::uint32_t>(state.range(0)), height = static_cast<std::uint32_t>(state.range(1));
    setenv("CLSPECKLE_FFT", engine, 1); // contexts read it when they are made
    const clspeckle::Context context;
    unsetenv("CLSPECKLE_FFT");
    const clspeckle::Queue queue(context);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = width;
    phase_desc.height = height;
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    aperture_desc.width = width;
    aperture_desc.height = height;
    aperture_desc.relative_diameter = 0.01 * double(state.range(2));
    aperture_desc.degree_of_polarization = 0.1 * double(state.range(3));
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    const std::vector<float> ideal(std::size_t{width} * height, 1.0f);
    const clspeckle::Buffer irradiance(context, queue, ideal), result(context, ideal.size() * sizeof(float));
    const ClspImage in = irradiance.image(width, height, CLSP_FORMAT_FLOAT32),
                    out = result.image(width, height, CLSP_FORMAT_FLOAT32);
    phase.enqueue_refresh(queue, 0);
    const auto frame = [&] {
        aperture.enqueue_intensity(queue, phase, in, out);
        queue.finish();
    };
    frame(); // builds what is left to build
    for (auto _ : state)
        frame();
    const ClspApertureInfo info = aperture.info();
    state.SetLabel(info.fft_backend);
    state.counters["workspace_MB"] = double(info.workspace_bytes) * 1e-6;
    state.counters["ns_per_pixel"] = benchmark::Counter(double(width) * height * 1e-9, benchmark::Counter::kIsIterationInvariantRate |
                                                                                             benchmark::Counter::kInvert);
}

void cases(benchmark::internal::Benchmark *b) {
    b->ArgNames({"width", "height", "D%", "p10"});
    const std::pair<int, int> sizes[] = {{512, 512}, {1024, 1024}, {1920, 1080}, {2048, 2048}};
    for (const auto &[width, height] : sizes) {
        b->Args({width, height, 50, 10});
        b->Args({width, height, 100, 10});
    }
    b->Args({1024, 1024, 25, 10})->Args({1024, 1024, 50, 0});
    // The CPU column is the processor time of all threads, which other programs on the machine change less than the
    // elapsed time.
    b->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime()->MinTime(0.5);
}

BENCHMARK_CAPTURE(intensity, fused, "fused")->Apply(cases);
BENCHMARK_CAPTURE(intensity, fused_groups, "fused-groups")->Apply(cases);
BENCHMARK_CAPTURE(intensity, clfft, "clfft")->Apply(cases);

} // namespace
