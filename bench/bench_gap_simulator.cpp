// What the diagnosis spends on simulated captures: time for a frame of 160 x 192 by scene and motion, from new speckle
// and from intensities that are kept; and on their statistics, by the host's threads and by the device. Linked with the
// engine's own objects.
#include "simulator/simulator.hpp"
#include "statistics/device_sums.hpp"
#include "statistics/sequence_statistics.hpp"

#include <benchmark/benchmark.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace clsp;

constexpr std::uint32_t kFrames = 40;
constexpr const char *kNames[] = {"dark", "flat", "board_static", "board_moving", "dots_static", "dots_moving"};

CaptureLayout camera() {
    CaptureLayout layout;
    layout.width = 192;
    layout.height = 160;
    layout.bits = 10;
    layout.pixel_pitch_m = 2.9e-6;
    layout.f_number = 5.6;
    layout.wavelength_m = 940e-9;
    layout.principal_point_px = {95.5, 79.5};
    CaptureDots dots;
    dots.sigma_px = 2.2;
    for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 12; ++x)
            dots.positions_px.push_back({10.3 + 15.4 * x, 9.7 + 15.1 * y});
    layout.dots = dots;
    const CaptureScene scenes[] = {CaptureScene::kDark,  CaptureScene::kFlat, CaptureScene::kBoard,
                                   CaptureScene::kBoard, CaptureScene::kDots, CaptureScene::kDots};
    for (std::size_t i = 0; i < 6; ++i) {
        SequenceLayout sequence;
        sequence.name = kNames[i];
        sequence.scene = scenes[i];
        sequence.moving = i == 3 || i == 5;
        sequence.frame_count = kFrames;
        layout.sequences.push_back(sequence);
    }
    return layout;
}

Simulator &simulator() {
    static Simulator simulator(Context::create({}), camera());
    return simulator;
}

// kept: the same seed again, so that only the sensor is drawn anew.
void BM_GapSimulator(benchmark::State &state, const std::vector<EffectSetting> &effects, bool kept) {
    const auto sequence = static_cast<std::size_t>(state.range(0));
    const SimulationLevels levels{130.0, 64.0, 4.0};
    std::vector<std::uint16_t> codes(kFrames * simulator().layout().pixel_count());
    std::uint64_t seed = 0;
    simulator().codes(sequence, effects, levels, seed, kFrames, codes.data());
    for (auto _ : state) {
        simulator().codes(sequence, effects, levels, kept ? 0 : ++seed, kFrames, codes.data());
        benchmark::ClobberMemory();
    }
    state.SetLabel(kNames[sequence]);
    state.counters["frames"] = benchmark::Counter(double(state.iterations()) * kFrames, benchmark::Counter::kIsRate);
}

// Half of a sequence's frames, as a diagnosis measures them.
void BM_GapStatistics(benchmark::State &state, bool on_device) {
    const auto sequence = static_cast<std::size_t>(state.range(0));
    constexpr std::uint32_t kHalf = kFrames / 2;
    std::vector<std::uint16_t> codes(kHalf * simulator().layout().pixel_count());
    simulator().codes(sequence, {}, {130.0, 64.0, 4.0}, 1, kHalf, codes.data());
    const SequenceStatistics statistics(camera(), sequence, kHalf);
    std::vector<double> values(statistics.list().size());
    std::unique_ptr<statistics::DeviceSums> device;
    if (on_device)
        device = std::make_unique<statistics::DeviceSums>(Context::create({}));
    for (auto _ : state) {
        statistics.compute(codes.data(), {64.0, 4.0}, values.data(), 1, device.get());
        benchmark::ClobberMemory();
    }
    state.SetLabel(kNames[sequence]);
    state.counters["frames"] = benchmark::Counter(double(state.iterations()) * kHalf, benchmark::Counter::kIsRate);
}

void sequences(benchmark::internal::Benchmark *b) {
    b->ArgName("sequence")->DenseRange(0, 5)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}
void moving(benchmark::internal::Benchmark *b) {
    b->ArgName("sequence")->Arg(3)->Arg(5)->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}

BENCHMARK_CAPTURE(BM_GapSimulator, new_speckle, {}, false)->Apply(sequences);
BENCHMARK_CAPTURE(BM_GapSimulator, kept_intensities, {}, true)->Apply(sequences);
BENCHMARK_CAPTURE(BM_GapSimulator, linewidth, {{"linewidth", {}}}, false)->Apply(moving);
BENCHMARK_CAPTURE(BM_GapSimulator, motion_decorrelation, {{"motion_decorrelation", {}}}, false)->Apply(moving);
BENCHMARK_CAPTURE(BM_GapSimulator, depolarization, {{"depolarization", {}}}, false)->Apply(moving);
BENCHMARK_CAPTURE(BM_GapSimulator, glare, {{"glare", {}}}, false)->Apply(moving);
BENCHMARK_CAPTURE(BM_GapSimulator, pixel_integration, {{"pixel_integration", {}}}, false)->Apply(moving);
BENCHMARK_CAPTURE(BM_GapStatistics, host, false)->Apply(sequences);
BENCHMARK_CAPTURE(BM_GapStatistics, device, true)->Apply(sequences);

} // namespace
