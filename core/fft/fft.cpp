#include "fft/fft.hpp"

#include "runtime/context.hpp"

#include <map>
#include <mutex>
#include <tuple>

namespace clsp {
namespace {

// Those of a context that are in use.
struct Plans {
    explicit Plans(const Context &) {}

    std::mutex mutex;
    std::map<std::tuple<std::uint32_t, std::uint32_t, bool>, std::weak_ptr<Fft>> plans; // width, height, clFFT's
};

std::shared_ptr<Fft> shared_plan(Context &context, std::uint32_t width, std::uint32_t height, bool clfft) {
    Plans &all = context.part<Plans>();
    const std::lock_guard<std::mutex> lock(all.mutex);
    std::weak_ptr<Fft> &entry = all.plans[{width, height, clfft}];
    std::shared_ptr<Fft> plan = entry.lock();
    if (!plan)
        entry = plan = clfft ? make_clfft(context, width, height) : make_line_transforms(context, width, height);
    return plan;
}

} // namespace

std::shared_ptr<Fft> fft_of(Context &context, std::uint32_t width, std::uint32_t height) {
    const std::shared_ptr<Fft> in_lanes = shared_plan(context, width, height, false);
    return in_lanes ? in_lanes : clfft_of(context, width, height);
}

std::shared_ptr<Fft> clfft_of(Context &context, std::uint32_t width, std::uint32_t height) {
    return shared_plan(context, width, height, true);
}

} // namespace clsp
