// The stages one by one.
#include "bench.hpp"

namespace {

struct Size {
    explicit Size(const benchmark::State &state)
        : width(static_cast<std::uint32_t>(state.range(0))), height(static_cast<std::uint32_t>(state.range(1))),
          pixels(std::size_t{width} * height) {}
    std::uint32_t width, height;
    std::size_t pixels;
};

void philox_normal(benchmark::State &state) {
    const Size size(state);
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);
    const clspeckle::Buffer buffer(context, size.pixels * sizeof(float));
    const ClspImage image = buffer.image(size.width, size.height, CLSP_FORMAT_FLOAT32);
    auto desc = clspeckle::make<ClspPhiloxDesc>();
    desc.distribution = CLSP_DISTRIBUTION_NORMAL;
    for (auto _ : state) {
        clspeckle::philox::enqueue_fill(context, queue, desc, image);
        queue.finish();
    }
}
BENCHMARK(philox_normal)->Apply(bench::sizes);

void phase_refresh(benchmark::State &state) {
    const Size size(state);
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);
    auto desc = clspeckle::make<ClspPhaseDesc>();
    desc.width = size.width;
    desc.height = size.height;
    desc.polarization_count = 1;
    const clspeckle::Phase phase(context, desc);
    std::uint64_t frame_index = 0;
    for (auto _ : state) {
        phase.enqueue_refresh(queue, frame_index++);
        queue.finish();
    }
}
BENCHMARK(phase_refresh)->Apply(bench::sizes);

// A wall at 1 m.
void look_up(benchmark::State &state, const ClspPatternDesc &desc) {
    const Size size(state);
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);
    const clspeckle::Pattern pattern(context, desc);
    const clspeckle::Buffer depth(context, queue, std::vector<float>(size.pixels, 1.0f));
    const clspeckle::Buffer albedo(context, queue, std::vector<float>(size.pixels, 0.5f));
    const clspeckle::Buffer irradiance(context, size.pixels * sizeof(float));
    auto geometry = clspeckle::make<ClspGeometry>();
    geometry.depth = depth.image(size.width, size.height, CLSP_FORMAT_FLOAT32);
    geometry.albedo = albedo.image(size.width, size.height, CLSP_FORMAT_FLOAT32);
    geometry.fx_px = geometry.fy_px = size.width;
    geometry.cx_px = 0.5 * (size.width - 1);
    geometry.cy_px = 0.5 * (size.height - 1);
    for (auto _ : state) {
        pattern.enqueue_lookup(queue, geometry, irradiance.image(size.width, size.height, CLSP_FORMAT_FLOAT32));
        queue.finish();
    }
}

void pattern_lookup(benchmark::State &state) {
    const std::vector<float> texels(1024 * 1024, 1.0f);
    auto desc = clspeckle::make<ClspPatternDesc>();
    desc.width = desc.height = 1024;
    desc.texels = texels.data();
    look_up(state, desc);
}
BENCHMARK(pattern_lookup)->Apply(bench::sizes)->MeasureProcessCPUTime();

// 2048 x 2048 texels of about 2500 dots: of a diffractive element, ideal, ideal with means over footprints.
enum class Source { kElement, kIdeal, kIdealArea };

clspeckle::DoePattern doe_texels(Source source) {
    const clspeckle::Context &context = bench::context();
    if (source == Source::kElement) {
        std::vector<float> phase(50 * 50);
        for (std::size_t i = 0; i < phase.size(); ++i)
            phase[i] = static_cast<float>(i * i % 97) * 0.0648f; // every order of the cell has light
        auto desc = clspeckle::make<ClspDoePatternDesc>();
        desc.width = desc.height = 50;
        desc.phase = phase.data();
        desc.pixel_pitch_m = 1e-6;
        desc.half_extent_x = desc.half_extent_y = 0.5;
        return {context, desc};
    }
    std::vector<double> directions;
    for (int m = -25; m < 25; ++m)
        for (int n = -25; n < 25; ++n)
            directions.insert(directions.end(), {0.0188 * m, 0.0188 * n});
    auto desc = clspeckle::make<ClspSpotPatternDesc>();
    desc.count = directions.size() / 2;
    desc.directions = directions.data();
    return {context, desc};
}

void doe_lookup(benchmark::State &state, Source source) {
    const std::vector<float> texels = doe_texels(source).texels();
    auto desc = clspeckle::make<ClspPatternDesc>();
    desc.projection = CLSP_PROJECTION_DIRECTION_COSINES;
    desc.width = desc.height = 2048;
    desc.texels = texels.data();
    desc.filter = source == Source::kIdealArea ? CLSP_FILTER_AREA : CLSP_FILTER_BILINEAR;
    look_up(state, desc);
}
BENCHMARK_CAPTURE(doe_lookup, element, Source::kElement)->Apply(bench::sizes)->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(doe_lookup, ideal, Source::kIdeal)->Apply(bench::sizes)->MeasureProcessCPUTime();
BENCHMARK_CAPTURE(doe_lookup, ideal_area, Source::kIdealArea)->Apply(bench::sizes)->MeasureProcessCPUTime();

void expose(benchmark::State &state, ClspSensorDesc desc) {
    const Size size(state);
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);
    desc.width = size.width;
    desc.height = size.height;
    const clspeckle::Sensor sensor(context, desc);
    const clspeckle::Buffer intensity(context, queue, std::vector<float>(size.pixels, 1.0f));
    const clspeckle::Buffer codes(context, size.pixels * sizeof(std::uint16_t));
    std::uint64_t frame_index = 0;
    const auto frame = [&] {
        sensor.enqueue_expose(queue, intensity.image(size.width, size.height, CLSP_FORMAT_FLOAT32), frame_index++,
                              codes.image(size.width, size.height, CLSP_FORMAT_UINT16));
        queue.finish();
    };
    frame(); // builds the kernel
    for (auto _ : state)
        frame();
}

void sensor_expose(benchmark::State &state) {
    expose(state, clspeckle::make<ClspSensorDesc>());
}
BENCHMARK(sensor_expose)->Apply(bench::sizes);

// 512 DN of light, 1024 electrons a pixel.
void sensor_expose_shot_noise(benchmark::State &state) {
    auto desc = clspeckle::make<ClspSensorDesc>();
    desc.conversion_gain_dn_per_e = 0.5;
    desc.shot_noise = 1;
    expose(state, desc);
}
BENCHMARK(sensor_expose_shot_noise)->Apply(bench::sizes);

void sensor_expose_every_effect(benchmark::State &state) {
    auto desc = clspeckle::make<ClspSensorDesc>();
    desc.conversion_gain_dn_per_e = 0.5;
    desc.shot_noise = 1;
    desc.full_well_e = 1800;
    desc.crosstalk_fraction = 0.1;
    desc.prnu = desc.column_prnu = desc.row_prnu = 0.01;
    desc.mosaic_gain[0] = 0.9;
    desc.dark_current_e_per_s = 100;
    desc.lag_fraction = 0.05;
    desc.gamma = 0.9;
    desc.dsnu_dn = desc.column_offset_dn = desc.row_noise_dn = desc.column_noise_dn = 1;
    desc.read_noise_spread = 0.2;
    desc.hot_pixel_fraction = desc.cold_pixel_fraction = desc.dull_pixel_fraction = 0.001;
    desc.row_offset_dn = desc.periodic_offset_dn = 1;
    desc.cubic_nonlinearity = 0.02;
    desc.telegraph_fraction = 0.01;
    desc.telegraph_step_dn = 20;
    desc.effective_bits = 8;
    expose(state, desc);
}
BENCHMARK(sensor_expose_every_effect)->Apply(bench::sizes);

} // namespace
