#include "stages/half_width.hpp"

#include <cmath>
#include <vector>

namespace clsp {

DeviceBuffer half_roots(const std::shared_ptr<Context> &context, std::uint32_t width) {
    constexpr double kTwoPi = 6.28318530717958647693;
    std::vector<cl_float2> roots(width / 2);
    for (std::size_t k = 0; k < roots.size(); ++k) {
        const double angle = -kTwoPi * double(k) / width;
        roots[k] = {{static_cast<cl_float>(std::cos(angle)), static_cast<cl_float>(std::sin(angle))}};
    }
    return DeviceBuffer(context, roots.size() * sizeof(cl_float2), roots.data());
}

} // namespace clsp
