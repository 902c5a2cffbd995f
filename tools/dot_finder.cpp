#include "dot_finder.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace tools {

namespace {

constexpr int kMostLag = 64;
constexpr double kNoises = 5.0;   // a maximum of noise among a million pixels is at 4.9
constexpr double kFaintest = 0.3; // of the usual dot; ghosts are fainter
constexpr double kWindow = 2.5;   // of a fit, in widths of a dot
constexpr double kOwnPart = 0.4;  // of the distance between dots, which a window may have
constexpr int kRounds = 4;
constexpr double kEvenNoise = 0.1;     // of a dot's height: what scatters where no light is
constexpr double kMostUncertain = 1.5; // of a dot's width: a fit that runs farther has found something else

double quantile(std::vector<double> values, double part) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

struct MeanImage {
    int width, height;
    std::vector<double> values;
    double at(int x, int y) const { return values[index(x, y)]; }
    double &at(int x, int y) { return values[index(x, y)]; }

  private:
    std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    }
};

/** The width of what the image is made of: an autocorrelation of Gaussians exp(-r^2 / (2 s^2)) is exp(-r^2 / (4 s^2)).
 */
double typical_sigma(const MeanImage &image) {
    const double mean =
        std::accumulate(image.values.begin(), image.values.end(), 0.0) / static_cast<double>(image.values.size());
    const auto correlation = [&](int lag) {
        double sum = 0.0;
        double count = 0.0;
        for (int y = 0; y + lag < image.height; ++y)
            for (int x = 0; x + lag < image.width; ++x, ++count)
                sum += (image.at(x, y) - mean) * (image.at(x + lag, y) + image.at(x, y + lag) - 2.0 * mean);
        return 0.5 * sum / count;
    };
    // From where half of it is left to where half of that is: what is finer, grains of speckle at rest, is gone there.
    std::array<double, 2> lags{}, values{};
    double least = 0.5 * correlation(0);
    std::size_t found = 0;
    for (int lag = 1; found < 2 && lag <= std::min({kMostLag, image.width / 2, image.height / 2}); ++lag)
        if (const double here = correlation(lag); here <= least) {
            lags[found] = lag;
            values[found++] = here;
            least = 0.5 * here;
        }
    if (found == 2 && values[1] > 0.0)
        return std::sqrt((lags[1] * lags[1] - lags[0] * lags[0]) / (4.0 * std::log(values[0] / values[1])));
    if (found > 0)
        return lags[0] / (2.0 * std::sqrt(std::log(2.0)));
    return 1.0;
}

/** Convolved with a Gaussian of unit sum; at the border with what there is of it. */
MeanImage smoothed(const MeanImage &image, double sigma) {
    const int reach = static_cast<int>(std::ceil(3.0 * sigma));
    std::vector<double> kernel;
    for (int i = -reach; i <= reach; ++i)
        kernel.push_back(std::exp(-i * i / (2.0 * sigma * sigma)));
    const auto pass = [&](const MeanImage &from, int dx, int dy) {
        MeanImage to = from;
        for (int y = 0; y < from.height; ++y)
            for (int x = 0; x < from.width; ++x) {
                double sum = 0.0;
                double weight = 0.0;
                for (int i = -reach; i <= reach; ++i) {
                    const int u = x + i * dx;
                    const int v = y + i * dy;
                    if (u < 0 || v < 0 || u >= from.width || v >= from.height)
                        continue;
                    const double k = kernel[static_cast<std::size_t>(i + reach)];
                    sum += k * from.at(u, v);
                    weight += k;
                }
                to.at(x, y) = sum / weight;
            }
        return to;
    };
    return pass(pass(image, 1, 0), 0, 1);
}

struct Dot {
    double x, y, height, sigma;
};

void add_dot(MeanImage &image, const Dot &dot, double factor) {
    const double reach = 4.0 * dot.sigma;
    const int left = std::max(0, static_cast<int>(dot.x - reach));
    const int right = std::min(image.width - 1, static_cast<int>(dot.x + reach));
    const int top = std::max(0, static_cast<int>(dot.y - reach));
    const int bottom = std::min(image.height - 1, static_cast<int>(dot.y + reach));
    for (int y = top; y <= bottom; ++y)
        for (int x = left; x <= right; ++x) {
            const double dx = x - dot.x;
            const double dy = y - dot.y;
            image.at(x, y) += factor * dot.height * std::exp(-0.5 * (dx * dx + dy * dy) / (dot.sigma * dot.sigma));
        }
}

/** The largest values within a radius. */
std::vector<Dot> maxima(const MeanImage &image, double radius, double threshold) {
    const int reach = std::max(1, static_cast<int>(radius));
    std::vector<Dot> found;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double here = image.at(x, y);
            bool largest = here > threshold;
            for (int v = std::max(0, y - reach); largest && v <= std::min(image.height - 1, y + reach); ++v)
                for (int u = std::max(0, x - reach); u <= std::min(image.width - 1, x + reach); ++u) {
                    const double other = image.at(u, v);
                    // Of equal ones the first.
                    largest = largest && (other < here || (other == here && (v > y || (v == y && u >= x))));
                }
            if (largest)
                found.push_back({static_cast<double>(x), static_cast<double>(y), here, 0.0});
        }
    return found;
}

/** Solves the normal equations of four parameters. */
std::optional<std::array<double, 4>> solved(std::array<std::array<double, 5>, 4> m) {
    for (std::size_t i = 0; i < 4; ++i) {
        std::size_t pivot = i;
        for (std::size_t r = i + 1; r < 4; ++r)
            if (std::abs(m[r][i]) > std::abs(m[pivot][i]))
                pivot = r;
        std::swap(m[i], m[pivot]);
        if (std::abs(m[i][i]) < 1e-300)
            return {};
        for (std::size_t r = 0; r < 4; ++r) {
            const double factor = r == i ? 0.0 : m[r][i] / m[i][i];
            for (std::size_t c = i; c < 5; ++c)
                m[r][c] -= factor * m[i][c];
        }
    }
    return std::array<double, 4>{m[0][4] / m[0][0], m[1][4] / m[1][1], m[2][4] / m[2][2], m[3][4] / m[3][3]};
}

/** Speckle scatters in proportion to the light: of a fit, by the distance from a dot's center in its widths. */
double weight_at(double distance) {
    const double scatter = std::exp(-0.5 * distance * distance) + kEvenNoise;
    return 1.0 / (scatter * scatter);
}

/** Least squares of height exp(-r^2 / (2 sigma^2)) on the pixels near the start (Levenberg and Marquardt). */
template <typename Value>
std::optional<Dot> fitted(const MeanImage &image, const Value &value_at, const Dot &start, double window) {
    const int left = std::max(0, static_cast<int>(std::ceil(start.x - window)));
    const int right = std::min(image.width - 1, static_cast<int>(std::floor(start.x + window)));
    const int top = std::max(0, static_cast<int>(std::ceil(start.y - window)));
    const int bottom = std::min(image.height - 1, static_cast<int>(std::floor(start.y + window)));
    const auto squares = [&](const Dot &dot, std::array<std::array<double, 5>, 4> *normal) {
        double sum = 0.0;
        for (int y = top; y <= bottom; ++y)
            for (int x = left; x <= right; ++x) {
                const double distance = std::hypot(x - start.x, y - start.y);
                if (distance > window)
                    continue;
                const double weight = weight_at(distance / start.sigma);
                const double dx = (x - dot.x) / dot.sigma;
                const double dy = (y - dot.y) / dot.sigma;
                const double shape = std::exp(-0.5 * (dx * dx + dy * dy));
                const double rest = value_at(x, y) - dot.height * shape;
                sum += weight * rest * rest;
                if (!normal)
                    continue;
                const double slope = dot.height * shape / dot.sigma;
                const std::array<double, 4> by = {shape, slope * dx, slope * dy, slope * (dx * dx + dy * dy)};
                for (std::size_t r = 0; r < 4; ++r) {
                    for (std::size_t c = 0; c < 4; ++c)
                        (*normal)[r][c] += weight * by[r] * by[c];
                    (*normal)[r][4] += weight * by[r] * rest;
                }
            }
        return sum;
    };
    Dot dot = start;
    double damping = 1e-3;
    double before = squares(dot, nullptr);
    for (int step = 0; step < 50 && damping < 1e6; ++step) {
        std::array<std::array<double, 5>, 4> normal{};
        squares(dot, &normal);
        for (std::size_t i = 0; i < 4; ++i)
            normal[i][i] *= 1.0 + damping;
        const auto change = solved(normal);
        if (!change)
            return {};
        const auto &[height, x, y, sigma] = *change;
        const Dot next{dot.x + x, dot.y + y, dot.height + height,
                       std::clamp(dot.sigma + sigma, 0.5 * dot.sigma, 2.0 * dot.sigma)};
        const double after = squares(next, nullptr);
        damping *= after < before ? 0.1 : 10.0;
        if (after < before) {
            dot = next;
            before = after;
            if (std::hypot(x, y) < 1e-4)
                break;
        }
    }
    const bool near = std::hypot(dot.x - start.x, dot.y - start.y) <= kMostUncertain * start.sigma;
    const bool alike = dot.sigma > start.sigma / 3.0 && dot.sigma < 3.0 * start.sigma;
    return near && alike && dot.height > 0.0 ? std::optional<Dot>(dot) : std::nullopt;
}

/**
 * The width that a fit gives a dot behind a lens of no aberrations, whose transfer of incoherent light is that of a
 * circular pupil, D cycles per pixel wide. fitted_px: the width by which pixels are weighted.
 */
double imaged_sigma(double sigma, double diameter, double fitted_px) {
    constexpr int kFrequencies = 100;
    constexpr int kRadii = 50;
    std::vector<double> profile(kRadii);
    const double pi = std::acos(-1.0);
    for (int i = 0; i < kRadii; ++i)
        for (int k = 0; k < kFrequencies; ++k) {
            const double part = (k + 0.5) / kFrequencies;
            const double f = part * diameter;
            const double transfer = std::acos(part) - part * std::sqrt(1.0 - part * part);
            const double radius = (i + 0.5) * kWindow * fitted_px / kRadii;
            profile[static_cast<std::size_t>(i)] +=
                f * transfer * std::exp(-2.0 * pi * pi * sigma * sigma * f * f) * ::j0(2.0 * pi * f * radius);
        }
    const auto rest = [&](double width) {
        double up = 0.0, own = 0.0, all = 0.0;
        for (int i = 0; i < kRadii; ++i) {
            const double distance = (i + 0.5) * kWindow / kRadii; // in fitted widths
            const double weight = weight_at(distance) * distance;
            const double shape = std::exp(-0.5 * std::pow(distance * fitted_px / width, 2));
            const double value = profile[static_cast<std::size_t>(i)];
            up += weight * shape * value;
            own += weight * shape * shape;
            all += weight * value * value;
        }
        return all - up * up / own; // the height is the best one
    };
    double low = 0.5 * fitted_px;
    double high = 2.0 * fitted_px;
    for (int step = 0; step < 40; ++step) { // the narrower half that holds the least
        const double third = (high - low) / 3.0;
        if (rest(low + third) < rest(high - third))
            high -= third;
        else
            low += third;
    }
    return 0.5 * (low + high);
}

} // namespace

FoundDots find_dots(const std::vector<float> &image, std::uint32_t width, std::uint32_t height, double noise_dn) {
    MeanImage picture{static_cast<int>(width), static_cast<int>(height), {image.begin(), image.end()}};
    const double sigma = std::max(0.6, typical_sigma(picture));
    MeanImage smooth = smoothed(picture, sigma);
    // The dark between the dots, by the lowest pixels: its level, and how even it is.
    const double low = quantile(smooth.values, 0.023);
    const double unevenness =
        std::max(quantile(smooth.values, 0.16) - low, noise_dn / (2.0 * sigma * std::sqrt(std::acos(-1.0))));
    for (MeanImage *p : {&picture, &smooth})
        for (double &value : p->values)
            value -= low;
    std::vector<Dot> candidates = maxima(smooth, 1.5 * sigma, (2.0 + kNoises) * unevenness);
    if (candidates.empty())
        return {};
    std::vector<double> heights;
    for (const Dot &candidate : candidates)
        heights.push_back(candidate.height);
    const double usual = quantile(heights, 0.75);

    candidates.erase(std::remove_if(candidates.begin(), candidates.end(),
                                    [&](const Dot &d) { return d.height < kFaintest * usual; }),
                     candidates.end());
    const double pitch = std::sqrt(static_cast<double>(width) * height / static_cast<double>(candidates.size()));

    // First each dot within what is its own, then about the place found, as wide as dots are, the others taken away.
    std::vector<Dot> dots;
    double fit_sigma = sigma;
    double window = std::max(1.5, std::min(kWindow * sigma, kOwnPart * pitch));
    for (int round = 0; round < kRounds; ++round) {
        MeanImage others = picture;
        std::fill(others.values.begin(), others.values.end(), 0.0);
        for (const Dot &dot : dots)
            add_dot(others, dot, 1.0);
        const std::vector<Dot> starts = round == 0 ? candidates : dots;
        dots.clear();
        for (Dot start : starts) {
            if (round > 0)
                add_dot(others, start, -1.0);
            const Dot own = start;
            start.sigma = fit_sigma;
            const auto dot = fitted(
                picture, [&](int x, int y) { return picture.at(x, y) - others.at(x, y); }, start, window);
            if (round > 0)
                add_dot(others, own, 1.0);
            // Grains of speckle at rest are maxima of one dot.
            if (dot && std::none_of(dots.begin(), dots.end(),
                                    [&](const Dot &d) { return std::hypot(d.x - dot->x, d.y - dot->y) < fit_sigma; }))
                dots.push_back(*dot);
        }
        if (dots.empty())
            return {};
        std::vector<double> sigmas;
        for (const Dot &dot : dots)
            sigmas.push_back(dot.sigma);
        fit_sigma = quantile(sigmas, 0.5);
        window = kWindow * fit_sigma;
    }
    FoundDots found;
    for (const Dot &dot : dots)
        found.positions_px.push_back({std::round(dot.x * 100.0) / 100.0, std::round(dot.y * 100.0) / 100.0});
    found.sigma_px = fit_sigma;
    return found;
}

double sigma_before_lens(double imaged_px, double pupil_diameter) {
    double low = 0.0;
    double high = imaged_px;
    for (int step = 0; step < 40; ++step) {
        const double middle = 0.5 * (low + high);
        (imaged_sigma(middle, pupil_diameter, imaged_px) < imaged_px ? low : high) = middle;
    }
    return high;
}

} // namespace tools
