// What an effect costs when it is on, and that it costs nothing when it is off: frames of dots through the whole
// camera. Compare the rows of one run (--benchmark_enable_random_interleaving=true --benchmark_repetitions=9).
#include "bench.hpp"

#include <string>
#include <vector>

namespace {

constexpr std::uint32_t side = 1024;

enum class Which { kPlain, kCleared, kOne };

void frame_with(benchmark::State &state, Which which, const std::string &id) {
    const clspeckle::Context &context = bench::context();
    const clspeckle::Queue queue(context);
    std::vector<double> positions;
    for (std::uint32_t y = 8; y < side; y += 16)
        for (std::uint32_t x = 8; x < side; x += 16)
            positions.insert(positions.end(), {double(x), double(y)});
    auto phase = clspeckle::make<ClspPhaseDesc>();
    auto aperture = clspeckle::make<ClspApertureDesc>();
    auto sensor = clspeckle::make<ClspSensorDesc>();
    auto dots = clspeckle::make<ClspDotsDesc>();
    phase.width = aperture.width = sensor.width = dots.width = side;
    phase.height = aperture.height = sensor.height = dots.height = side;
    dots.positions_px = positions.data();
    dots.count = positions.size() / 2;
    const clspeckle::Phase phase_stage(context, phase);
    const clspeckle::Aperture aperture_stage(context, aperture);
    const clspeckle::Sensor sensor_stage(context, sensor);
    const clspeckle::Dots dots_stage(context, dots);
    auto desc = clspeckle::make<ClspPipelineDesc>();
    desc.phase = phase_stage;
    desc.aperture = aperture_stage;
    desc.sensor = sensor_stage;
    desc.dots = dots_stage;
    const clspeckle::Pipeline pipeline(context, desc);
    if (which == Which::kOne)
        pipeline.set_effect(id);
    if (which == Which::kCleared) {
        for (const ClspEffectInfo &effect : clspeckle::effects())
            pipeline.set_effect(effect.id);
        pipeline.clear_effects();
    }
    const clspeckle::Buffer codes(context, std::size_t{side} * side * sizeof(std::uint16_t));
    auto frame = clspeckle::make<ClspFrame>();
    frame.output = codes.image(side, side, CLSP_FORMAT_UINT16);
    // Moving, where the effect is for that.
    frame.refresh = id == "motion_decorrelation" ? CLSP_REFRESH_ALL : CLSP_REFRESH_MASK;
    pipeline.warm_up(queue, frame);
    for (auto _ : state) {
        pipeline.enqueue_frame(queue, frame);
        queue.finish();
        ++frame.frame_index;
    }
}

const bool registered = [] {
    const auto add = [](const std::string &name, Which which, const std::string &id) {
        benchmark::RegisterBenchmark(("effect/" + name).c_str(),
                                     [which, id](benchmark::State &state) { frame_with(state, which, id); })
            ->Unit(benchmark::kMillisecond)
            ->UseRealTime();
    };
    add("none", Which::kPlain, "");
    add("all_set_and_cleared", Which::kCleared, "");
    for (const ClspEffectInfo &effect : clspeckle::effects())
        add(effect.id, Which::kOne, effect.id);
    return true;
}();

} // namespace
