#include "statistics/spectrum_sums.hpp"

#include "statistics/parallel_for.hpp"
#include "statistics/sink.hpp"

#include <unsupported/Eigen/FFT>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>

namespace clsp::statistics {

namespace {

// Rings of |f| up to the corner of the frequency plane, narrow enough for the spectrum to be flat in each.
constexpr std::size_t kPeakRings = 48;
constexpr double kCorner = 0.7072;

struct PowerSums {
    std::array<double, kBands + 1> power{}, count{};
    std::array<double, kPeakRings> ring_power{}, ring_square{}, ring_count{};
    double along_x = 0.0, along_y = 0.0;
};

// The part of an image whose spectrum it is.
struct Box {
    explicit Box(const Geometry &geometry)
        : width(transform_size(geometry.width)), height(transform_size(geometry.height)),
          first((geometry.height - height) / 2 * geometry.width + (geometry.width - width) / 2),
          stride(geometry.width) {}
    std::size_t width, height, first, stride;
};

// |F|^2 of fx = kx / width from 0 on: of (kx, ky) at kx * height + ky.
std::vector<double> power_spectrum(const Box &box, const float *image) {
    const std::size_t width = box.width, height = box.height, half = width / 2 + 1;
    const std::vector<float> window_x = hann(width), window_y = hann(height);
    Eigen::FFT<float> transform;
    transform.SetFlag(Eigen::FFT<float>::HalfSpectrum);
    std::vector<float> row(width);
    std::vector<std::complex<float>> line, column(height), spectrum(half * height);
    for (std::size_t y = 0; y < height; ++y) {
        for (std::size_t x = 0; x < width; ++x)
            row[x] = image[box.first + y * box.stride + x] * window_x[x] * window_y[y];
        transform.fwd(line, row);
        for (std::size_t x = 0; x < half; ++x)
            spectrum[x * height + y] = line[x];
    }
    std::vector<double> power(half * height);
    for (std::size_t kx = 0; kx < half; ++kx) {
        std::copy(spectrum.begin() + std::ptrdiff_t(kx * height), spectrum.begin() + std::ptrdiff_t((kx + 1) * height),
                  column.begin());
        transform.fwd(line, column);
        for (std::size_t ky = 0; ky < height; ++ky)
            power[kx * height + ky] = double(std::norm(line[ky]));
    }
    return power;
}

// What the window makes of the mean.
bool is_mean(std::size_t kx, std::size_t ky) {
    return kx <= 1 && ky <= 1;
}

std::size_t ring_of(double frequency) {
    return std::min(std::size_t(frequency / kCorner * double(kPeakRings)), kPeakRings - 1);
}

PowerSums sum_power(const Box &box, double cutoff, const std::vector<double> &powers) {
    const std::size_t width = box.width, height = box.height, half = width / 2 + 1;
    PowerSums sums;
    for (std::size_t kx = 0; kx < half; ++kx) {
        const double multiplicity = kx == 0 || 2 * kx == width ? 1.0 : 2.0, fx = double(kx) / double(width);
        for (std::size_t ky = 0; 2 * ky <= height; ++ky) {
            if (is_mean(kx, ky))
                continue;
            // fy and -fy.
            const bool both = ky > 0 && 2 * ky < height;
            const double here = powers[kx * height + ky], there = both ? powers[kx * height + height - ky] : 0.0;
            const double count = both ? 2.0 * multiplicity : multiplicity, power = here + there;
            const double fy = double(ky) / double(height);
            const double frequency = std::sqrt(fx * fx + fy * fy), position = frequency / cutoff * double(kBands);
            const std::size_t band = position < double(kBands) ? std::size_t(position) : kBands;
            sums.power[band] += multiplicity * power;
            sums.count[band] += count;
            const std::size_t ring = ring_of(frequency);
            sums.ring_power[ring] += multiplicity * power;
            sums.ring_square[ring] += multiplicity * (here * here + there * there);
            sums.ring_count[ring] += count;
            if (fx > fy)
                sums.along_x += multiplicity * power;
            else if (fx < fy)
                sums.along_y += multiplicity * power;
        }
    }
    return sums;
}

// The logarithm of a standard normal number's chance to be above z, also where the chance is no double.
double log_chance_above(double z) {
    constexpr double kFar = 30.0;
    return z < kFar ? std::log(0.5 * std::erfc(z * M_SQRT1_2))
                    : -0.5 * z * z - std::log(z * std::sqrt(2.0 * M_PI)) - 1.0 / (z * z);
}

// The standard normal number that is exceeded as seldom as one of `count` numbers is so far out that each is with
// probability exp(-rarity).
double normal_score_of_rarest(double rarity, double count) {
    const double others = std::log(count) - rarity; // of how many are expected so far out
    const double chance = others < -std::log(1e12) ? others : std::log(-std::expm1(-std::exp(others)));
    double low = -10.0, high = 10.0 + std::sqrt(2.0 * std::max(rarity, 0.0));
    for (int step = 0; step < 60; ++step) {
        const double middle = 0.5 * (low + high);
        (log_chance_above(middle) > chance ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

// Offsets of rows and of columns have all their power where fx or fy is 0 or, by the window, one step beside it: each
// of these lines is a surrounding of its own, four rings another.
SpectralLine strongest_line(const Box &box, const std::vector<double> &powers) {
    const std::size_t width = box.width, height = box.height, half = width / 2 + 1;
    constexpr std::size_t kRings = kPeakRings / 4, kRowOffsets = kRings, kColumnOffsets = kRings + 2;
    constexpr double kNothing = 1e-12;
    const auto surrounding = [&](std::size_t kx, std::size_t ky) {
        if (kx <= 1)
            return kRowOffsets + kx;
        if (ky <= 1)
            return kColumnOffsets + ky;
        const double fx = double(kx) / double(width), fy = double(ky) / double(height);
        return ring_of(std::sqrt(fx * fx + fy * fy)) / 4;
    };
    // Logarithms: the line itself counts in its surrounding as one of many.
    std::array<double, kRings + 4> total{}, count{};
    std::vector<std::uint8_t> rings(powers.size());
    const auto each = [&](const auto &work) {
        for (std::size_t kx = 0; kx < half; ++kx)
            for (std::size_t y = 0; y < height; ++y) {
                const std::size_t ky = std::min(y, height - y);
                // The other half of fx = 0 is the same again.
                if (!is_mean(kx, ky) && (kx > 0 || 2 * y <= height))
                    work(kx * height + y, kx, y, ky);
            }
    };
    each([&](std::size_t at, std::size_t kx, std::size_t, std::size_t ky) {
        const std::size_t ring = surrounding(kx, ky);
        rings[at] = std::uint8_t(ring);
        total[ring] += std::log(powers[at] + kNothing);
        count[ring] += 1.0;
    });
    std::array<double, kRings + 4> largest{};
    std::array<std::size_t, kRings + 4> place{};
    each([&](std::size_t at, std::size_t, std::size_t, std::size_t) {
        const std::size_t ring = rings[at];
        if (powers[at] > largest[ring]) {
            largest[ring] = powers[at];
            place[ring] = at;
        }
    });
    // Noise has exponential powers. The mean of their logarithms is Euler's constant below that of their mean. It
    // scatters as the mean of fewer powers does: logarithms scatter more, and neighbours under a Hann window are alike.
    // A power over the mean of so many others has the law of F.
    constexpr double kEuler = 0.57721566490153286, kOfLogarithms = M_PI * M_PI / 6.0, kOfWindow = 35.0 / 18.0;
    constexpr double kBandwidth = 1.5; // of the window, in frequencies each way
    double rarest = -1.0, frequencies = 0.0;
    std::size_t at = 0;
    for (std::size_t ring = 0; ring < count.size(); ++ring) {
        frequencies += count[ring] / (kBandwidth * kBandwidth);
        if (count[ring] == 0.0)
            continue;
        const double power = (largest[ring] + kNothing) / std::exp(total[ring] / count[ring] + kEuler);
        const double others = count[ring] / (kOfLogarithms * kOfWindow * (ring < kRings ? kOfWindow : 1.0));
        const double rarity = others * std::log1p(power / others);
        if (rarity > rarest) {
            rarest = rarity;
            at = place[ring];
        }
    }
    SpectralLine line;
    line.prominence = normal_score_of_rarest(rarest, frequencies);
    // The window spreads a wave over its neighbours, which may be in another surrounding.
    const auto w = std::ptrdiff_t(width), h = std::ptrdiff_t(height);
    const auto power_at = [&](std::ptrdiff_t kx, std::ptrdiff_t ky) {
        kx = (kx + w) % w;
        if (kx > w / 2) { // the image is real
            kx = w - kx;
            ky = -ky;
        }
        ky = (ky % h + h) % h;
        return is_mean(std::size_t(kx), std::size_t(std::min(ky, h - ky))) ? 0.0 : powers[std::size_t(kx * h + ky)];
    };
    std::ptrdiff_t kx = std::ptrdiff_t(at) / h, ky = std::ptrdiff_t(at) % h;
    const std::ptrdiff_t middle_x = kx, middle_y = ky;
    for (std::ptrdiff_t x = std::max(middle_x - 1, std::ptrdiff_t(0)); x <= std::min(middle_x + 1, w / 2); ++x)
        for (std::ptrdiff_t y = middle_y - 1; y <= middle_y + 1; ++y)
            if (power_at(x, y) > power_at(kx, ky)) {
                kx = x;
                ky = (y + h) % h;
            }
    const double most = power_at(kx, ky);
    // Between two frequencies of the grid the window's transform goes as 1 / (d (1 - d^2)): of the amplitudes at d and
    // 1 - d the ratio is (1 + d) / (2 - d).
    const auto offset = [&](double before, double after) {
        const double ratio_of = std::sqrt(ratio(std::max(before, after), most));
        const double found = std::clamp((2.0 * ratio_of - 1.0) / (1.0 + ratio_of), 0.0, 0.5);
        return after > before ? found : -found;
    };
    const double dx = offset(power_at(kx - 1, ky), power_at(kx + 1, ky));
    const double dy = offset(power_at(kx, ky - 1), power_at(kx, ky + 1));
    const auto window = [](double d) { // at d from its middle, over that in the middle
        return std::abs(d) < 1e-6 ? 1.0 : std::sin(M_PI * d) / (M_PI * d * (1.0 - d * d));
    };
    // The windows' means are 1/2 each; half of the amplitude is at the negative frequency.
    line.amplitude = 8.0 * std::sqrt(most) / (double(width) * double(height) * window(dx) * window(dy));
    line.frequency_x = (double(kx) + dx) / double(width);
    line.frequency_y = (double(2 * ky > h ? ky - h : ky) + dy) / double(height);
    return line;
}

} // namespace

std::size_t transform_size(std::size_t size) {
    for (std::size_t candidate = size / 2 * 2; candidate > 1; candidate -= 2) {
        std::size_t rest = candidate;
        for (const std::size_t factor : {2, 3, 5})
            while (rest % factor == 0)
                rest /= factor;
        if (rest == 1)
            return candidate;
    }
    return 1;
}

std::vector<float> hann(std::size_t size) {
    std::vector<float> window(size, 1.0f);
    for (std::size_t i = 0; size > 2 && i < size; ++i)
        window[i] = float(0.5 - 0.5 * std::cos(2.0 * M_PI * (double(i) + 0.5) / double(size)));
    return window;
}

// Beyond 0.68 cycles per pixel lie only the corners of the frequency plane.
bool has_outside(const Geometry &geometry) {
    return geometry.cutoff > 0.0 && geometry.cutoff < 0.68;
}

SpectrumSums sum_spectrum(const Geometry &geometry, double cutoff, const std::vector<const float *> &images,
                          unsigned threads, SpectralLine *line) {
    const Box box(geometry);
    std::vector<PowerSums> parts(images.size());
    parallel_for(images.size(), threads, [&](std::size_t t) {
        const std::vector<double> powers = power_spectrum(box, images[t]);
        parts[t] = sum_power(box, cutoff, powers);
        if (line && t == 0)
            *line = strongest_line(box, powers);
    });
    PowerSums total;
    for (const PowerSums &part : parts) {
        for (std::size_t k = 0; k <= kBands; ++k) {
            total.power[k] += part.power[k];
            total.count[k] += part.count[k];
        }
        for (std::size_t k = 0; k < kPeakRings; ++k) {
            total.ring_power[k] += part.ring_power[k];
            total.ring_square[k] += part.ring_square[k];
            total.ring_count[k] += part.ring_count[k];
        }
        total.along_x += part.along_x;
        total.along_y += part.along_y;
    }
    SpectrumSums sums;
    double power = 0.0, count = 0.0, peaks = 0.0;
    for (std::size_t k = 0; k <= kBands; ++k) {
        power += total.power[k];
        count += total.count[k];
    }
    for (std::size_t k = 0; k < kPeakRings; ++k)
        if (total.ring_power[k] > 0.0) {
            const double mean = total.ring_power[k] / total.ring_count[k];
            peaks += 0.5 * total.ring_square[k] / (mean * mean);
        }
    const double mean_density = ratio(power, count);
    for (std::size_t k = 0; k < kBands; ++k)
        sums.band[k] = ratio(ratio(total.power[k], total.count[k]), mean_density);
    sums.outside = ratio(ratio(total.power[kBands], total.count[kBands]), mean_density);
    if (total.along_x > 0.0 && total.along_y > 0.0)
        sums.direction = total.along_x / total.along_y;
    if (count > 0.0)
        sums.peaks = peaks / count;
    return sums;
}

} // namespace clsp::statistics
