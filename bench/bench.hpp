// What the benchmarks share: one context, queues, images.
#pragma once

#include <benchmark/benchmark.h>
#include <clspeckle/clspeckle.hpp>

#include <cstdint>
#include <utility>
#include <vector>

namespace bench {

inline clspeckle::Context &context() {
    static clspeckle::Context context;
    return context;
}

// Width and height of the sizes that the benchmarks run over.
inline void sizes(benchmark::internal::Benchmark *b) {
    b->ArgNames({"width", "height"})->Args({512, 512})->Args({1024, 1024})->Args({1920, 1080})->Args({2048, 2048});
    b->Unit(benchmark::kMillisecond)->UseRealTime();
}

// And aperture diameters in hundredths of what the image's sampling resolves.
inline void apertures(benchmark::internal::Benchmark *b) {
    b->ArgNames({"width", "height", "D%"});
    for (const auto &[width, height] :
         {std::pair{512, 512}, {1024, 1024}, {1280, 720}, {1920, 1080}, {2048, 2048}, {4096, 4096}})
        for (const int diameter : {25, 50, 100})
            b->Args({width, height, diameter});
    // The CPU column is the processor time of all threads, which other programs on the machine change less than the
    // elapsed time.
    b->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}

} // namespace bench
