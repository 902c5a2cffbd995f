// Design of beam splitters: iterations of the weighted Gerchberg-Saxton, and a whole design of 5303 beams.
#include "bench.hpp"

namespace {

std::vector<ClspDoeDesignOrder> layout(bool symmetric, std::uint32_t side) {
    auto desc = clspeckle::make<ClspDotLayoutDesc>();
    desc.width = desc.height = side;
    desc.point_symmetric = symmetric ? 1 : 0;
    desc.min_difference = 0.0; // small cells have too few orders for it
    const clspeckle::DotLayout dots = clspeckle::dot_layout(desc);
    std::vector<ClspDoeDesignOrder> orders;
    for (std::size_t k = 0; k < dots.orders.size(); k += 2)
        orders.push_back({dots.orders[k], dots.orders[k + 1], 1.0});
    return orders;
}

// Time of one iteration: of continuous phase, without the set-up, which a design has once.
void BM_DoeIterations(benchmark::State &state) {
    const auto side = static_cast<std::uint32_t>(state.range(0));
    const std::vector<ClspDoeDesignOrder> orders = layout(false, side);
    auto desc = clspeckle::make<ClspDoeDesignDesc>();
    desc.width = desc.height = side;
    desc.levels = 0;
    desc.iterations = 50;
    desc.orders = orders.data();
    desc.order_count = orders.size();
    clspeckle::DoeDesign design(bench::context(), desc);
    for (auto _ : state)
        design = clspeckle::DoeDesign(bench::context(), desc);
    state.counters["s_per_iteration"] = benchmark::Counter(static_cast<double>(state.iterations()) * desc.iterations,
                                                           benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

// levels, sweeps of the search: what `clspeckle doe design` does by default, and its figures.
void BM_DoeDesign5303(benchmark::State &state) {
    auto desc = clspeckle::make<ClspDoeDesignDesc>();
    desc.levels = static_cast<std::uint32_t>(state.range(0));
    desc.search_sweeps = static_cast<std::uint32_t>(state.range(1));
    const std::vector<ClspDoeDesignOrder> orders = layout(desc.levels == 2, desc.width);
    desc.orders = orders.data();
    desc.order_count = orders.size();
    ClspDoeDesignReport report{};
    for (auto _ : state)
        report = clspeckle::DoeDesign(bench::context(), desc).report();
    state.counters["efficiency"] = report.efficiency;
    state.counters["uniformity_rms"] = report.uniformity_rms;
}

BENCHMARK(BM_DoeIterations)
    ->ArgName("side")
    ->Arg(256)
    ->Arg(512)
    ->Arg(1024)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MinTime(0.5);
BENCHMARK(BM_DoeDesign5303)
    ->ArgNames({"levels", "sweeps"})
    ->Args({8, 0})
    ->Args({8, 20})
    ->Args({2, 0})
    ->Args({2, 20})
    ->Unit(benchmark::kSecond)
    ->UseRealTime()
    ->Iterations(1);

} // namespace
