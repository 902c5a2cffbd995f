// Depth from dots: the detector on the device, and a frame from the upload to the depth of each dot.
#include "bench.hpp"

#include <cmath>
#include <cstddef>
#include <random>

namespace {

constexpr double sigma = 1.3, spacing = 10.0, shift = 30.0; // px; shift: of a wall at 1 m

// Dots on a jittered lattice, one for each 10 x 10 px, on a wall.
struct Scene {
    explicit Scene(const benchmark::State &state)
        : width(static_cast<std::uint32_t>(state.range(0))), height(static_cast<std::uint32_t>(state.range(1))) {
        std::mt19937 random(3);
        const auto uniform = [&] { return double(random()) / 4294967296.0 - 0.5; };
        for (double y = 5.0; y < height; y += spacing)
            for (double x = 5.0; x < width; x += spacing) {
                positions.push_back(x + 5.0 * uniform());
                positions.push_back(y + 5.0 * uniform());
            }
        auto desc = clspeckle::make<ClspDotsDesc>();
        desc.width = width;
        desc.height = height;
        desc.positions_px = positions.data();
        desc.count = positions.size() / 2;
        desc.sigma_px = sigma;
        desc.scale = 200;
        buffer = clspeckle::Buffer(bench::context(), std::uint64_t{width} * height * sizeof(float));
        image = buffer.image(width, height, CLSP_FORMAT_FLOAT32);
        const clspeckle::Queue queue(bench::context());
        clspeckle::Dots(bench::context(), desc).enqueue_render(queue, image);
        queue.finish();
        for (std::size_t i = 0; i < positions.size(); i += 2) {
            directions.push_back((positions[i] - shift - 0.5 * width) / width);
            directions.push_back((positions[i + 1] - 0.5 * height) / width);
        }
    }
    clspeckle::Depth depth() const {
        auto desc = clspeckle::make<ClspDepthDesc>();
        desc.width = width;
        desc.height = height;
        desc.dot_sigma_px = sigma;
        desc.directions = directions.data();
        desc.direction_count = directions.size() / 2;
        desc.fx_px = desc.fy_px = width;
        desc.cx_px = 0.5 * width;
        desc.cy_px = 0.5 * height;
        desc.laser_from_camera[3] = -shift / width; // metres: 30 px at 1 m
        desc.near_m = 0.5;
        desc.far_m = 4.0;
        return {bench::context(), desc};
    }
    std::uint32_t width, height;
    std::vector<double> positions, directions;
    clspeckle::Buffer buffer;
    ClspImage image{};
};

void depth_detect(benchmark::State &state) {
    const Scene scene(state);
    const clspeckle::Queue queue(bench::context());
    const clspeckle::Depth depth = scene.depth();
    depth.enqueue_detect(queue, scene.image); // PoCL compiles at the first run
    queue.finish();
    for (auto _ : state) {
        depth.enqueue_detect(queue, scene.image);
        queue.finish();
    }
    state.counters["dots"] = double(depth.dots(queue).dots.size());
}

// With reading back, identification and triangulation.
void depth_frame(benchmark::State &state) {
    const Scene scene(state);
    const clspeckle::Queue queue(bench::context());
    const clspeckle::Depth depth = scene.depth();
    depth.enqueue_detect(queue, scene.image);
    clspeckle::DepthResult result = depth.dots(queue);
    for (auto _ : state) {
        depth.enqueue_detect(queue, scene.image);
        result = depth.dots(queue);
    }
    state.counters["placed"] = double(result.summary.placed_count);
}

void depth_sizes(benchmark::internal::Benchmark *b) {
    b->ArgNames({"width", "height"})->Args({640, 480})->Args({1280, 960});
    b->Unit(benchmark::kMillisecond)->UseRealTime()->MinTime(0.5);
}

BENCHMARK(depth_detect)->Apply(depth_sizes);
BENCHMARK(depth_frame)->Apply(depth_sizes);

} // namespace
