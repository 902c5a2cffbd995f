#include "stages/pupil.hpp"

#include "runtime/checks.hpp"
#include "runtime/error.hpp"
#include "runtime/image_view.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/core.h>
#include <functional>

namespace clsp {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Signed frequency of FFT bin i of n.
std::int64_t frequency(std::uint32_t i, std::uint32_t n) {
    return i < (n + 1) / 2 ? std::int64_t{i} : std::int64_t{i} - n;
}

// Looked up bilinearly in pupil coordinates, the rim at 1.
class PupilImage {
  public:
    explicit PupilImage(const PupilParameters &p) : width_(p.image_width), height_(p.image_height) {
        check_image_size(width_, height_, "pupil_image");
        pixels_ = copy_host_image(
            {p.image, width_, height_, p.image_pitch_bytes, "pupil_image", "pupil_pitch_bytes"},
            [](float t) { return t >= 0.0f && t <= 1.0f; }, "transmissions must be 0 to 1");
    }
    double operator()(double u, double v) const {
        const double x = std::clamp((u + 1.0) * 0.5 * width_ - 0.5, 0.0, width_ - 1.0);
        const double y = std::clamp((v + 1.0) * 0.5 * height_ - 0.5, 0.0, height_ - 1.0);
        const auto x0 = static_cast<std::uint32_t>(x), y0 = static_cast<std::uint32_t>(y);
        const std::uint32_t x1 = std::min(x0 + 1, width_ - 1), y1 = std::min(y0 + 1, height_ - 1);
        const double ax = x - x0, ay = y - y0;
        return (1 - ay) * ((1 - ax) * at(x0, y0) + ax * at(x1, y0)) + ay * ((1 - ax) * at(x0, y1) + ax * at(x1, y1));
    }

  private:
    double at(std::uint32_t x, std::uint32_t y) const { return pixels_[std::size_t{y} * width_ + x]; }

    std::uint32_t width_, height_;
    std::vector<float> pixels_;
};

} // namespace

Pupil make_pupil(const PupilParameters &p, const FieldGrid &grid, double relative_diameter) {
    if (p.shape != PupilShape::kCircle && p.shape != PupilShape::kImage)
        throw Error(Status::kInvalidArgument, fmt::format("pupil is {}, expected CLSP_PUPIL_CIRCLE or CLSP_PUPIL_IMAGE",
                                                          static_cast<std::uint32_t>(p.shape)));
    if (p.normalization != Normalization::kTransmission && p.normalization != Normalization::kUnitMean)
        throw Error(Status::kInvalidArgument,
                    fmt::format("normalization is {}, expected CLSP_NORMALIZATION_TRANSMISSION or _UNIT_MEAN",
                                static_cast<std::uint32_t>(p.normalization)));
    check_fraction(p.soft_rim, "soft_rim");

    const std::uint32_t width = grid.grid_width, height = grid.grid_height;
    // D in cycles per field sample; radius in bins is D W / 2 along x and D H / 2 along y.
    const double d = relative_diameter / grid.oversampling;
    // kx^2 H^2 + ky^2 W^2 < (1 - 2^-40) D^2 W^2 H^2 / 4, decided in integers (sides are at most 2^14: everything fits
    // in 63 bits and in the 64 bits of a long double): a float test errs at 3-4-5 triangles, and the margin settles D
    // that are not binary fractions.
    const auto w2 = std::int64_t{width} * width, h2 = std::int64_t{height} * height;
    const long double limit = (1.0L - 0x1p-40L) * static_cast<long double>(d) * d * w2 * h2 / 4.0L;

    Pupil pupil;
    pupil.transmission.assign(grid.samples(), 0.0f);
    std::function<double(double, double)> shape;
    if (p.shape == PupilShape::kCircle && p.image)
        throw Error(Status::kInvalidArgument,
                    "pupil_image was given, but pupil is CLSP_PUPIL_CIRCLE; set it to CLSP_PUPIL_IMAGE");
    if (p.shape == PupilShape::kImage) {
        shape = PupilImage(p);
    }
    double sum = 0.0;
    for (std::uint32_t y = 0; y < height; ++y) {
        const std::int64_t ky = frequency(y, height);
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::int64_t kx = frequency(x, width);
            double t = 0.0;
            // Pupil coordinates, 1 at the rim.
            const double u = 2.0 * double(kx) / (d * width), v = 2.0 * double(ky) / (d * height);
            if (shape) {
                // The boundary itself is out, as the circle's rim is; the margin is the circle's.
                if (std::max(std::abs(u), std::abs(v)) < 1.0 - 0x1p-41)
                    t = shape(u, v);
            } else if (static_cast<long double>(kx * kx * h2 + ky * ky * w2) < limit) {
                const double rho = std::sqrt(u * u + v * v), start = 1.0 - p.soft_rim;
                t = rho <= start ? 1.0 : 0.5 * (1.0 + std::cos(kPi * (rho - start) / p.soft_rim));
            }
            if (t > 0.0) {
                ++pupil.samples;
                sum += t * t;
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
                    "the pupil passes nothing: its image is 0 everywhere that the grid samples it");
    const double scale = p.normalization == Normalization::kUnitMean ? gain / std::sqrt(pupil.mean_transmission) : gain;
    for (float &t : pupil.transmission)
        t = static_cast<float>(t * scale);
    return pupil;
}

} // namespace clsp
