#include "fft/plan/line_plan.hpp"

#include "runtime/error.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <numeric>
#include <utility>

namespace clsp {
namespace {

// What is left of the length without the factors that butterflies exist for: 1 if there is a plan.
std::uint32_t rest_of(std::uint32_t length) {
    for (const std::uint32_t prime : {2u, 3u, 5u, 7u, 11u, 13u})
        while (length % prime == 0)
            length /= prime;
    return length;
}

// Large radices first: the first one decides how many blocks there are, and blocks should fit the first-level cache.
// Powers of two go in eights, which fit the registers of a CPU best, but for a last 4 or 2.
std::vector<std::uint32_t> radices_of(std::uint32_t length) {
    std::vector<std::uint32_t> radices;
    for (const std::uint32_t radix : {13u, 11u, 8u, 7u, 5u, 4u, 3u, 2u})
        while (length % radix == 0) {
            // 16 = 4 * 4 has fewer operations behind the last stage than 8 * 2.
            if (radix == 8 && length % 16 == 0 && length % 32 != 0)
                break;
            radices.push_back(radix);
            length /= radix;
        }
    std::stable_sort(radices.begin(), radices.end(), std::greater<>());
    return radices;
}

// Stages and the sum of their radices, which grows with the operations.
std::pair<std::size_t, std::uint32_t> cost_of(const std::vector<std::uint32_t> &radices) {
    return {radices.size(), std::accumulate(radices.begin(), radices.end(), 0u)};
}

// The cheapest way to take `length` apart in radices up to `largest`, none larger than the one before; empty if there
// is none.
std::vector<std::uint32_t> cheapest_radices(std::uint32_t length, std::uint32_t largest) {
    std::vector<std::uint32_t> best;
    for (std::uint32_t radix = std::min(length, largest); radix >= 2; --radix) {
        if (length % radix != 0)
            continue;
        std::vector<std::uint32_t> radices{radix};
        if (length > radix) {
            const std::vector<std::uint32_t> rest = cheapest_radices(length / radix, radix);
            if (rest.empty())
                continue;
            radices.insert(radices.end(), rest.begin(), rest.end());
        }
        if (best.empty() || cost_of(radices) < cost_of(best))
            best = radices;
    }
    return best;
}

LinePlan plan_of(std::uint32_t length, std::vector<std::uint32_t> radices) {
    LinePlan plan;
    plan.length = length;
    plan.radices = std::move(radices);
    plan.frequencies.assign(length, 0);
    std::uint32_t block = length, weight = 1;
    for (const std::uint32_t radix : plan.radices) {
        const std::uint32_t m = block / radix;
        for (std::uint32_t position = 0; position < length; ++position)
            plan.frequencies[position] += weight * (position % block / m);
        if (m > 1)
            for (std::uint32_t j = 0; j < m; ++j)
                for (std::uint32_t k = 1; k < radix; ++k) {
                    // Reduced in integers, so that the angle is good to the last digit.
                    const double angle = -2.0 * M_PI * double(std::uint64_t{j} * k % block) / block;
                    plan.twiddles.push_back(static_cast<float>(std::cos(angle)));
                    plan.twiddles.push_back(static_cast<float>(std::sin(angle)));
                }
        weight *= radix;
        block = m;
    }
    return plan;
}

void check_length(std::uint32_t length) {
    if (!plan_exists(length))
        throw Error(Status::kUnsupported,
                    fmt::format("there is no transform of {} points: lines have 2 to {} points and no prime "
                                "factor above {}",
                                length, kLongestLine, kLargestFactor));
}

} // namespace

bool plan_exists(std::uint32_t length) {
    return length >= 2 && length <= kLongestLine && rest_of(length) == 1;
}

LinePlan make_cpu_plan(std::uint32_t length) {
    check_length(length);
    return plan_of(length, radices_of(length));
}

LinePlan make_gpu_plan(std::uint32_t length) {
    check_length(length);
    std::vector<std::uint32_t> radices = cheapest_radices(length, kLargestGpuRadix);
    std::reverse(radices.begin(), radices.end());
    return plan_of(length, radices);
}

} // namespace clsp
