// What the benchmarks share: one context, queues, images.
#pragma once

#include <benchmark/benchmark.h>
#include <clspeckle/clspeckle.hpp>

#include <cstdint>
#include <vector>

namespace bench {

inline clspeckle::Context &context() {
    static clspeckle::Context context;
    return context;
}

// Width and height of the sizes that the benchmarks run over.
inline void sizes(benchmark::internal::Benchmark *b) {
    b->ArgNames({"width", "height"})->Args({512, 512})->Args({1024, 1024})->Args({1920, 1080})->Args({2048, 2048});
    b->Unit(benchmark::kMillisecond)->UseRealTime()->MinTime(0.5);
}

} // namespace bench
