#include "capture/frame_sample.hpp"

#include "statistics/distributions.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

namespace clsp {
namespace {

constexpr std::size_t kMostCodes = std::size_t{1} << 22;
constexpr std::uint32_t kMostSide = 64, kMostFrames = 1024, kMargin = 3;
constexpr std::size_t kLeastTiles = 6;
constexpr std::size_t kLeastOfTile = 32;                   // pixels
constexpr double kLeastPart = 0.4;                         // of the difference between frames, that a shift explains
constexpr double kLeastShift = 0.03, kSearchedShift = 0.1; // pixels
constexpr std::uint32_t kLeastNoiseFrames = 2;
constexpr std::size_t kMostNoise = std::size_t{1} << 20; // codes
constexpr double kUsualVariance = 4.0;
constexpr std::uint32_t kFarFirst = 5, kFarLast = 8; // pixels that share a row's or a column's noise alone

constexpr double kChanceOfSampleFinding = 1e-6; // of a finding where there is nothing

using Pair = Eigen::Vector2d;

// What each tile tells of a number, in equal parts.
NoiseCorrelation agreed(const std::vector<double> &tiles) {
    if (tiles.size() < kLeastTiles)
        return {};
    const double n = double(tiles.size());
    double mean = 0.0, square = 0.0;
    for (const double value : tiles)
        mean += value / n;
    for (const double value : tiles)
        square += (value - mean) * (value - mean);
    const double error = std::sqrt(square / (n - 1.0) / n);
    return {mean, std::abs(mean) > student_two_sided_quantile(kChanceOfSampleFinding, n - 1.0) * error};
}

// Half of the derivative along an axis, of fourth order.
double slope_at(const std::uint16_t *code, std::ptrdiff_t step) {
    return (8 * (code[step] - code[-step]) - (code[2 * step] - code[-2 * step])) * (1.0 / 24.0);
}

} // namespace

FrameSample::FrameSample(const CaptureLayout &layout, std::uint32_t frames)
    : width_(layout.width), height_(layout.height), frames_(std::min(frames, kMostFrames)),
      top_(static_cast<std::uint16_t>(layout.maximum_code())) {
    const auto side = std::min(kMostSide, static_cast<std::uint32_t>(std::sqrt(double(kMostCodes) / double(kTiles) /
                                                                               std::max(1.0, double(frames_)))));
    const auto across = static_cast<std::uint32_t>(kTilesAcross);
    tile_width_ = std::min({width_, side, width_ / across + 2 * kMargin});
    tile_height_ = std::min({height_, side, height_ / across + 2 * kMargin});
    for (std::uint32_t k = 0; k < kTiles; ++k) {
        const auto corner = [&](std::uint32_t cell, std::uint32_t all, std::uint32_t tile) {
            const std::uint32_t middle = (2 * cell + 1) * all / (2 * across);
            return std::min(middle > tile / 2 ? middle - tile / 2 : 0, all - tile);
        };
        corners_[k] = {corner(k % across, width_, tile_width_), corner(k / across, height_, tile_height_)};
    }
    codes_.resize(frames_ * kTiles * tile_pixels());
}

void FrameSample::add(std::uint32_t frame, std::uint32_t first_row, std::uint32_t row_count,
                      const std::uint16_t *rows) {
    if (frame >= frames_)
        return;
    for (std::size_t k = 0; k < kTiles; ++k) {
        const auto [x, y] = corners_[k];
        std::uint16_t *to = codes_.data() + (std::size_t{frame} * kTiles + k) * tile_pixels();
        for (std::uint32_t row = std::max(y, first_row); row < std::min(y + tile_height_, first_row + row_count); ++row)
            std::copy_n(rows + std::size_t{row - first_row} * width_ + x, tile_width_,
                        to + std::size_t{row - y} * tile_width_);
    }
}

std::vector<std::uint8_t> FrameSample::counted(std::size_t k, const std::vector<std::uint8_t> &mask) const {
    std::vector<std::uint8_t> result(tile_pixels(), 1);
    if (!mask.empty())
        for (std::uint32_t y = 0; y < tile_height_; ++y)
            std::copy_n(mask.data() + (std::size_t{corners_[k].y} + y) * width_ + corners_[k].x, tile_width_,
                        result.data() + std::size_t{y} * tile_width_);
    return result;
}

// Least squares of the difference to frame 0 on the picture's gradient, which is that of both frames, so that their
// noise does not bias it. Farther than a part of a pixel the difference is no such product: it is taken from the best
// of the places a whole pixel away.
std::vector<PictureShift> FrameSample::shifts(const std::vector<std::uint8_t> &mask) const {
    if (frames_ < 2 || tile_width_ <= 2 * kMargin || tile_height_ <= 2 * kMargin)
        return {};
    const std::ptrdiff_t width = tile_width_;
    std::array<std::vector<std::ptrdiff_t>, kTiles> inner; // pixels whose neighbours count, too
    std::size_t tiles = 0;
    for (std::size_t k = 0; k < kTiles; ++k) {
        const std::vector<std::uint8_t> counts = counted(k, mask);
        for (std::uint32_t y = kMargin; y + kMargin < tile_height_; ++y)
            for (std::uint32_t x = kMargin; x + kMargin < tile_width_; ++x) {
                bool whole = true;
                for (std::uint32_t row = y - kMargin; row <= y + kMargin && whole; ++row) {
                    const auto at = counts.begin() + std::ptrdiff_t{row} * width + x;
                    whole = std::all_of(at - kMargin, at + kMargin + 1, [](std::uint8_t one) { return one != 0; });
                }
                if (whole)
                    inner[k].push_back(std::ptrdiff_t{y} * width + x);
            }
        tiles += inner[k].size() >= kLeastOfTile;
    }
    if (tiles < kLeastTiles)
        return {};

    struct Moments {
        double n = 0.0, energy = 0.0;
        Pair product = Pair::Zero();
        Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
    };
    const auto moments = [&](std::uint32_t frame, std::size_t k, std::ptrdiff_t offset) {
        const std::uint16_t *first = tile(0, k), *now = tile(frame, k) + offset;
        double n = 0.0, r1 = 0.0, x1 = 0.0, y1 = 0.0, rr = 0.0, rx = 0.0, ry = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
        for (const std::ptrdiff_t i : inner[k]) {
            const bool counts = first[i] != top_ && now[i] != top_;
            const double r = counts ? now[i] - first[i] : 0;
            const double x = counts ? slope_at(first + i, 1) + slope_at(now + i, 1) : 0.0;
            const double y = counts ? slope_at(first + i, width) + slope_at(now + i, width) : 0.0;
            n += counts;
            r1 += r;
            x1 += x;
            y1 += y;
            rr += r * r;
            rx += r * x;
            ry += r * y;
            xx += x * x;
            xy += x * y;
            yy += y * y;
        }
        Moments result;
        result.n = n;
        if (n < double(kLeastOfTile))
            return result;
        result.energy = rr - r1 * r1 / n;
        result.product = Pair(rx - r1 * x1 / n, ry - r1 * y1 / n);
        result.square << xx - x1 * x1 / n, xy - x1 * y1 / n, xy - x1 * y1 / n, yy - y1 * y1 / n;
        return result;
    };
    struct Fit {
        double energy = 0.0, rest = 0.0; // of the difference, and without what the shift explains
        Pair shift = Pair::Zero(), error = Pair::Zero();
        double tiles = 0.0;
    };
    const auto fit_at = [&](std::uint32_t frame, int right, int down) {
        std::array<Moments, kTiles> of;
        Fit fit;
        Pair product = Pair::Zero();
        Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
        double weights = 0.0, weights_square = 0.0;
        for (std::size_t k = 0; k < kTiles; ++k) {
            of[k] = moments(frame, k, down * width + right);
            if (of[k].n < double(kLeastOfTile))
                continue;
            const double weight = of[k].square.trace();
            weights += weight;
            weights_square += weight * weight;
            fit.energy += of[k].energy;
            product += of[k].product;
            square += of[k].square;
        }
        // How many tiles tell the shift: some may have no dot.
        fit.tiles = weights > 0.0 ? weights * weights / weights_square : 0.0;
        if (fit.tiles < double(kLeastTiles) || !(square.determinant() > 1e-6 * square.trace() * square.trace())) {
            fit.tiles = 0.0;
            return fit;
        }
        const Eigen::Matrix2d inverse = square.inverse();
        const Pair slope = inverse * product;
        Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
        for (const Moments &one : of)
            if (one.n >= double(kLeastOfTile)) {
                const Pair rest = one.product - one.square * slope;
                scatter += rest * rest.transpose();
            }
        fit.shift = Pair(right, down) - slope;
        fit.rest = fit.energy - product.dot(slope);
        fit.error = (fit.tiles / (fit.tiles - 2.0) * inverse * scatter * inverse).diagonal().cwiseSqrt();
        return fit;
    };

    std::vector<PictureShift> result(frames_);
    std::map<int, double> limits; // by the number of tiles
    for (std::uint32_t t = 1; t < frames_; ++t) {
        const Fit here = fit_at(t, 0, 0);
        if (here.tiles == 0.0)
            continue;
        Fit fit = here;
        for (int k = 0; k < 9 && here.shift.norm() > kSearchedShift; ++k)
            if (const Fit other = fit_at(t, k % 3 - 1, k / 3 - 1); other.tiles > 0.0 && other.energy < fit.energy)
                fit = other;
        const auto [limit, is_new] = limits.try_emplace(static_cast<int>(fit.tiles));
        if (is_new)
            limit->second =
                student_two_sided_quantile(kChanceOfSampleFinding / (2.0 * (frames_ - 1.0)), limit->first - 2.0);
        const bool sure = (fit.shift.cwiseAbs().array() > limit->second * fit.error.array()).any();
        result[t] = {fit.shift.x(), fit.shift.y(),
                     sure && fit.shift.norm() > kLeastShift && here.energy - fit.rest > kLeastPart * here.energy};
    }
    return result;
}

NoiseCorrelations FrameSample::correlations(const std::vector<std::uint8_t> &mask) const {
    NoiseCorrelations result;
    if (frames_ < kLeastNoiseFrames || tile_width_ <= kFarLast || tile_height_ <= kFarLast)
        return result;
    const std::size_t pixels = tile_pixels();
    const auto frames =
        static_cast<std::uint32_t>(std::clamp<std::size_t>(kMostNoise / (kTiles * pixels), kLeastNoiseFrames, frames_));
    const double n = frames;
    std::array<std::vector<std::uint8_t>, kTiles> counts;
    std::array<std::vector<float>, kTiles> means, variances;
    std::vector<float> usual;
    for (std::size_t k = 0; k < kTiles; ++k) {
        counts[k] = counted(k, mask);
        std::vector<double> sums(pixels), squares(pixels);
        for (std::uint32_t t = 0; t < frames; ++t) {
            const std::uint16_t *now = tile(t, k);
            for (std::size_t i = 0; i < pixels; ++i) {
                sums[i] += now[i];
                squares[i] += double(now[i]) * now[i];
                counts[k][i] &= now[i] != 0 && now[i] != top_;
            }
        }
        for (std::size_t i = 0; i < pixels; ++i) {
            means[k].push_back(float(sums[i] / n));
            variances[k].push_back(float((squares[i] - sums[i] * sums[i] / n) / (n - 1.0)));
            if (counts[k][i])
                usual.push_back(variances[k].back());
        }
    }
    if (usual.empty())
        return result;
    std::nth_element(usual.begin(), usual.begin() + std::ptrdiff_t(usual.size() / 2), usual.end());
    const float most = float(kUsualVariance) * usual[usual.size() / 2];

    std::vector<double> right, down, next;
    for (std::size_t k = 0; k < kTiles; ++k) {
        double counted_pixels = 0.0, level = 0.0, spread = 0.0;
        for (std::size_t i = 0; i < pixels; ++i) {
            counts[k][i] &= variances[k][i] <= most;
            counted_pixels += counts[k][i];
            level += counts[k][i] * means[k][i];
        }
        if (counted_pixels < double(kLeastOfTile))
            continue;
        level /= counted_pixels;
        std::vector<float> away(pixels); // of the pixel's mean from the tile's
        for (std::size_t i = 0; i < pixels; ++i) {
            away[i] = counts[k][i] ? float(means[k][i] - level) : 0.0f;
            spread += double(away[i]) * away[i];
        }
        // Sums of products, and how many: at the pixel, beside it, farther in its row; below it, farther in its column.
        constexpr std::size_t kLags = 2 + kFarLast - kFarFirst;
        double own = 0.0, products[2][kLags] = {}, pairs[2][kLags] = {}, in_time = 0.0;
        std::array<std::vector<float>, 2> rooms{std::vector<float>(pixels), std::vector<float>(pixels)};
        const auto lag_of = [](std::size_t j) { return j == 0 ? std::size_t{1} : kFarFirst + j - 1; };
        for (std::uint32_t t = 0; t < frames; ++t) {
            const std::uint16_t *now = tile(t, k);
            std::vector<float> &rest = rooms[t % 2], &before = rooms[(t + 1) % 2];
            double mean = 0.0, slope = 0.0;
            for (std::size_t i = 0; i < pixels; ++i) {
                rest[i] = counts[k][i] ? float(now[i]) - means[k][i] : 0.0f;
                mean += rest[i];
                slope += double(rest[i]) * away[i];
            }
            // Light that flickers moves all pixels by their level.
            mean /= counted_pixels;
            slope = spread > 0.0 ? slope / spread : 0.0;
            for (std::size_t i = 0; i < pixels; ++i) {
                rest[i] -= counts[k][i] ? float(mean + slope * away[i]) : 0.0f;
                own += double(rest[i]) * rest[i];
                in_time += t > 0 ? double(rest[i]) * before[i] : 0.0;
            }
            for (std::size_t j = 0; j < kLags; ++j) {
                const std::size_t lag = lag_of(j);
                float across = 0.0f, along = 0.0f;
                for (std::size_t y = 0; y < tile_height_; ++y) {
                    const float *row = rest.data() + y * tile_width_;
                    for (std::size_t x = 0; x + lag < tile_width_; ++x)
                        across += row[x] * row[x + lag];
                    for (std::size_t x = 0; x < tile_width_ && y + lag < tile_height_; ++x)
                        along += row[x] * row[x + lag * tile_width_];
                }
                products[0][j] += across;
                products[1][j] += along;
            }
        }
        for (std::size_t j = 0; j < kLags; ++j)
            for (std::size_t y = 0; y < tile_height_; ++y)
                for (std::size_t x = 0; x < tile_width_; ++x) {
                    const std::size_t i = y * tile_width_ + x, lag = lag_of(j);
                    pairs[0][j] += x + lag < tile_width_ ? n * counts[k][i] * counts[k][i + lag] : 0.0;
                    pairs[1][j] += y + lag < tile_height_ ? n * counts[k][i] * counts[k][i + lag * tile_width_] : 0.0;
                }
        own /= n * counted_pixels;
        for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
            double far = 0.0, far_pairs = 0.0;
            for (std::size_t j = 1; j < kLags; ++j) {
                far += products[axis][j];
                far_pairs += pairs[axis][j];
            }
            if (far_pairs < double(kLeastOfTile) || pairs[axis][0] < double(kLeastOfTile))
                continue;
            far /= far_pairs;
            if (own > far)
                (axis == 0 ? right : down).push_back((products[axis][0] / pairs[axis][0] - far) / (own - far));
        }
        // Without the frames' mean even independent ones have a correlation of -1 / (frames - 1).
        if (own > 0.0)
            next.push_back(in_time / ((n - 1.0) * counted_pixels) / own + 1.0 / (n - 1.0));
    }
    result.right = agreed(right);
    result.down = agreed(down);
    result.next = agreed(next);
    return result;
}

} // namespace clsp
