#include "fft/cpu/lines.hpp"

#include "fft/cpu/codelets.hpp"
#include "fft/cpu/lanes.hpp"

#include <map>
#include <mutex>

namespace clsp {
namespace {

struct KeptLines {
    explicit KeptLines(const Context &) {}

    std::mutex mutex;
    std::map<std::uint32_t, std::shared_ptr<const CpuLines>> by_length;
};

} // namespace

std::shared_ptr<const CpuLines> cpu_lines(const Context &context, std::uint32_t length) {
    KeptLines &kept = context.part<KeptLines>();
    const std::lock_guard<std::mutex> lock(kept.mutex);
    std::shared_ptr<const CpuLines> &lines = kept.by_length[length];
    if (!lines) {
        LinePlan plan = make_cpu_plan(length);
        std::string text = cpu_codelets(plan, simd_lanes(context));
        lines = std::make_shared<const CpuLines>(CpuLines{std::move(plan), {kCpuCodeletsName, std::move(text)}});
    }
    return lines;
}

} // namespace clsp
