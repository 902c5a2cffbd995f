// Motion, and the phase that follows it.
#include "bench.hpp"

#include <cstddef>

namespace {

struct Scene {
    explicit Scene(const benchmark::State &state)
        : width(static_cast<std::uint32_t>(state.range(0))), height(static_cast<std::uint32_t>(state.range(1))),
          pixels(std::size_t{width} * height) {}
    ClspImage image(const clspeckle::Buffer &buffer, std::uint32_t format) const {
        return buffer.image(width, height, format);
    }
    clspeckle::Phase phase(const clspeckle::Queue &queue, bool translate) const {
        auto desc = clspeckle::make<ClspPhaseDesc>();
        desc.width = width;
        desc.height = height;
        desc.polarization_count = 1;
        desc.dynamics = CLSP_DYNAMICS_CONTINUOUS;
        desc.translate = translate ? 1 : 0;
        clspeckle::Phase made(bench::context(), desc);
        made.enqueue_refresh(queue, 0);
        return made;
    }
    std::uint32_t width, height;
    std::size_t pixels;
};

// A path for every pixel; range(2) is its length in thousandths of a correlation length. 0: nothing moves.
void phase_advance(benchmark::State &state) {
    const Scene scene(state);
    const clspeckle::Queue queue(bench::context());
    const clspeckle::Phase phase = scene.phase(queue, false);
    const std::vector<float> lengths(scene.pixels, 1e-3f * static_cast<float>(state.range(2)));
    const clspeckle::Buffer path(bench::context(), queue, lengths);
    auto advance = clspeckle::make<ClspPhaseAdvance>();
    advance.path = scene.image(path, CLSP_FORMAT_FLOAT32);
    std::uint64_t frame_index = 1;
    for (auto _ : state) {
        phase.enqueue_advance(queue, frame_index++, advance);
        queue.finish();
    }
}

// All that an advance can do: path, time and a shift of a third of a pixel.
void phase_advance_with_shift(benchmark::State &state) {
    const Scene scene(state);
    const clspeckle::Queue queue(bench::context());
    const clspeckle::Phase phase = scene.phase(queue, true);
    const clspeckle::Buffer path(bench::context(), queue, std::vector<float>(scene.pixels, 0.02f));
    const clspeckle::Buffer correlation(bench::context(), queue, std::vector<float>(scene.pixels, 0.98f));
    const clspeckle::Buffer shift(bench::context(), queue, std::vector<float>(2 * scene.pixels, 0.3f));
    auto advance = clspeckle::make<ClspPhaseAdvance>();
    advance.path = scene.image(path, CLSP_FORMAT_FLOAT32);
    advance.correlation = scene.image(correlation, CLSP_FORMAT_FLOAT32);
    advance.shift = scene.image(shift, CLSP_FORMAT_FLOAT32X2);
    std::uint64_t frame_index = 1;
    for (auto _ : state) {
        phase.enqueue_advance(queue, frame_index++, advance);
        queue.finish();
    }
}

// A moving camera, from depth to path and shift.
void motion_compute(benchmark::State &state) {
    const Scene scene(state);
    const clspeckle::Queue queue(bench::context());
    auto desc = clspeckle::make<ClspMotionDesc>();
    desc.width = scene.width;
    desc.height = scene.height;
    desc.fx_px = desc.fy_px = scene.width;
    desc.cx_px = 0.5 * (scene.width - 1);
    desc.cy_px = 0.5 * (scene.height - 1);
    const clspeckle::Motion motion(bench::context(), desc);
    const clspeckle::Buffer depth(bench::context(), queue, std::vector<float>(scene.pixels, 1.0f));
    const clspeckle::Buffer path(bench::context(), scene.pixels * sizeof(float));
    const clspeckle::Buffer shift(bench::context(), scene.pixels * 2 * sizeof(float));
    const double pose[12] = {1, 0, 0, 7e-6, 0, 1, 0, 0, 0, 0, 1, 0};
    auto input = clspeckle::make<ClspMotionInput>();
    input.depth = scene.image(depth, CLSP_FORMAT_FLOAT32);
    input.previous_from_current = pose;
    input.transform_count = 1;
    auto output = clspeckle::make<ClspMotionOutput>();
    output.path = scene.image(path, CLSP_FORMAT_FLOAT32);
    output.shift = scene.image(shift, CLSP_FORMAT_FLOAT32X2);
    for (auto _ : state) {
        motion.enqueue_compute(queue, input, output);
        queue.finish();
    }
}

void lengths(benchmark::internal::Benchmark *b) {
    b->ArgNames({"width", "height", "path"});
    for (const int path : {0, 14, 1000})
        b->Args({1024, 1024, path});
    b->Unit(benchmark::kMillisecond)->UseRealTime()->MinTime(0.5);
}

BENCHMARK(phase_advance)->Apply(lengths);
BENCHMARK(phase_advance_with_shift)->Apply(bench::sizes);
BENCHMARK(motion_compute)->Apply(bench::sizes);

} // namespace
