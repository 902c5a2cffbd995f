// The fused engine beside clFFT: from stored phases and an ideal image to the intensity, no sensor. fftw_frame does the
// same work by FFTW.
#include "bench.hpp"

#include <cstdlib>

namespace {

// relative_diameter in hundredths.
void intensity(benchmark::State &state, const char *engine, double degree_of_polarization) {
    const auto width = static_cast<std::uint32_t>(state.range(0)), height = static_cast<std::uint32_t>(state.range(1));
    setenv("CLSPECKLE_FFT", engine, 1); // contexts read it when they are made
    const clspeckle::Context context;
    unsetenv("CLSPECKLE_FFT");
    const clspeckle::Queue queue(context);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = width;
    phase_desc.height = height;
    phase_desc.field = CLSP_FIELD_UNIT_PHASOR; // what the other programs make: exp(i phase)
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    aperture_desc.width = width;
    aperture_desc.height = height;
    aperture_desc.relative_diameter = 0.01 * double(state.range(2));
    aperture_desc.degree_of_polarization = degree_of_polarization;
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

BENCHMARK_CAPTURE(intensity, fused, "fused", 1.0)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, fused_unpolarized, "fused", 0.0)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, fused_groups, "fused-groups", 1.0)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, clfft, "clfft", 1.0)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, clfft_unpolarized, "clfft", 0.0)->Apply(bench::apertures);

} // namespace
