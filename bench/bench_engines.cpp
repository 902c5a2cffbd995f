// The device's own engine beside clFFT: from stored phases and an ideal image to the intensity, or with the default
// sensor to codes. fftw_frame does the intensity's work by FFTW.
#include "bench.hpp"

#include <cstdlib>

namespace {

// Frames that follow each other without a wait, as a renderer's do: what a GPU's time for one of them is.
constexpr int kStreamed = 64;

// relative_diameter in hundredths.
void intensity(benchmark::State &state, const char *engine, double degree_of_polarization, bool with_sensor,
               int frames_per_wait = 1) {
    const auto width = static_cast<std::uint32_t>(state.range(0)), height = static_cast<std::uint32_t>(state.range(1));
    setenv("CLSPECKLE_FFT", engine, 1); // contexts read it when they are made
    setenv("CLSPECKLE_TUNING", "off", 1);
    const clspeckle::Context context;
    unsetenv("CLSPECKLE_FFT");
    unsetenv("CLSPECKLE_TUNING");
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
    // With a sensor the same as a pipeline's frame, to codes.
    clspeckle::Pipeline pipeline;
    auto description = clspeckle::make<ClspFrame>();
    if (with_sensor) {
        auto sensor_desc = clspeckle::make<ClspSensorDesc>();
        sensor_desc.width = width;
        sensor_desc.height = height;
        pipeline = clspeckle::Pipeline(context, phase, aperture, clspeckle::Sensor(context, sensor_desc));
        description.irradiance = in;
        description.output = result.image(width, height, CLSP_FORMAT_UINT16);
    }
    const auto frame = [&] {
        if (with_sensor)
            pipeline.enqueue_frame(queue, description);
        else
            aperture.enqueue_intensity(queue, phase, in, out);
        ++description.frame_index;
    };
    frame(); // builds what is left to build
    queue.finish();
    while (state.KeepRunningBatch(frames_per_wait)) {
        for (int i = 0; i < frames_per_wait; ++i)
            frame();
        queue.finish();
    }
    const ClspApertureInfo info = aperture.info();
    state.SetLabel(info.fft_engine);
    state.counters["workspace_MB"] = double(info.workspace_bytes) * 1e-6;
    state.counters["ns_per_pixel"] = benchmark::Counter(
        double(width) * height * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

BENCHMARK_CAPTURE(intensity, own, "auto", 1.0, false)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, own_unpolarized, "auto", 0.0, false)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, own_sensor, "auto", 1.0, true)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, own_streamed, "auto", 1.0, false, kStreamed)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, own_unpolarized_streamed, "auto", 0.0, false, kStreamed)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, own_sensor_streamed, "auto", 1.0, true, kStreamed)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, clfft_streamed, "clfft", 1.0, false, kStreamed)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, gpu, "gpu", 1.0, false)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, clfft, "clfft", 1.0, false)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, clfft_unpolarized, "clfft", 0.0, false)->Apply(bench::apertures);

} // namespace
