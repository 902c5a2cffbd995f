// The power spectrum of images under a Hann window: a real frame is not periodic, and its edges would leak into all
// frequencies.
#include "statistics/speckle_sums.hpp"

#include "statistics/parallel_for.hpp"
#include "statistics/sink.hpp"

#include <unsupported/Eigen/FFT>

#include <algorithm>
#include <cmath>
#include <complex>

namespace clsp::statistics {

namespace {

constexpr double kPi = 3.14159265358979323846;

std::vector<float> hann(std::size_t count) {
    std::vector<float> window(count);
    for (std::size_t i = 0; i < count; ++i)
        window[i] = float(0.5 - 0.5 * std::cos(2.0 * kPi * (double(i) + 0.5) / double(count)));
    return window;
}

// Rings of |f| up to the corner of the frequency plane, narrow enough for the spectrum to be flat in each.
constexpr std::size_t kPeakRings = 48;
constexpr double kCorner = 0.7072;

struct PowerSums {
    std::array<double, kBands + 1> power{}, count{};
    std::array<double, kPeakRings> ring_power{}, ring_square{}, ring_count{};
    double along_x = 0.0, along_y = 0.0;
};

PowerSums sum_power(const Geometry &geometry, double cutoff, const float *image) {
    const std::size_t width = geometry.width, height = geometry.height, half = width / 2 + 1;
    const std::vector<float> window_x = hann(width), window_y = hann(height);
    Eigen::FFT<float> transform;
    transform.SetFlag(Eigen::FFT<float>::HalfSpectrum);
    std::vector<float> row(width);
    std::vector<std::complex<float>> line, column(height), spectrum(half * height);
    for (std::size_t y = 0; y < height; ++y) {
        for (std::size_t x = 0; x < width; ++x)
            row[x] = image[y * width + x] * window_x[x] * window_y[y];
        transform.fwd(line, row);
        for (std::size_t x = 0; x < half; ++x)
            spectrum[x * height + y] = line[x];
    }
    PowerSums sums;
    for (std::size_t kx = 0; kx < half; ++kx) {
        std::copy(spectrum.begin() + std::ptrdiff_t(kx * height), spectrum.begin() + std::ptrdiff_t((kx + 1) * height),
                  column.begin());
        transform.fwd(line, column);
        const double multiplicity = kx == 0 || 2 * kx == width ? 1.0 : 2.0, fx = double(kx) / double(width);
        for (std::size_t y = 0; y < height; ++y) {
            const std::size_t ky = std::min(y, height - y);
            if (kx <= 1 && ky <= 1)
                continue; // what the window makes of the mean
            const double fy = double(ky) / double(height), power = double(std::norm(line[y]));
            const double frequency = std::sqrt(fx * fx + fy * fy), position = frequency / cutoff * double(kBands);
            const std::size_t band = position < double(kBands) ? std::size_t(position) : kBands;
            sums.power[band] += multiplicity * power;
            sums.count[band] += multiplicity;
            const std::size_t ring = std::min(std::size_t(frequency / kCorner * double(kPeakRings)), kPeakRings - 1);
            sums.ring_power[ring] += multiplicity * power;
            sums.ring_square[ring] += multiplicity * power * power;
            sums.ring_count[ring] += multiplicity;
            if (fx > fy)
                sums.along_x += multiplicity * power;
            else if (fx < fy)
                sums.along_y += multiplicity * power;
        }
    }
    return sums;
}

} // namespace

// Beyond 0.68 cycles per pixel lie only the corners of the frequency plane.
bool has_outside(const Geometry &geometry) {
    return geometry.cutoff > 0.0 && geometry.cutoff < 0.68;
}

SpectrumSums sum_spectrum(const Geometry &geometry, double cutoff, const std::vector<const float *> &images,
                          unsigned threads) {
    std::vector<PowerSums> parts(images.size());
    parallel_for(images.size(), threads, [&](std::size_t t) { parts[t] = sum_power(geometry, cutoff, images[t]); });
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
