#include "measure/evidence_statistics.hpp"

#include "statistics/spectrum_sums.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

namespace clsp::evidence {
namespace {

constexpr std::size_t kLargestTransform = 512; // px a side; the spectrum of a larger image is that of its middle
constexpr double kRingWidth = 0.5;             // px

std::size_t side_of(std::size_t size) {
    return statistics::transform_size(std::min(size, kLargestTransform));
}

} // namespace

Plane mean_image(const Frames &frames) {
    Plane mean(frames.pixels());
    for (std::size_t t = 0; t < frames.count; ++t)
        for (std::size_t i = 0; i < mean.size(); ++i)
            mean[i] += float(frames.frame(t)[i]);
    for (float &value : mean)
        value /= float(frames.count);
    return mean;
}

Plane temporal_deviation(const Frames &frames, const Plane &mean) {
    Plane squares(frames.pixels());
    for (std::size_t t = 0; t < frames.count; ++t)
        for (std::size_t i = 0; i < squares.size(); ++i) {
            const float difference = float(frames.frame(t)[i]) - mean[i];
            squares[i] += difference * difference;
        }
    for (float &value : squares)
        value = std::sqrt(value / float(std::max(1u, frames.count - 1)));
    return squares;
}

Plane block_means(const Plane &plane, std::size_t width, std::size_t height, std::uint32_t edge) {
    if (edge == 1)
        return plane;
    const std::size_t columns = (width + edge - 1) / edge, rows = (height + edge - 1) / edge;
    Plane result(columns * rows);
    for (std::size_t row = 0; row < rows; ++row)
        for (std::size_t column = 0; column < columns; ++column) {
            double total = 0.0, count = 0.0;
            for (std::size_t y = row * edge; y < std::min(height, (row + 1) * edge); ++y)
                for (std::size_t x = column * edge; x < std::min(width, (column + 1) * edge); ++x, ++count)
                    total += double(plane[y * width + x]);
            result[row * columns + column] = float(total / count);
        }
    return result;
}

double quantile(Plane values, double share) {
    if (values.empty())
        return 0.0;
    const auto rank = std::size_t(std::lround(share * double(values.size() - 1)));
    std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(rank), values.end());
    return double(values[rank]);
}

HistogramRange histogram_range(const std::vector<Frames> &versions) {
    std::vector<std::uint64_t> counts(65536);
    std::uint64_t total = 0;
    for (const Frames &frames : versions)
        for (std::size_t t = 0; t < frames.count; ++t)
            for (std::size_t i = 0; i < frames.pixels(); ++i)
                if (frames.is_used(i)) {
                    ++counts[frames.frame(t)[i]];
                    ++total;
                }
    constexpr double kCut = 0.0005;
    std::uint64_t below = 0;
    std::uint32_t first = 0, last = 0;
    for (std::uint32_t code = 0; code < counts.size(); ++code) {
        if (double(below) <= kCut * double(total))
            first = code;
        below += counts[code];
        last = code;
        if (double(below) >= (1.0 - kCut) * double(total))
            break;
    }
    // Some room, so that the ends are seen to be ends.
    const std::uint32_t margin = std::max(2u, (last - first) / 16);
    const std::uint32_t highest = std::uint32_t(versions.front().layout->maximum_code());
    first -= std::min(first, margin);
    last = std::min(highest, last + margin);
    HistogramRange range;
    range.first = first;
    range.step = std::max(1u, std::uint32_t((last - first + kHistogramBins) / kHistogramBins));
    range.bins = (last - first) / range.step + 1;
    return range;
}

Histogram histogram(const Frames &frames, const HistogramRange &range) {
    std::vector<double> counts(range.bins);
    double total = 0.0, outside = 0.0;
    for (std::size_t t = 0; t < frames.count; ++t)
        for (std::size_t i = 0; i < frames.pixels(); ++i) {
            if (!frames.is_used(i))
                continue;
            const std::uint32_t code = frames.frame(t)[i],
                                bin = code < range.first ? range.bins : (code - range.first) / range.step;
            ++total;
            if (bin < range.bins)
                ++counts[bin];
            else
                ++outside;
        }
    for (double &count : counts)
        count /= std::max(total, 1.0);
    return {std::move(counts), outside / std::max(total, 1.0)};
}

std::size_t band_count(const CaptureLayout &layout) {
    return std::clamp<std::size_t>(std::min(side_of(layout.width), side_of(layout.height)) / 2, 4, 48);
}

std::vector<double> radial_power(const Frames &frames, const Plane &mean, Fluctuation fluctuation, std::size_t bands) {
    const std::size_t width = side_of(frames.width()), height = side_of(frames.height());
    const std::size_t left = (frames.width() - width) / 2, top = (frames.height() - height) / 2;
    const std::vector<float> across = statistics::hann(width), down = statistics::hann(height);
    double window = 0.0;
    for (const float a : across)
        for (const float b : down)
            window += double(a * b) * double(a * b);
    std::vector<double> power(bands), count(bands);
    Eigen::FFT<float> fft;
    using Complex = std::complex<float>;
    std::vector<Complex> image(width * height), column(height), transformed;
    std::vector<Complex> row(width);
    for (std::size_t t = 0; t < frames.count; ++t) {
        const std::uint16_t *codes = frames.frame(t);
        double total = 0.0, used = 0.0;
        for (std::size_t i = 0; i < frames.pixels(); ++i)
            if (frames.is_used(i)) {
                total += double(codes[i]);
                ++used;
            }
        const float level = float(total / std::max(used, 1.0));
        for (std::size_t y = 0; y < height; ++y) {
            for (std::size_t x = 0; x < width; ++x) {
                const std::size_t pixel = (top + y) * frames.width() + left + x;
                const float reference = fluctuation == Fluctuation::kOverTime ? mean[pixel] : level;
                row[x] = frames.is_used(pixel) ? (float(codes[pixel]) - reference) * across[x] * down[y] : 0.0f;
            }
            fft.fwd(transformed, row);
            std::copy(transformed.begin(), transformed.end(), image.begin() + std::ptrdiff_t(y * width));
        }
        for (std::size_t x = 0; x <= width / 2; ++x) { // the other half is the mirror image
            for (std::size_t y = 0; y < height; ++y)
                column[y] = image[y * width + x];
            fft.fwd(transformed, column);
            const double times = x == 0 || 2 * x == width ? 1.0 : 2.0, fx = double(x) / double(width);
            for (std::size_t y = 0; y < height; ++y) {
                const double fy = (double(y) - (2 * y > height ? double(height) : 0.0)) / double(height);
                const double frequency = std::hypot(fx, fy);
                if (frequency == 0.0 || frequency >= 0.5)
                    continue;
                const auto band = std::min(bands - 1, std::size_t(2.0 * frequency * double(bands)));
                power[band] += times * double(std::norm(transformed[y]));
                count[band] += times;
            }
        }
    }
    // Frames minus their common mean have lost 1 / n of their variance.
    const double n = double(frames.count);
    const double lost = fluctuation == Fluctuation::kOverTime && frames.count > 1 ? n / (n - 1.0) : 1.0;
    for (std::size_t k = 0; k < bands; ++k)
        power[k] = count[k] > 0.0 ? lost * power[k] / (count[k] * window) : 0.0;
    return power;
}

std::vector<double> temporal_autocorrelation(const Frames &frames) {
    std::vector<double> result;
    if (frames.count < 2)
        return result;
    std::vector<double> mean(frames.count), norm(frames.count);
    double used = 0.0;
    for (std::size_t i = 0; i < frames.pixels(); ++i)
        used += frames.is_used(i);
    const auto moment = [&](std::size_t a, std::size_t b) {
        double total = 0.0;
        for (std::size_t i = 0; i < frames.pixels(); ++i)
            if (frames.is_used(i))
                total += (double(frames.frame(a)[i]) - mean[a]) * (double(frames.frame(b)[i]) - mean[b]);
        return total;
    };
    for (std::size_t t = 0; t < frames.count; ++t) {
        double total = 0.0;
        for (std::size_t i = 0; i < frames.pixels(); ++i)
            total += frames.is_used(i) ? double(frames.frame(t)[i]) : 0.0;
        mean[t] = total / std::max(used, 1.0);
        norm[t] = moment(t, t);
    }
    for (std::size_t lag = 0; lag < frames.count; ++lag) {
        double total = 0.0;
        for (std::size_t t = 0; t + lag < frames.count; ++t) {
            const double scale = std::sqrt(norm[t] * norm[t + lag]);
            // A frame of one code throughout is equal to itself and nothing else is known of it.
            total += scale > 0.0 ? moment(t, t + lag) / scale : (lag == 0 ? 1.0 : 0.0);
        }
        result.push_back(total / double(frames.count - lag));
    }
    return result;
}

std::vector<double> dot_profile_radii() {
    std::vector<double> radii;
    for (int k = 0; k < int(kDotReach / kRingWidth); ++k)
        radii.push_back((k + 0.5) * kRingWidth);
    return radii;
}

DotStack stack_dots(const Frames &frames, const Plane &mean, double black_level_dn) {
    DotStack stack;
    if (!frames.layout->dots)
        return stack;
    constexpr int kEdge = 2 * kDotReach + 1;
    std::vector<double> image(kEdge * kEdge), light(dot_profile_radii().size()), count(light.size());
    const auto width = std::ptrdiff_t(frames.width()), height = std::ptrdiff_t(frames.height());
    for (const auto &position : frames.layout->dots->positions_px) {
        const std::ptrdiff_t x0 = std::lround(position[0]), y0 = std::lround(position[1]);
        if (x0 < kDotReach || y0 < kDotReach || x0 + kDotReach >= width || y0 + kDotReach >= height)
            continue;
        const auto pixel = [&](int dx, int dy) { return std::size_t((y0 + dy) * width + x0 + dx); };
        bool is_open = true;
        for (int dy = -kDotReach; dy <= kDotReach; ++dy)
            for (int dx = -kDotReach; dx <= kDotReach; ++dx)
                is_open = is_open && frames.is_used(pixel(dx, dy));
        if (!is_open)
            continue;
        ++stack.dots;
        for (int dy = -kDotReach; dy <= kDotReach; ++dy)
            for (int dx = -kDotReach; dx <= kDotReach; ++dx) {
                const double signal = double(mean[pixel(dx, dy)]) - black_level_dn;
                image[std::size_t((dy + kDotReach) * kEdge + dx + kDotReach)] += signal;
                const double radius = std::hypot(double(x0 + dx) - position[0], double(y0 + dy) - position[1]);
                const auto ring = std::size_t(radius / kRingWidth);
                if (ring < light.size()) {
                    light[ring] += signal;
                    ++count[ring];
                }
            }
    }
    if (!stack.dots)
        return stack;
    for (const double value : image)
        stack.image.push_back(float(value / stack.dots));
    // Rings that hold no pixel centre (dots on whole pixels leave some) take the value of their inner neighbour.
    for (std::size_t k = 0; k < light.size(); ++k)
        stack.profile_dn.push_back(count[k] > 0.0 ? light[k] / count[k] : (k ? stack.profile_dn[k - 1] : 0.0));
    return stack;
}

} // namespace clsp::evidence
