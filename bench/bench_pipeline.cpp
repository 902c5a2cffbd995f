// Whole frames: aperture and sensor over an ideal image, by size, aperture and polarization.
#include "bench.hpp"

#include <cmath>

namespace {

// A stage's description for images of that size.
template <typename Desc> Desc sized(std::uint32_t width, std::uint32_t height) {
    auto desc = clspeckle::make<Desc>();
    desc.width = width;
    desc.height = height;
    return desc;
}

// relative_diameter in hundredths, degree of polarization in tenths, refresh 0 (still) or 1 (all new), fill factor in
// hundredths (0: a pixel is a point).
void frame(benchmark::State &state) {
    const auto width = static_cast<std::uint32_t>(state.range(0)), height = static_cast<std::uint32_t>(state.range(1));
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);

    auto aperture_desc = sized<ClspApertureDesc>(width, height);
    aperture_desc.relative_diameter = 0.01 * double(state.range(2));
    aperture_desc.degree_of_polarization = 0.1 * double(state.range(3));
    aperture_desc.fill_factor = 0.01 * double(state.range(5));
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, sized<ClspPhaseDesc>(width, height)),
                                       clspeckle::Aperture(context, aperture_desc),
                                       clspeckle::Sensor(context, sized<ClspSensorDesc>(width, height)));

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
    ->Args({64, 64, 50, 10, 0, 0}) // what the host does for a frame, nearly alone
    ->Args({512, 512, 50, 10, 0, 0})
    ->Args({640, 480, 50, 10, 0, 0})
    ->Args({640, 480, 50, 0, 0, 0})
    ->Args({1280, 720, 50, 10, 0, 0})
    ->Args({1280, 720, 50, 0, 0, 0})
    ->Args({1280, 720, 50, 10, 1, 0})
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
    ->UseRealTime()
    ->MeasureProcessCPUTime();

// From G-buffers to codes: a wall under a pattern of 5303 dots, looked up, speckled, recorded. streamed 1: frames
// follow each other without a wait.
void frame_of_dots(benchmark::State &state) {
    const auto width = static_cast<std::uint32_t>(state.range(0)), height = static_cast<std::uint32_t>(state.range(1));
    const int frames_per_wait = state.range(2) ? 64 : 1;
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);

    // Vogel's spiral: as many dots as one likes, as far apart everywhere.
    constexpr int kDots = 5303;
    std::vector<double> directions;
    for (int i = 0; i < kDots; ++i) {
        const double radius = 0.45 * std::sqrt((i + 0.5) / kDots), angle = 2.399963229728653 * i;
        directions.insert(directions.end(), {radius * std::cos(angle), radius * std::sin(angle)});
    }
    auto spot_desc = clspeckle::make<ClspSpotPatternDesc>();
    spot_desc.count = kDots;
    spot_desc.directions = directions.data();
    const std::vector<float> texels = clspeckle::DoePattern(context, spot_desc).texels();
    auto pattern_desc = clspeckle::make<ClspPatternDesc>();
    pattern_desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
    pattern_desc.width = pattern_desc.height = 2048;
    pattern_desc.texels = texels.data();
    auto aperture_desc = sized<ClspApertureDesc>(width, height);
    aperture_desc.relative_diameter = 0.5;
    const clspeckle::Pipeline pipeline(context, clspeckle::Pattern(context, pattern_desc),
                                       clspeckle::Phase(context, sized<ClspPhaseDesc>(width, height)),
                                       clspeckle::Aperture(context, aperture_desc),
                                       clspeckle::Sensor(context, sized<ClspSensorDesc>(width, height)));

    const std::size_t pixels = std::size_t{width} * height;
    const clspeckle::Buffer depth(context, queue, std::vector<float>(pixels, 1.0f));
    const clspeckle::Buffer albedo(context, queue, std::vector<float>(pixels, 0.5f));
    const clspeckle::Buffer codes(context, pixels * sizeof(std::uint16_t));
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.image(width, height, CLSP_FORMAT_FLOAT32);
    geometry.albedo = albedo.image(width, height, CLSP_FORMAT_FLOAT32);
    geometry.fx_px = geometry.fy_px = width;
    geometry.cx_px = 0.5 * (width - 1);
    geometry.cy_px = 0.5 * (height - 1);
    auto description = clspeckle::make<ClspFrame>();
    description.geometry = &geometry;
    description.output = codes.image(width, height, CLSP_FORMAT_UINT16);
    pipeline.warm_up(queue, description);
    while (state.KeepRunningBatch(frames_per_wait)) {
        for (int i = 0; i < frames_per_wait; ++i) {
            pipeline.enqueue_frame(queue, description);
            ++description.frame_index;
        }
        queue.finish();
    }
}

BENCHMARK(frame_of_dots)
    ->ArgNames({"width", "height", "streamed"})
    ->ArgsProduct({{2048}, {2048}, {0, 1}})
    ->ArgsProduct({{1920}, {1080}, {0, 1}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

} // namespace
