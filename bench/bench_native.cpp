// The passes of the engine for CPUs in C++ (bench/native), from the same phases and ideal image to the intensity: the
// yardstick of intensity/own in bench_engines.cpp.
#include "bench.hpp"
#include "native/native_passes.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace {

// relative_diameter in hundredths.
void intensity(benchmark::State &state, native::Order order) {
    const auto width = static_cast<std::uint32_t>(state.range(0)), height = static_cast<std::uint32_t>(state.range(1));
    std::unique_ptr<native::Passes> passes;
    try {
        passes = native::make_passes(order, width, height, 0.01 * double(state.range(2)));
    } catch (const std::invalid_argument &error) {
        state.SkipWithError(error.what());
        return;
    }
    const std::size_t pixels = std::size_t{width} * height;
    const native::Pages phase = native::allocate_pages(pixels), ideal = native::allocate_pages(pixels),
                        result = native::allocate_pages(pixels);
    for (std::size_t i = 0; i < pixels; ++i) { // Weyl's sequence: no two equal
        const double turns = 0.6180339887498949 * double(i);
        phase[i] = float(6.283185307179586 * (turns - std::floor(turns)));
        ideal[i] = 1.0f;
        result[i] = 0.0f;
    }
    const auto frame = [&] {
        passes->intensity(phase.get(), ideal.get(), result.get());
        benchmark::ClobberMemory();
    };
    frame();
    for (auto _ : state)
        frame();
    state.SetLabel("C++, vectors of " + std::to_string(native::lanes()));
    state.counters["workspace_MB"] = double(passes->workspace_bytes()) * 1e-6;
    state.counters["ns_per_pixel"] = benchmark::Counter(
        double(pixels) * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

BENCHMARK_CAPTURE(intensity, native, native::Order::kColumnsFirst)->Apply(bench::apertures);
BENCHMARK_CAPTURE(intensity, native_rows_first, native::Order::kRowsFirst)->Apply(bench::apertures);

} // namespace
