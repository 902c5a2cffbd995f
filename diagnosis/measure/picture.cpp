#include "measure/picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace clsp::evidence {
namespace {

std::uint8_t shade(double share) {
    return std::uint8_t(std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
}

} // namespace

Picture gray_picture(const std::vector<float> &plane, std::uint32_t width, std::uint32_t height, double low,
                     double high) {
    Picture picture{width, height, 1, low, high, std::vector<std::uint8_t>(plane.size())};
    const double range = high > low ? high - low : 1.0;
    for (std::size_t i = 0; i < plane.size(); ++i)
        picture.pixels[i] = shade((double(plane[i]) - low) / range);
    return picture;
}

Picture diverging_picture(const std::vector<float> &plane, std::uint32_t width, std::uint32_t height, double reach) {
    // Ends of the ColorBrewer scale RdBu, which stays readable for the colour-blind.
    constexpr std::array<double, 3> kBlue{33.0 / 255.0, 102.0 / 255.0, 172.0 / 255.0},
        kRed{178.0 / 255.0, 24.0 / 255.0, 43.0 / 255.0};
    Picture picture{width, height, 3, -reach, reach, std::vector<std::uint8_t>(3 * plane.size())};
    for (std::size_t i = 0; i < plane.size(); ++i) {
        const double share = reach > 0.0 ? std::clamp(double(plane[i]) / reach, -1.0, 1.0) : 0.0;
        const auto &end = share < 0.0 ? kBlue : kRed;
        for (std::size_t c = 0; c < 3; ++c)
            picture.pixels[3 * i + c] = shade(1.0 - std::abs(share) * (1.0 - end[c]));
    }
    return picture;
}

} // namespace clsp::evidence
