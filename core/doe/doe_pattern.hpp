// The pattern of a diffractive optical element (DOE), computed or found in a cache.
#pragma once

#include "doe/doe_parameters.hpp"
#include "runtime/context.hpp"

#include <memory>
#include <utility>

namespace clsp {

enum class DoeSource : std::uint32_t { kComputed = 0, kMemory = 1, kDisk = 2 };

// A finished pattern; immutable.
class DoePattern {
  public:
    DoePattern(std::shared_ptr<const DoePatternResult> result, DoeSource source)
        : result_(std::move(result)), source_(source) {}
    const DoePatternResult &result() const { return *result_; }
    DoeSource source() const { return source_; }

  private:
    std::shared_ptr<const DoePatternResult> result_;
    DoeSource source_;
};

// Computes a pattern, or finds it in the context's memory or in the cache folder. Blocks.
std::shared_ptr<DoePattern> make_doe_pattern(const std::shared_ptr<Context> &context,
                                             const DoePatternParameters &parameters);
// Ideal dots.
std::shared_ptr<DoePattern> make_spot_pattern(const SpotPatternParameters &parameters);

} // namespace clsp
