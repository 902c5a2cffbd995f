// One-dimensional transforms of the engines for CPUs and GPUs: in which radices a length is taken apart, and the tables
// that its kernels read.
#pragma once

#include <cstdint>
#include <vector>

namespace clsp {

// A transform of `length` points in place, by decimation in frequency. Stage s has radix r and leaves r blocks of m
// points, m the product of the radices behind it: with q = 0 .. r - 1 and j = 0 .. m - 1
//   y[k m + j] = w^(j k) sum_q x[q m + j] exp(-2 pi i q k / r),   w = exp(-2 pi i / (r m)),
// and each block goes on by itself. What comes out stands in digit-reversed order; the inverse takes the same steps
// backwards, so that nothing is ever put in order.
struct LinePlan {
    std::uint32_t length = 0;
    std::vector<std::uint32_t> radices; // first stage to last
    // Frequency, 0 .. length - 1, that stands at each position behind the forward transform.
    std::vector<std::uint32_t> frequencies;
    // Stage after stage: for each j the real and imaginary parts of w^j, w^(2 j) .. w^((r - 1) j). The last stage (m =
    // 1) has none.
    std::vector<float> twiddles;

    // Points of each block that the first stage leaves.
    std::uint32_t block_length() const { return length / radices.front(); }
};

// The largest prime factor of a length, and the longest one.
constexpr std::uint32_t kLargestFactor = 13;
constexpr std::uint32_t kLongestLine = 8192;

// True if make_cpu_plan() takes the length: 2 to kLongestLine, no prime factor above kLargestFactor.
bool plan_exists(std::uint32_t length);
LinePlan make_cpu_plan(std::uint32_t length);

// The same for work-groups: as few stages as radices up to kLargestGpuRadix allow, since each ends at a barrier, and
// among those the one with the smallest radices.
constexpr std::uint32_t kLargestGpuRadix = 16;
LinePlan make_gpu_plan(std::uint32_t length);

} // namespace clsp
