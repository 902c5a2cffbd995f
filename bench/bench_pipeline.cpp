// Whole frames: aperture and sensor over an ideal image, by size, aperture and polarisation.
#include "bench.hpp"

namespace {

// relative_diameter in hundredths, degree of polarization in tenths, refresh 0 (still) or 1 (all new), fill factor in
// hundredths (0: a pixel is a point).
void frame(benchmark::State &state) {
    const auto width = static_cast<std::uint32_t>(state.range(0)), height = static_cast<std::uint32_t>(state.range(1));
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);

    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    phase_desc.width = width;
    phase_desc.height = height;
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    aperture_desc.width = width;
    aperture_desc.height = height;
    aperture_desc.relative_diameter = 0.01 * double(state.range(2));
    aperture_desc.degree_of_polarization = 0.1 * double(state.range(3));
    aperture_desc.fill_factor = 0.01 * double(state.range(5));
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    sensor_desc.width = width;
    sensor_desc.height = height;
    const clspeckle::Phase phase(context, phase_desc);
    const clspeckle::Aperture aperture(context, aperture_desc);
    const clspeckle::Sensor sensor(context, sensor_desc);
    const clspeckle::Pipeline pipeline(context, phase, aperture, sensor);

    const std::size_t pixels = std::size_t{width} * height;
    const clspeckle::Buffer irradiance(context, queue, std::vector<float>(pixels, 1.0f));
    const clspeckle::Buffer codes(context, pixels * sizeof(std::uint16_t));
    auto description = clspeckle::make<ClspFrame>();
    description.irradiance = irradiance.image(width, height, CLSP_FORMAT_FLOAT32);
    description.output = codes.image(width, height, CLSP_FORMAT_UINT16);
    description.refresh = state.range(4) ? CLSP_REFRESH_ALL : CLSP_REFRESH_MASK;
    pipeline.warm_up(queue, description);
    for (auto _ : state) {
        pipeline.enqueue_frame(queue, description);
        queue.finish();
        ++description.frame_index;
    }
    state.counters["pixels_per_second"] =
        benchmark::Counter(double(pixels), benchmark::Counter::kIsIterationInvariantRate);
}

BENCHMARK(frame)
    ->ArgNames({"width", "height", "D_percent", "p_tenths", "refresh_all", "fill_percent"})
    ->Args({512, 512, 50, 10, 0, 0})
    ->Args({1024, 1024, 50, 10, 0, 0})
    ->Args({1024, 1024, 100, 10, 0, 0})
    ->Args({1024, 1024, 50, 0, 0, 0})
    ->Args({1024, 1024, 50, 10, 1, 0})
    ->Args({1024, 1024, 50, 10, 0, 80})
    ->Args({1024, 1024, 50, 0, 0, 80})
    ->Args({1920, 1080, 50, 10, 0, 0})
    ->Args({1920, 1080, 50, 10, 0, 80})
    ->Args({2048, 2048, 50, 10, 0, 0})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

} // namespace
