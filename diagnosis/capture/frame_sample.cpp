#include "capture/frame_sample.hpp"

#include "statistics/distributions.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

namespace clsp {
namespace {

constexpr std::size_t kMostCodes = std::size_t{1} << 22;
constexpr std::uint32_t kMostSide = 64, kMostSampled = 1024, kMargin = 3;
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
    : width_(layout.width), height_(layout.height), frames_(std::min(frames, kMostSampled)),
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

std::vector<FrameSample::NoiseTile> FrameSample::noise_tiles(const std::vector<std::uint8_t> &mask,
                                                             std::uint32_t frames) const {
    const std::size_t pixels = tile_pixels();
    const double n = frames;
    std::vector<NoiseTile> tiles(kTiles);
    std::vector<float> usual;
    std::array<std::vector<float>, kTiles> variances;
    for (std::size_t k = 0; k < kTiles; ++k) {
        NoiseTile &of = tiles[k];
        of.k = k;
        const std::vector<std::uint8_t> counts = counted(k, mask);
        of.counts.assign(counts.begin(), counts.end());
        std::vector<double> sums(pixels), squares(pixels);
        for (std::uint32_t t = 0; t < frames; ++t) {
            const std::uint16_t *now = tile(t, k);
            for (std::size_t i = 0; i < pixels; ++i) {
                sums[i] += now[i];
                squares[i] += double(now[i]) * now[i];
                of.counts[i] = now[i] != 0 && now[i] != top_ ? of.counts[i] : 0.0f;
            }
        }
        for (std::size_t i = 0; i < pixels; ++i) {
            of.means.push_back(float(sums[i] / n));
            variances[k].push_back(float((squares[i] - sums[i] * sums[i] / n) / (n - 1.0)));
            if (of.counts[i] != 0.0f)
                usual.push_back(variances[k].back());
        }
    }
    if (usual.empty())
        return {};
    std::nth_element(usual.begin(), usual.begin() + std::ptrdiff_t(usual.size() / 2), usual.end());
    const float most = float(kUsualVariance) * usual[usual.size() / 2];
    for (NoiseTile &of : tiles) {
        double level = 0.0;
        of.in_row.assign(tile_height_, 0.0f);
        of.in_column.assign(tile_width_, 0.0f);
        for (std::size_t i = 0; i < pixels; ++i) {
            of.counts[i] = variances[of.k][i] <= most ? of.counts[i] : 0.0f;
            of.pixels += of.counts[i];
            of.in_row[i / tile_width_] += of.counts[i];
            of.in_column[i % tile_width_] += of.counts[i];
            level += double(of.counts[i]) * of.means[i];
        }
        level /= std::max(1.0, of.pixels);
        for (std::size_t i = 0; i < pixels; ++i) {
            of.away.push_back(of.counts[i] * float(of.means[i] - level));
            of.spread += double(of.away[i]) * of.away[i];
        }
    }
    tiles.erase(std::remove_if(tiles.begin(), tiles.end(),
                               [](const NoiseTile &of) { return of.pixels < double(kLeastOfTile); }),
                tiles.end());
    return tiles;
}

void FrameSample::noise_of(const NoiseTile &of, std::uint32_t frame, std::vector<float> &rest,
                           std::vector<float> &row_means) const {
    const std::uint16_t *now = tile(frame, of.k);
    const std::size_t pixels = tile_pixels();
    rest.resize(pixels);
    double mean = 0.0, slope = 0.0;
    for (std::size_t i = 0; i < pixels; ++i) {
        rest[i] = of.counts[i] * (float(now[i]) - of.means[i]);
        mean += rest[i];
        slope += double(rest[i]) * of.away[i];
    }
    // Light that flickers moves all pixels by their level.
    const auto shared = float(mean / of.pixels), factor = float(of.spread > 0.0 ? slope / of.spread : 0.0);
    for (std::size_t i = 0; i < pixels; ++i)
        rest[i] -= of.counts[i] * (shared + factor * of.away[i]);
    row_means.assign(tile_height_, 0.0f);
    std::vector<float> column_means(tile_width_, 0.0f);
    for (std::size_t y = 0; y < tile_height_; ++y) {
        float *row = rest.data() + y * tile_width_;
        const float *counts = of.counts.data() + y * tile_width_;
        float sum = 0.0f;
        for (std::size_t x = 0; x < tile_width_; ++x)
            sum += row[x];
        row_means[y] = sum / std::max(1.0f, of.in_row[y]);
        for (std::size_t x = 0; x < tile_width_; ++x) {
            row[x] -= counts[x] * row_means[y];
            column_means[x] += row[x];
        }
    }
    for (std::size_t x = 0; x < tile_width_; ++x)
        column_means[x] /= std::max(1.0f, of.in_column[x]);
    for (std::size_t y = 0; y < tile_height_; ++y)
        for (std::size_t x = 0; x < tile_width_; ++x)
            rest[y * tile_width_ + x] -= of.counts[y * tile_width_ + x] * column_means[x];
}

FrameNoises FrameSample::noise(const std::vector<std::uint8_t> &mask) const {
    FrameNoises result;
    if (frames_ < kLeastNoiseFrames)
        return result;
    const std::vector<NoiseTile> tiles = noise_tiles(mask, frames_);
    result.frames.resize(frames_);
    std::array<std::vector<float>, 2> rooms;
    std::vector<float> row_means;
    for (const NoiseTile &of : tiles) {
        // The means that are taken off take as many degrees of freedom.
        const auto with_pixels = [](float count) { return count > 0.0f; };
        result.pixels += of.pixels + 1.0 - double(std::count_if(of.in_row.begin(), of.in_row.end(), with_pixels)) -
                         double(std::count_if(of.in_column.begin(), of.in_column.end(), with_pixels));
        for (std::uint32_t t = 0; t < frames_; ++t) {
            std::vector<float> &rest = rooms[t % 2], &before = rooms[(t + 1) % 2];
            noise_of(of, t, rest, row_means);
            float square = 0.0f, step = 0.0f;
            for (std::size_t i = 0; i < rest.size(); ++i)
                square += rest[i] * rest[i];
            for (std::size_t i = 0; t > 0 && i < rest.size(); ++i)
                step += (rest[i] - before[i]) * (rest[i] - before[i]);
            result.frames[t].square += square;
            result.frames[t].step += step;
        }
    }
    if (result.pixels < double(kLeastOfTile))
        return {};
    for (FrameNoise &frame : result.frames) {
        frame.square /= result.pixels;
        frame.step /= result.pixels;
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
    std::vector<double> right, down, next, rows;
    double rows_square = 0.0, rows_count = 0.0;
    std::array<std::vector<float>, 2> rooms{std::vector<float>(pixels), std::vector<float>(pixels)};
    std::vector<float> row_means;
    for (const NoiseTile &of : noise_tiles(mask, frames)) {
        // Sums of products, and how many: at the pixel, beside it, farther in its row; below it, farther in its column.
        constexpr std::size_t kLags = 2 + kFarLast - kFarFirst;
        double own = 0.0, products[2][kLags] = {}, pairs[2][kLags] = {}, in_time = 0.0;
        double row_squares = 0.0, row_products = 0.0;
        const auto lag_of = [](std::size_t j) { return j == 0 ? std::size_t{1} : kFarFirst + j - 1; };
        for (std::uint32_t t = 0; t < frames; ++t) {
            std::vector<float> &rest = rooms[t % 2], &before = rooms[(t + 1) % 2];
            noise_of(of, t, rest, row_means);
            for (std::size_t i = 0; i < pixels; ++i) {
                own += double(rest[i]) * rest[i];
                in_time += t > 0 ? double(rest[i]) * before[i] : 0.0;
            }
            for (std::size_t y = 0; y < tile_height_; ++y) {
                row_squares += double(row_means[y]) * row_means[y];
                row_products += y > 0 ? double(row_means[y]) * row_means[y - 1] : 0.0;
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
                    const double counts = n * of.counts[i];
                    pairs[0][j] += x + lag < tile_width_ ? counts * of.counts[i + lag] : 0.0;
                    pairs[1][j] += y + lag < tile_height_ ? counts * of.counts[i + lag * tile_width_] : 0.0;
                }
        own /= n * of.pixels;
        for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
            double far = 0.0, far_pairs = 0.0;
            for (std::size_t j = 1; j < kLags; ++j) {
                far += products[axis][j];
                far_pairs += pairs[axis][j];
            }
            if (far_pairs < double(kLeastOfTile) || pairs[axis][0] < double(kLeastOfTile))
                continue;
            // Without the means of rows and columns even independent pixels have a small one, at all distances alike.
            far /= far_pairs;
            if (own > far)
                (axis == 0 ? right : down).push_back((products[axis][0] / pairs[axis][0] - far) / (own - far));
        }
        // Without the frames' mean even independent ones have a correlation of -1 / (frames - 1).
        if (own > 0.0)
            next.push_back(in_time / ((n - 1.0) * of.pixels) / own + 1.0 / (n - 1.0));
        if (row_squares > 0.0)
            rows.push_back(row_products / row_squares);
        rows_square += row_squares;
        rows_count += (n - 1.0) * double(tile_height_);
    }
    result.right = agreed(right);
    result.down = agreed(down);
    result.next = agreed(next);
    result.rows = agreed(rows);
    result.rows_dn = rows_count > 0.0 ? std::sqrt(rows_square / rows_count) : 0.0;
    return result;
}

} // namespace clsp
