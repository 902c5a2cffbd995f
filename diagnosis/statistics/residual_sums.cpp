#include "statistics/residual_sums.hpp"

#include <algorithm>
#include <cmath>

namespace clsp::statistics {

namespace {

using Image = std::vector<float>;

// Derivatives of the mean image with respect to a motion right, down, about the axis, and away from it. 0 beside masked
// pixels and at the edge.
std::array<Image, 4> motion_derivatives(const Geometry &geometry, const Image &mean) {
    std::array<Image, 4> derivatives;
    for (Image &image : derivatives)
        image.assign(geometry.pixels, 0.0f);
    const std::size_t width = geometry.width;
    for (std::size_t y = 1; y + 1 < geometry.height; ++y)
        for (std::size_t x = 1; x + 1 < width; ++x) {
            const std::size_t i = y * width + x;
            if (geometry.is_masked() && geometry.weight[i] * geometry.weight[i - 1] * geometry.weight[i + 1] *
                                                geometry.weight[i - width] * geometry.weight[i + width] ==
                                            0.0f)
                continue;
            const float right = 0.5f * (mean[i + 1] - mean[i - 1]), down = 0.5f * (mean[i + width] - mean[i - width]);
            const float u = float(geometry.field_x[x]), v = float(geometry.field_y[y]);
            derivatives[0][i] = right;
            derivatives[1][i] = down;
            derivatives[2][i] = u * down - v * right;
            derivatives[3][i] = u * right + v * down;
        }
    return derivatives;
}

// Squared weight of a pixel of a static laser scene in the correlation over time: bright pixels tell of a living
// surface, dark ones of the sensor's noise.
Image brightness_weight(const Frames &frames) {
    Image weight(frames.mean.size());
    const float light = float(frames.light);
    for (std::size_t i = 0; i < weight.size(); ++i) {
        const float bright = std::max(frames.mean[i], 0.0f), share = bright / (bright + light);
        weight[i] = share * share;
    }
    return weight;
}

} // namespace

std::vector<std::size_t> temporal_lags(const Geometry &geometry) {
    std::vector<std::size_t> lags;
    if (geometry.frames < 3)
        return lags; // the residuals of two frames are each other's negative: always -1
    const auto add = [&](std::size_t lag) {
        if (lag >= 1 && lag < geometry.frames && std::find(lags.begin(), lags.end(), lag) == lags.end())
            lags.push_back(lag);
    };
    add(1);
    add(2);
    if (geometry.is_static_laser()) {
        add(4);
        add(8);
    }
    add(geometry.frames / 2);
    return lags;
}

ResidualSums sum_residuals(const Geometry &geometry, const Frames &frames, FrameSums &frame_sums) {
    ResidualSums sums;
    if (geometry.frames < 2)
        return sums;
    const std::vector<std::size_t> lags = temporal_lags(geometry);
    ResidualWeights weights;
    if (geometry.is_static_laser()) {
        weights.derivatives = motion_derivatives(geometry, frames.mean);
        for (std::size_t k = 0; k < weights.derivatives.size(); ++k)
            for (std::size_t y = 0; y < geometry.height; ++y) {
                const float *row = weights.derivatives[k].data() + y * geometry.width;
                sums.motions[k].information += dot(row, row, geometry.width);
            }
        weights.brightness = brightness_weight(frames);
    }
    const std::vector<ResidualFrameSums> parts = frame_sums.sum_residuals(geometry, frames, weights, lags);

    const double count = double(geometry.frames);
    double square = 0.0;
    sums.temporal.assign(lags.size(), 0.0);
    for (auto &motion : sums.motions)
        motion.amount.reserve(geometry.frames);
    for (const ResidualFrameSums &part : parts) {
        sums.powers.add(part.powers);
        sums.column_variance += part.column_variance / count;
        square += part.square / count;
        for (std::size_t k = 0; k < lags.size(); ++k)
            sums.temporal[k] += part.temporal[k] / (count - double(lags[k]));
        for (std::size_t k = 0; k < kNoiseLags.size(); ++k)
            sums.noise[k] += part.noise[k];
        for (std::size_t k = 0; k < sums.motions.size(); ++k)
            sums.motions[k].amount.push_back(ratio(part.motion[k], sums.motions[k].information));
    }
    for (double &value : sums.temporal)
        value = ratio(value, square);
    const double mean_square = sums.powers.square / (count * double(geometry.used));
    for (std::size_t k = 0; k < kNoiseLags.size(); ++k)
        sums.noise[k] = ratio(ratio(sums.noise[k], count * geometry.pairs(kNoiseLags[k])), mean_square);
    return sums;
}

} // namespace clsp::statistics
