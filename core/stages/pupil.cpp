#include "stages/pupil.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/image_view.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <fmt/core.h>
#include <optional>
#include <string>

namespace clsp {
namespace {

// Signed frequency of FFT bin i of n.
std::int64_t frequency(std::uint32_t i, std::uint32_t n) {
    return i < (n + 1) / 2 ? std::int64_t{i} : std::int64_t{i} - n;
}

// The bins of n whose frequencies are at most `farthest`, in their order. Beyond the rim no pupil passes anything, so
// that all else in a grid stays 0.
std::vector<std::uint32_t> bins_within(double farthest, std::uint32_t n) {
    std::vector<std::uint32_t> bins;
    for (std::uint32_t i = 0; i < n; ++i)
        if (std::abs(double(frequency(i, n))) <= farthest)
            bins.push_back(i);
    return bins;
}

// Looked up bilinearly in pupil coordinates, the rim at 1.
class PupilImage {
  public:
    explicit PupilImage(const PupilParameters &p) : width_(p.image_width), height_(p.image_height) {
        check_image_size(width_, height_, "pupil_image");
        const bool is_complex = p.image_imaginary;
        const float least = is_complex ? -1.0f : 0.0f;
        const auto part = [&](const float *pixels, const char *name) {
            return copy_host_image(
                {pixels, width_, height_, p.image_pitch_bytes, name, "pupil_pitch_bytes"},
                [&](float t) { return t >= least && t <= 1.0f; },
                is_complex ? "parts of transmissions must be -1 to 1" : "transmissions must be 0 to 1");
        };
        const std::vector<float> real = part(p.image, "pupil_image");
        pixels_.assign(real.begin(), real.end());
        if (!is_complex)
            return;
        const std::vector<float> imaginary = part(p.image_imaginary, "pupil_image_imaginary");
        constexpr double kMost = 1.0 + 1e-6; // exp(i phi) in single precision
        for (std::size_t i = 0; i < pixels_.size(); ++i) {
            pixels_[i].imag(imaginary[i]);
            if (std::abs(pixels_[i]) > kMost)
                throw Error(Status::kInvalidData,
                            fmt::format("pupil_image and pupil_image_imaginary have the magnitude {2} at [{0}, {1}]; "
                                        "transmissions must have one of 0 to 1",
                                        i / width_, i % width_, std::abs(pixels_[i])));
        }
    }
    std::complex<double> operator()(double u, double v) const {
        const double x = std::clamp((u + 1.0) * 0.5 * width_ - 0.5, 0.0, width_ - 1.0);
        const double y = std::clamp((v + 1.0) * 0.5 * height_ - 0.5, 0.0, height_ - 1.0);
        const auto x0 = static_cast<std::uint32_t>(x), y0 = static_cast<std::uint32_t>(y);
        const std::uint32_t x1 = std::min(x0 + 1, width_ - 1), y1 = std::min(y0 + 1, height_ - 1);
        const double ax = x - x0, ay = y - y0;
        return (1 - ay) * ((1 - ax) * at(x0, y0) + ax * at(x1, y0)) + ay * ((1 - ax) * at(x0, y1) + ax * at(x1, y1));
    }

  private:
    std::complex<double> at(std::uint32_t x, std::uint32_t y) const { return pixels_[std::size_t{y} * width_ + x]; }

    std::uint32_t width_, height_;
    std::vector<std::complex<double>> pixels_;
};

// Distance from the axis to the polygon's boundary in a direction, the rim at 1. With n blades the chord between two
// vertices lies at a = cos(pi/n) and is 2 b = 2 sin(pi/n) long. In the direction psi from a blade's middle, the arc of
// curvature c through both ends holds c r^2 + 2 (q - c a) r cos(psi) = 2 a q - c (a^2 - b^2) with q = sqrt(1 - c^2
// b^2); solved so that nothing cancels as c goes to 0, where it is the chord r = a / cos(psi).
class Polygon {
  public:
    explicit Polygon(const PupilParameters &p)
        : sector_(2.0 * M_PI / p.blade_count), rotation_(p.blade_rotation_rad), curvature_(p.blade_curvature) {
        const double a = std::cos(0.5 * sector_), b = std::sin(0.5 * sector_), c = curvature_;
        const double q = std::sqrt(1.0 - c * c * b * b);
        linear_ = q - c * a;
        constant_ = 2.0 * a * q - c * (a * a - b * b);
    }
    double boundary(double theta) const {
        // remainder() is exact: the angle from the middle of a blade, within half a sector.
        const double psi = std::remainder(theta - rotation_ - 0.5 * sector_, sector_);
        const double half = linear_ * std::cos(psi);
        return constant_ / (half + std::sqrt(half * half + curvature_ * constant_));
    }

  private:
    double sector_, rotation_, curvature_, linear_, constant_;
};

void check(const PupilParameters &p) {
    check_fraction(p.soft_rim, "soft_rim");
    if (p.shape != PupilShape::kImage && (p.image || p.image_imaginary))
        throw Error(Status::kInvalidArgument,
                    fmt::format("pupil_image was given, but pupil is {}; make it an image",
                                p.shape == PupilShape::kCircle    ? "a circle"
                                : p.shape == PupilShape::kPolygon ? "a polygon"
                                                                  : "a ring"));
    if (p.shape == PupilShape::kPolygon && (p.blade_count < kMinBlades || p.blade_count > kMaxBlades))
        throw Error(Status::kInvalidArgument,
                    fmt::format("blade_count is {}, it must be {} to {}", p.blade_count, kMinBlades, kMaxBlades));
    // Angles far outside a turn would lose their digits.
    constexpr double kLargestAngle = 1e6;
    if (!(std::abs(p.blade_rotation_rad) <= kLargestAngle))
        throw Error(Status::kInvalidArgument, fmt::format("blade_rotation_rad is {}, it must be {} to {}",
                                                          p.blade_rotation_rad, -kLargestAngle, kLargestAngle));
    check_fraction(p.blade_curvature, "blade_curvature");
    if (!(p.obstruction_ratio >= 0.0 && p.obstruction_ratio < 1.0))
        throw Error(Status::kInvalidArgument,
                    fmt::format("obstruction_ratio is {}, it must be at least 0 and below 1", p.obstruction_ratio));
    if (p.shape == PupilShape::kRing && p.obstruction_ratio == 0.0)
        throw Error(Status::kInvalidArgument,
                    "obstruction_ratio is 0, but pupil is a ring, which needs it above 0; without an obstruction use a "
                    "circle");
    const auto check_waves = [](double waves, const std::string &name) {
        if (!(std::abs(waves) <= kLargestAberrationWaves))
            throw Error(Status::kInvalidArgument, fmt::format("{} is {}, it must be {} to {}", name, waves,
                                                              -kLargestAberrationWaves, kLargestAberrationWaves));
    };
    check_waves(p.defocus_waves, "defocus_waves");
    for (std::uint32_t i = 0; i < kZernikeCount; ++i)
        check_waves(p.zernike_waves[i], fmt::format("zernike_waves[{}] (Noll index {})", i, i + kFirstZernike));
}

bool aberrated(const PupilParameters &p) {
    return p.defocus_waves != 0.0 ||
           std::any_of(p.zernike_waves.begin(), p.zernike_waves.end(), [](double waves) { return waves != 0.0; });
}

double wavefront(const PupilParameters &p, double u, double v) {
    const double rho = std::hypot(u, v);
    double waves = p.defocus_waves * rho * rho;
    for (std::uint32_t i = 0; i < kZernikeCount; ++i)
        if (p.zernike_waves[i] != 0.0)
            waves += p.zernike_waves[i] * zernike(i + kFirstZernike, rho, std::atan2(v, u));
    return waves;
}

// Falls from 1 to 0 over the last part `soft` of the way from 0 to 1.
double rim(double way, double soft) {
    const double start = 1.0 - soft;
    return way <= start ? 1.0 : 0.5 * (1.0 + std::cos(M_PI * (way - start) / soft));
}

// The slope of the wavefront, in turns per frequency step, is where light of that frequency lands, in grid widths: half
// a turn is half the grid. Beyond it the samples would show another wavefront than the one that was asked for.
void check_sampling(const std::vector<double> &waves, const std::vector<float> &transmission, const FieldGrid &grid,
                    const std::vector<std::uint32_t> &rows, const std::vector<std::uint32_t> &columns) {
    const std::uint32_t width = grid.grid_width, height = grid.grid_height;
    double steepest = 0.0;
    for (const std::uint32_t y : rows) {
        for (const std::uint32_t x : columns) {
            const std::size_t i = std::size_t{y} * width + x;
            const std::size_t right = std::size_t{y} * width + (x + 1) % width,
                              below = std::size_t{(y + 1) % height} * width + x;
            if (!(transmission[i] > 0.0f))
                continue;
            // Not across the fold at the highest frequency.
            if (transmission[right] > 0.0f && frequency((x + 1) % width, width) == frequency(x, width) + 1)
                steepest = std::max(steepest, std::abs(waves[right] - waves[i]));
            if (transmission[below] > 0.0f && frequency((y + 1) % height, height) == frequency(y, height) + 1)
                steepest = std::max(steepest, std::abs(waves[below] - waves[i]));
        }
    }
    if (steepest > 0.5)
        throw Error(
            Status::kInvalidArgument,
            fmt::format("the aberrations (defocus_waves, zernike_waves) spread a point over {:.3g} times the field "
                        "grid of {} x {} samples, which holds at most 1; use fewer waves, a larger guard_px or "
                        "a larger image",
                        2.0 * steepest, width, height));
}

} // namespace

double zernike(std::uint32_t noll_index, double rho, double theta) {
    const double r2 = rho * rho;
    switch (noll_index) {
    case 4:
        return std::sqrt(3.0) * (2.0 * r2 - 1.0);
    case 5:
        return std::sqrt(6.0) * r2 * std::sin(2.0 * theta);
    case 6:
        return std::sqrt(6.0) * r2 * std::cos(2.0 * theta);
    case 7:
        return std::sqrt(8.0) * (3.0 * r2 - 2.0) * rho * std::sin(theta);
    case 8:
        return std::sqrt(8.0) * (3.0 * r2 - 2.0) * rho * std::cos(theta);
    case 9:
        return std::sqrt(8.0) * r2 * rho * std::sin(3.0 * theta);
    case 10:
        return std::sqrt(8.0) * r2 * rho * std::cos(3.0 * theta);
    case 11:
        return std::sqrt(5.0) * ((6.0 * r2 - 6.0) * r2 + 1.0);
    case 12:
        return std::sqrt(10.0) * (4.0 * r2 - 3.0) * r2 * std::cos(2.0 * theta);
    case 13:
        return std::sqrt(10.0) * (4.0 * r2 - 3.0) * r2 * std::sin(2.0 * theta);
    case 14:
        return std::sqrt(10.0) * r2 * r2 * std::cos(4.0 * theta);
    case 15:
        return std::sqrt(10.0) * r2 * r2 * std::sin(4.0 * theta);
    default:
        throw Error(Status::kInternal,
                    fmt::format("Zernike polynomial {} was asked for, 4 to 15 are known", noll_index));
    }
}

Pupil make_pupil(const PupilParameters &p, const FieldGrid &grid, double relative_diameter) {
    check(p);

    const std::uint32_t width = grid.grid_width, height = grid.grid_height;
    // D in cycles per field sample; radius in bins is D W / 2 along x and D H / 2 along y.
    const double d = relative_diameter / grid.oversampling;
    // kx^2 H^2 + ky^2 W^2 < (1 - 2^-40) D^2 W^2 H^2 / 4, decided in integers (sides are at most 2^14: everything fits
    // in 63 bits and in the 64 bits of a long double): a float test errs at 3-4-5 triangles, and the margin settles D
    // that are not binary fractions.
    const auto w2 = std::int64_t{width} * width, h2 = std::int64_t{height} * height;
    // Whole numbers are below a limit if they are below the next whole number.
    const auto limit =
        static_cast<std::int64_t>(std::ceil((1.0L - 0x1p-40L) * static_cast<long double>(d) * d * w2 * h2 / 4.0L));
    // The obstruction's own boundary is out as well.
    const auto least =
        static_cast<std::int64_t>(std::floor((1.0L + 0x1p-40L) * static_cast<long double>(d * p.obstruction_ratio) *
                                             (d * p.obstruction_ratio) * w2 * h2 / 4.0L));
    // A hair inside a boundary that is not decided in integers: rounding must not let frequencies on it pass.
    constexpr double kInside = 1.0 - 0x1p-41;

    Pupil pupil;
    pupil.transmission.assign(grid.samples(), 0.0f);
    std::vector<double> waves;
    // A complex image's turns stand apart: whole ones are lost, so that their slope is not known.
    std::vector<float> image_turns;
    if (aberrated(p) || p.image_imaginary)
        waves.assign(grid.samples(), 0.0);
    if (p.image_imaginary)
        image_turns.assign(grid.samples(), 0.0f);
    std::optional<PupilImage> image;
    if (p.shape == PupilShape::kImage)
        image.emplace(p);
    std::optional<Polygon> polygon;
    if (p.shape == PupilShape::kPolygon)
        polygon.emplace(p);
    double sum = 0.0;
    const std::vector<std::uint32_t> rows = bins_within(0.5 * d * height, height),
                                     columns = bins_within(0.5 * d * width, width);
    for (const std::uint32_t y : rows) {
        const std::int64_t ky = frequency(y, height);
        const double v = 2.0 * double(ky) / (d * height);
        for (const std::uint32_t x : columns) {
            const std::int64_t kx = frequency(x, width);
            double t = 0.0;
            // Pupil coordinates, 1 at the rim.
            const double u = 2.0 * double(kx) / (d * width);
            const std::int64_t k2 = kx * kx * h2 + ky * ky * w2;
            if (image) {
                // The boundary itself is out, as the circle's rim is; the margin is the circle's.
                const double way = std::max(std::abs(u), std::abs(v));
                if (way < kInside) {
                    const std::complex<double> amplitude = (*image)(u, v);
                    t = std::abs(amplitude) * rim(way, p.soft_rim);
                    if (!image_turns.empty())
                        image_turns[std::size_t{y} * width + x] =
                            static_cast<float>(std::arg(amplitude) / (2.0 * M_PI));
                }
            } else if (k2 < limit && !polygon && p.soft_rim == 0.0) {
                t = 1.0;
            } else if (k2 < limit) {
                double way = std::sqrt(u * u + v * v);
                if (polygon)
                    way /= polygon->boundary(std::atan2(v, u));
                t = !polygon || way < kInside ? rim(way, p.soft_rim) : 0.0;
            }
            if (p.obstruction_ratio > 0.0)
                // 1 on the obstruction's boundary, 0 and below where its soft rim is over.
                t = k2 > least ? t * rim(2.0 - std::sqrt(u * u + v * v) / p.obstruction_ratio, p.soft_rim) : 0.0;
            if (t > 0.0) {
                ++pupil.samples;
                sum += t * t;
                if (!waves.empty())
                    waves[std::size_t{y} * width + x] = wavefront(p, u, v);
            }
            pupil.transmission[std::size_t{y} * width + x] = static_cast<float>(t);
        }
    }
    // z has unit variance on each sample, so its power per cycle falls with the number of samples per pixel; the
    // aperture's light must not: amplitudes grow by the oversampling.
    const double gain = grid.oversampling;
    pupil.mean_transmission = gain * gain * sum / double(grid.samples());
    if (!(sum > 0.0))
        throw Error(Status::kInvalidArgument,
                    image ? "the pupil passes nothing: its image is 0 everywhere that the grid samples it"
                          : "the pupil passes nothing: the grid's frequencies all lie outside its boundary or on its "
                            "obstruction; use a smaller obstruction_ratio, a larger image or a larger guard_px");
    if (!waves.empty()) {
        check_sampling(waves, pupil.transmission, grid, rows, columns);
        pupil.phase_turns.assign(waves.size(), 0.0f);
    }
    const double scale = p.normalization == Normalization::kUnitMean ? gain / std::sqrt(pupil.mean_transmission) : gain;
    for (const std::uint32_t y : rows)
        for (const std::uint32_t x : columns) {
            const std::size_t i = std::size_t{y} * width + x;
            float &t = pupil.transmission[i];
            t = static_cast<float>(t * scale);
            if (!waves.empty() && t > 0.0f)
                pupil.phase_turns[i] =
                    static_cast<float>(std::remainder(waves[i] + (image_turns.empty() ? 0.0f : image_turns[i]), 1.0));
        }
    return pupil;
}

} // namespace clsp
