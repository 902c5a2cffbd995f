#include "simulator/sample_filters.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace clsp {
namespace {

constexpr int kReachPx = 4; // px, of Lanczos's window

double sinc(double x) {
    return x == 0.0 ? 1.0 : std::sin(M_PI * x) / (M_PI * x);
}

struct Taps {
    int first; // relative to the pixel
    std::array<float, 2 * kReachPx> weight;
};

// Value at x - shift from the samples around it.
Taps lanczos(double shift) {
    const double at = -shift, base = std::floor(at);
    Taps taps{static_cast<int>(base) - kReachPx + 1, {}};
    double sum = 0.0;
    for (int k = 0; k < 2 * kReachPx; ++k) {
        const double d = at - (taps.first + k);
        taps.weight[std::size_t(k)] = float(sinc(d) * sinc(d / kReachPx));
        sum += taps.weight[std::size_t(k)];
    }
    for (float &weight : taps.weight)
        weight = float(weight / sum);
    return taps;
}

} // namespace

PointSpread pixel_area_spread(double fill_factor) {
    const auto along = [fill_factor](double d) {
        constexpr int kSteps = 16; // Simpson's rule; sinc turns slowly over one pixel
        const double step = fill_factor / kSteps;
        double sum = 0.0;
        for (int k = 0; k <= kSteps; ++k)
            sum += (k == 0 || k == kSteps ? 1.0 : k % 2 ? 4.0 : 2.0) * sinc(d - 0.5 * fill_factor + k * step);
        return sum * step / 3.0;
    };
    return [along](double dx, double dy) { return along(dx) * along(dy); };
}

std::vector<float> shifted(const std::vector<float> &image, std::uint32_t width, std::uint32_t height, double dx,
                           double dy) {
    const auto pass = [](const std::vector<float> &from, int count, int lines, std::ptrdiff_t step,
                         std::ptrdiff_t line_step, double shift) {
        const Taps taps = lanczos(shift);
        std::vector<float> to(from.size());
        for (int line = 0; line < lines; ++line)
            for (int x = 0; x < count; ++x) {
                float sum = 0.0f;
                for (int k = 0; k < 2 * kReachPx; ++k)
                    sum += taps.weight[std::size_t(k)] *
                           from[std::size_t(line * line_step + std::clamp(x + taps.first + k, 0, count - 1) * step)];
                to[std::size_t(line * line_step + x * step)] = sum;
            }
        return to;
    };
    const int w = int(width), h = int(height);
    std::vector<float> result = pass(pass(image, w, h, 1, w, dx), h, w, w, 1, dy);
    for (float &value : result)
        value = std::max(value, 0.0f);
    return result;
}

} // namespace clsp
